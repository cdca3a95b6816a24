//! `cargo xtask hunt [MINUTES]` or `--cases N`: generated inputs of every kind through the real program, on fixed seeds.
//!
//! ```text
//! number of a case ─▶ Chance ─▶ kind ─▶ files (good ones changed, or made by a grammar) and a command ─▶ run ─▶ oracle
//! ```
//!
//! A case depends on its number alone, so `cargo xtask hunt --case N` makes it again. First come the findings of earlier hunts, which
//! stand in `testdata/found` with their command; a new finding is put there. What holds of any run is in [`oracle`].

mod case;
mod chance;
mod commands;
mod documents;
mod logs;
mod oracle;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use tempfile::TempDir;
use xtask::shell::root;

use crate::hunts::case::HuntCase;
use crate::hunts::commands::{Materials, case};
use crate::program::Program;

/// Length of a hunt, minutes.
const MINUTES: u64 = 60;
/// Findings after which a hunt ends: they are likely the same.
const MOST_FINDINGS: usize = 20;

/// What a hunt has seen.
#[derive(Default)]
struct Seen {
    /// Number of cases of each kind, and of those that ended with status 0 or 1.
    kinds: BTreeMap<&'static str, [u64; 2]>,
    findings: Vec<String>,
}

/// Hunts for so many minutes or cases from case 0 on, or runs one case and keeps its files. So many cases are the same on every machine: CI
/// asks for those.
pub(crate) fn hunt(args: &[&str]) -> Result<()> {
    let program = Program::beside_the_lab()?;
    let materials = Materials::make(&program)?;
    match args {
        ["--case", number] => return one(&program, &materials, number.parse().context("--case: no number")?),
        ["--found"] => {
            found_again(&program)?;
            return Ok(());
        }
        _ => {}
    }
    let (from, end) = reach(args)?;
    let again = found_again(&program)?;
    let (next, seen) = (AtomicU64::new(from), Mutex::new(Seen::default()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let hunters: Vec<_> =
            (0..threads).map(|_| scope.spawn(|| hunter(&program, &materials, &next, &seen, end))).collect();
        hunters.into_iter().try_for_each(|hunter| hunter.join().map_err(|_| anyhow::anyhow!("a hunter panicked"))?)
    })?;
    let seen = seen.into_inner().unwrap_or_default();
    let to = end.cases.map_or(next.into_inner(), |cases| from.saturating_add(cases));
    report(&seen, from, to, again)?;
    ensure!(
        seen.findings.is_empty(),
        "{} findings, kept in testdata/found:\n{}",
        seen.findings.len(),
        seen.findings.join("\n")
    );
    Ok(())
}

/// Where a hunt ends, whichever comes first.
#[derive(Clone, Copy)]
struct End {
    until: Option<Instant>,
    cases: Option<u64>,
    from: u64,
}

impl End {
    fn is_reached(&self, number: u64) -> bool {
        self.until.is_some_and(|until| Instant::now() >= until)
            || self.cases.is_some_and(|cases| number >= self.from.saturating_add(cases))
    }
}

/// First case and end that the arguments ask for.
fn reach(args: &[&str]) -> Result<(u64, End)> {
    let after = |name: &str| args.iter().position(|arg| *arg == name).and_then(|at| args.get(at + 1));
    let from = after("--from").map_or(Ok(0), |from| from.parse()).context("--from: no number of a case")?;
    let cases = after("--cases").map(|cases| cases.parse()).transpose().context("--cases: how many?")?;
    let minutes = args.first().filter(|arg| !arg.starts_with("--")).map(|arg| arg.parse()).transpose();
    let minutes: Option<u64> = minutes.context("how many minutes?")?.or(cases.is_none().then_some(MINUTES));
    let until = minutes.map(|minutes| Instant::now() + Duration::from_secs(60 * minutes));
    Ok((from, End { until, cases, from }))
}

