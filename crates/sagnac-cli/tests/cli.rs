//! The program as scripts and people call it: exit status, what goes where, files untouched by failure.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn sagnac() -> Command {
    Command::cargo_bin("sagnac").unwrap()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn testdata(name: &str) -> String {
    root().join("testdata").join(name).display().to_string()
}

/// A file of the shared recordings, or `None` where they are missing (with a message).
fn shared(name: &str) -> Option<String> {
    let path = root().join("../shared/data").join(name);
    if path.exists() {
        return Some(path.display().to_string());
    }
    xtask::skip::skip(&format!("{} is not there", path.display()));
    None
}

struct Ran {
    status: i32,
    out: String,
    err: String,
}

fn run(args: &[&str]) -> Ran {
    let output = sagnac().args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ran { status: output.status.code().unwrap(), out: text(&output.stdout), err: text(&output.stderr) }
}

fn json(args: &[&str]) -> (i32, Value) {
    let ran = run(args);
    (ran.status, serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {}\n{}", ran.out, ran.err)))
}

/// A folder with the chamber calibrated on two cycles.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        let (one, two, setup) =
            (testdata("chamber/cycle-1.csv.gz"), testdata("chamber/cycle-2.csv.gz"), testdata("chamber/bench.toml"));
        let ran = run(&["calibrate", &one, &two, "--setup", &setup, "-o", &bench.path("unit.cal.json")]);
        assert_eq!(ran.status, 0, "{}", ran.err);
        bench
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.folder.path().join(name), text).unwrap();
        self.path(name)
    }
}

#[test]
fn the_main_job_ends_with_a_proof() {
    let bench = Bench::new();
    let (cal, img, retest) = (bench.path("unit.cal.json"), bench.path("unit.img"), testdata("chamber/retest.csv.gz"));
    assert_eq!(run(&["export", &cal, "--to", "image", "-o", &img]).status, 0);
    let (status, proof) = json(&["verify", &cal, &retest, "--limits", &testdata("chamber/limits.toml"), "--json"]);
    assert_eq!(status, 0);
    let axis = &proof["axes"][0];
    assert_eq!((&axis["axis"], &axis["pass"]), (&Value::from("z"), &Value::from(true)));
    for key in ["before", "after", "noise_floor", "improvement", "improvement_sigma", "status_windows", "limits"] {
        assert!(!axis[key].is_null(), "{key}");
    }
    let over_floor = axis["after"]["sigma_dph"].as_f64().unwrap() / axis["noise_floor"]["value_dph"].as_f64().unwrap();
    assert!(over_floor < 1.08, "{over_floor}");
    // The image's digest differs only by its parent; the figures are the same through either.
    let (_, by_image) = json(&["verify", &img, &retest, "--json"]);
    assert_eq!(by_image["axes"][0]["after"], axis["after"]);
    let (_, image) = json(&["inspect", &img, "--json"]);
    assert_eq!((&image["serial"], &image["sha256"]), (&Value::from("RLG-0001"), &by_image["image_sha256"]));
}

#[test]
fn limits_not_met_is_status_1_and_says_which() {
    let bench = Bench::new();
    let limits = bench.write("limits.toml", "improvement_min = 100.0\n");
    let ran =
        run(&["verify", "-v", &bench.path("unit.cal.json"), &testdata("chamber/retest.csv.gz"), "--limits", &limits]);
    assert_eq!(ran.status, 1);
    assert!(ran.out.contains("LIMITS NOT MET") && ran.out.contains("improvement_min"), "{}", ran.out);
}

