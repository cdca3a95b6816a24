//! Each ready scenario with each fault, through `inspect`: named, or not good for a calibration.
//! The page is not written if a fault goes undetected that is not documented as such.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};
use sagnac_sim::FaultKind;
use serde_json::Value;
use tempfile::TempDir;
use xtask::shell::text;

use crate::made::Made;
use crate::makes::READY;
use crate::places::FAULTS;
use crate::program::Program;

/// Faults that go undetected, as listed in docs/explanation/simulator.md: a slow clock stretches all rows alike.
const UNNOTICED: [(&str, &str); 4] = [
    ("paper", "clock_drift"),
    ("square-28cm", "clock_drift"),
    ("prism-heater-loop", "clock_drift"),
    ("triangle-28cm-dithered", "clock_drift"),
];

/// Scenario and fault of those undetected.
type Unnoticed = Vec<(&'static str, &'static str)>;

/// Result of `inspect`.
struct Seen {
    rows: u64,
    excluded: BTreeMap<String, u64>,
    verdict: String,
    cautions: Vec<String>,
    good: bool,
}

fn seen(program: &Program, folder: &Path, scenario: &str, fault: Option<&str>) -> Result<Seen> {
    let log = folder.join(format!("{scenario}-{}.csv", fault.unwrap_or("none")));
    let (toml, bench) = (format!("scenarios/{scenario}/{scenario}.toml"), format!("scenarios/{scenario}/bench.toml"));
    let fault: Vec<&str> = fault.iter().flat_map(|kind| ["--fault", kind]).collect();
    program.stdout(&[&["simulate", &toml, "-o", text(&log)?], &fault[..]].concat())?;
    let object = serde_json::from_str(&program.stdout(&["inspect", text(&log)?, "--setup", &bench, "--json"])?)?;
    std::fs::remove_file(&log)?;
    of_inspect(&object).with_context(|| format!("unexpected fields in the output of inspect for {scenario}: {object}"))
}

fn of_inspect(object: &Value) -> Option<Seen> {
    let tallies = object["excluded"].as_array()?.iter();
    let excluded = tallies.map(|t| Some((t["reason"].as_str()?.to_owned(), t["rows"].as_u64()?)));
    let survey = &object["survey"];
    let good_for = survey["good_for"].as_str()?;
    let verdict = match survey["reason"].as_str() {
        None => good_for.to_owned(),
        // The reason up to its places.
        Some(reason) => format!("{good_for}: {}", reason.split([';', '(']).next()?.trim()),
    };
    let cautions = survey["cautions"].as_array()?.iter().map(|caution| Some(caution.as_str()?.to_owned()));
    Some(Seen {
        rows: object["rows"].as_u64()?,
        excluded: excluded.collect::<Option<_>>()?,
        verdict,
        cautions: cautions.collect::<Option<_>>()?,
        good: good_for == "calibration",
    })
}

/// A caution without its figures: they differ from log to log.
fn kind_of(caution: &str) -> String {
    caution.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// Reasons that are new or concern at least 0.5 % of the rows more, and cautions that are new. A shortened window by itself does not count.
fn named(clean: &Seen, broken: &Seen) -> Vec<String> {
    let more = broken.excluded.iter().filter_map(|(reason, rows)| {
        let before = clean.excluded.get(reason).copied().unwrap_or(0);
        let more = rows.saturating_sub(before);
        let counts = reason != "short_window" && more > 0 && (before == 0 || more * 200 >= broken.rows);
        counts.then(|| format!("{reason} {more}"))
    });
    let known: Vec<String> = clean.cautions.iter().map(|caution| kind_of(caution)).collect();
    let new = broken.cautions.iter().filter(|caution| !known.contains(&kind_of(caution)));
    more.chain(new.map(|caution| caution.replace('|', "/"))).collect()
}

const HEAD: &str = "# Faults

Made by `cargo xtask bless`; do not edit.

Each ready scenario has each fault from two fifths to three fifths of its run. The log goes through `sagnac inspect`. *Named* are the
reasons for which rows are excluded beyond those of the same test without the fault, with their number, and what there is to mind. **Not noticed** means that the log looks
like a good one; [Simulator](../explanation/simulator.md#faults-that-are-not-detected) states why.

| scenario | fault | named | good for |
|---|---|---|---|
";

pub(crate) fn make(program: &Program) -> Result<Vec<Made>> {
    let folder = TempDir::new()?;
    let tables: Vec<Result<(String, Unnoticed)>> = std::thread::scope(|scope| {
        let folder = folder.path();
        let threads = READY.map(|scenario| scope.spawn(move || of_scenario(program, folder, scenario)));
        threads.map(|thread| thread.join().unwrap_or_else(|_| Err(anyhow!("a panic, see above")))).into()
    });
    let (mut page, mut unnoticed) = (String::from(HEAD), Vec::new());
    for table in tables {
        let (rows, of_scenario) = table?;
        page += &rows;
        unnoticed.extend(of_scenario);
    }
    ensure!(unnoticed == UNNOTICED, "unnoticed are {unnoticed:?}, documented {UNNOTICED:?}");
    Ok(vec![Made::new(FAULTS, page)])
}

fn of_scenario(program: &Program, folder: &Path, scenario: &'static str) -> Result<(String, Unnoticed)> {
    let clean = seen(program, folder, scenario, None)?;
    ensure!(clean.good, "{scenario} without a fault: good for {}", clean.verdict);
    let (mut rows, mut unnoticed) = (String::new(), Vec::new());
    for (_, fault) in FaultKind::ALL {
        let broken = seen(program, folder, scenario, Some(fault))?;
        let mut named = named(&clean, &broken);
        if named.is_empty() && broken.good {
            named.push("**not noticed**".to_owned());
            unnoticed.push((scenario, fault));
        }
        let words = fault.replace('_', " ");
        rows += &format!("| {scenario} | {words} | {} | {} |\n", named.join(", "), broken.verdict);
    }
    Ok((rows, unnoticed))
}
