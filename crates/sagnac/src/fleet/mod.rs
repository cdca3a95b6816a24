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
mod folder;
mod manifest;
mod pattern;
mod prior;
mod quality;
mod recipe;
mod result;
mod summary;
#[cfg(feature = "parquet")]
mod table;
mod unit;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

pub use common_basis::{COMMON_TEMPERATURES_C, CommonBasis};
pub use control::{ControlChart, Rule};
pub use folder::{Results, TABLE, check_output, outputs_of, parts_of, results_in};
pub use manifest::{Unit, units_among, units_in_manifest, units_of};
pub use prior::{ExactSum, LotMean, LotSums, NotUsed, Population, Prior, PriorFile};
pub use quality::{Capability, Odd, Quality, Quantity, RigEffect, Yield};
pub use recipe::Recipe;
pub use result::{Acceptance, AxisResult, LimitResult, Refusal, UnitOutcome, UnitResult};
pub use summary::{InOrder, Summary};
#[cfg(feature = "parquet")]
pub use table::{TableSummary, table_summary};
pub use unit::{Answer, answer};

use sagnac_log::error::{Error, Result};
use sagnac_log::threads::STACK_BYTES;

/// How a machine's own threads do it.
#[derive(Clone, Copy)]
pub struct FleetWork<'a> {
    /// What is done with each unit.
    pub recipe: &'a Recipe,
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
pub fn calibrate(units: &[Unit], work: &FleetWork<'_>, folder: &Path, report: &(dyn Fn(Done) + Sync)) -> Result<()> {
    let memory = work.recipe.setup.memory;
    calibrate_by(units, work, folder, report, &|unit, before| answer(unit, work.recipe, memory, before))
}

/// The same where `answer` does a unit, unless its key is the one given.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_by(
    units: &[Unit],
    work: &FleetWork<'_>,
    folder: &Path,
    report: &(dyn Fn(Done) + Sync),
    answer: &(dyn Fn(&Unit, Option<&str>) -> Answer + Sync),
) -> Result<()> {
    let results = Results::open(folder)?;
    each(units, work.threads, &|place| {
        let unit = &units[place];
        let before = results.before(unit).filter(|_| !work.again);
        let answer = answer(unit, before.as_ref().map(|before| before.key.as_str()));
        let (result, is_kept) = results.take(unit, before, answer)?;
        report(Done { place, result, is_kept });
        Ok(())
    })?;
    results.write_table()
}

/// Does some work for each unit; so many threads take the next one each. The first error ends it.
fn each(units: &[Unit], threads: usize, work: &(dyn Fn(usize) -> Result<()> + Sync)) -> Result<()> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<Error>> = Mutex::default();
    let take = || {
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            if place >= units.len() {
                break;
            }
            if let Err(e) = by_one_thread(|| work(place)) {
                next.store(units.len(), Ordering::Relaxed);
                failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(e);
            }
        }
    };
    std::thread::scope(|scope| {
        for number in 1..threads.min(units.len()) {
            let thread = std::thread::Builder::new().name(format!("units {number}"));
            // A machine may refuse a thread: the others do its work.
            let _ = thread.stack_size(STACK_BYTES).spawn_scoped(scope, take);
        }
        take();
    });
    failed.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Does some work by one thread alone, whatever it would do by several: for who has as many units at a time as there are processors.
pub fn by_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let alone = || sagnac_log::threads::alone(work);
    match rayon::ThreadPoolBuilder::new().num_threads(1).stack_size(STACK_BYTES).build() {
        Ok(pool) => pool.install(alone),
        Err(_) => alone(),
    }
}