/// Exit status 2 with file, line, column and value; 3 with the reason. As JSON too.
#[test]
fn complaints_name_their_place() {
    let bench = Bench::new();
    let log = bench.write("bad.csv", "time_s,temperature_c,counts\n1,20,1.5\n2,20,1\n");
    let ran = run(&["calibrate", &log, "--arcsec-per-count", "1"]);
    assert_eq!(ran.status, 2);
    assert!(
        ran.err.contains(&format!("{log}:2")) && ran.err.contains("\"1.5\"") && ran.err.contains("--quantum"),
        "{}",
        ran.err
    );
    let (status, object) = json(&["calibrate", &log, "--arcsec-per-count", "1", "--json"]);
    assert_eq!((status, &object["refused"], &object["place"]["line"]), (2, &Value::from(false), &Value::from(2)));

    let log = bench.write("units.csv", "time_s,temperature_f,counts\n1,20,1\n");
    let ran = run(&["inspect", &log, "--arcsec-per-count", "1"]);
    assert!(ran.status == 2 && ran.err.contains("`temperature_f`") && ran.err.contains(":1"), "{}", ran.err);

    let setup = bench.write("bench.toml", "arcsec_per_count = 1.0\nquantm = 1\n");
    let ran = run(&["calibrate", &log, "--setup", &setup]);
    assert!(ran.status == 2 && ran.err.contains(&format!("{setup}:2")) && ran.err.contains("quantm"), "{}", ran.err);

    let log = log_of_one_temperature(&bench);
    let (status, object) = json(&["calibrate", &log, "--arcsec-per-count", "1", "--json"]);
    assert_eq!((status, &object["refused"]), (3, &Value::from(true)));
    assert!(object["reason"].as_str().unwrap().contains("a fit needs 10 °C"), "{object}");

    for args in
        [vec!["calibrate"], vec!["frobnicate"], vec!["calibrate", &log, "--model", "cubic"], vec!["verify", &log, &log]]
    {
        assert_eq!(run(&args).status, 2, "{args:?}");
    }
    // A log without a stated scale is still described.
    let whole = bench.write("counts.csv", "time_s,temperature_c,counts\n1,20,3\n2,20,4\n3,20,5\n");
    let (status, object) = json(&["inspect", &whole, "--json"]);
    assert_eq!((status, &object["asks_for"]), (0, &Value::from("arcsec_per_count")));
    assert_eq!(
        (&object["axes"][0]["mean_counts_per_s"], &object["axes"][0]["mean_dph"]),
        (&Value::from(4.0), &Value::Null)
    );
    assert_eq!(run(&["inspect", "/nowhere/at/all.csv"]).status, 2);
    assert_eq!(run(&["inspect", &bench.folder.path().display().to_string()]).status, 2);
}

#[test]
fn a_failure_leaves_old_outputs_alone() {
    let bench = Bench::new();
    let old = bench.write("out.cal.json", "the old file");
    let still = bench.write("short.csv", "time_s,temperature_c,counts\n1,20,1\n2,40,1\n3,50,1\n");
    assert_eq!(run(&["calibrate", &still, "--arcsec-per-count", "1", "-o", &old]).status, 3);
    let broken = bench.write("broken.csv", "time_s,temperature_c,counts\n1,20,1\n2,20,1\n3,20,0.5\n");
    assert_eq!(run(&["compensate", &bench.path("unit.cal.json"), &broken, "--axis", "z", "-o", &old]).status, 2);
    assert_eq!(run(&["inspect", &broken, "--arcsec-per-count", "1", "--windows", &old]).status, 2);
    assert_eq!(run(&["export", &still, "--to", "image", "-o", &old]).status, 2);
    assert_eq!(fs::read_to_string(&old).unwrap(), "the old file");
    let names: Vec<String> =
        fs::read_dir(bench.folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(names.iter().all(|name| !name.starts_with(".sagnac-")), "{names:?}");
}

/// A symbolic link is followed, a pipe written to; neither is replaced by a file.
#[cfg(unix)]
#[test]
fn links_and_pipes_stay_what_they_are() {
    let bench = Bench::new();
    let target = bench.write("target.img", "old");
    let link = bench.path("link.img");
    std::os::unix::fs::symlink(&target, &link).unwrap();
    assert_eq!(run(&["export", &bench.path("unit.cal.json"), "--to", "image", "-o", &link]).status, 0);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert!(fs::read(&target).unwrap().starts_with(b"SAGNACIM"));
    let fifo = bench.path("pipe");
    assert!(Process::new("mkfifo").arg(&fifo).status().unwrap().success());
    let reader = std::thread::spawn({
        let fifo = fifo.clone();
        move || fs::read(fifo).unwrap()
    });
    assert_eq!(run(&["export", &bench.path("unit.cal.json"), "--to", "image", "-o", &fifo]).status, 0);
    assert!(reader.join().unwrap().starts_with(b"SAGNACIM"));
    assert!(!fs::metadata(&fifo).unwrap().is_file());
}

/// A result that could not be printed is a failure.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_standard_output_is_an_error() {
    for args in [&["simulate", "--paper"][..], &["line", "send", "confirm"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Process::new(assert_cmd::cargo::cargo_bin("sagnac")).args(args).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("standard output"), "{args:?}");
    }
}

