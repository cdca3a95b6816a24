//! Nothing from a file reaches a terminal, a CSV or a stamp raw.

use std::fs;
use std::path::PathBuf;

use assert_cmd::Command;
use sagnac_core::{Description, Image};
use tempfile::TempDir;

const CLEAR: &str = "\u{1b}[2J\u{7}\u{9b}31m\u{202e}";

struct Bench {
    folder: TempDir,
}

impl Bench {
    /// With a log of 400 rows and a calibration of it.
    fn new() -> Self {
        let it = Self { folder: tempfile::tempdir().unwrap() };
        let rows: String = (1..=400)
            .map(|row: u32| format!("{},{:.4},{}\n", row * 5, 5.0 + f64::from(row) * 0.075, 150 + row * 7 % 3))
            .collect();
        it.write("log.csv", &format!("time_s,temperature_c,counts\n{rows}"));
        let args = ["calibrate", "log.csv", "--arcsec-per-count", "0.15125", "--window", "25", "--serial", "RLG-7"];
        let (status, _, said) = it.run(&[&args[..], &["--model", "bias 1", "-o", "unit.cal.json"]].concat());
        assert_eq!(status, 0, "{said}");
        it
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Exit status, standard output, standard error; neither of the two has anything that controls a terminal.
    fn run(&self, args: &[&str]) -> (i32, String, String) {
        let output = Command::cargo_bin("sagnac").unwrap().args(args).current_dir(self.folder.path()).output().unwrap();
        let [out, said] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        for text in [&out, &said] {
            let raw = text.chars().find(|c| *c != '\n' && (c.is_control() || *c == '\u{202e}'));
            assert_eq!(raw, None, "{args:?}: {text:?}");
        }
        (output.status.code().unwrap(), out, said)
    }
}

/// Headers, file names, flags, JSON and TOML: said, and not obeyed.
#[test]
fn a_terminal_is_not_controlled() {
    let it = Bench::new();
    it.write("header.csv", &format!("time_s,temperature_c,{CLEAR}counts\n1,20,1\n"));
    it.write("read.csv", &format!("time_s,temperature_c_a{CLEAR},counts\n1,20,1\n2,20,1\n"));
    it.write("cell.csv", &format!("time_s,temperature_c,counts\n1,{CLEAR},1\n2,20,{CLEAR}\n3,20,1\n"));
    it.write("odd.json", &format!("{{\"format\": \"{CLEAR}\"}}"));
    it.write(
        "odd.toml",
        &format!("serial = \"A\"\n\"{}\" = 3\n", CLEAR.escape_unicode().to_string().replace("\\u{", "\\U{")),
    );
    it.write("odd-value.toml", "serial = \"A\\u001b[2J\"\n");
    it.write(&format!("{CLEAR}.csv"), "time_s,temperature_c,counts\n1,20,1\n");
    let named = format!("{CLEAR}.csv");
    let missing = format!("none{CLEAR}.csv");
    let runs: [&[&str]; 11] = [
        &["inspect", "header.csv"],
        &["inspect", "header.csv", "--json"],
        &["inspect", "read.csv", "--arcsec-per-count", "1"],
        &["inspect", "cell.csv", "--arcsec-per-count", "1"],
        &["inspect", "odd.json"],
        &["calibrate", "log.csv", "--setup", "odd.toml"],
        &["calibrate", "log.csv", "--setup", "odd-value.toml"],
        &["inspect", &named, "--arcsec-per-count", "1"],
        &["inspect", &missing],
        &["inspect", &missing, "--json"],
        &["verify", "unit.cal.json", "log.csv", "--limits", &missing],
    ];
    for run in runs {
        it.run(run);
    }
    let (status, out, _) = it.run(&["inspect", &missing, "--json"]);
    let object: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((status, object["place"]["file"].as_str()), (2, Some(missing.as_str())), "JSON keeps the name itself");
}

/// A serial number or a name of a column that is read has no control characters; it is refused where it comes from.
#[test]
fn names_are_refused_at_their_source() {
    let it = Bench::new();
    it.write("serial.toml", "serial = \"A\\nB,C\"\narcsec_per_count = 0.15125\n");
    it.write("name.csv", "time_s,temperature_c_a\u{1},counts\n1,20,1\n2,20,1\n");
    let record = fs::read_to_string(it.path("unit.cal.json")).unwrap().replace("RLG-7", "A\\nB");
    it.write("serial.cal.json", &record);
    for (args, why) in [
        (&["calibrate", "log.csv", "--setup", "serial.toml"][..], "no control characters"),
        (&["calibrate", "log.csv", "--arcsec-per-count", "1", "--serial", "A\u{1b}B"], "no control characters"),
        (&["inspect", "name.csv", "--arcsec-per-count", "1"], "a header contains control characters"),
        (&["inspect", "serial.cal.json"], "no control characters"),
    ] {
        let (status, _, said) = it.run(args);
        assert!(status == 2 && said.contains(why), "{args:?}: {said}");
    }
}

/// A record is a text that anyone may change: in a report as well, what controls stands as its number.
#[test]
fn a_report_has_no_control_characters() {
    let it = Bench::new();
    let record = fs::read_to_string(it.path("unit.cal.json")).unwrap();
    let (from, to) = ("\"program\": \"", "\"program\": \"a\\b\\u009b\\u202eb");
    assert!(record.contains(from), "{record}");
    it.write("odd.json", &record.replace(from, to));
    for args in [
        &["compare", "odd.json", "unit.cal.json", "--report", "out.html"][..],
        &["verify", "odd.json", "log.csv", "--report", "out.html"],
    ] {
        let (status, _, said) = it.run(args);
        assert!(status < 2, "{args:?}: {said}");
        let page = fs::read_to_string(it.path("out.html")).unwrap();
        let raw = page.chars().find(|c| !['\n', '\t'].contains(c) && (c.is_control() || *c == '\u{202e}'));
        assert_eq!(raw, None, "{args:?}");
    }
    let page = fs::read_to_string(it.path("out.html")).unwrap();
    assert!(page.len() > 10_000);
}

/// A text cell that would begin a comment line is quoted: no reader loses the row.
#[test]
fn a_row_does_not_become_a_comment() {
    let it = Bench::new();
    it.write("notes.csv", "note,time_s,temperature_c,counts\n\"#x\",5,20,150\n\"#y\",10,20.1,150\nz,15,20.2,150\n");
    let (status, _, said) = it.run(&["compensate", "unit.cal.json", "notes.csv", "-o", "out.csv"]);
    assert_eq!(status, 0, "{said}");
    let text = fs::read_to_string(it.path("out.csv")).unwrap();
    assert!(text.contains("\n\"#x\",5,20,") && text.contains("\n\"#y\",10,"), "{text}");
    let rows = text.lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!(rows, 4, "{text}");
}

/// The bytes of an image's serial number may be any: what controls a terminal, or goes on behind a zero, is refused by every command.
#[test]
fn a_serial_that_controls_is_refused() {
    let it = Bench::new();
    assert_eq!(it.run(&["export", "unit.cal.json", "--to", "image", "-o", "unit.img"]).0, 0);
    let image = Image::decode(&fs::read(it.path("unit.img")).unwrap()).unwrap();
    for text in [&b"A\nB\x1b[2J\x07"[..], b"RLG-7\0\0more"] {
        let mut serial = [0; 32];
        serial[..text.len()].copy_from_slice(text);
        let odd = Image::new(Description { serial, ..*image.description() }).unwrap();
        let mut bytes = vec![0; odd.encoded_len()];
        odd.encode(&mut bytes).unwrap();
        fs::write(it.path("odd.img"), bytes).unwrap();
        for args in
            [&["compensate", "odd.img", "log.csv"][..], &["inspect", "odd.img"], &["verify", "odd.img", "log.csv"]]
        {
            let (status, out, said) = it.run(args);
            assert!(status == 2 && out.is_empty() && said.contains("control characters"), "{args:?}: {said}");
        }
    }
}

/// A comment column may hold anything; in a corrected log it is shown, and not obeyed. Letters of an older encoding stay.
#[test]
fn cells_do_not_control() {
    let it = Bench::new();
    let rows: String = (1..=40).map(|row| format!("{},20.{row},150,{CLEAR}\n", row * 5)).collect();
    it.write("notes.csv", &format!("time_s,temperature_c,counts,note\n{rows}"));
    let (status, out, said) = it.run(&["compensate", "unit.cal.json", "notes.csv"]);
    assert!(status == 0 && out.contains(",\\u{1b}[2J\\u{7}\\u{9b}31m\\u{202e},"), "{said}{out}");
    // An older encoding is noticed where a log begins; further down it may stand in a comment.
    let rows: String = (1..=400).map(|row| format!("{},20.{row},150,plain\n", row * 5)).collect();
    let mut latin = format!("time_s,temperature_c,counts,note\n{rows}").into_bytes();
    latin.extend_from_slice(b"2005,20.1,150,Pr\xfcfer\x1b[2J\n2010,20.2,150,b\n");
    fs::write(it.path("latin.csv"), latin).unwrap();
    let args = ["compensate", "unit.cal.json", "latin.csv", "-o", "out.csv"];
    assert_eq!(it.run(&args).0, 0);
    let written = fs::read(it.path("out.csv")).unwrap();
    assert!(written.windows(13).any(|part| part == b"Pr\xfcfer\\u{1b}["), "{}", String::from_utf8_lossy(&written));
}

/// What cannot be written is an error, also of help and version; an argument does not control the terminal.
#[test]
fn help_that_cannot_be_written_is_an_error() {
    let it = Bench::new();
    for args in [
        &["--help"][..],
        &["calibrate", "--help"],
        &["--version"],
        &["manual", "markdown"],
        &["inspect", "unit.cal.json"],
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("sagnac"));
        let output = command.args(args).current_dir(it.folder.path()).stdout(full).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("standard output: cannot write"), "{args:?}: {said}");
        assert_eq!(it.run(args).0, 0);
    }
    assert_eq!(it.run(&[&format!("--{CLEAR}")]).0, 2);
    assert_eq!(it.run(&["inspect", &format!("--{CLEAR}")]).0, 2);
}

