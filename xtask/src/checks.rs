//! Checks that CI runs. Each stops at the first failure; the message names the remedy.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use xtask::debian::{self, need};
use xtask::shell::{built, root, sh, sh_in, stdout_of, target, text};

/// Examples that measure speed and need arguments; `cargo xtask bench` runs them.
const STOPWATCHES: [&str; 2] = ["speed", "ticks"];

/// Runs every example of every crate; each asserts its results. `cargo test` has built them.
pub(crate) fn examples() -> Result<()> {
    let mut count = 0;
    for package in std::fs::read_dir(root().join("crates"))? {
        let Ok(files) = std::fs::read_dir(package?.path().join("examples")) else { continue };
        for file in files {
            let path = file?.path();
            let name = path.file_stem().and_then(|stem| stem.to_str()).context("an example's name is not UTF-8")?;
            if !STOPWATCHES.contains(&name) {
                stdout_of(120, text(&built("debug/examples", name))?, &[], &root())?;
                count += 1;
            }
        }
    }
    ensure!(count > 0, "no example was found");
    println!("examples: {count} ran, each with its assertions");
    Ok(())
}

/// A task of the lab.
pub(crate) fn lab(args: &[&str]) -> Result<()> {
    build_lab()?;
    run_lab(args)
}

/// The program, and the lab that runs it, for `cargo build`: in one selection, so that both share one set of features.
pub(crate) const PROGRAMS: [&str; 4] = ["--package", "sagnac-cli", "--package", "sagnac-lab"];

pub(crate) fn build_lab() -> Result<()> {
    sh("cargo", &[&["build", "--quiet", "--locked"], &PROGRAMS[..]].concat())
}

pub(crate) fn run_lab(args: &[&str]) -> Result<()> {
    sh(text(&built("debug", "lab"))?, args)
}

/// Checks that tests, program and lab share their artifacts: one version and one set of features per package.
pub(crate) fn compiled_once() -> Result<()> {
    let packages = |selection: &[&str]| -> Result<BTreeSet<String>> {
        let tree = ["tree", "--locked", "--prefix", "none", "--format", "{p} {f}"];
        let stdout = stdout_of(120, "cargo", &[&tree, selection].concat(), &root())?;
        Ok(stdout.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect())
    };
    let programs = packages(&[&PROGRAMS[..], &["--package", "sagnac-fuzz", "--edges", "normal,build"]].concat())?;
    let tests = packages(&["--workspace", "--edges", "normal,build,dev"])?;
    let twice: Vec<&str> = programs.difference(&tests).map(String::as_str).collect();
    ensure!(
        twice.is_empty(),
        "compiled twice, because the tests use other features (see the end of lab/Cargo.toml):\n{}",
        twice.join("\n")
    );
    println!("compiled once: all {} packages of program, lab and fuzz targets are those of the tests", programs.len());
    Ok(())
}

/// Lints of everything, also of the programs of tests that only CI runs.
pub(crate) fn clippy() -> Result<()> {
    let everything = ["--workspace", "--all-targets", "--test", "studies", "--test", "browser", "--locked"];
    sh("cargo", &[&["clippy"], &everything[..], &["--", "-D", "warnings"]].concat())
}

/// The tests that need a browser.
pub(crate) fn browser() -> Result<()> {
    need(debian::BROWSER)?;
    sh("cargo", &["test", "--locked", "--test", "browser", "--no-fail-fast"])
}

/// The README's first command, with the program built as for the tests: a third of the time of a release build. It needs neither the live
/// bench nor Parquet, which are two fifths of what there is to compile.
pub(crate) fn example() -> Result<()> {
    // What a second build would save costs a seventh of the first.
    let build = ["build", "--locked", "--package", "sagnac-cli", "--no-default-features"];
    sh_in(&root(), "cargo", &build, &[("CARGO_INCREMENTAL", "0")])?;
    fs::create_dir_all(root().join("target"))?;
    let [one, two, retest] = ["cycle-1", "cycle-2", "retest"].map(|name| format!("testdata/chamber/{name}.csv.gz"));
    let setup = "testdata/chamber/bench.toml";
    let sagnac = built("debug", "sagnac");
    let sagnac = text(&sagnac)?;
    sh(sagnac, &["calibrate", &one, &two, "--setup", setup, "-o", "target/unit.cal.json"])?;
    sh(sagnac, &["export", "target/unit.cal.json", "--to", "image", "-o", "target/unit.img"])?;
    sh(sagnac, &["verify", "target/unit.cal.json", &retest, "--limits", "testdata/chamber/limits.toml"])?;
    println!(
        "example: {sagnac} is without the live bench, Parquet and ULog; `cargo build --package sagnac-cli` makes the whole program"
    );
    Ok(())
}

/// Links core, loops and board with a panic handler that does not exist. The same links with an added panic must fail.
pub(crate) fn no_panic() -> Result<()> {
    const ENTRIES: [(&str, &str); 4] = [
        ("sagnac-core", "sagnac_core_everything"),
        ("sagnac-loops", "sagnac_loops_everything"),
        ("sagnac-board", "sagnac_board_everything"),
        ("sagnac-board on hardware", "sagnac_hardware_everything"),
    ];
    let target = target().join("no-panic");
    let library = target.join("release/libsagnac_no_panic.a");
    build_no_panic(&target, &["--features", "broken"])?;
    for (name, entry) in ENTRIES {
        ensure!(link(&library, entry).is_err(), "{name} with a panic path links: this check is not effective");
    }
    build_no_panic(&target, &[])?;
    for (name, entry) in ENTRIES {
        link(&library, entry).with_context(|| format!("{name} has a panic path"))?;
        println!("no-panic: {name} links without a panic path, and does not with one");
    }
    Ok(())
}

fn build_no_panic(target: &Path, features: &[&str]) -> Result<()> {
    let target = target.display().to_string();
    let args = [&["build", "--release", "--locked", "--target-dir", &target], features].concat();
    sh_in(&root().join("firmware/no-panic"), "cargo", &args, &[])
}

/// Links one symbol and all it needs; undefined symbols are errors.
fn link(library: &Path, entry: &str) -> Result<()> {
    let out = library.with_file_name("linked");
    let entry_flag = format!("-Wl,--entry={entry}");
    let keep = format!("-Wl,--undefined={entry}");
    let args = ["-nostdlib", "-static", "-Wl,--gc-sections", &entry_flag, &keep];
    // Symbols that every target's runtime provides.
    let runtime = ["memcpy", "memmove", "memset", "memcmp", "bcmp"].map(|name| format!("-Wl,--defsym={name}=0"));
    let output = Command::new("cc")
        .args(args)
        .args(&runtime)
        .arg(library)
        .arg("-o")
        .arg(&out)
        .output()
        .context("cannot start cc")?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(())
}