#[test]
fn damaged_and_foreign_corrections_are_refused() {
    let bench = Bench::new();
    let (cal, img, retest) = (bench.path("unit.cal.json"), bench.path("unit.img"), testdata("chamber/retest.csv.gz"));
    assert_eq!(run(&["export", &cal, "--to", "image", "-o", &img]).status, 0);
    let mut bytes = fs::read(&img).unwrap();
    bytes[130] ^= 4;
    fs::write(bench.folder.path().join("flipped.img"), &bytes).unwrap();
    let ran = run(&["verify", &bench.path("flipped.img"), &retest]);
    assert!(ran.status == 2 && ran.err.contains("CRC-32"), "{}", ran.err);
    let ran = run(&["verify", &cal, &retest, "--serial", "RLG-0002"]);
    assert!(ran.status == 2 && ran.err.contains("RLG-0002"), "{}", ran.err);
    let text = fs::read_to_string(&cal).unwrap().replace("\"RLG-0001\"", "\"unassigned\"");
    let unassigned = bench.write("unassigned.cal.json", &text);
    let ran = run(&["export", &unassigned, "--to", "image", "-o", &bench.path("no.img")]);
    assert!(
        ran.status == 3 && ran.err.contains("--serial") && !Path::new(&bench.path("no.img")).exists(),
        "{}",
        ran.err
    );
    assert_eq!(run(&["verify", &cal, &testdata("chamber/cycle-2.csv.gz"), "--arcsec-per-count", "0.2"]).status, 2);
}

#[test]
fn compensated_output_is_not_calibrated_again() {
    let bench = Bench::new();
    let (cal, retest, out) =
        (bench.path("unit.cal.json"), testdata("chamber/retest.csv.gz"), bench.path("corrected.csv"));
    assert_eq!(run(&["compensate", &cal, &retest, "-o", &out]).status, 0);
    let to_stdout = run(&["compensate", &cal, &retest]);
    assert_eq!(to_stdout.out, fs::read_to_string(&out).unwrap());
    let ran = run(&["calibrate", &out, "--arcsec-per-count", "0.15125"]);
    assert!(ran.status == 3 && ran.err.contains("already compensated"), "{}", ran.err);
}