/// A byte order mark before JSON and TOML, and lines that end in a carriage return alone.
#[test]
fn the_marks_of_other_systems() {
    let it = Bench::new();
    let record = fs::read_to_string(it.path("unit.cal.json")).unwrap();
    it.write("bom.cal.json", &format!("\u{feff}{record}"));
    it.write("bom.toml", "\u{feff}serial = \"RLG-7\"\narcsec_per_count = 0.15125\n");
    assert_eq!(it.run(&["inspect", "bom.cal.json"]).1, it.run(&["inspect", "unit.cal.json"]).1);
    assert_eq!(it.run(&["inspect", "log.csv", "--setup", "bom.toml"]).0, 0);
    assert_eq!(it.run(&["inspect", "log.csv", "--setup", "bom.toml", "--windows", "w.parquet"]).0, 0);
    let log = fs::read_to_string(it.path("log.csv")).unwrap();
    it.write("mac.csv", &log.replace('\n', "\r"));
    let (status, _, said) = it.run(&["inspect", "mac.csv", "--arcsec-per-count", "1"]);
    assert!(status == 2 && said.contains("carriage return alone") && said.contains("tr '\\r' '\\n'"), "{said}");
    it.write("windows.csv", &log.replace('\n', "\r\n"));
    assert_eq!(it.run(&["inspect", "windows.csv", "--arcsec-per-count", "1"]).0, 0);
}
