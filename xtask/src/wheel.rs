//! `cargo xtask wheel`: the Python package in `python/`, a workspace of its own: format, lints, licences, one wheel for every CPython from
//! 3.10 on, and its tests in fresh environments: one with what users have next to it, one with nothing.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::debian::{self, need};
use xtask::shell::{built, root, sh, sh_in, stdout_of, target, text};

use crate::cargo_tools::need_cargo_tool;
use crate::checks::build_lab;

/// Largest wheel, bytes.
const MOST_BYTES: u64 = 8_000_000;

pub(crate) fn wheel(makes_pages: bool) -> Result<()> {
    need(debian::WHEEL)?;
    need_cargo_tool("deny")?;
    let folder = root().join("python");
    let cargo = |args: &[&str]| sh_in(&folder, "cargo", args, &[]);
    cargo(&["fmt", "--check"])?;
    cargo(&["fetch", "--locked"])?;
    cargo(&["deny", "--offline", "check", "--hide-inclusion-graph", "licenses", "bans", "sources"])?;
    cargo(&["clippy", "--quiet", "--all-targets", "--locked", "--", "-D", "warnings"])?;
    let full = environment("full")?;
    install(&full, &["--requirement", text(&folder.join("requirements.txt"))?])?;
    let wheel = build(&folder, &full)?;
    let bare = environment("bare")?;
    for python in [&full, &bare] {
        install(python, &["--force-reinstall", "--no-deps", text(&wheel)?])?;
    }
    // The program that the package's bytes are compared with, as the tests and the lab have it.
    build_lab()?;
    let program = built("debug", "sagnac");
    let env = [("SAGNAC_PROGRAM", text(&program)?), ("MPLBACKEND", "Agg")];
    sh_in(&folder, text(&bare)?, &["tests/without_packages.py"], &env)?;
    let python = |args: &[&str]| sh_in(&folder, text(&full)?, args, &env);
    if makes_pages {
        return python(&["notebooks/pages.py"]);
    }
    python(&["-m", "mypy", "--strict", "package/sagnac", "tests", "notebooks/pages.py"])?;
    python(&["-m", "mypy.stubtest", "--concise", "sagnac._sagnac"])?;
    python(&["-m", "pytest", "--quiet"])
}

/// The Python of an environment that is made again.
fn environment(name: &str) -> Result<PathBuf> {
    let venv = target().join("python").join(name);
    if venv.exists() {
        fs::remove_dir_all(&venv).with_context(|| format!("cannot remove {}", venv.display()))?;
    }
    sh("python3", &["-m", "venv", text(&venv)?])?;
    Ok(venv.join("bin/python"))
}

fn install(python: &Path, what: &[&str]) -> Result<()> {
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    sh(text(python)?, &[&pip[..], what].concat())
}

/// The wheel, compiled by the compiler itself: clippy's driver leaves out optimisations, and ticks of a stream then take half as long again.
fn build(folder: &Path, python: &Path) -> Result<PathBuf> {
    let wheels = target().join("wheels");
    if wheels.exists() {
        fs::remove_dir_all(&wheels)?;
    }
    let maturin = ["-m", "maturin", "build", "--quiet", "--release", "--locked", "--out", text(&wheels)?];
    sh_in(folder, text(python)?, &maturin, &[])?;
    let entry = fs::read_dir(&wheels)?.next().context("maturin has made no wheel")??;
    let bytes = entry.metadata()?.len();
    let name = entry.file_name().to_string_lossy().into_owned();
    println!("wheel: {name}, {bytes} bytes");
    ensure!(bytes < MOST_BYTES, "the wheel has {bytes} bytes, {MOST_BYTES} at most");
    ensure!(name.contains("cp310-abi3"), "{name} is not for every CPython from 3.10 on");
    let listed = stdout_of(60, text(python)?, &["-m", "zipfile", "--list", text(&entry.path())?], folder)?;
    ensure!(listed.contains("sagnac/py.typed") && listed.contains("sagnac/_sagnac.pyi"), "the wheel has no types");
    Ok(entry.path())
}
