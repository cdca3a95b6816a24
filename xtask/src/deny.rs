//! `cargo xtask deny`: licences, bans and sources of the dependencies, by `deny.toml` and what `Cargo.lock` names.

use anyhow::Result;
use xtask::shell::sh;

use crate::cargo_tools::need_cargo_tool;

/// What it reads: `cargo xtask ci` derives from these when it is due.
const READS: [&str; 2] = ["deny.toml", "Cargo.toml"];

pub(crate) fn deny() -> Result<()> {
    need_cargo_tool("deny")?;
    println!("deny: the dependencies of {} by {}", READS[1], READS[0]);
    // For every platform, so that the check itself needs no network.
    sh("cargo", &["fetch", "--locked"])?;
    sh("cargo", &["deny", "--offline", "check", "licenses", "bans", "sources"])
}
