//! The folder of a fleet's results, held while a program writes into it.
//!
//! ```text
//! answer ─▶ records/UNIT.cal.json, proofs/UNIT.json ─▶ units/UNIT.json, last ─▶ all of them: fleet.parquet
//! ```
//!
//! What a unit had before is replaced when all of its new files are whole: a full disk, or a program that is killed, leaves each unit as it was or
//! as it is. A unit whose logs cannot be read keeps what it has, and says so.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::Unit;
use super::result::{UnitOutcome, UnitResult, VERSION};
use super::unit::Answer;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::sha256_of_file;
use sagnac_log::paths::files_in;
use sagnac_log::read::read_own_text;
use sagnac_log::write::{remove_abandoned, write_bytes, write_together};

/// Folder of the records, of the proofs, and of what is known of each unit.
const RECORDS: &str = "records";
const PROOFS: &str = "proofs";
pub(super) const UNITS: &str = "units";
/// The table.
pub const TABLE: &str = "fleet.parquet";
/// Far more than a result has.
const MOST_RESULT_BYTES: u64 = 16 << 20;
/// Held while a program writes into the folder.
const LOCK: &str = "lock";

/// The folder, locked for as long as this is.
pub struct Results {
    folder: PathBuf,
    _lock: File,
}

/// What a folder of results is made of: the table, and folders of files.
pub fn parts_of(folder: &Path) -> [PathBuf; 4] {
    [TABLE, RECORDS, PROOFS, UNITS].map(|part| folder.join(part))
}

impl Results {
    /// Makes the folder where there is none, and locks it.
    ///
    /// # Errors
    /// A folder that cannot be written, or that another program writes into.
    pub fn open(folder: &Path) -> Result<Self> {
        for part in [RECORDS, PROOFS, UNITS] {
            let part = folder.join(part);
            fs::create_dir_all(&part).map_err(|e| Error::io_path(&part, "make the folder", &e))?;
        }
        let lock = locked(&folder.join(LOCK))?;
        for part in [RECORDS, PROOFS, UNITS] {
            remove_abandoned(&folder.join(part))?;
        }
        Ok(Self { folder: folder.to_owned(), _lock: lock })
    }

    /// What a unit has from before, if its files are as they were written.
    pub fn before(&self, unit: &Unit) -> Option<UnitResult> {
        let files = Files::of(&unit.name, &self.folder);
        let before: UnitResult = serde_json::from_str(&result_text(&files.result).ok()?).ok()?;
        let is_whole = |path: &Path, written: &Option<String>| match written {
            Some(written) => path.is_file() && sha256_of_file(path).is_ok_and(|sha256| sha256 == *written),
            None => !path.exists(),
        };
        let is_whole = is_whole(&files.record, &before.record_sha256) && is_whole(&files.proof, &before.proof_sha256);
        (before.version == VERSION && !before.key.is_empty() && is_whole).then_some(before)
    }

    /// Writes what came of a unit, unless it is what was there before. The result, and whether it is that of before.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn take(&self, unit: &Unit, before: Option<UnitResult>, answer: Answer) -> Result<(UnitResult, bool)> {
        let Files { result: of_result, record: of_record, proof: of_proof } = Files::of(&unit.name, &self.folder);
        let (result, record, proof) = match (answer, before) {
            (Answer::Unchanged, Some(before)) => {
                let is_renewed = before.outcome == UnitOutcome::NotRenewed;
                let now = UnitResult { lot: unit.lot.clone(), rig: unit.rig.clone(), ..before }.renewed();
                if is_renewed {
                    write_bytes(&of_result, text_of(&now)?.as_bytes())?;
                }
                return Ok((now, true));
            }
            (Answer::Unchanged, None) => {
                return Err(Error::defect("a unit is unchanged, but has no earlier result").file(&unit.name));
            }
            (Answer::Done { result, .. }, Some(before)) if is_away(unit, &result) && before.record_sha256.is_some() => {
                let kept = UnitResult { outcome: UnitOutcome::NotRenewed, refusal: result.refusal, ..before };
                write_bytes(&of_result, text_of(&kept)?.as_bytes())?;
                return Ok((kept, true));
            }
            (Answer::Done { result, record, proof }, _) => (*result, record, proof),
        };
        let text = text_of(&result)?;
        write_together(&[
            (&of_record, record.as_deref().map(str::as_bytes)),
            (&of_proof, proof.as_deref().map(str::as_bytes)),
            (&of_result, Some(text.as_bytes())),
        ])?;
        Ok((result, false))
    }

    /// Writes the table of all units of the folder.
    ///
    /// # Errors
    /// A table that cannot be written; a result that cannot be read.
    pub fn write_table(&self) -> Result<()> {
        #[cfg(feature = "parquet")]
        super::table::write(&results_in(&self.folder)?, &self.folder.join(TABLE))?;
        Ok(())
    }
}

