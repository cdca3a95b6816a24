//! `cargo xtask fuzz`: every target on a corpus of good and broken inputs, a million executions each; with `--address` under a sanitizer
//! of memory; with `--smoke`, as in CI, some thousand each.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh_in, text};

use crate::cargo_tools::need_cargo_tool;
use crate::checks::lab;

/// Duration and checks.
struct Effort {
    /// Flags of `cargo fuzz build` and `cargo fuzz run`.
    build: &'static [&'static str],
    target_folder: &'static str,
    limits: &'static [&'static str],
}

/// The full run, by the project's compiler.
const FULL: Effort =
    Effort { build: &["--sanitizer", "none"], target_folder: "../target/fuzz", limits: &["-runs=1000000"] };
/// The same, which also detects memory errors in what is not ours; it needs a nightly compiler.
const ADDRESS: Effort =
    Effort { build: &["--sanitizer", "address"], target_folder: "../target/fuzz-address", limits: &["-runs=1000000"] };
/// Built like the tests, by the same compiler: our code has no `unsafe` for a sanitizer to check. From one seed, so many
/// executions, or as many of those as fit into some seconds: the same inputs on every machine.
const SMOKE: Effort = Effort {
    build: &["--dev", "--sanitizer", "none"],
    target_folder: "../target/fuzz-smoke",
    limits: &["-runs=4000", "-seed=1", "-max_total_time=4"],
};

/// Longest input, bytes. Longer inputs find nothing new and are slower: a few hundred executions a second at 16 KiB,
/// thousands at 2 KiB. Only Parquet needs more, for its footer.
const MAX_LENGTH: usize = 2048;
const MAX_LENGTH_OF_PARQUET: usize = 16_384;

fn max_length(target: &str) -> usize {
    if target == "parquet" { MAX_LENGTH_OF_PARQUET } else { MAX_LENGTH }
}

/// Runs all targets, or those named.
pub(crate) fn fuzz(args: &[&str]) -> Result<()> {
    need_cargo_tool("fuzz")?;
    let effort = match args.first() {
        Some(&"--smoke") => SMOKE,
        Some(&"--address") => ADDRESS,
        _ => FULL,
    };
    let wanted: Vec<&str> = args.iter().copied().filter(|arg| !arg.starts_with("--")).collect();
    let targets = targets()?;
    if let Some(unknown) = wanted.iter().find(|name| targets.iter().all(|target| target != *name)) {
        bail!("no fuzz target {unknown}; there are: {}", targets.join(", "));
    }
    let seeds = seeds()?;
    cargo_fuzz("build", &effort, &[])?;
    for target in targets.iter().filter(|name| wanted.is_empty() || wanted.contains(&name.as_str())) {
        run(target, &effort, &seeds)?;
    }
    Ok(())
}

fn cargo_fuzz(task: &str, effort: &Effort, rest: &[&str]) -> Result<()> {
    let toolchain: &[&str] = if effort.build.contains(&"address") { &["+nightly"] } else { &[] };
    let args = [toolchain, &["fuzz", task, "--target-dir", effort.target_folder], effort.build, rest].concat();
    sh_in(&root().join("fuzz"), "cargo", &args, &[])
}

/// The targets in fuzz/fuzz_targets.
fn targets() -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(root().join("fuzz/fuzz_targets"))? {
        let path = entry?.path();
        names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
    }
    names.sort();
    Ok(names)
}

/// The corpus of broken inputs, which the lab makes, and the good ones of testdata.
fn seeds() -> Result<Vec<PathBuf>> {
    let broken = root().join("target/corpus");
    lab(&["corpus", text(&broken)?])?;
    let folders = [broken, root().join("testdata"), root().join("scenarios")];
    let mut files: Vec<PathBuf> = folders.iter().flat_map(|folder| walk(folder)).collect();
    ensure!(files.len() > 100, "only {} files to start from", files.len());
    files.sort();
    Ok(files)
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}

fn run(target: &str, effort: &Effort, seeds: &[PathBuf]) -> Result<()> {
    let corpus = root().join("fuzz/corpus").join(target);
    fs::create_dir_all(&corpus)?;
    for (number, seed) in seeds.iter().enumerate() {
        let bytes = fs::read(seed).with_context(|| format!("cannot read {}", seed.display()))?;
        let start = &bytes[..bytes.len().min(max_length(target))];
        // Some targets add the magic bytes themselves; their seeds are without it.
        let start = match target {
            "ulog" => start.get(16..).unwrap_or_default(),
            "gzip" => start.get(3..).unwrap_or_default(),
            _ => start,
        };
        fs::write(corpus.join(format!("seed-{number}")), start)?;
    }
    let length = format!("-max_len={}", max_length(target));
    // Without leak detection, because a decoding thread that is about to end looks like a leak. Memory is limited anyway.
    let bounds =
        [&length, "-timeout=20", "-rss_limit_mb=3000", "-detect_leaks=0", "-print_final_stats=1", "-verbosity=0"];
    cargo_fuzz("run", effort, &[&[target, "--"][..], effort.limits, &bounds].concat())
        .with_context(|| format!("{target}: the input is in fuzz/artifacts/{target}"))
}
