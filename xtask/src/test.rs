//! `cargo xtask test`: all that shows within minutes whether the project works. It needs Rust and a C compiler.
//!
//! ```text
//! format, layers ─▶ cargo test --no-run ─▶ each program of tests, in its package's folder ─▶ doctests, examples, no-panic ─▶ table
//! ```
//!
//! A test that lacks a tool or a recording appends a line to a file, because libtest counts it as passed; the table has it as skipped.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use xtask::shell::{root, sh, target};
use xtask::skip::SKIPPED;

use crate::checks::{compiled_once, examples, no_panic};
use crate::ci::processor_s;
use crate::layers::layers;

/// A program of tests.
struct Program {
    /// Package and kind, as people say them: `sagnac, tests`.
    name: String,
    /// The flags that select it among the others: `--test tests`, `--lib`.
    selects: String,
    folder: PathBuf,
    path: PathBuf,
}

/// The table, row by row.
#[derive(Default)]
struct Table {
    text: String,
    passed: u64,
    skipped: u64,
    /// Commands that run one failed test alone.
    failed: Vec<String>,
}

/// Runs everything, also behind a failure of a test.
pub(crate) fn test() -> Result<()> {
    let wall = Instant::now();
    let mut table = Table::default();
    table.step("format", || sh("cargo", &["fmt", "--all", "--check"]))?;
    table.step("layers", layers)?;
    table.step("compiled once", compiled_once)?;
    let mut programs = Vec::new();
    table.step("compile", || {
        programs = compiled()?;
        Ok(())
    })?;
    let skipped = target().join("skipped");
    fs::write(&skipped, "")?;
    for program in &programs {
        table.run(program, &skipped)?;
    }
    table.doctests()?;
    table.step("examples", examples)?;
    table.step("no-panic", no_panic)?;
    print!("{}", fs::read_to_string(&skipped)?);
    println!("{:32} {:>8} {:>7} {:>8}\n{}", "part", "s", "passed", "skipped", table.text);
    let [wall_s, processor_s] = [wall.elapsed().as_secs_f64(), processor_s()?];
    println!(
        "{} passed, {} skipped in {wall_s:.0} s, {processor_s:.0} s of processor time",
        table.passed, table.skipped
    );
    ensure!(table.failed.is_empty(), "failed; each alone:\n  {}", table.failed.join("\n  "));
    Ok(())
}

impl Table {
    fn row(&mut self, name: &str, since: Instant, counts: Option<[u64; 2]>) {
        let seconds = since.elapsed().as_secs_f64();
        let counts = counts.map_or(String::new(), |[passed, skipped]| format!(" {passed:7} {skipped:8}"));
        self.text += &format!("{name:32} {seconds:8.1}{counts}\n");
    }

    /// A step without tests.
    fn step(&mut self, name: &str, step: impl FnOnce() -> Result<()>) -> Result<()> {
        let since = Instant::now();
        step().with_context(|| format!("{name} failed"))?;
        self.row(name, since, None);
        Ok(())
    }

    /// A program of tests, in its package's folder as cargo runs it.
    fn run(&mut self, program: &Program, skipped: &Path) -> Result<()> {
        println!("\n{}", program.name);
        let since = Instant::now();
        let before = lines(skipped)?;
        let mut tests = Command::new(&program.path);
        tests.current_dir(&program.folder).env("CARGO_MANIFEST_DIR", &program.folder).env(SKIPPED, skipped);
        let [passed, failed] = self.watch(&mut tests, &program.selects)?;
        if passed + failed > 0 {
            let skipped = lines(skipped)? - before;
            // libtest has counted them as passed.
            let passed = passed.saturating_sub(skipped);
            (self.passed, self.skipped) = (self.passed + passed, self.skipped + skipped);
            self.row(&program.name, since, Some([passed, skipped]));
        }
        Ok(())
    }

    fn doctests(&mut self) -> Result<()> {
        let since = Instant::now();
        let mut cargo = Command::new("cargo");
        cargo.args(["test", "--doc", "--locked", "--no-fail-fast"]).current_dir(root());
        let [passed, _] = self.watch(&mut cargo, "--doc")?;
        self.passed += passed;
        self.row("doctests", since, Some([passed, 0]));
        Ok(())
    }