/// A row goes in, its corrected row comes out before the next one is sent.
#[test]
fn compensate_answers_a_pipe_line_by_line() {
    let bench = Bench::new();
    let mut child = Process::new(assert_cmd::cargo::cargo_bin("sagnac"))
        .args(["compensate", &bench.path("unit.cal.json")])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut to = child.stdin.take().unwrap();
    let mut from = BufReader::new(child.stdout.take().unwrap()).lines();
    // Two rows give the interval; from then on each is answered before the next is written.
    to.write_all(b"time_s,temperature_c,counts\n5,25,149\n10,25,149\n").unwrap();
    let head: Vec<String> = (0..4).map(|_| from.next().unwrap().unwrap()).collect();
    assert!(head[0].starts_with("# sagnac compensated") && head[2].starts_with("5,25,"), "{head:?}");
    for row in 3..20 {
        writeln!(to, "{},25,149", row * 5).unwrap();
        let line = from.next().unwrap().unwrap();
        assert!(line.starts_with(&format!("{},25,149,", row * 5)), "{line}");
    }
    drop(to);
    assert!(from.next().is_none());
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let bench = Bench::new();
    let mut child = Process::new(assert_cmd::cargo::cargo_bin("sagnac"))
        .args(["compensate", &bench.path("unit.cal.json"), &testdata("chamber/retest.csv.gz")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Windows are written to look at; as a log they are refused, with the command to use.
#[test]
fn windows_are_written_to_look_at() {
    let bench = Bench::new();
    let (one, two, setup) =
        (testdata("chamber/cycle-1.csv.gz"), testdata("chamber/cycle-2.csv.gz"), testdata("chamber/bench.toml"));
    let head = "run,start_ns,end_ns,duration_ns,samples,first_line,reference_dps,excluded,angle_z,mean_c_,variance_c2_,min_c_,max_c_";
    for name in ["w.csv", "w.parquet"] {
        let table = bench.path(name);
        let ran = run(&["inspect", &one, &two, "--setup", &setup, "--windows", &table]);
        assert!(ran.status == 0 && ran.out.contains(&format!("wrote {table}")), "{}", ran.err);
        let again = run(&["inspect", &table]);
        assert!(again.status == 0 && again.out.contains("windows of a log, to look at"), "{}{}", again.out, again.err);
        for args in [vec!["calibrate", &table], vec!["inspect", &table, &one], vec!["calibrate", &one, &table]] {
            let ran = run(&[&args[..], &["--setup", &setup]].concat());
            let remedy = "sagnac calibrate run1.csv -o unit.cal.json";
            assert!(ran.status == 2 && ran.err.contains("not a log") && ran.err.contains(remedy), "{}", ran.err);
        }
    }
    let text = fs::read_to_string(bench.path("w.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.len(), lines[0]), (793, head));
    assert_eq!(lines[1], "0,0,100000000000,100000000000,20,2,,,2968,-40,0,-40,-40");
    for name in ["unit.cal.json", "w.csv", "w.parquet"] {
        let ran = run(&["inspect", &bench.path(name), "--windows", &bench.path("no.csv")]);
        assert!(ran.status == 2 && ran.err.contains("need a log"), "{name}: {}", ran.err);
    }
}

/// An old command is answered with the one that does the same now, and nothing is done.
#[test]
fn old_verbs_say_what_they_are_now() {
    for (old, now) in [
        (vec!["window", "a b.csv", "c.csv", "-o", "w.csv"], "sagnac inspect 'a b.csv' c.csv --windows w.csv"),
        (vec!["window", "a.csv", "--output=w.csv"], "sagnac inspect a.csv --windows=w.csv"),
        (vec!["demo"], "sagnac simulate --paper"),
        (vec!["demo", "--seed", "3"], "sagnac simulate --paper --seed 3"),
        (vec!["frames", "it's.bin", "-o", "f.csv"], r"sagnac line read 'it'\''s.bin' -o f.csv"),
        (vec!["line", "confirm", "-o", "/dev/ttyUSB0"], "sagnac line send confirm -o /dev/ttyUSB0"),
        (vec!["line", "-o", "x", "roll-back"], "sagnac line send -o x roll-back"),
    ] {
        let ran = run(&old);
        assert_eq!((ran.status, ran.out.as_str()), (2, ""), "{old:?}");
        let [first, help] = ran.err.lines().collect::<Vec<_>>()[..] else { panic!("{}", ran.err) };
        assert!(first.starts_with(&format!("error: `sagnac {}` is `sagnac ", old[0])), "{first}");
        assert_eq!(help, format!("  help: {now}"));
    }
}

#[test]
fn an_imported_polynomial_is_verified_like_any_calibration() {
    let bench = Bench::new();
    let old = bench.path("old.cal.json");
    let args = ["import", "--polynomial", "0.00008,-0.0065,0.125,2980", "--window", "100", "--span", "-40,70"];
    let more = ["--arcsec-per-count", "0.15125", "--axis", "z", "-o", &old];
    let ran = run(&[&args[..], &more[..]].concat());
    assert_eq!(ran.status, 0, "{}", ran.err);
    let (status, proof) = json(&["verify", &old, &testdata("chamber/retest.csv.gz"), "--json"]);
    assert_eq!(status, 0);
    let gain = proof["axes"][0]["improvement_sigma"].as_f64().unwrap();
    assert!((1.0..1.4).contains(&gain), "temperature alone gains little here: {gain}");
}

#[test]
fn the_papers_table_is_printed_next_to_ours() {
    let ran = run(&["simulate", "--paper"]);
    assert_eq!(ran.status, 0);
    for piece in ["paper, before", "491.75", "70.75", "15.3107 Hz", "6.779e-23", "381.25", " expected"] {
        assert!(ran.out.contains(piece), "{piece}: {}", ran.out);
    }
    assert_eq!(ran.out, run(&["simulate", "--paper", "--seed", "1"]).out);
}

#[test]
fn real_recordings_are_described_and_refused_as_they_deserve() {
    let setup = testdata("rlg-ln100-static/bench.toml");
    let Some(log) = shared("rlg-ln100-static/x_LN100_up.csv.gz") else { return };
    let (status, object) = json(&["inspect", &log, "--setup", &setup, "--json"]);
    assert_eq!((status, &object["quantity"], &object["rows"]), (0, &Value::from("rates"), &Value::from(19_217)));
    // Its README: 64 Hz (dt 0.0156087 s), 300 s, x mean up 3.18850e-3 °/s.
    let close = |key: &Value, expected: f64, part: f64| {
        assert!((key.as_f64().unwrap() / expected - 1.0).abs() < part, "{key} {expected}")
    };
    close(&object["sample_interval_s"], 0.015_608_7, 1e-3);
    close(&object["length_s"], 300.0, 2e-3);
    close(&object["axes"][0]["mean_dph"], 3.1885e-3 * 3600.0, 2e-3);
    assert_eq!(object["survey"]["good_for"], Value::from("noise"));
    assert!(object["survey"]["reason"].as_str().unwrap().contains("no temperature"), "{object}");
    // Its README: the Allan deviation of x falls with slope −1, dither and quantization: no walk shows in 300 s.
    assert!(object["survey"]["axes"][0]["arw_deg_rt_h"].is_null(), "{object}");
    let ran = run(&["calibrate", &log, "--setup", &setup]);
    assert!(ran.status == 3 && ran.err.contains("no temperature"), "{}", ran.err);
    for raw in ["x_LN100_up.ins", "x_LN100_down.ins"] {
        let raw = shared(&format!("rlg-ln100-static/{raw}")).unwrap();
        for command in ["inspect", "calibrate"] {
            let ran = run(&[command, &raw, "--setup", &setup]);
            assert!(ran.status == 2 && ran.err.contains("binary"), "{}", ran.err);
        }
    }
}

/// Real counts of a standing vehicle, three axes without temperature. From its README: 184,718 samples of 10 ms, 30.8 min; z has a
/// mean of 8.410 °/h where the Earth turns by 8.464. The size of a count is asked for, and no angle random walk is printed.
#[test]
fn counts_of_a_standing_vehicle_are_described_and_have_no_random_walk() {
    let Some(log) = shared("rlg-psins-static/rlg.csv.gz") else { return };
    let ran = run(&["inspect", &log]);
    assert!(ran.status == 0 && ran.out.contains("counts, quantum 1, axes x y z, no thermometer"), "{}", ran.out);
    assert!(ran.out.contains("--arcsec-per-count") && !ran.out.contains("°/h of"), "{}", ran.out);
    let ran = run(&["allan", &log]);
    assert!(ran.status == 2 && ran.err.contains("give --arcsec-per-count"), "{}", ran.err);
    let size = ["--arcsec-per-count", "0.1"];
    let (status, object) = json(&[&["inspect", &log][..], &size, &["--json"]].concat());
    assert_eq!((status, &object["quantity"], &object["rows"]), (0, &Value::from("counts"), &Value::from(184_718)));
    assert!((object["sample_interval_s"].as_f64().unwrap() - 0.01).abs() < 1e-9, "{object}");
    assert!((object["length_s"].as_f64().unwrap() - 1847.18).abs() < 0.02, "{object}");
    let z = object["axes"][2]["mean_dph"].as_f64().unwrap();
    assert!((z - 8.410).abs() < 0.001, "{z}");
    let ran = run(&[&["calibrate", &log][..], &size].concat());
    assert!(ran.status == 3 && ran.err.contains("no temperature"), "{}", ran.err);
    let ran = run(&[&["allan", "-v", &log][..], &size].concat());
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert_eq!(ran.out.matches("not resolvable\n").count(), 15, "{}", ran.out);
    let why = "the curve follows the five laws at none of its τ";
    assert!(ran.out.contains(why) && !ran.out.contains("with them: \n"), "{}", ran.out);
}

#[test]
fn completions_and_man_pages_know_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish", "man"] {
        let text = String::from_utf8(sagnac().args(["manual", shell]).output().unwrap().stdout).unwrap();
        for word in ["calibrate", "verify", "compensate", "inspect", "export", "import", "line"] {
            assert!(text.contains(word), "{shell} does not know {word}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    sagnac().args(["manual", "man", "--output"]).arg(folder.path()).assert().success();
    let page = std::fs::read_to_string(folder.path().join("sagnac-calibrate.1")).unwrap();
    assert!(page.contains("arcsec") && page.contains(".TH"));
}

/// On a terminal (by util-linux's script): progress and coloured help, unless switched off; in a pipe neither.
#[test]
fn a_terminal_is_treated_as_one_and_no_color_is_heeded() {
    let on_terminal = |no_color: bool| {
        let mut command = std::process::Command::new("script");
        command.args(["-qec", &format!("{} --help", env!("CARGO_BIN_EXE_sagnac")), "/dev/null"]).env("TERM", "xterm");
        command.env_remove("NO_COLOR");
        if no_color {
            command.env("NO_COLOR", "1");
        }
        String::from_utf8(command.output().unwrap().stdout).unwrap()
    };
    let (plain, coloured) = (on_terminal(true), on_terminal(false));
    assert!(plain.contains("calibrate") && coloured.contains("calibrate"));
    assert!(coloured.contains('\u{1b}'), "the help is not even styled on a terminal");
    // Bold and underlined is no colour.
    assert!(!plain.contains("\u{1b}[3"), "{plain:?}");
    let piped = String::from_utf8(sagnac().arg("--help").output().unwrap().stdout).unwrap();
    assert!(!piped.contains('\u{1b}'));
}

/// `inspect` names every kind of file that the program writes, none as a log with a mistake.
#[test]
fn every_file_that_is_written_is_recognised() {
    let bench = Bench::new();
    let (log, setup) = (testdata("chamber/retest.csv.gz"), testdata("chamber/bench.toml"));
    let scenario = testdata("../scenarios/paper/paper.toml");
    let record = bench.path("unit.cal.json");
    let limits = testdata("chamber/limits.toml");
    let path = |name: &str| bench.path(name);
    let saved = |name: &str, args: &[&str]| {
        let ran = run(args);
        assert!(ran.status <= 1, "{args:?}: {}", ran.err);
        if !ran.out.is_empty() {
            fs::write(path(name), ran.out).unwrap();
        }
    };
    saved("proof.json", &["verify", &record, &log, "--limits", &limits, "--json", "--report", &path("proof.html")]);
    saved("noise.json", &["allan", &log, "--setup", &setup, "--json", "-o", &path("curve.csv")]);
    saved("compared.json", &["compare", &record, &record, "--json"]);
    saved("points.json", &["evaluate", &record, "--at", "20", "--json"]);
    saved("inspected.json", &["inspect", &log, "--setup", &setup, "--json", "--report", &path("log.html")]);
    saved("-", &["inspect", &log, "--setup", &setup, "--windows", &path("windows.parquet")]);
    saved("-", &["inspect", &log, "--setup", &setup, "--windows", &path("windows.csv")]);
    saved("-", &["compensate", &record, &log, "-o", &path("corrected.csv")]);
    saved("-", &["compensate", &record, &log, "-o", &path("corrected.parquet")]);
    saved("-", &["export", &record, "--to", "image", "-o", &path("unit.img")]);
    saved("-", &["export", &record, "--to", "upload", "-o", &path("upload.bin")]);
    saved("-", &["export", &record, "--to", "data-sheet", "-o", &path("unit.md")]);
    saved("-", &["export", &record, "--to", "c", "--with", "board,loops,banks,line", "-o", &path("c")]);
    saved("-", &["export", &record, "--to", "verilog", "-o", &path("rtl")]);
    saved("-", &["key", "new", "-o", &path("factory.key")]);
    saved("-", &["simulate", &scenario, "-o", &path("run.csv"), "--truth", &path("truth.csv")]);
    let mut seen = 0;
    for (name, said) in [
        ("unit.cal.json", "a calibration of RLG-0001"),
        ("proof.json", "a verification of RLG-0001"),
        ("proof.html", "a report: "),
        ("noise.json", "a noise budget of 1 axis from 1 log"),
        ("curve.csv", "an Allan curve"),
        ("compared.json", "a comparison of 2 calibrations"),
        ("points.json", "a correction evaluated"),
        ("inspected.json", "what `sagnac inspect` said of a log"),
        ("log.html", "a report: "),
        ("windows.parquet", "windows of a log"),
        ("windows.csv", "windows of a log"),
        ("corrected.csv", "a compensated log (serial RLG-0001"),
        ("corrected.parquet", "a compensated log"),
        ("unit.img", "an image for axis z"),
        ("upload.bin", "pieces of an image, 1 commit;"),
        ("unit.md", "made by `sagnac export`"),
        ("c/sagnac_unit.c", "made by `sagnac export`"),
        ("c/sagnac_board.h", "made by `sagnac export`"),
        ("c/Makefile", "made by `sagnac export`"),
        ("rtl/sagnac_image.hex", "made by `sagnac export`"),
        ("rtl/sagnac_image.v", "made by `sagnac export`"),
        ("factory.key", "a private key: keep it secret"),
        ("factory.pub", "a public key"),
        ("run.csv", "a log of "),
        ("truth.csv", "the truth of a simulated test"),
    ] {
        let ran = run(&["inspect", &path(name)]);
        assert!(ran.status == 0 && ran.out.contains(said), "{name}: {} {}{}", ran.status, ran.out, ran.err);
        seen += 1;
    }
    for (file, said) in [(setup, "a setup of RLG-0001"), (limits, "limits of an acceptance"), (scenario, "a scenario")]
    {
        assert!(run(&["inspect", &file]).out.contains(said), "{file}");
    }
    assert_eq!(seen, 25);
    // A refusal as JSON goes to standard output and ends with another status.
    let refused = run(&["calibrate", &log_of_one_temperature(&bench), "--arcsec-per-count", "1", "--json"]);
    let inspected = run(&["inspect", &bench.write("refused.json", &refused.out)]);
    assert!(inspected.out.contains("an error of this program: "), "{}", inspected.out);
}

fn log_of_one_temperature(bench: &Bench) -> String {
    let rows: String = (1..2000).map(|s| format!("{s},25.{},4\n", s % 3)).collect();
    bench.write("still.csv", &format!("time_s,temperature_c,counts\n{rows}"))
}

/// A log that the correction is not made for is not corrected without a word: exit status 1, and how much was.
#[test]
fn compensate_says_how_much_it_corrected() {
    let bench = Bench::new();
    let record = bench.path("unit.cal.json");
    let compensate = |log: &str, flags: &[&str]| {
        let out = bench.path("out.csv");
        let ran = run(&[&["compensate", &record, log, "-o", &out], flags].concat());
        assert!(fs::read_to_string(&out).is_ok_and(|text| text.lines().count() == 602), "{}", ran.err);
        fs::remove_file(out).unwrap();
        (ran.status, ran.err)
    };
    // Ten minutes of rows of 5 s at a temperature, from the row that the temperature begins with.
    let written = |name: &str, celsius: &dyn Fn(usize) -> Option<f64>| {
        let row =
            |at: usize| format!("{},{},150\n", 5 * (at + 1), celsius(at).map_or(String::new(), |c| c.to_string()));
        let rows: String = (0..600).map(row).collect();
        fs::write(bench.path(name), format!("time_s,temperature_c,counts\n{rows}")).unwrap();
        bench.path(name)
    };
    let (status, said) = compensate(&written("within.csv", &|_| Some(25.0)), &[]);
    assert!(status == 0 && said.contains("corrected 600 of 600 rows, 100.0 %"), "{said}");
    let (status, said) = compensate(&written("hot.csv", &|_| Some(125.0)), &[]);
    assert!(status == 1 && said.contains("corrected 0 of 600 rows, 0 %; 600 outside the span of the fit"), "{said}");
    assert!(said.contains("LESS THAN 90.0 % CORRECTED"), "{said}");
    let half = written("half.csv", &|at| Some(if at < 300 { 25.0 } else { 125.0 }));
    let (status, said) = compensate(&half, &[]);
    // The target takes the step when it has stayed for three updates, which are less than a row.
    assert!(status == 1 && said.contains("corrected 301 of 600 rows, 50.17 %; 299 outside"), "{said}");
    assert_eq!(compensate(&half, &["--corrected-min", "0.5"]).0, 0);
    // Kelvin under a header of °C is no temperature of a gyro; none at all.
    let (status, said) = compensate(&written("kelvin.csv", &|_| Some(298.15)), &[]);
    assert!(status == 1 && said.contains("600 without a temperature"), "{said}");
    let (status, said) = compensate(&written("none.csv", &|_| None), &[]);
    assert!(status == 1 && said.contains("600 without a temperature"), "{said}");
    for bad in ["-0.1", "1.1", "nan", "x"] {
        let ran = run(&["compensate", &record, &half, &format!("--corrected-min={bad}")]);
        assert!(ran.status == 2 && ran.err.contains("from 0 to 1"), "{bad}: {}", ran.err);
    }
}
