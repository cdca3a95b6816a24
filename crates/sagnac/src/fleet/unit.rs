//! One unit: calibrated and judged, or refused with its reason; and whether it has to be done again.
//!
//! ```text
//! key = SHA-256(program, model and options, setup, limits, name and SHA-256 of each run and retest)
//! ```

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::result::{UnitResult, VERSION};
use super::{Recipe, Unit};
use crate::calibration::Calibration;
use crate::fit::FitOptions;
use crate::verify::{Correction, Verification, VerifyOptions, verify};
use crate::window::WindowBuilder;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogReader, Logs, ReadMode, hex, sha256, sha256_of_file};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::setup::Setup;

/// What came of a unit, on whatever machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// It was done before: nothing that its result depends on has changed.
    Unchanged,
    /// Its result, with its record and the proof on its retests where there are any, as they are written.
    Done {
        /// The result.
        result: Box<UnitResult>,
        /// The text of its record.
        record: Option<String>,
        /// The text of its verification.
        proof: Option<String>,
    },
}

/// Does a unit, unless its key is that of `before`. Whatever goes wrong with its logs is a result with its reason.
pub fn answer(unit: &Unit, recipe: &Recipe, memory: MemoryBudget, before: Option<&str>) -> Answer {
    let options = recipe.options_of(unit);
    let setup = setup_of(unit, &recipe.setup, memory);
    let key = match (&setup, &options) {
        (Ok(setup), Ok(options)) => key_of(unit, setup, options, recipe),
        (Err(e), _) | (_, Err(e)) => Err(e.clone()),
    };
    if key.as_ref().is_ok_and(|key| Some(key.as_str()) == before) {
        return Answer::Unchanged;
    }
    let fitted = match (&setup, options, &key) {
        (Ok(setup), Ok(options), Ok(_)) => guarded(|| record_of(unit, setup, &options)),
        (Err(e), ..) | (.., Err(e)) => Err(e.clone()),
        (_, Err(e), _) => Err(e),
    };
    let mut result = Box::new(UnitResult::begun(unit, key.unwrap_or_default()));
    let (mut record, mut proof) = (None, None);
    match fitted {
        Ok((calibration, text)) => {
            result.calibrated(&calibration, hash_of(&text));
            record = Some(text);
            if !unit.retests.is_empty() {
                match guarded(|| proof_of(unit, calibration, recipe, memory)) {
                    Ok((verification, text)) => {
                        result.proved(&verification, hash_of(&text));
                        proof = Some(text);
                    }
                    Err(e) => result.not_judged(e),
                }
            }
        }
        Err(e) => result.refused(e),
    }
    Answer::Done { result, record, proof }
}

impl Answer {
    /// That a unit could not be done at all: its logs could not be fetched, or the machine cannot do what it was asked.
    pub fn failed(unit: &Unit, error: Error) -> Self {
        let mut result = UnitResult::begun(unit, String::new());
        result.refused(error);
        Self::Done { result: Box::new(result), record: None, proof: None }
    }

    /// With the names by which the logs were given, where it was done on files of other names: (file, given).
    pub fn rename(&mut self, names: &[(String, String)]) {
        let Self::Done { result, .. } = self else { return };
        for refusal in result.refusal.iter_mut().chain(&mut result.retest_refusal) {
            for (file, given) in names {
                refusal.place = refusal.place.replace(file, given);
                refusal.reason = refusal.reason.replace(file, given);
            }
        }
    }
}

fn hash_of(text: &str) -> String {
    hex(&sha256(text.as_bytes()))
}

/// A panic while one unit is done is a defect of this program, and not the end of the fleet.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(Error::defect("the work on this unit stopped")))
}

/// The setup of a unit: its own, or that of all; its name is its serial number where that has none.
fn setup_of(unit: &Unit, of_all: &Setup, memory: MemoryBudget) -> Result<Setup> {
    let setup = match &unit.setup {
        Some(path) => Setup::read(path)?,
        None => of_all.clone(),
    };
    let mut setup = Setup { memory, ..setup };
    setup.serial.get_or_insert_with(|| unit.name.clone());
    Ok(setup)
}

/// What a result depends on.
fn key_of(unit: &Unit, setup: &Setup, options: &FitOptions, recipe: &Recipe) -> Result<String> {
    let hashes = |logs: &[PathBuf]| {
        logs.iter().map(|log| Ok([file_name(log), sha256_of_file(log)?])).collect::<Result<Vec<_>>>()
    };
    let FitOptions { model, source_date_epoch, corrects_warm_up, removes_bias, prior, progress: _ } = options;
    let prior = prior.as_ref().map(|prior| (&prior.sha256, &prior.lot));
    let fit = format!("{model:?} {source_date_epoch:?} {corrects_warm_up} {removes_bias} {prior:?}");
    let limits = recipe.limits.as_ref().map(|limits| &limits.source);
    let logs = (hashes(&unit.runs)?, hashes(&unit.retests)?);
    let all = (VERSION, crate::calibration::program(), fit, setup, setup.memory.windows(), limits, logs);
    let text = serde_json::to_string(&all).map_err(|e| Error::defect(format!("cannot name the setup: {e}")))?;
    Ok(hex(&sha256(text.as_bytes())))
}

fn file_name(path: &std::path::Path) -> String {
    sagnac_units::format::file_name(&path.display().to_string())
}

fn record_of(unit: &Unit, setup: &Setup, options: &FitOptions) -> Result<(Calibration, String)> {
    if unit.runs.is_empty() {
        return Err(
            Error::input("the unit has no log for its calibration", "add one with `use` = calibrate").file(&unit.name)
        );
    }
    let windows = WindowBuilder::read_all(open(&unit.runs, setup), setup)?.finish();
    let calibration = crate::fit::calibrate(windows, setup, options)?;
    let text = calibration.to_json()?;
    Ok((calibration, text))
}

fn proof_of(
    unit: &Unit,
    calibration: Calibration,
    recipe: &Recipe,
    memory: MemoryBudget,
) -> Result<(Verification, String)> {
    let correction = Correction::from_calibration(calibration)?;
    let setup = Setup { memory, ..correction.setup() };
    let proof = verify(&correction, open(&unit.retests, &setup), &setup, VerifyOptions::default())?;
    let proof = match &recipe.limits {
        Some(limits) => proof.limits(limits)?,
        None => proof,
    };
    let text = serde_json::to_string_pretty(&proof.verification)
        .map_err(|e| Error::defect(format!("cannot write the proof of {}: {e}", unit.name)))?;
    Ok((proof.verification, text + "\n"))
}

fn open<'a>(logs: &'a [PathBuf], setup: &'a Setup) -> Logs<'a> {
    Logs::opened_by(logs.iter().map(move |log| LogReader::open(log, setup, ReadMode::Bulk)))
}