    /// Shows what tests print, and counts those that have passed and failed.
    fn watch(&mut self, tests: &mut Command, selects: &str) -> Result<[u64; 2]> {
        let mut child = tests.stdout(Stdio::piped()).spawn().context("cannot start the tests")?;
        let (mut counts, known) = ([0; 2], self.failed.len());
        for line in BufReader::new(child.stdout.take().context("tests without an output")?).split(b'\n') {
            let line = String::from_utf8_lossy(&line?).into_owned();
            println!("{line}");
            if let Some(found) = result(&line) {
                counts.iter_mut().zip(found).for_each(|(count, more)| *count += more);
            }
            let failed = line.strip_prefix("test ").and_then(|rest| rest.strip_suffix(" ... FAILED"));
            self.failed.extend(failed.map(|name| format!("cargo test {selects} -- --exact '{name}'")));
        }
        let status = child.wait()?;
        if !status.success() && self.failed.len() == known {
            self.failed.push(format!("cargo test {selects}    ({status})"));
        }
        Ok(counts)
    }
}

/// Passed and failed, of libtest's last line.
fn result(line: &str) -> Option<[u64; 2]> {
    let rest = line.strip_prefix("test result: ")?.split_once(". ")?.1;
    let count = |word: &str| rest.split("; ").find_map(|part| part.strip_suffix(word)?.trim().parse().ok());
    Some([count("passed")?, count("failed")?])
}

fn lines(path: &Path) -> Result<u64> {
    Ok(fs::read_to_string(path)?.lines().count() as u64)
}

/// Compiles all tests and examples; the programs of tests.
fn compiled() -> Result<Vec<Program>> {
    let args = ["test", "--locked", "--no-run", "--message-format", "json-render-diagnostics"];
    println!("$ cargo {}", args.join(" "));
    let output = Command::new("cargo").args(args).current_dir(root()).stderr(Stdio::inherit()).output()?;
    if !output.status.success() {
        bail!("the tests do not compile; once more: cargo test --no-run");
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let messages = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let mut programs: Vec<Program> = messages.filter_map(|message| program(&message)).collect();
    ensure!(!programs.is_empty(), "no program of tests was compiled");
    programs.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(programs)
}

/// The program that a message of cargo is about, if it is one of tests.
fn program(message: &Value) -> Option<Program> {
    let path = PathBuf::from(message["executable"].as_str()?);
    if message["profile"]["test"] != true {
        return None;
    }
    let folder = Path::new(message["manifest_path"].as_str()?).parent()?.to_owned();
    let target = message["target"]["name"].as_str()?;
    let (selects, kind) = match message["target"]["kind"][0].as_str()? {
        "lib" => ("--lib".to_owned(), "library".to_owned()),
        "bin" => (format!("--bin {target}"), format!("bin {target}")),
        kind => (format!("--{kind} {target}"), target.to_owned()),
    };
    let package = folder.strip_prefix(root()).unwrap_or(&folder).file_name()?.to_str()?.to_owned();
    Some(Program { name: format!("{package}, {kind}"), selects, folder, path })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_libtest_are_counted() {
        let line =
            "test result: FAILED. 119 passed; 8 failed; 0 ignored; 0 measured; 3 filtered out; finished in 116.82s";
        assert_eq!(result(line), Some([119, 8]));
        assert_eq!(result("test a::b ... ok"), None);
    }

    #[test]
    fn a_failed_test_is_named_with_the_command_that_runs_it_alone() {
        let mut table = Table::default();
        let mut tests = Command::new("sh");
        let said = "test a::b ... FAILED\ntest a::c ... ok\ntest result: FAILED. 1 passed; 1 failed; 0 ignored";
        tests.args(["-c", &format!("printf '{said}\\n'; exit 101")]);
        assert_eq!(table.watch(&mut tests, "--test tests").unwrap(), [1, 1]);
        assert_eq!(table.failed, ["cargo test --test tests -- --exact 'a::b'"]);
        // A program that dies names no test.
        let mut dies = Command::new("sh");
        dies.args(["-c", "kill -9 $$"]);
        table.watch(&mut dies, "--lib").unwrap();
        assert!(table.failed[1].starts_with("cargo test --lib    (signal: 9"), "{:?}", table.failed);
    }
}
