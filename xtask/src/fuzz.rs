//! `cargo xtask fuzz`: a million executions of every target, seeded with the corpus of broken inputs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh, sh_in};

const EXECUTIONS: u32 = 1_000_000;
/// Larger inputs find nothing that smaller ones do not; only Parquet needs some room for its footer. What unpacks or
/// holds many rows is read a few hundred times a second at 16 KiB and thousands of times at 2.
const MAX_LENGTH: u32 = 2048;
const MAX_LENGTH_OF_PARQUET: u32 = 16_384;

fn max_length(target: &str) -> u32 {
    if target == "parquet" { MAX_LENGTH_OF_PARQUET } else { MAX_LENGTH }
}

/// Runs all targets, or those named.
pub(crate) fn fuzz(wanted: &[&str]) -> Result<()> {
    let installed = Command::new("cargo").args(["fuzz", "--version"]).output().is_ok_and(|out| out.status.success());
    if !installed {
        sh("cargo", &["install", "cargo-fuzz", "--locked"])?;
    }
    let targets = targets()?;
    if let Some(unknown) = wanted.iter().find(|name| targets.iter().all(|target| target != *name)) {
        bail!("no fuzz target {unknown}; there are: {}", targets.join(", "));
    }
    let seeds = seeds()?;
    sh_in(&root().join("fuzz"), "cargo", &["+nightly", "fuzz", "build", "--target-dir", "../target/fuzz"], &[])?;
    for target in targets.iter().filter(|name| wanted.is_empty() || wanted.contains(&name.as_str())) {
        run(target, &seeds)?;
    }
    Ok(())
}

/// As fuzz/fuzz_targets has them.
fn targets() -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(root().join("fuzz/fuzz_targets"))? {
        let path = entry?.path();
        names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
    }
    names.sort();
    Ok(names)
}

/// The corpus of broken inputs, made by its test, and the good ones of testdata.
fn seeds() -> Result<Vec<PathBuf>> {
    let kept = root().join("target/corpus");
    let keep = [("SAGNAC_KEEP_CORPUS", kept.to_str().context("a path that is no text")?)];
    sh_in(&root(), "cargo", &["test", "--locked", "-p", "sagnac-cli", "--test", "bad_input"], &keep)?;
    let mut files = Vec::new();
    let folders = [kept, root().join("testdata"), root().join("scenarios")];
    for folder in folders.iter().flat_map(|folder| walk(folder)) {
        files.push(folder);
    }
    ensure!(!files.is_empty(), "the test of broken inputs kept none");
    files.sort();
    Ok(files)
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

fn run(target: &str, seeds: &[PathBuf]) -> Result<()> {
    let corpus = root().join("fuzz/corpus").join(target);
    fs::create_dir_all(&corpus)?;
    for (number, seed) in seeds.iter().enumerate() {
        let bytes = fs::read(seed).with_context(|| format!("cannot read {}", seed.display()))?;
        let start = &bytes[..bytes.len().min(max_length(target) as usize)];
        // Targets that put the magic before the bytes get them without it.
        let start = match target {
            "ulog" => start.get(16..).unwrap_or_default(),
            "gzip" => start.get(3..).unwrap_or_default(),
            _ => start,
        };
        fs::write(corpus.join(format!("seed-{number}")), start)?;
    }
    let (runs, length) = (format!("-runs={EXECUTIONS}"), format!("-max_len={}", max_length(target)));
    let args = ["+nightly", "fuzz", "run", "--target-dir", "../target/fuzz", target, "--"];
    // Leaks are not looked for: a decoding thread that is about to end looks like one. Memory is limited all the same.
    let limits = [
        runs.as_str(),
        length.as_str(),
        "-timeout=20",
        "-rss_limit_mb=3000",
        "-detect_leaks=0",
        "-print_final_stats=1",
        "-verbosity=0",
    ];
    sh_in(&root().join("fuzz"), "cargo", &[&args[..], &limits].concat(), &[])
        .with_context(|| format!("{target}: the input stands in fuzz/artifacts/{target}"))
}