fn report(seen: &Seen, from: u64, to: u64, again: usize) -> Result<()> {
    println!(
        "hunt: cases {from} to {to}, after {again} findings of earlier hunts\n{:12} {:>8} {:>12}",
        "kind", "cases", "status 0, 1"
    );
    for (kind, [all, done]) in &seen.kinds {
        println!("{kind:12} {all:8} {done:12}");
        // A kind whose every case is refused reaches only the first check of its reader.
        ensure!(*all < 200 || *done > 0, "not one case of {kind} was accepted: its inputs are not good enough");
    }
    Ok(())
}

/// Takes one case after the other.
fn hunter(program: &Program, materials: &Materials, next: &AtomicU64, seen: &Mutex<Seen>, end: End) -> Result<()> {
    loop {
        let number = next.fetch_add(1, Ordering::Relaxed);
        if end.is_reached(number) {
            return Ok(());
        }
        let case = case(number, materials)?;
        let folder = prepared(&case)?;
        let (outcome, wrong) = oracle::judge(&case, program, folder.path())?;
        let Ok(mut seen) = seen.lock() else { bail!("another hunter panicked") };
        let [all, done] = seen.kinds.entry(case.kind).or_default();
        *all += 1;
        *done += u64::from(matches!(outcome.status, 0 | 1));
        if !wrong.is_empty() {
            let finding =
                format!("{}-{}: sagnac {}\n  {}", case.kind, case.number, case.args.join(" "), wrong.join("\n  "));
            println!("{finding}");
            keep(&case)?;
            seen.findings.push(finding);
        }
        if seen.findings.len() >= MOST_FINDINGS {
            return Ok(());
        }
    }
}

/// A folder with the files of a case.
fn prepared(case: &HuntCase) -> Result<TempDir> {
    let folder = TempDir::new()?;
    for (name, bytes) in &case.files {
        fs::write(folder.path().join(name), bytes)?;
    }
    Ok(folder)
}

/// Runs one case, with its files kept where the message says.
fn one(program: &Program, materials: &Materials, number: u64) -> Result<()> {
    let case = case(number, materials)?;
    let folder = prepared(&case)?;
    let path = folder.keep();
    println!("cd {} && sagnac {}", path.display(), case.args.join(" "));
    let (outcome, wrong) = oracle::judge(&case, program, &path)?;
    ensure!(wrong.is_empty(), "status {}:\n  {}", outcome.status, wrong.join("\n  "));
    println!("status {}, nothing wrong: {}", outcome.status, outcome.message());
    Ok(())
}

/// Findings of all hunts: a folder each, with the files and the arguments, one on a line.
fn found() -> PathBuf {
    root().join("testdata/found")
}

const COMMAND: &str = "command.txt";

/// Puts a finding where the next hunt, and CI, begins.
fn keep(case: &HuntCase) -> Result<()> {
    let folder = found().join(format!("{}-{}", case.kind, case.number));
    fs::create_dir_all(&folder)?;
    for (name, bytes) in &case.files {
        if case.args.iter().any(|arg| arg == name) {
            fs::write(folder.join(name), bytes)?;
        }
    }
    Ok(fs::write(folder.join(COMMAND), case.args.join("\n"))?)
}

/// Runs the findings of earlier hunts: none may be one again. Returns their number.
fn found_again(program: &Program) -> Result<usize> {
    let mut folders: Vec<PathBuf> =
        fs::read_dir(found()).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    folders.retain(|folder| folder.join(COMMAND).is_file());
    folders.sort();
    let mut wrong = Vec::new();
    for folder in &folders {
        let case = kept(folder)?;
        let at = prepared(&case)?;
        let problems = oracle::judge(&case, program, at.path())?.1;
        wrong.extend((!problems.is_empty()).then(|| format!("{}: {}", folder.display(), problems.join("\n  "))));
    }
    ensure!(wrong.is_empty(), "found again:\n{}", wrong.join("\n"));
    Ok(folders.len())
}

fn kept(folder: &Path) -> Result<HuntCase> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name != COMMAND {
            files.push((name, fs::read(&path)?));
        }
    }
    let args = fs::read_to_string(folder.join(COMMAND))?.split('\n').map(str::to_owned).collect();
    Ok(HuntCase { number: 0, kind: "found", args, files, outputs: commands::OUTPUTS.to_vec() })
}