/// The text of a unit's result. What is no file, a device or a pipe, has none.
fn result_text(path: &Path) -> Result<String> {
    if !path.is_file() {
        return Err(Error::input("this is no file", "remove it, and calibrate the fleet again")
            .file(path.display().to_string()));
    }
    read_own_text(path, "read the result", MOST_RESULT_BYTES)
}

/// The files that a unit gets in a folder of results.
pub fn outputs_of(unit: &Unit, folder: &Path) -> [PathBuf; 3] {
    let files = Files::of(&unit.name, folder);
    [files.record, files.proof, files.result]
}

/// What is known of every unit of a folder, in the natural order of their names.
///
/// # Errors
/// A folder or result that cannot be read, or that another version of this program wrote.
pub fn results_in(folder: &Path) -> Result<Vec<UnitResult>> {
    let units = folder.join(UNITS);
    if !units.is_dir() {
        return Err(Error::input(
            "this is not a folder of `sagnac fleet calibrate`",
            format!("give the folder with {UNITS}/ in it, or make one: sagnac fleet calibrate data/ -o FLEET/"),
        )
        .file(folder.display().to_string()));
    }
    let is_result = |path: &Path| path.extension().is_some_and(|ending| ending == "json");
    let read = |path: PathBuf| -> Result<UnitResult> {
        let text = result_text(&path)?;
        let broken = |what: String| {
            Error::input(what, "remove the file, and calibrate the fleet again").file(path.display().to_string())
        };
        let result: UnitResult =
            serde_json::from_str(&text).map_err(|e| broken(format!("not the result of a unit: {e}")))?;
        if result.version != VERSION {
            return Err(broken(format!("the result has version {}, and this program has {}", result.version, VERSION)));
        }
        Ok(result)
    };
    files_in(&units)?.into_iter().filter(|path| is_result(path)).map(read).collect()
}

/// Refuses results among the units: the next run would take them for some.
///
/// # Errors
/// A folder that is the source or lies in it.
pub fn check_output(folder: &Path, source: &Path) -> Result<()> {
    if !is_within(folder, source) {
        return Ok(());
    }
    Err(Error::input("the output folder is inside the folder of the units", "give a folder next to it")
        .column("--output")
        .value(folder.display().to_string()))
}

/// True for a folder that is another one or lies in it, or will.
fn is_within(folder: &Path, other: &Path) -> bool {
    let Ok(other) = other.canonicalize() else { return false };
    let known = folder.ancestors().find_map(|part| {
        let part = if part.as_os_str().is_empty() { Path::new(".") } else { part };
        part.canonicalize().ok()
    });
    other.is_dir() && known.is_some_and(|known| known.starts_with(&other))
}

/// Files of a unit.
struct Files {
    result: PathBuf,
    record: PathBuf,
    proof: PathBuf,
}

impl Files {
    fn of(unit: &str, folder: &Path) -> Self {
        Self {
            result: folder.join(UNITS).join(format!("{unit}.json")),
            record: folder.join(RECORDS).join(format!("{unit}.cal.json")),
            proof: folder.join(PROOFS).join(format!("{unit}.json")),
        }
    }
}

/// The unit has no logs, or without a key some that could not be read.
fn is_away(unit: &Unit, result: &UnitResult) -> bool {
    unit.runs.is_empty() || result.key.is_empty()
}

fn text_of(result: &UnitResult) -> Result<String> {
    serde_json::to_string_pretty(result)
        .map_err(|e| Error::defect(format!("cannot write the result of {}: {e}", result.unit)))
}

/// The lock of a folder, for as long as the file is open.
fn locked(path: &Path) -> Result<File> {
    let file = File::options().create(true).truncate(false).write(true).open(path);
    let file = file.map_err(|e| Error::io_path(path, "open", &e))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(fs::TryLockError::WouldBlock) => Err(Error::input(
            "another program writes into this folder",
            "wait until that program ends, or give another folder",
        )
        .file(path.display().to_string())),
        Err(fs::TryLockError::Error(e)) => Err(Error::io_path(path, "lock", &e)),
    }
}
