//! Which units there are, and what belongs to each.
//!
//! ```text
//! a folder of folders:  SOURCE/RLG-0001/*.csv, with retest/*.csv and a bench.toml of its own where it has them
//! a pattern:            SOURCE/{lot}/unit={unit}/run={run}.parquet; SOURCE/*/*.csv is that of {unit}/*.csv
//! a manifest:           unit,lot,rig,run,use,setup       a line for each log; paths from the manifest's folder
//! ```
//!
//! Fails for a unit with two lots, rigs or setups, and for a name that cannot be a file's.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::pattern::{self, MatchedLog, Use};
use sagnac_log::error::{Error, Result};
use sagnac_log::paths::{folders_in, in_order, logs_among, logs_of, matches_among};
use sagnac_log::read::read_text;
use sagnac_units::format::{controls, one_line};

/// Setup of a unit in its own folder.
const OWN_SETUP: &str = "bench.toml";
/// Folder of its retests.
const OWN_RETESTS: &str = "retest";
/// Longest name of a unit: it names files, and stands in an image.
const MOST_LETTERS: usize = 32;
/// A million lines.
const MOST_MANIFEST_BYTES: u64 = 256 << 20;
/// Columns of a manifest.
const COLUMNS: [&str; 6] = ["unit", "run", "lot", "rig", "use", "setup"];

/// A gyro and its tests.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Unit {
    /// Its name, and its serial number where its setup does not say one.
    pub name: String,
    /// Lot; empty where it is not known.
    pub lot: String,
    /// Rig; empty where it is not known.
    pub rig: String,
    /// Logs of the calibration, each a run unless one goes on in the next.
    pub runs: Vec<PathBuf>,
    /// Logs that the calibration is proved on.
    pub retests: Vec<PathBuf>,
    /// A setup of its own.
    pub setup: Option<PathBuf>,
}

/// The units of a folder, a pattern or a manifest.
///
/// # Errors
/// What cannot be read, or names no unit.
pub fn units_of(source: &Path) -> Result<Vec<Unit>> {
    if source.is_dir() {
        return of_folder(source);
    }
    if pattern::is_template(source) {
        let logs = |pattern: &str| Ok(logs_of(Path::new(pattern))?.unwrap_or_default());
        return gathered(pattern::matches(source, logs)?);
    }
    match logs_of(source)? {
        Some(logs) => gathered(logs.into_iter().map(by_its_folder).collect()),
        None => units_in_manifest(source, source.parent().unwrap_or(Path::new(""))),
    }
}

/// The units of a store that is no folder of this machine: `names` are all its files below `source`, a prefix such as
/// `s3://bucket/units` or a pattern, each with the prefix in front.
///
/// # Errors
/// Names that are no units.
pub fn units_among(source: &str, names: Vec<PathBuf>) -> Result<Vec<Unit>> {
    let root = Path::new(source);
    if pattern::is_template(root) {
        return gathered(pattern::matches(root, |pattern| matches_among(pattern, names))?);
    }
    if source.contains(['*', '?', '[']) {
        return gathered(matches_among(source, names)?.into_iter().map(by_its_folder).collect());
    }
    let mut units: BTreeMap<String, Folder> = BTreeMap::new();
    for name in names {
        let below = name.strip_prefix(root).map(Path::to_path_buf).unwrap_or_default();
        let parts: Vec<&str> = below.iter().filter_map(OsStr::to_str).collect();
        match parts[..] {
            [unit, _, ..] if unit.starts_with('.') => {}
            [unit, OWN_SETUP] => units.entry(unit.to_owned()).or_default().setup = Some(name),
            [unit, _] => units.entry(unit.to_owned()).or_default().runs.push(name),
            [unit, OWN_RETESTS, _] => units.entry(unit.to_owned()).or_default().retests.push(name),
            _ => {}
        }
    }
    if units.is_empty() {
        return Err(no_folder(source));
    }
    let mut names: Vec<PathBuf> = units.keys().map(PathBuf::from).collect();
    in_order(&mut names);
    let unit = |path: PathBuf| {
        let name = path.to_string_lossy().into_owned();
        checked(&name).map_err(|e| e.file(root.join(&path).display().to_string()))?;
        let Folder { runs, retests, setup } = units.remove(&name).unwrap_or_default();
        Ok(Unit { name, runs: logs_among(runs), retests: logs_among(retests), setup, ..Unit::default() })
    };
    names.into_iter().map(unit).collect()
}

