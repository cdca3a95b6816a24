//! `sagnac simulate` as a user has it: log, truth, Parquet, pipes, reports in a browser.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use assert_cmd::assert::OutputAssertExt;
use tempfile::TempDir;

fn scenario(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    root.join(name).join(format!("{name}.toml")).display().to_string()
}

fn sagnac(folder: &TempDir, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sagnac")).args(args).current_dir(folder.path()).output().unwrap()
}

fn read(folder: &TempDir, name: &str) -> Vec<u8> {
    std::fs::read(folder.path().join(name)).unwrap()
}

#[test]
fn log_and_truth_are_written_next_to_each_other_and_the_same_again() {
    let folder = TempDir::new().unwrap();
    let paper = scenario("paper");
    for (log, truth) in [("a.csv", "a.truth.csv"), ("b.csv", "b.truth.csv")] {
        sagnac(&folder, &["simulate", &paper, "--seed", "5", "-o", log, "--truth", truth]).assert().success();
    }
    assert_eq!(read(&folder, "a.csv"), read(&folder, "b.csv"));
    assert_eq!(read(&folder, "a.truth.csv"), read(&folder, "b.truth.csv"));
    let piped = sagnac(&folder, &["simulate", &paper, "--seed", "5"]);
    assert_eq!(piped.stdout, read(&folder, "a.csv"), "standard output is the same log");
    assert!(piped.stderr.is_empty());
    let lines = |name: &str| String::from_utf8(read(&folder, name)).unwrap().lines().count();
    assert_eq!((lines("a.csv"), lines("a.truth.csv")), (14_401, 14_401));
}

/// Parquet holds the same numbers: the same calibration but for the input's hash and name.
#[test]
fn parquet_is_the_same_log() {
    let folder = TempDir::new().unwrap();
    let paper = scenario("paper");
    let record = |log: &str, out: &str| -> serde_json::Value {
        sagnac(&folder, &["simulate", &paper, "-o", log]).assert().success();
        let args = ["calibrate", log, "--arcsec-per-count", "0.6531375089814306", "-o", out];
        sagnac(&folder, &args).assert().success();
        let mut record: serde_json::Value = serde_json::from_slice(&read(&folder, out)).unwrap();
        record["provenance"]["inputs"] = serde_json::Value::Null;
        record
    };
    assert_eq!(record("run.csv", "csv.json"), record("run.parquet", "parquet.json"));
}

/// The program itself gives the bytes that the simulator's own tests hold.
#[test]
fn the_program_gives_the_bytes_of_every_machine() {
    let held = include_str!("../../sagnac-sim/tests/first_bytes.txt");
    let folder = TempDir::new().unwrap();
    for line in held.lines() {
        let (name, sum) = line.split_once(' ').unwrap();
        let args = ["simulate", &scenario(name), "--seed", "1", "-o", "log.csv", "--truth", "truth.csv"];
        sagnac(&folder, &args).assert().success();
        let first = |file: &str| -> Vec<u8> {
            let bytes = read(&folder, file);
            bytes.split_inclusive(|b| *b == b'\n').take(3001).flatten().copied().collect()
        };
        let bytes = [first("log.csv"), first("truth.csv")].concat();
        let fnv =
            bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
        assert_eq!(format!("{fnv:016x}"), sum, "{name}");
    }
}

/// Nothing that was named twice is overwritten, and nothing is run before that is known.
#[test]
fn files_out_are_apart() {
    let folder = TempDir::new().unwrap();
    let own = folder.path().join("own.toml");
    std::fs::copy(scenario("loop-design"), &own).unwrap();
    let before = read(&folder, "own.toml");
    for args in [
        vec!["-o", "own.toml"],
        vec!["--report", "own.html", "-o", "./own.toml"],
        vec!["-o", "a.csv", "--truth", "./a.csv"],
        vec!["-o", "a.csv", "--report", "a.csv"],
        vec!["--bode", "--report", "./own.toml"],
        vec!["--truth", "t.parquet"],
        vec!["--report", "r.csv"],
        vec!["--report", "nofolder/r.html"],
        vec!["--report", "."],
    ] {
        let out = sagnac(&folder, &[&["simulate", "own.toml"], &args[..]].concat());
        assert_eq!(out.status.code(), Some(2), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{args:?} left something");
    }
    assert_eq!(read(&folder, "own.toml"), before);
}

/// A reader that has enough ends the program quietly.
#[test]
fn a_closed_pipe_is_no_failure() {
    let folder = TempDir::new().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_sagnac"))
        .args(["simulate", &scenario("triangle-28cm-dithered")])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(out.status.success() && out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn the_sweep_prints_what_was_designed_and_measured() {
    let folder = TempDir::new().unwrap();
    let out = sagnac(&folder, &["simulate", &scenario("loop-design"), "--bode"]);
    let text = String::from_utf8(out.stdout).unwrap();
    // docs/how-to/simulate.md shows this line.
    let line = "path length loop: crossover 20.09 Hz (design 20.00 Hz), phase margin 87.47° (design 87.12°)";
    assert!(text.contains(line), "{text}");
}
