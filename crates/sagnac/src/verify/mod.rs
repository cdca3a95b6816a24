//! The proof: a retest log through the decoded image, before next to after.
//!
//! ```text
//! retest ─▶ Replay (sagnac-core at the true tick) ─▶ windows of raw and corrected counts ─▶ Values
//! ```
//!
//! Both sides are summed over the same windows; which windows are left out is decided from the raw
//! counts alone. `docs/explanation/verification.md` defines every value.

mod flight;
mod limits;
mod overrides;
mod replay;
mod reservations;
mod result;
mod values;

pub use flight::position::{Corner, Flight, FlightAxis, Gyrocompass, HeadingError, PositionError};
pub use flight::strapdown::{Channel, Strapdown, noise_m, positions_m};
pub use limits::file::SETS;
pub use limits::judge::Proof;
pub use limits::source::{LimitsSource, Specification};
pub use limits::table::{Applies, Bound, LimitSpec, Limits, SPECS};
pub use limits::unanswered::{Unanswered, unanswered};
pub use limits::verdict::{DecisionRule, Judged, Verdict};
pub use overrides::Override;
pub use replay::column_of_input::{InputColumns, LogColumn};
pub use replay::compensate::{Compensated, CorrectedFormat, compensate, status_text};
pub use replay::correction::Correction;
pub use replay::flagged::FlaggedOff;
pub use replay::options::VerifyOptions;
pub use replay::tick_by_tick::{Corrected, Replay};
pub use result::{AxisVerification, Coverage, REPEATED_PROFILE, RetestNoiseFloor, Verification};
pub use values::before_after::{DriftValues, expected_range};
pub use values::diagnostics::{GapSteps, ResidualDiagnostics};
pub use values::judged_windows::Estimate;
pub use values::memory::Memory;
pub use values::rate_table::{PlateauProof, ScaleProof, ScaleValues};
pub use values::repeatability::{BiasRepeatability, RunBias, TurnOns};
pub use values::residual::{Plateaus, RandomWalk, RetestResidual};
pub use values::suspects::Suspect;

use crate::calibration::{LogFile, log_files, program};
use crate::verify::replay::paired::PairedWindows;
use crate::verify::values::of_axis::{Against, Retest, unit_of};
use crate::window::refuse_still;
use sagnac_log::error::Result;
use sagnac_log::ingest::{LogReader, Logs, hex, share_rows};
use sagnac_log::setup::Setup;
use sagnac_noise::{Repeat, Trace};
use sagnac_units::s_from_ns;

