//! Each ready scenario with each fault, through `inspect` (which tries `calibrate`): noticed, named, or refused.
//! docs/reference/faults.md is this table; SAGNAC_WRITE_DOCS=1 writes it anew.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use sagnac_sim::FaultKind;
use serde_json::Value;

const READY: [&str; 4] = ["paper", "square-28cm", "prism-heater-loop", "triangle-28cm-dithered"];

/// What goes unnoticed, and is listed in docs/explanation/simulator.md. A thermometer alone that stands still is no more than a
/// steady one; a clock that slows down stretches all rows alike.
const UNNOTICED: [(&str, &str); 5] = [
    ("paper", "stuck_thermometer"),
    ("paper", "clock_drift"),
    ("square-28cm", "clock_drift"),
    ("prism-heater-loop", "clock_drift"),
    ("triangle-28cm-dithered", "clock_drift"),
];

/// Scenario and fault of what nothing named.
type Unnoticed = Vec<(&'static str, &'static str)>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What `inspect` said.
struct Seen {
    rows: u64,
    excluded: BTreeMap<String, u64>,
    calibrate: String,
    refused: bool,
}

fn sagnac(args: &[&str]) -> Vec<u8> {
    let out = Command::new(env!("CARGO_BIN_EXE_sagnac")).args(args).output().unwrap();
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

fn seen(folder: &Path, scenario: &str, fault: Option<&str>) -> Seen {
    let of = |file: &str| root().join("scenarios").join(scenario).join(file).display().to_string();
    let log = folder.join(format!("{scenario}-{}.csv", fault.unwrap_or("none"))).display().to_string();
    let (toml, bench) = (of(&format!("{scenario}.toml")), of("bench.toml"));
    let fault: Vec<&str> = fault.iter().flat_map(|kind| ["--fault", kind]).collect();
    sagnac(&[&["simulate", &toml, "-o", &log], &fault[..]].concat());
    let object: Value = serde_json::from_slice(&sagnac(&["inspect", &log, "--setup", &bench, "--json"])).unwrap();
    std::fs::remove_file(&log).unwrap();
    let tallies = object["excluded"].as_array().unwrap().iter();
    let excluded = tallies.map(|t| (t["reason"].as_str().unwrap().to_owned(), t["rows"].as_u64().unwrap()));
    let calibrate = &object["calibrate"];
    let refused = calibrate["refused"].as_bool().unwrap_or(false);
    let words = match calibrate["models"][0].as_str() {
        Some(model) => format!("`{model}`"),
        // The reason up to its first colon: the rest is places.
        None => format!("refused: {}", calibrate["reason"].as_str().unwrap().split([';', '(']).next().unwrap().trim()),
    };
    Seen { rows: object["rows"].as_u64().unwrap(), excluded: excluded.collect(), calibrate: words, refused }
}

/// Reasons that are new, or of half a per cent of the rows and more; a cut window alone says nothing.
fn named(clean: &Seen, broken: &Seen) -> Vec<String> {
    let more = broken.excluded.iter().filter_map(|(reason, rows)| {
        let before = clean.excluded.get(reason).copied().unwrap_or(0);
        let more = rows.saturating_sub(before);
        let counts = reason != "short_window" && more > 0 && (before == 0 || more * 200 >= broken.rows);
        counts.then(|| format!("{reason} {more}"))
    });
    more.collect()
}

const HEAD: &str = "# Faults

Made by `SAGNAC_WRITE_DOCS=1 cargo test -p sagnac-cli --test faults`, which also holds it.

Each ready scenario has each fault from two fifths to three fifths of its run. The log goes through `sagnac inspect`. *Named* are the
reasons for which rows are excluded beyond those of the same test without the fault, with their number. **Not noticed** means that the log looks
like a good one; [Simulator](../explanation/simulator.md#faults-that-nobody-notices) states why.

| scenario | fault | named | calibrate |
|---|---|---|---|
";

#[test]
fn every_fault_in_every_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let tables: Vec<(String, Unnoticed)> = std::thread::scope(|scope| {
        let folder = folder.path();
        let threads = READY.map(|scenario| scope.spawn(move || of_scenario(folder, scenario)));
        threads.map(|thread| thread.join().unwrap()).into()
    });
    let (parts, unnoticed): (Vec<String>, Vec<Unnoticed>) = tables.into_iter().unzip();
    let table = String::from(HEAD) + &parts.concat();
    let path = root().join("docs/reference/faults.md");
    if std::env::var_os("SAGNAC_WRITE_DOCS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    assert!(
        std::fs::read_to_string(&path).unwrap() == table,
        "docs/reference/faults.md is not what this makes:\n{table}"
    );
    assert_eq!(unnoticed.concat(), UNNOTICED);
}

fn of_scenario(folder: &Path, scenario: &'static str) -> (String, Unnoticed) {
    let clean = seen(folder, scenario, None);
    assert!(!clean.refused, "{scenario} without a fault: {}", clean.calibrate);
    let (mut table, mut unnoticed) = (String::new(), Vec::new());
    for (_, fault) in FaultKind::ALL {
        let broken = seen(folder, scenario, Some(fault));
        let mut named = named(&clean, &broken);
        if named.is_empty() && !broken.refused {
            named.push("**not noticed**".to_owned());
            unnoticed.push((scenario, fault));
        }
        writeln!(table, "| {scenario} | {} | {} | {} |", fault.replace('_', " "), named.join(", "), broken.calibrate)
            .unwrap();
    }
    (table, unnoticed)
}
