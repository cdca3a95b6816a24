//! `cargo xtask same PROGRAM`: does another build of `sagnac` give the same answers as this one?
//!
//! ```text
//! logs of testdata, 200 simulated units ─▶ calibrate, verify, compare, fleet, prior ─▶ results of PROGRAM ┐
//!                                                                                ─▶ results of this one ─┴▶ differences
//! ```
//!
//! For a change that only moves code. Texts and image files must be equal; numbers of a JSON document may differ by
//! [`NUMBERS`]. It sees the results that a user sees, and no path of the code that these logs leave out.

mod units;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use xtask::shell::{root, stdout_of, text};

use crate::measures::same::units::{Command, UNITS, fleets, simulated, testdata};
use crate::program::Program;

/// Largest relative difference of two numbers in JSON.
const NUMBERS: f64 = 1e-9;
/// Of a fleet's unit: the hash of its logs and of the options, which another build may word differently.
const QUESTION: &str = "key";
/// Differences that are printed.
const SHOWN: usize = 40;

/// Compares this build with the program at a path. The results of both stay in target/same, and serve again for the same programs.
pub(crate) fn same(args: &[&str]) -> Result<()> {
    let (other, units) = match args {
        [other] => (*other, UNITS),
        [other, "--units", units] => (*other, units.parse().context("--units: how many?")?),
        _ => bail!("same: the path of another build of `sagnac`, for example target/same/sagnac"),
    };
    let folder = root().join("target/same");
    for (name, program) in [("other", Program::at(fs::canonicalize(other)?)), ("this", Program::beside_the_lab()?)] {
        let (to, mark) = (folder.join(name), folder.join(format!("{name}.made-by")));
        let made_by =
            format!("{} {units} units", stdout_of(60, "git", &["hash-object", text(program.path())?], &root())?.trim());
        if fs::read_to_string(&mark).is_ok_and(|before| before == made_by) {
            continue;
        }
        if to.exists() {
            fs::remove_dir_all(&to)?;
        }
        run_all(&program, &to, units)?;
        fs::write(mark, made_by)?;
    }
    let differences = differences(&folder.join("other"), &folder.join("this"))?;
    let files = files(&folder.join("this"))?.len();
    println!("same: {files} files of results, {} differ", differences.len());
    for difference in differences.iter().take(SHOWN) {
        println!("  {difference}");
    }
    ensure!(differences.is_empty(), "the two builds differ; both results are in {}", folder.display());
    Ok(())
}

/// Runs every command, one unit after the other on each core, and the fleets at the end.
fn run_all(program: &Program, folder: &Path, units: usize) -> Result<()> {
    let next = AtomicUsize::new(0);
    let failed = Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= units {
                return;
            }
            let at = folder.join(format!("unit-{number:03}"));
            if let (Err(error), Ok(mut failed)) =
                (simulated(number as u64, &at).and_then(|list| run(program, &at, &list)), failed.lock())
            {
                failed.push(error);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    if let Some(error) = failed.into_inner().unwrap_or_default().pop() {
        return Err(error);
    }
    let at = folder.join("testdata");
    run(program, &at, &testdata(&at)?)?;
    run(program, folder, &fleets(folder)?)
}

/// Runs some commands in a folder, and writes status and outputs of each into a file.
fn run(program: &Program, folder: &Path, commands: &[Command]) -> Result<()> {
    for Command { name, args } in commands {
        let output = std::process::Command::new(program.path()).args(args).current_dir(folder).output()?;
        let status = output.status.code().with_context(|| format!("{name} ended by a signal"))?;
        ensure!(status != 101, "{name} panicked: sagnac {}", args.join(" "));
        let is_json = args.iter().any(|arg| arg == "--json");
        let suffix = if is_json && status <= 1 { "json" } else { "txt" };
        fs::write(folder.join(format!("{name}.out.{suffix}")), &output.stdout)?;
        let said = format!("status {status}\n{}", String::from_utf8_lossy(&output.stderr));
        fs::write(folder.join(format!("{name}.said.txt")), said)?;
    }
    Ok(())
}

/// Every file of a folder and those within, by their paths from it. Logs are inputs, and the fleet's report shows its table.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(at) = open.pop() {
        for entry in fs::read_dir(&at)? {
            let path = entry?.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_none_or(|extension| extension != "csv" && extension != "parquet") {
                found.push(path.strip_prefix(folder)?.to_owned());
            }
        }
    }
    found.sort();
    Ok(found)
}