/// Replays retest logs through the images of a correction and compares both sides, window by window. Every window that has
/// counts is judged, unless the options exclude some.
///
/// # Errors
/// Logs that do not fit the correction, too few windows for any value, or an axis whose counter nothing turns.
pub fn verify<'a>(
    correction: &Correction,
    logs: impl Into<Logs<'a>>,
    setup: &Setup,
    options: VerifyOptions,
) -> Result<Proof> {
    let mut logs = logs.into();
    let fits = |log: &LogReader| correction.fit_to(log.shape(), setup).map_err(|e| e.file(log.summary().file));
    let (_, readings) = fits(logs.first()?)?;
    let sensor = readings.thermometer;
    // What the setup of the retest does not state is as the calibration had it.
    let of_calibration = correction.setup().input_rates_dph();
    let letters = &logs.first()?.shape().axes;
    let input_rate_dph = setup.input_rates_of_log(of_calibration.as_ref(), letters)?;
    let stated = &Setup { input_rate_dph, earth: None, ..setup.clone() };
    let mut whole = PairedWindows::replayed(correction, logs, setup)?;
    whole.leave_out_unknown(stated)?;
    refuse_still(&whole.raw)?;
    let kept = options.excludes().then(|| whole.excluding(options, setup.discard_initial_s));
    let pair = kept.as_ref().unwrap_or(&whole);
    let against = Against { correction, setup: stated, sensor };
    let (axes, report_data) = against.values(&Retest {
        excluded_fraction: kept.as_ref().map(|kept| kept.excluded_fraction(&whole)),
        suspects_in: Some(&whole.raw),
        ..Retest::all(pair)
    })?;
    let every_row = kept.as_ref().map(|_| against.values(&Retest::all(&whole))).transpose()?;
    let windows = &pair.raw;
    let (window_s, record) = (windows.shape.nominal_s, correction.calibration.as_ref());
    let overrides = reservations::of_retest(record, window_s, &axes);
    let units = setup.units.unwrap_or_default();
    let quieter = axes.iter().filter_map(|axis| reservations::quieter(record, axis, units));
    let other_unit = axes.iter().filter_map(|axis| reservations::other_unit(record, axis, setup));
    let copies = reservations::repeated(&whole.raw.trace);
    let objections = quieter.chain(other_unit).chain(reservations::other_offset(record, setup)).chain(copies).collect();
    let verification = Verification {
        program: program(),
        serial: correction.serial(),
        sensor: setup.sensor.clone(),
        rig: setup.rig.clone(),
        unit: unit_of(windows).1.to_owned(),
        window_s,
        axes,
        excluded: windows.tallies.list(),
        image_sha256: correction.sha256(),
        record_sha256: correction.images.first().map_or(String::new(), |image| hex(&image.description().parent)),
        limits: None,
        untested_axes: untested_axes(correction, &windows.shape.axes),
        training_overlap: training_overlap(correction, &log_files(windows), &whole.raw.trace),
        training_unknown: correction.calibration.is_none(),
        overrides,
        objections,
        new_clocks: whole.clocks.new.clone(),
        unseen_h: Some(s_from_ns(whole.clocks.unseen_ns) / 3600.0).filter(|hours| *hours > 0.0),
        inputs: log_files(windows).into_iter().map(LogFile::named).collect(),
    };
    let several = pair.raw.runs.len() > 1 && !verification.axes.iter().any(|axis| axis.about_common_mean);
    let runs = if several { pair.raw.runs.len() } else { 0 };
    // A run too short for values of its own is judged with the others.
    let one = |run: usize| {
        let alone = pair.of_run(run);
        let of_run = Retest {
            pair: &alone,
            missing_fraction: pair.missing_fraction(Some(run)),
            excluded_fraction: kept.as_ref().map(|_| alone.excluded_fraction(&whole.of_run(run))),
            flagged_off: &[],
            suspects_in: None,
        };
        Some((pair.raw.runs[run].name(), against.values(&of_run).ok()?.0))
    };
    let each_run = (0..runs).filter_map(one).collect();
    let record_window_s = correction.calibration.as_ref().map(|record| record.window_s);
    Ok(Proof { verification, report_data, every_row, each_run, record_window_s })
}

/// Axes of a calibration that a retest does not have.
fn untested_axes(correction: &Correction, tested: &[char]) -> Vec<char> {
    let all = correction.calibration.iter().flat_map(|calibration| &calibration.axes);
    all.map(|axis| axis.axis).filter(|axis| !tested.contains(axis)).collect()
}

/// Names of the retests whose bytes or rows the calibration was made from: a copy with other line ends, columns or compression, with
/// a few rows lost, or in parts is no other test. Nor is one in other rows, or with counts moved: it has their noise.
fn training_overlap(correction: &Correction, retests: &[LogFile], trace: &Trace) -> Vec<String> {
    let of_fit = || correction.calibration.iter().flat_map(|calibration| &calibration.provenance.inputs);
    let sketch_of = |log: &LogFile| log.rows_sketch.clone();
    let fits: Vec<String> = of_fit().map(sketch_of).collect();
    let fits: Vec<&str> = fits.iter().map(String::as_str).collect();
    let all: Vec<&str> = retests.iter().map(|retest| retest.rows_sketch.as_str()).collect();
    let same_rows = |retest: &LogFile| share_rows(&[&retest.rows_sketch], &fits);
    let seen = |retest: &&LogFile| same_rows(retest) || of_fit().any(|input| input.sha256 == retest.sha256);
    let names = |logs: &mut dyn Iterator<Item = &LogFile>| logs.map(|retest| retest.file.clone()).collect::<Vec<_>>();
    let repeated = names(&mut retests.iter().filter(seen));
    let trained = || correction.calibration.as_ref()?.provenance.noise_trace.as_ref()?.trace();
    let has_their_noise = || trained().is_some_and(|trained| Repeat::of_other(trace, &trained).is_some());
    // Parts of a log share few hashes with it each, and many together.
    let is_of_fit = repeated.is_empty() && (share_rows(&all, &fits) || has_their_noise());
    if is_of_fit { names(&mut retests.iter()) } else { repeated }
}

#[cfg(test)]
mod tests {
    /// A cheap sequence without correlation, variance 1/12.
    pub(super) fn noise(i: usize) -> f64 {
        ((i * 7919 + i * i * 104_729) % 1009) as f64 / 1009.0 - 0.5
    }
}
