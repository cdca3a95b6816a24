//! `cargo xtask dist`: the program for users without Rust, as an archive and as a Debian package.
//!
//! ```text
//! sources ─zig─▶ sagnac (old GLIBC) ─▶ files: man pages, completions, licences ─┬▶ sagnac-VERSION-x86_64-linux.tar.gz
//!                                                                               └▶ sagnac_VERSION_amd64.deb
//!                                                                both packed twice, unpacked, installed, run
//! ```
//!
//! `--check` skips the release build and packs the program of the tests; CI runs this.

mod binary;
mod check;
mod files;
mod licences;
mod pack;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::debian::{self, need};
use xtask::shell::{built, root, stdout_of, target};

use crate::checks::build_lab;

/// The newest GLIBC that the archive may require: that of 2012, which Rust's standard library requires.
const OLDEST_GLIBC: [u32; 2] = [2, 17];

/// The program to pack, with its version and time.
struct Release {
    version: String,
    /// Time stamp of all files in archive and package, seconds since 1970.
    time: String,
    program: PathBuf,
}

/// Builds, packs and checks.
pub(crate) fn dist(args: &[&str]) -> Result<()> {
    need(debian::DIST)?;
    let quick = args.contains(&"--check");
    let program = if quick { as_the_tests_have_it()? } else { binary::build()? };
    let release = Release { version: version()?, time: time()?, program };
    let folder = target().join(if quick { "dist-check" } else { "dist" });
    let packed = pack::pack(&release, &folder)?;
    check::check(&release, &packed, &folder.join("check"))?;
    if !quick {
        let glibc = binary::needs(&release.program)?.glibc;
        ensure!(glibc <= OLDEST_GLIBC, "the program asks for GLIBC {glibc:?}, newer than {OLDEST_GLIBC:?}");
        fs::remove_dir_all(folder.join("check"))?;
    }
    println!("dist: {}\ndist: {}", packed.archive.display(), packed.deb.display());
    Ok(())
}

fn as_the_tests_have_it() -> Result<PathBuf> {
    build_lab()?;
    Ok(built("debug", "sagnac"))
}

/// Version of the workspace.
fn version() -> Result<String> {
    let manifest = fs::read_to_string(root().join("Cargo.toml"))?;
    let line = manifest.lines().find_map(|line| line.strip_prefix("version = ")).context("no version in Cargo.toml")?;
    Ok(line.trim_matches('"').to_owned())
}

/// SOURCE_DATE_EPOCH, otherwise the time of the last commit.
fn time() -> Result<String> {
    if let Ok(given) = std::env::var("SOURCE_DATE_EPOCH") {
        ensure!(given.parse::<u64>().is_ok(), "SOURCE_DATE_EPOCH is {given}, not a number of seconds");
        return Ok(given);
    }
    let stdout =
        stdout_of(60, "git", &["log", "-1", "--format=%ct"], &root()).context("no git: give SOURCE_DATE_EPOCH")?;
    Ok(stdout.trim().to_owned())
}

/// Makes a folder, or empties it.
fn empty(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("cannot empty {}", folder.display()))?;
    }
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}