fn differences(other: &Path, this: &Path) -> Result<Vec<String>> {
    let (before, after) = (files(other)?, files(this)?);
    let all: BTreeMap<&PathBuf, ()> = before.iter().chain(&after).map(|path| (path, ())).collect();
    let mut differences = Vec::new();
    for path in all.keys() {
        match (fs::read(other.join(path)), fs::read(this.join(path))) {
            (Ok(before), Ok(after)) => {
                let is_json = path.extension().is_some_and(|extension| extension == "json");
                let difference =
                    if is_json { difference_of_json(&before, &after) } else { difference_of_text(&before, &after) };
                differences.extend(difference.map(|difference| format!("{}: {difference}", path.display())));
            }
            (Ok(_), Err(_)) => differences.push(format!("{}: the other build alone writes it", path.display())),
            _ => differences.push(format!("{}: this build alone writes it", path.display())),
        }
    }
    Ok(differences)
}

/// The first line that differs.
fn difference_of_text(before: &[u8], after: &[u8]) -> Option<String> {
    if before == after {
        return None;
    }
    let [before, after] = [before, after].map(String::from_utf8_lossy);
    let pair = before.lines().zip(after.lines()).find(|(before, after)| before != after);
    Some(pair.map_or_else(|| "one is longer".to_owned(), |(before, after)| format!("`{before}` → `{after}`")))
}

fn difference_of_json(before: &[u8], after: &[u8]) -> Option<String> {
    match (serde_json::from_slice(before), serde_json::from_slice(after)) {
        (Ok(before), Ok(after)) => difference_of_values("", &before, &after),
        _ => difference_of_text(before, after),
    }
}

/// The first place where two documents differ.
fn difference_of_values(at: &str, before: &Value, after: &Value) -> Option<String> {
    match (before, after) {
        (Value::Object(before), Value::Object(after)) => {
            let stray = before
                .keys()
                .find(|key| !after.contains_key(*key))
                .or_else(|| after.keys().find(|key| !before.contains_key(*key)));
            if let Some(stray) = stray {
                return Some(format!("{at}.{stray} stands in one alone"));
            }
            before
                .iter()
                .filter(|(key, _)| key.as_str() != QUESTION)
                .find_map(|(key, value)| difference_of_values(&format!("{at}.{key}"), value, &after[key]))
        }
        (Value::Array(before), Value::Array(after)) if before.len() == after.len() => {
            let mut pairs = before.iter().zip(after).enumerate();
            pairs.find_map(|(place, (before, after))| difference_of_values(&format!("{at}[{place}]"), before, after))
        }
        (Value::Number(a), Value::Number(b)) => {
            let (x, y) = (a.as_f64()?, b.as_f64()?);
            let differ = a != b && (x - y).abs() > NUMBERS * x.abs().max(y.abs());
            differ.then(|| format!("{at}: {a} → {b}"))
        }
        _ => (before != after).then(|| format!("{at}: {before} → {after}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_digit_a_lost_key_and_a_longer_list_are_seen() {
        let before = br#"{"a": [1.0, 2.0], "b": "x"}"#;
        let seen = |after: &[u8]| difference_of_json(before, after);
        assert_eq!(seen(br#"{"a": [1.0000000001, 2.0], "b": "x"}"#), None);
        assert_eq!(seen(br#"{"a": [1.00000001, 2.0], "b": "x"}"#).as_deref(), Some(".a[0]: 1.0 → 1.00000001"));
        assert_eq!(seen(br#"{"a": [1.0, 2.0]}"#).as_deref(), Some(".b stands in one alone"));
        assert!(seen(br#"{"a": [1.0, 2.0, 3.0], "b": "x"}"#).is_some());
        assert_eq!(difference_of_text(b"one\ntwo\n", b"one\ntwa\n").as_deref(), Some("`two` → `twa`"));
    }
}
