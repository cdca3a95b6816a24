//! One unit: calibrated and judged, or refused with its reason; and whether it has to be done again.
//!
//! ```text
//! key = SHA-256(program, model and options, setup, limits, name and SHA-256 of each run and retest)
//! ```

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use super::result::{UnitResult, VERSION};
use super::{PROOFS, RECORDS, UNITS, Unit, Work};
use crate::calibration::Calibration;
use crate::fit::FitOptions;
use crate::verify::{Correction, Verification, VerifyOptions, verify};
use crate::window::WindowBuilder;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogReader, Logs, ReadMode, hex, sha256, sha256_of_file};
use sagnac_log::setup::Setup;
use sagnac_log::write::write_bytes;

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

    /// The result of before, if it has this key and its files are as they were written.
    fn kept(&self, key: &str) -> Option<UnitResult> {
        let before: UnitResult = serde_json::from_slice(&fs::read(&self.result).ok()?).ok()?;
        let is_whole = |path: &Path, written: &Option<String>| match written {
            Some(written) => sha256_of_file(path).is_ok_and(|found| found == *written),
            None => !path.exists(),
        };
        let is_whole = is_whole(&self.record, &before.record_sha256) && is_whole(&self.proof, &before.proof_sha256);
        (before.version == VERSION && before.key == key && is_whole).then_some(before)
    }
}

/// A unit's result, and whether it is the one of before.
///
/// # Errors
/// A result that cannot be written.
pub(super) fn calibrated(unit: &Unit, work: &Work<'_>, folder: &Path) -> Result<(UnitResult, bool)> {
    let files = Files::of(&unit.name, folder);
    let options = options_of(unit, work);
    let setup = setup_of(unit, work.setup);
    let key = match (&setup, &options) {
        (Ok(setup), Ok(options)) => key_of(unit, setup, options, work),
        (Err(e), _) | (_, Err(e)) => Err(e.clone()),
    };
    let kept = key.as_ref().ok().filter(|_| !work.again).and_then(|key| files.kept(key));
    if let Some(before) = kept {
        return Ok((UnitResult { lot: unit.lot.clone(), rig: unit.rig.clone(), ..before }, true));
    }
    // What stands there is not of these logs.
    [&files.result, &files.record, &files.proof].into_iter().try_for_each(|path| remove(path))?;
    let made = match (setup, options, &key) {
        (Ok(setup), Ok(options), Ok(_)) => guarded(|| record_of(unit, &setup, &options)),
        (Err(e), ..) | (_, Err(e), _) => Err(e),
        (.., Err(e)) => Err(e.clone()),
    };
    let mut result = UnitResult::begun(unit, key.unwrap_or_default());
    match made {
        Ok((calibration, text)) => {
            result.calibrated(&calibration, written(&files.record, &text)?);
            if !unit.retests.is_empty() {
                match guarded(|| proof_of(unit, calibration, work)) {
                    Ok((verification, text)) => result.proved(&verification, written(&files.proof, &text)?),
                    Err(e) => result.not_judged(e),
                }
            }
        }
        Err(e) => result.refused(e),
    }
    let text = serde_json::to_string_pretty(&result)
        .map_err(|e| Error::input(format!("cannot write the result of {}: {e}", unit.name)))?;
    written(&files.result, &text)?;
    Ok((result, false))
}

/// Writes a text; its hash.
fn written(path: &Path, text: &str) -> Result<String> {
    write_bytes(path, text.as_bytes())?;
    Ok(hex(&sha256(text.as_bytes())))
}

/// A panic while one unit is done is a defect of this program, and not the end of the fleet.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        Err(Error::input("a defect of this program, not of the unit")
            .help("calibrate the unit by itself, and report what that says with the log if you can"))
    })
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io_path(path, "remove", &e)),
        _ => Ok(()),
    }
}

/// The setup of a unit: its own, or that of all; its name is its serial number where that has none.
fn setup_of(unit: &Unit, of_all: &Setup) -> Result<Setup> {
    let mut setup = match &unit.setup {
        Some(path) => Setup { memory: of_all.memory, ..Setup::read(path)? },
        None => of_all.clone(),
    };
    setup.serial.get_or_insert_with(|| unit.name.clone());
    Ok(setup)
}

/// How it is fitted: with what is known of its lot, where there is a prior.
fn options_of(unit: &Unit, work: &Work<'_>) -> Result<FitOptions> {
    let lot = Some(unit.lot.as_str()).filter(|lot| !lot.is_empty());
    let prior = work.prior.map(|prior| prior.of_unit(lot)).transpose()?;
    Ok((work.options)().prior(prior))
}

/// What a result depends on.
fn key_of(unit: &Unit, setup: &Setup, options: &FitOptions, work: &Work<'_>) -> Result<String> {
    let hashes = |logs: &[PathBuf]| {
        logs.iter().map(|log| Ok([file_name(log), sha256_of_file(log)?])).collect::<Result<Vec<_>>>()
    };
    let FitOptions { model, source_date_epoch, bootstrap, loss, corrects_warm_up, prior, progress: _ } = options;
    let prior = prior.as_ref().map(|prior| (&prior.sha256, &prior.lot));
    let fit = format!("{model:?} {source_date_epoch:?} {bootstrap:?} {loss:?} {corrects_warm_up} {prior:?}");
    let limits = work.limits.map(|limits| &limits.source);
    let logs = (hashes(&unit.runs)?, hashes(&unit.retests)?);
    let all = (VERSION, crate::calibration::program(), fit, setup, setup.memory.windows(), limits, logs);
    let text = serde_json::to_string(&all).map_err(|e| Error::input(format!("cannot name the setup: {e}")))?;
    Ok(hex(&sha256(text.as_bytes())))
}

fn file_name(path: &Path) -> String {
    sagnac_units::format::file_name(&path.display().to_string())
}

fn record_of(unit: &Unit, setup: &Setup, options: &FitOptions) -> Result<(Calibration, String)> {
    if unit.runs.is_empty() {
        return Err(Error::input("no log of this unit").file(&unit.name));
    }
    let windows = WindowBuilder::read_all(open(&unit.runs, setup), setup)?.finish();
    let calibration = crate::fit::calibrate(windows, setup, options)?;
    let text = calibration.to_json()?;
    Ok((calibration, text))
}

fn proof_of(unit: &Unit, calibration: Calibration, work: &Work<'_>) -> Result<(Verification, String)> {
    let correction = Correction::from_calibration(calibration)?;
    let setup = Setup { memory: work.setup.memory, ..correction.setup() };
    let proof = verify(&correction, open(&unit.retests, &setup), &setup, VerifyOptions::default())?;
    let proof = match work.limits {
        Some(limits) => proof.limits(limits)?,
        None => proof,
    };
    let text = serde_json::to_string_pretty(&proof.verification)
        .map_err(|e| Error::input(format!("cannot write the proof of {}: {e}", unit.name)))?;
    Ok((proof.verification, text + "\n"))
}

fn open<'a>(logs: &'a [PathBuf], setup: &'a Setup) -> Logs<'a> {
    Logs::opened_by(logs.iter().map(move |log| LogReader::open(log, setup, ReadMode::Bulk)))
}
