//! `cargo xtask fuzz`: every target on a corpus of good and broken inputs, a million executions each, guided by the code that they reach;
//! with `--address` under a sanitizer of memory.
//!
//! With `--smoke`, as in CI, about a thousand each: the targets count the code that they reach in themselves, and are linked with the libraries
//! as the tests have them, with their overflow checks. So nothing is compiled once more with the fuzzer's instruments.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{built, root, sh, sh_in, text};

use crate::cargo_tools::need_cargo_tool;
use crate::checks::{PROGRAMS, lab};

/// How a full run builds the targets and all that they reach.
struct Build {
    /// Flags of `cargo fuzz build` and `cargo fuzz run`.
    flags: &'static [&'static str],
    target_folder: &'static str,
}

/// By the project's compiler: our code has no `unsafe` for a sanitizer to check.
const PLAIN: Build = Build { flags: &["--sanitizer", "none"], target_folder: "../target/fuzz" };
/// The same, which also detects memory errors in what is not ours; it needs a nightly compiler.
const ADDRESS: Build = Build { flags: &["--sanitizer", "address"], target_folder: "../target/fuzz-address" };

/// Executions of a full run.
const MANY: &[&str] = &["-runs=1000000"];
/// From one seed, so many executions, or as many of those as fit into some seconds. A seed that reaches nothing new is kept,
/// for what it reaches in the libraries is not counted.
const FEW: &[&str] = &["-runs=4000", "-seed=1", "-max_total_time=4", "-keep_seed=1"];

/// Longest input, bytes. Longer inputs find nothing new and are slower: a few hundred executions a second at 16 KiB,
/// thousands at 2 KiB. Only Parquet needs more, for its footer.
const MAX_LENGTH: usize = 2048;
const MAX_LENGTH_OF_PARQUET: usize = 16_384;

fn max_length(target: &str) -> usize {
    if target == "parquet" { MAX_LENGTH_OF_PARQUET } else { MAX_LENGTH }
}

/// Runs all targets, or those named.
pub(crate) fn fuzz(args: &[&str]) -> Result<()> {
    let wanted: Vec<&str> = args.iter().copied().filter(|arg| !arg.starts_with("--")).collect();
    let mut targets = targets()?;
    if let Some(unknown) = wanted.iter().find(|name| targets.iter().all(|target| target != *name)) {
        bail!("no fuzz target {unknown}; there are: {}", targets.join(", "));
    }
    targets.retain(|name| wanted.is_empty() || wanted.contains(&name.as_str()));
    let seeds = seeds()?;
    match args.first() {
        Some(&"--smoke") => smoke(&targets, &seeds),
        Some(&"--address") => full(&ADDRESS, &targets, &seeds),
        _ => full(&PLAIN, &targets, &seeds),
    }
}

/// As the tests have the libraries: one build for program, lab and targets, so that all three share one set of features.
fn smoke(targets: &[String], seeds: &[PathBuf]) -> Result<()> {
    let counted = ["--package", "sagnac-fuzz", "--features", "sagnac-fuzz/counted"];
    let wrapper = root().join("fuzz/counted.sh");
    let args = [&["build", "--quiet", "--locked"], &PROGRAMS[..], &counted].concat();
    sh_in(&root(), "cargo", &args, &[("RUSTC_WRAPPER", text(&wrapper)?)])?;
    for target in targets {
        let (corpus, options) = prepare(target, seeds)?;
        let options: Vec<&str> = [text(&corpus)?].into_iter().chain(options.iter().map(String::as_str)).collect();
        sh(text(&built("debug", target))?, &[&options[..], FEW].concat()).with_context(|| finding(target))?;
    }
    Ok(())
}

fn full(build: &Build, targets: &[String], seeds: &[PathBuf]) -> Result<()> {
    need_cargo_tool("fuzz")?;
    cargo_fuzz("build", build, &[])?;
    for target in targets {
        let (_, options) = prepare(target, seeds)?;
        let options: Vec<&str> = [target, "--"].into_iter().chain(options.iter().map(String::as_str)).collect();
        cargo_fuzz("run", build, &[&options[..], MANY].concat()).with_context(|| finding(target))?;
    }
    Ok(())
}

fn cargo_fuzz(task: &str, build: &Build, rest: &[&str]) -> Result<()> {
    let toolchain: &[&str] = if build.flags.contains(&"address") { &["+nightly"] } else { &[] };
    let args = [toolchain, &["fuzz", task, "--target-dir", build.target_folder], build.flags, rest].concat();
    sh_in(&root().join("fuzz"), "cargo", &args, &[])
}

fn finding(target: &str) -> String {
    format!("{target}: the input is in fuzz/artifacts/{target}")
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

/// Writes the seeds of a target; its corpus, and the options of the fuzzer that every run has.
fn prepare(target: &str, seeds: &[PathBuf]) -> Result<(PathBuf, Vec<String>)> {
    let corpus = root().join("fuzz/corpus").join(target);
    let artifacts = root().join("fuzz/artifacts").join(target);
    fs::create_dir_all(&corpus)?;
    fs::create_dir_all(&artifacts)?;
    for (number, seed) in seeds.iter().enumerate() {
        let bytes = fs::read(seed).with_context(|| format!("cannot read {}", seed.display()))?;
        let start = &bytes[..bytes.len().min(max_length(target))];
        // Some targets add the magic bytes themselves; their seeds are without it.
        let start = match target {
            "ulog" => start.get(16..).unwrap_or_default(),
            "gzip_log" => start.get(3..).unwrap_or_default(),
            _ => start,
        };
        fs::write(corpus.join(format!("seed-{number}")), start)?;
    }
    // Without leak detection, because a decoding thread that is about to end looks like a leak. Memory is limited anyway.
    let bounds = ["-timeout=20", "-rss_limit_mb=3000", "-detect_leaks=0", "-print_final_stats=1", "-verbosity=0"];
    let mut options = vec![format!("-max_len={}", max_length(target))];
    options.push(format!("-artifact_prefix={}/", text(&artifacts)?));
    options.extend(bounds.map(str::to_owned));
    Ok((corpus, options))
}
