//! A factory's gyros: a manifest in, a record for each unit and a table of all out.
//!
//! ```text
//! manifest ─▶ unit: runs, retests, setup ─▶ calibrated, judged ─▶ records/UNIT.cal.json, proofs/UNIT.json, units/UNIT.json ─▶ fleet.parquet
//! ```
//!
//! A unit is calibrated by one thread alone, and as many units at a time as there are threads: the records are byte for byte those of
//! [`crate::fit::calibrate`] whatever their number. What cannot be calibrated is a row with its reason, never the end of the fleet. A
//! unit is done once: it is done again when the bytes of a log, the setup, the model, the limits or the program's version have changed.
//! The table has every unit of the folder, so units of another manifest are added to those of before.
//!
//! Fails where two programs write into one folder at a time: the second is refused.

mod common_basis;
mod control;
#[cfg(test)]
mod draws;
mod manifest;
mod pattern;
mod prior;
mod quality;
mod result;
#[cfg(feature = "parquet")]
mod table;
mod unit;

use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

pub use common_basis::{COMMON_TEMPERATURES_C, CommonBasis};
pub use control::{ControlChart, Rule};
pub use manifest::{Unit, units_of};
pub use prior::{ExactSum, LotMean, NotUsed, Population, Prior, PriorFile, Sums};
pub use quality::{Capability, Odd, Quality, Quantity, RigEffect, Yield};
pub use result::{Acceptance, AxisResult, LimitResult, Outcome, Refusal, UnitResult};
#[cfg(feature = "parquet")]
pub use table::{TableSummary, table_summary};

use crate::fit::FitOptions;
use crate::verify::Limits;
use sagnac_log::error::{Error, Result};
use sagnac_log::paths::files_in;
use sagnac_log::setup::Setup;
use sagnac_log::write::remove_abandoned;

/// Folder of the records, of the proofs, and of what is known of each unit.
const RECORDS: &str = "records";
const PROOFS: &str = "proofs";
const UNITS: &str = "units";
/// The table.
pub const TABLE: &str = "fleet.parquet";
/// Held while a program writes into the folder.
const LOCK: &str = "lock";

/// What is done with each unit.
pub struct Work<'a> {
    /// What the logs cannot say, for units without a setup of their own.
    pub setup: &'a Setup,
    /// Makes the options of a fit.
    pub options: &'a (dyn Fn() -> FitOptions + Sync),
    /// What is known of the units before their tests.
    pub prior: Option<&'a PriorFile>,
    /// What a retest is held against.
    pub limits: Option<&'a Limits>,
    /// Units at a time.
    pub threads: usize,
    /// Also what has not changed is done.
    pub again: bool,
}

/// A unit that is done: its place in the manifest, its result, and whether it was done before already.
pub struct Done {
    /// Place in the manifest.
    pub place: usize,
    /// What came of it.
    pub result: UnitResult,
    /// Nothing of it had changed since it was done before.
    pub is_kept: bool,
}

/// Calibrates all units into a folder and writes the table; `report` is called with each as it is done, in any order.
///
/// # Errors
/// A folder that cannot be written, or that another program writes into.
pub fn calibrate(units: &[Unit], work: &Work<'_>, folder: &Path, report: &(dyn Fn(Done) + Sync)) -> Result<()> {
    for part in [RECORDS, PROOFS, UNITS] {
        let part = folder.join(part);
        fs::create_dir_all(&part).map_err(|e| Error::io_path(&part, "make the folder", &e))?;
    }
    let _lock = locked(&folder.join(LOCK))?;
    for part in [RECORDS, PROOFS, UNITS] {
        remove_abandoned(&folder.join(part))?;
    }
    each(units, work.threads, &|place| {
        let (result, is_kept) = unit::calibrated(&units[place], work, folder)?;
        report(Done { place, result, is_kept });
        Ok(())
    })?;
    #[cfg(feature = "parquet")]
    table::write(&results_in(folder)?, &folder.join(TABLE))?;
    Ok(())
}

/// What is known of every unit of a folder, in the natural order of their names.
///
/// # Errors
/// A folder or result that cannot be read, or that another version of this program wrote.
pub fn results_in(folder: &Path) -> Result<Vec<UnitResult>> {
    let units = folder.join(UNITS);
    if !units.is_dir() {
        return Err(Error::input("not a folder of `sagnac fleet calibrate`")
            .file(folder.display().to_string())
            .help(format!("such a folder has a folder {UNITS}/ with a result for each unit")));
    }
    let is_result = |path: &Path| path.extension().is_some_and(|ending| ending == "json");
    let read = |path: std::path::PathBuf| -> Result<UnitResult> {
        let text = fs::read(&path).map_err(|e| Error::io_path(&path, "read", &e))?;
        let broken = |what: String| {
            Error::input(what).file(path.display().to_string()).help("remove the file and calibrate the fleet again")
        };
        let result: UnitResult =
            serde_json::from_slice(&text).map_err(|e| broken(format!("not the result of a unit: {e}")))?;
        if result.version != result::VERSION {
            return Err(broken(format!(
                "version {} of a unit's result; this program has {}",
                result.version,
                result::VERSION
            )));
        }
        Ok(result)
    };
    files_in(&units)?.into_iter().filter(|path| is_result(path)).map(read).collect()
}

/// The lock of a folder, for as long as the file is open.
fn locked(path: &Path) -> Result<File> {
    let file = File::options().create(true).truncate(false).write(true).open(path);
    let file = file.map_err(|e| Error::io_path(path, "open", &e))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(fs::TryLockError::WouldBlock) => Err(Error::input("another program writes into this folder")
            .file(path.display().to_string())
            .help("wait until it has ended, or give another folder")),
        Err(fs::TryLockError::Error(e)) => Err(Error::io_path(path, "lock", &e)),
    }
}

/// Does some work for each unit; so many threads take the next one each. The first error ends it.
fn each(units: &[Unit], threads: usize, work: &(dyn Fn(usize) -> Result<()> + Sync)) -> Result<()> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<Error>> = Mutex::default();
    let take = || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(sagnac_log::threads::STACK_BYTES).build();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            if place >= units.len() {
                break;
            }
            let alone = || sagnac_log::threads::alone(|| work(place));
            let done = match &pool {
                Ok(pool) => pool.install(alone),
                Err(_) => alone(),
            };
            if let Err(e) = done {
                next.store(units.len(), Ordering::Relaxed);
                failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(e);
            }
        }
    };
    std::thread::scope(|scope| {
        for number in 1..threads.min(units.len()) {
            let thread = std::thread::Builder::new().name(format!("units {number}"));
            // A machine may refuse a thread: the others do its work.
            let _ = thread.stack_size(sagnac_log::threads::STACK_BYTES).spawn_scoped(scope, take);
        }
        take();
    });
    failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}
