//! Odd machines: one thread, few descriptors, a short stack. The work goes on and its result is the same.

use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use sagnac_log::ingest::sha256;
use sagnac_sim::{LaggedChamber, csv_bytes};
use tempfile::TempDir;

const CALIBRATE: &str = "calibrate --arcsec-per-count 0.15125 --reference 20 --model bias-2";

/// A folder that the user nobody may write to, with the program in it.
fn bench() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).unwrap();
    fs::copy(assert_cmd::cargo::cargo_bin("sagnac"), folder.path().join("sagnac")).unwrap();
    folder
}

/// Runs `./sagnac` under limits of util-linux's prlimit. Root has no limit of threads, so it becomes nobody.
fn limited(folder: &Path, limit: &str, line: &str) -> Output {
    let is_root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
    let mut command = Command::new(if is_root { "setpriv" } else { "prlimit" });
    if is_root {
        command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "prlimit"]);
    }
    let args = line.split_whitespace().map(|word| if word == "bias-2" { "bias 2" } else { word });
    command.args([limit, "./sagnac"]).args(args).current_dir(folder).stdin(Stdio::null()).output().unwrap()
}

/// No limit that matters.
const FREE: &str = "--nofile=1024";

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A run of the lagged chamber, as text of more than one piece.
fn log() -> Vec<u8> {
    let chamber = LaggedChamber { row_s: 4, ..LaggedChamber::domain_notes() };
    csv_bytes(chamber.run(5))
}

/// A log and its calibration, and a simulated test as Parquet with its setup.
fn more(folder: &Path) {
    fs::write(folder.join("log.csv"), log()).unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/paper");
    for name in ["paper.toml", "bench.toml"] {
        fs::write(folder.join(name), fs::read(scenario.join(name)).unwrap()).unwrap();
    }
    for line in ["simulate paper.toml -o run.parquet", &format!("{CALIBRATE} log.csv --serial A-1 -o unit.cal.json")] {
        let made = limited(folder, FREE, line);
        assert!(made.status.success(), "{}", said(&made));
    }
}

#[test]
fn one_thread_is_enough() {
    let folder = bench();
    let at = folder.path();
    more(at);
    // No second process or thread for this user.
    let only = "--nproc=1";
    for line in [
        format!("{CALIBRATE} log.csv -o out"),
        "calibrate log.csv --arcsec-per-count 0.15125 --reference 20 -o out".to_owned(),
        "allan log.csv --arcsec-per-count 0.15125 --json".to_owned(),
        "inspect log.csv --arcsec-per-count 0.15125 --windows out".to_owned(),
        "verify unit.cal.json log.csv --json".to_owned(),
        "calibrate run.parquet --setup bench.toml -o out".to_owned(),
    ] {
        let run = |limits: &str| {
            let output = limited(at, limits, &line);
            let made = fs::read(at.join("out")).unwrap_or_default();
            (output.status.code(), [output.stdout, output.stderr, made].map(|bytes| sha256(&bytes)))
        };
        let (many, one) = (run(FREE), run(only));
        assert!(matches!(many.0, Some(0 | 1)), "{line}");
        assert!(one == many, "{line}: {}", said(&limited(at, only, &line)));
    }
}

/// The limit is below the number of logs by far; one is open at a time.
#[test]
fn a_test_of_many_files_needs_few_descriptors() {
    let folder = bench();
    let at = folder.path();
    let text = String::from_utf8(log()).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let lines: Vec<&str> = rows.lines().collect();
    let mut names = String::new();
    for (number, part) in lines.chunks(lines.len().div_ceil(300)).enumerate() {
        let name = format!("part-{number:03}.csv");
        let mut file = fs::File::create(at.join(&name)).unwrap();
        writeln!(file, "{header}\n{}", part.join("\n")).unwrap();
        names += &format!("{name} ");
    }
    assert!(names.split(' ').count() >= 300);
    fs::write(at.join("log.csv"), &text).unwrap();
    let many = limited(at, "--nofile=24", &format!("{CALIBRATE} {names} -o many.cal.json"));
    assert!(many.status.success(), "{}", said(&many));
    let whole = limited(at, "--nofile=24", &format!("{CALIBRATE} log.csv -o whole.cal.json"));
    assert!(whole.status.success(), "{}", said(&whole));
    let record =
        |name: &str| -> serde_json::Value { serde_json::from_slice(&fs::read(at.join(name)).unwrap()).unwrap() };
    let [many, whole] = ["many.cal.json", "whole.cal.json"].map(record);
    assert_eq!(many["provenance"]["inputs"].as_array().unwrap().len(), 300);
    assert_eq!(many["axes"][0]["terms"], whole["axes"][0]["terms"]);
    for line in ["verify many.cal.json", "allan --arcsec-per-count 0.15125"] {
        let output = limited(at, "--nofile=24", &format!("{line} {names}"));
        assert!(matches!(output.status.code(), Some(0 | 1)), "{line}: {}", said(&output));
    }
}

/// The thread that starts a program has the stack of the shell; files are decoded on another.
#[test]
fn a_short_stack_is_enough() {
    let folder = bench();
    let at = folder.path();
    more(at);
    for line in ["calibrate run.parquet --setup bench.toml -o out", "inspect unit.cal.json"] {
        let output = limited(at, "--stack=102400", line);
        assert_eq!(output.status.code(), limited(at, FREE, line).status.code(), "{line}: {}", said(&output));
    }
}

/// A real disk of 256 KB that is full: the command says so with the name of its file, the file of before stands, and nothing is left behind.
#[test]
fn a_full_disk_keeps_what_it_holds() {
    let folder = bench();
    let at = folder.path();
    more(at);
    fs::create_dir(at.join("disk")).unwrap();
    let names = "cd disk; ls -A | sort; sha256sum old.json";
    for (line, file) in [
        (format!("{} log.csv -o disk/old.json", CALIBRATE.replace("bias-2", "'bias 2'")), "old.json"),
        (format!("{} log.csv --report disk/new.html", CALIBRATE.replace("bias-2", "'bias 2'")), "new.html"),
        ("export unit.cal.json --to image -o disk/new.img".to_owned(), "new.img"),
        ("compensate unit.cal.json log.csv -o disk/new.csv".to_owned(), "new.csv"),
        ("simulate paper.toml -o disk/new.parquet".to_owned(), "new.parquet"),
        ("inspect log.csv --arcsec-per-count 0.15125 --windows disk/new.csv".to_owned(), "new.csv"),
    ] {
        // The disk is there for this shell alone.
        let script = format!(
            "mount -t tmpfs -o size=256k tmpfs disk || exit 99
             cp unit.cal.json disk/old.json
             head -c 1000000 /dev/zero > disk/filler 2> /dev/null
             before=$({names})
             ./sagnac {line} > /dev/null
             status=$?
             test \"$before\" = \"$({names})\" || exit 98
             exit $status"
        );
        let shell = ["--map-root-user", "--mount", "sh", "-c", &script];
        let output = Command::new("unshare").args(shell).current_dir(at).stdin(Stdio::null()).output().unwrap();
        let said = said(&output);
        assert!(output.status.code() == Some(2) && said.contains(file), "{line}: {:?} {said}", output.status);
        assert!(said.contains("No space left"), "{line}: {said}");
    }
}