/// What lies in a unit's folder.
#[derive(Default)]
struct Folder {
    runs: Vec<PathBuf>,
    retests: Vec<PathBuf>,
    setup: Option<PathBuf>,
}

fn no_folder(place: &str) -> Error {
    Error::input(
        "the folder contains no unit folders",
        "put the logs of each unit in its own folder, or give a manifest or a pattern such as data/{unit}.csv",
    )
    .file(place)
}

/// Each folder is a unit, by its name. One without logs is a unit too, which fails by that name.
fn of_folder(folder: &Path) -> Result<Vec<Unit>> {
    let all = folders_in(folder)?;
    if all.is_empty() {
        return Err(no_folder(&folder.display().to_string()));
    }
    let logs_in = |path: &Path| logs_of(path).ok().flatten().unwrap_or_default();
    let unit = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        checked(&name).map_err(|e| e.file(path.display().to_string()))?;
        let retests = path.join(OWN_RETESTS);
        let retests = if retests.is_dir() { logs_in(&retests) } else { Vec::new() };
        let setup = Some(path.join(OWN_SETUP)).filter(|setup| setup.is_file());
        Ok(Unit { name, runs: logs_in(path), retests, setup, ..Unit::default() })
    };
    all.iter().map(unit).collect()
}

fn by_its_folder(log: PathBuf) -> MatchedLog {
    let folder = log.parent().and_then(Path::file_name).unwrap_or_default();
    MatchedLog { unit: folder.to_string_lossy().into_owned(), log, ..MatchedLog::default() }
}

fn gathered(logs: Vec<MatchedLog>) -> Result<Vec<Unit>> {
    let mut units = Gathered::default();
    for MatchedLog { unit, lot, rig, of, log } in logs {
        let place = log.display().to_string();
        units.add(Unit { name: unit, lot, rig, ..Unit::default() }, of, log).map_err(|e| e.file(place))?;
    }
    Ok(units.all)
}

/// The units of a manifest, in the order of their first lines; its paths are from `folder`, and URLs are as they are.
///
/// # Errors
/// What cannot be read, a line that is wrong, no line.
pub fn units_in_manifest(path: &Path, folder: &Path) -> Result<Vec<Unit>> {
    let from_folder = |text: &str| if text.contains("://") { PathBuf::from(text) } else { folder.join(text) };
    let name = path.display().to_string();
    let broken = |e: csv::Error| {
        Error::input(
            format!("cannot read the manifest: {e}"),
            "correct the line, docs/how-to/fleet.md shows a manifest",
        )
        .file(&name)
    };
    // The reader's line numbers are those of single line ends.
    let text = read_text(path, "read the manifest", MOST_MANIFEST_BYTES)?.replace("\r\n", "\n");
    let delimiter = delimiter_of(text.as_bytes());
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).delimiter(delimiter).from_reader(text.as_bytes());
    let headers = reader.headers().map_err(broken)?.clone();
    let known = format!("use these columns, `unit` and `run` always: {}", COLUMNS.join(", "));
    if let Some(odd) = headers.iter().find(|header| !COLUMNS.contains(header)) {
        return Err(Error::input("unknown column in the manifest", known).file(&name).column(odd));
    }
    let column = |wanted: &str| headers.iter().position(|header| header == wanted);
    if let Some(missing) = ["unit", "run"].into_iter().find(|wanted| column(wanted).is_none()) {
        return Err(Error::input("the manifest lacks a column", known).file(&name).column(missing));
    }
    let columns = COLUMNS.map(column);
    let mut units = Gathered::default();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, csv::Position::line);
        let [unit, run, lot, rig, of, setup] = columns.map(|at| at.and_then(|at| record.get(at)).unwrap_or_default());
        let here = |e: Error| e.file(&name).line(line);
        if let Some((_, odd)) = [("lot", lot), ("rig", rig)].iter().find(|(_, text)| text.contains(controls)) {
            let what = "the name has a control character or a line end";
            return Err(here(Error::input(what, "write it with letters, digits and signs").value(one_line(odd))));
        }
        if run.is_empty() {
            return Err(here(
                Error::input("the line names no run", "write the log's path in the column `run`").column("run"),
            ));
        }
        let own = Unit {
            name: unit.to_owned(),
            lot: lot.to_owned(),
            rig: rig.to_owned(),
            setup: Some(setup).filter(|text| !text.is_empty()).map(from_folder),
            ..Unit::default()
        };
        units.add(own, of.parse().map_err(here)?, from_folder(run)).map_err(here)?;
    }
    if units.all.is_empty() {
        return Err(Error::input("the manifest has no lines", "add a line for each log: unit,run").file(&name));
    }
    Ok(units.all)
}

/// What parts the columns of the first line: a comma, else a semicolon or a tabulator.
fn delimiter_of(start: &[u8]) -> u8 {
    let header = start.split(|byte| *byte == b'\n').next().unwrap_or_default();
    [b',', b';', b'\t'].into_iter().find(|delimiter| header.contains(delimiter)).unwrap_or(b',')
}

/// Units as their logs come.
#[derive(Default)]
struct Gathered {
    all: Vec<Unit>,
    places: HashMap<String, usize>,
}

impl Gathered {
    fn add(&mut self, own: Unit, of: Use, log: PathBuf) -> Result<()> {
        checked(&own.name)?;
        let next = self.all.len();
        let at = *self.places.entry(own.name.clone()).or_insert(next);
        if at == next {
            self.all.push(own);
        } else if let unit = &self.all[at]
            && (&unit.lot, &unit.rig, &unit.setup) != (&own.lot, &own.rig, &own.setup)
        {
            return Err(Error::input(
                "the lot, rig or setup differs from an earlier line of this unit",
                "give a unit on two rigs two names",
            )
            .column("unit")
            .value(&own.name));
        }
        let unit = &mut self.all[at];
        let logs = if of == Use::Verify { &mut unit.retests } else { &mut unit.runs };
        if logs.contains(&log) {
            return Err(Error::input("the same log twice", "remove one of the two lines")
                .column("run")
                .value(log.display().to_string()));
        }
        logs.push(log);
        Ok(())
    }
}

/// A name that can be a file's on any system.
fn checked(name: &str) -> Result<()> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || ['-', '_', '.', '='].contains(&c);
    if name.is_empty() || name.starts_with('.') || name.len() > MOST_LETTERS || !name.chars().all(is_plain) {
        return Err(Error::input(
            "the name cannot be used for a unit",
            format!("use up to {MOST_LETTERS} letters, digits, - _ . and =, and no point in front"),
        )
        .column("unit")
        .value(name));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a store's listing says is what a folder of the same names would.
    #[test]
    fn a_listing_is_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let names = [
            "RLG-10/run-1.csv",
            "RLG-10/run-10.csv",
            "RLG-10/run-2.csv.gz",
            "RLG-10/notes.txt",
            "RLG-10/.hidden.csv",
            "RLG-2/a.parquet",
            "RLG-2/retest/b.parquet",
            "RLG-2/bench.toml",
            "RLG-2/deeper/than/c.csv",
            "RLG-3/notes.txt",
            "loose.csv",
        ];
        for name in names {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "x").unwrap();
        }
        let source = folder.path().to_str().unwrap();
        let listing = || names.iter().rev().map(|name| folder.path().join(name)).collect::<Vec<_>>();
        let units = units_among(source, listing()).unwrap();
        assert_eq!(units, units_of(folder.path()).unwrap());
        assert_eq!(units.iter().map(|unit| unit.name.as_str()).collect::<Vec<_>>(), ["RLG-2", "RLG-3", "RLG-10"]);
        assert_eq!(units[2].runs.len(), 3);
        for pattern in ["{unit}/run-{run}.csv*", "*/*.csv", "{unit}/{lot}/b.parquet"] {
            let pattern = format!("{source}/{pattern}");
            assert_eq!(units_among(&pattern, listing()).unwrap(), units_of(Path::new(&pattern)).unwrap(), "{pattern}");
        }
        for wrong in ["nothing-here", "*.ulg", "{lot}/a.csv"] {
            assert!(units_among(&format!("{source}/{wrong}"), listing()).is_err(), "{wrong}");
        }
    }
}
