//! The proof: a retest log through the decoded image, before beside after.
//!
//! ```text
//! retest ─▶ Replay (sagnac-core at the true tick) ─▶ windows of raw and corrected counts ─▶ Figures
//! ```
//!
//! Both sides are summed over the same windows; which windows are left out is decided from the raw
//! counts alone. `docs/explanation/verification.md` defines every figure.

mod compensate;
mod figures;
mod flight;
mod limit_specs;
mod limits;
mod paired;
mod proof;
mod readings;
mod repeatability;
mod replay;
mod residual;
mod residual_diagnostics;
mod residual_noise;
mod stats;
mod strapdown;
mod suspects;
mod turned;
mod unanswered;
mod verdict;

use std::collections::BTreeMap;

use sagnac_core::Image;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use compensate::{Compensated, CorrectedFormat, compensate, status_text};
pub use flight::{Corner, Flight, FlightAxis, Gyrocompass, HeadingError, PositionError};
pub use limit_specs::{Applies, Bound, LimitSpec, SPECS};
pub use limits::{Limits, LimitsSource, SETS};
pub use proof::Proof;
pub use readings::{LogColumn, Readings};
pub use repeatability::{BiasRepeatability, RunBias, TurnOns};
pub use replay::{Corrected, Replay};
pub use residual::{Plateaus, RandomWalk, Residual};
pub use residual_diagnostics::{Estimate, GapSteps, ResidualDiagnostics};
pub use stats::{Figures, expected_range};
pub use strapdown::{Channel, Strapdown, noise_m, positions_m};
pub use suspects::Suspect;
pub use turned::{PlateauProof, ScaleFigures, ScaleProof};
pub use unanswered::{Unanswered, unanswered};
pub use verdict::{DecisionRule, Judged, Verdict};

use crate::calibration::{Calibration, LogFile, LogUnit, PpmEstimate, program};
use crate::fit;
use crate::verify::figures::{Against, unit_of};
use crate::verify::paired::PairedWindows;
use crate::verify::suspects::suspects;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogReader, LogShape, Logs, Tally, hex, sha256, share_rows};
use sagnac_log::setup::{PerAxis, Setup};
use sagnac_units::format::celsius;

/// What a retest is held against.
#[derive(Clone, Debug)]
pub struct Correction {
    /// One image per axis.
    pub images: Vec<Image>,
    /// The calibration they come from, if it is at hand.
    pub calibration: Option<Calibration>,
}

impl Correction {
    /// Encodes every axis of a calibration.
    ///
    /// # Errors
    /// What [`crate::export::encode`] says.
    pub fn from_calibration(calibration: Calibration) -> Result<Self> {
        let parent = sha256(calibration.to_json()?.as_bytes());
        let encoded: Result<Vec<Image>> = calibration
            .axes
            .iter()
            .map(|axis| {
                let image = crate::export::encode(&calibration, axis, parent, 1)?;
                // The proof is about what ships: through the bytes.
                Image::decode(&crate::export::image_bytes(&image)).map_err(|e| Error::input(e.to_string()))
            })
            .collect();
        Ok(Self { images: encoded?, calibration: Some(calibration) })
    }

    /// An image alone.
    pub fn from_image(image: Image) -> Self {
        Self { images: vec![image], calibration: None }
    }

    /// The setup with which a retest is read: the calibration's own, or what the image knows.
    pub fn setup(&self) -> Setup {
        if let Some(calibration) = &self.calibration {
            let (arcsec_per_count, quantum) = match calibration.unit {
                LogUnit::Counts { arcsec_per_count, quantum } => (Some(arcsec_per_count), Some(quantum)),
                LogUnit::Rates { .. } => (None, None),
            };
            return Setup { arcsec_per_count, quantum, ..calibration.setup.clone() };
        }
        let Some(d) = self.images.first().map(|image| *image.description()) else {
            return Setup::default();
        };
        let quantum = d.quantum_nano_counts as f64 / 1e9;
        Setup {
            arcsec_per_count: Some(d.scale_factor_femto_arcsec as f64 / 1e15 / quantum),
            quantum: Some(quantum),
            axis: Some(char::from(d.axis)),
            ..Setup::default()
        }
    }

    /// Serial number in the images.
    pub fn serial(&self) -> String {
        self.images.first().and_then(Image::serial).unwrap_or_default().to_owned()
    }

    /// The image of each axis of a log, and the columns they read.
    ///
    /// # Errors
    /// An axis without image, a thermometer that the log does not have, another serial in the setup.
    pub fn fit_to(&self, shape: &LogShape, setup: &Setup) -> Result<(Vec<Image>, Readings)> {
        if let Some(wanted) = setup.serial.as_deref().filter(|serial| *serial != self.serial()) {
            return Err(Error::input(format!("the correction belongs to {:?}, not to {wanted:?}", self.serial()))
                .column("serial")
                .help("a correction fits one gyro only"));
        }
        let find = |axis: &char| {
            let image = self.images.iter().find(|image| char::from(image.description().axis) == *axis);
            image.copied().ok_or_else(|| {
                Error::input(format!("the correction has no axis {axis}"))
                    .help("give the axis of a single-axis log with --axis, or map other columns to \"ignore\"")
            })
        };
        let images: Result<Vec<Image>> = shape.axes.iter().map(find).collect();
        let only = shape.thermometers.len() == 1;
        let own = self
            .calibration
            .as_ref()
            .and_then(Calibration::thermometer_name)
            .map(str::to_owned)
            .filter(|name| !(only && name.is_empty()));
        let sensor = match setup.use_thermometer.clone().or(own) {
            Some(name) => Some(shape.thermometers.iter().position(|other| *other == name).ok_or_else(|| {
                Error::input(format!("the log has no thermometer {name:?}, which the correction uses"))
                    .help(format!("it has: {}", Error::choices(&shape.thermometers)))
            })?),
            None if shape.thermometers.is_empty() => None,
            None if only => Some(0),
            None => {
                let names = shape.thermometers.join(", ");
                let what =
                    format!("the log has several thermometers ({names}), and the image does not say which it uses");
                return Err(Error::input(what).help("name it with --thermometer"));
            }
        };
        let images = images?;
        let axes = self.calibration.as_ref().map(|calibration| calibration.axes.as_slice());
        let readings = Readings::find(&images, axes, sensor, shape, setup)?;
        Ok((images, readings))
    }

    /// SHA-256 of the images' bytes, in the order of the axes.
    pub fn sha256(&self) -> String {
        let bytes: Vec<u8> = self.images.iter().flat_map(crate::export::image_bytes).collect();
        hex(&sha256(&bytes))
    }
}

/// The floor of a retest's windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RetestNoiseFloor {
    /// σ of the used windows from noise alone, °/h: root mean square of √(N²/τ + 2Q²/τ²) over their lengths τ.
    pub value_dph: f64,
    /// The same in the unit of the figures.
    pub value: f64,
    /// Expected max − min of the largest run's n windows of white noise, in the unit of the figures.
    pub expected_peak_to_peak: f64,
    /// That n.
    pub n: usize,
    /// Where it comes from.
    pub source: String,
}

/// How much of the temperatures of the fit a retest saw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Coverage {
    /// Span of the fit, by the image, °C.
    pub fit_c: [f64; 2],
    /// Lowest and highest sample of the used windows, °C.
    pub tested_c: [f64; 2],
    /// Part of the fit's span that the windows cover, 0 to 1; gaps of a twentieth of it count as covered.
    pub covered_fraction: f64,
}

/// Part of the fit's span that a gap between windows may have and count as covered.
const BRIDGED: f64 = 0.05;

impl Coverage {
    /// `20.0 … 45.0 °C: 23 % of the fit's -39.0 … 69.0 °C`.
    pub fn words(&self) -> String {
        let Self { tested_c: [lo, hi], fit_c: [from, to], covered_fraction } = *self;
        let [lo, hi, from, to] = [lo, hi, from, to].map(celsius);
        format!("{lo} … {hi} °C: {:.0} % of the fit's {from} … {to} °C", 100.0 * covered_fraction)
    }

    fn of(image: &Image, windows: &Windows, used: &[usize], sensor: usize) -> Option<Self> {
        let spec = image.inputs().first()?;
        let fit_c = [spec.span_lo_q24, spec.span_hi_q24].map(|q24| f64::from(q24) / 2.0_f64.powi(24));
        let (min_c, max_c) = (&windows.rows.min_c[sensor], &windows.rows.max_c[sensor]);
        let mut stretches: Vec<[f64; 2]> =
            used.iter().map(|i| [min_c[*i], max_c[*i]]).filter(|[lo, _]| lo.is_finite()).collect();
        stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let span = fit_c[1] - fit_c[0];
        let (mut common, mut reached) = (0.0, f64::NEG_INFINITY);
        for [from, to] in &stretches {
            // Between windows a little is left out; farther apart nothing was seen.
            let start = if from - reached <= BRIDGED * span { reached } else { *from };
            common += (to.min(fit_c[1]) - start.max(fit_c[0]).min(fit_c[1])).max(0.0);
            reached = reached.max(*to);
        }
        let lo = stretches.first().map_or(f64::INFINITY, |[lo, _]| *lo);
        let hi = reached;
        let covered_fraction = (common / span).clamp(0.0, 1.0);
        (lo <= hi).then_some(Self { fit_c, tested_c: [lo, hi], covered_fraction })
    }
}

/// What a retest of the calibration's own profile does not show.
pub const REPEATED_PROFILE: &str = "temperature moves with its rate or with time as in the calibration, which cannot separate \
                                    them: this test proves nothing for other profiles";

/// One axis of a verification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AxisVerification {
    /// Axis letter.
    pub axis: char,
    /// As logged.
    pub before: Figures,
    /// As corrected.
    pub after: Figures,
    /// Noise floor; null where neither the retest nor the calibration knows it.
    pub noise_floor: Option<RetestNoiseFloor>,
    /// max − min before over after; null where after is zero.
    pub improvement: Option<f64>,
    /// σ before over after; null where after is zero.
    pub improvement_sigma: Option<f64>,
    /// Diagnostics of the residual.
    pub residual_diagnostics: ResidualDiagnostics,
    /// Temperatures of the retest beside those of the fit; null without a temperature.
    pub coverage: Option<Coverage>,
    /// A rate table turned the gyro.
    #[serde(default)]
    pub turned: bool,
    /// It turned it about this axis.
    #[serde(default)]
    pub turned_about: bool,
    /// What is left, figure by figure.
    pub residual: Residual,
    /// What a stated flight comes to; null without one, or where the retest does not tell it.
    pub flight: Option<PositionError>,
    /// Why the flight cannot be told, if one was stated.
    pub flight_unavailable: Option<String>,
    /// The scale factor over temperature, where a rate table tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_factor: Option<ScaleProof>,
    /// Fixed bias against the calibration; null where the input rate is not known.
    pub bias_repeatability: Option<BiasRepeatability>,
    /// Why it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias_repeatability_unavailable: Option<String>,
    /// Part of the fit's temperature rates that the ramps of the retest reach, 0 to 1; null without rate terms or a record.
    pub rate_coverage: Option<f64>,
    /// Temperature and its rate, or time, moved together in the calibration, and in this retest again: it proves nothing for
    /// other profiles.
    pub repeats_profile: bool,
    /// Scale factor less that of the calibration at T0; null where a rate table did not turn both.
    pub scale_factor_difference: Option<PpmEstimate>,
    /// The calibration has a scale factor of its own, from a rate table.
    pub scale_factor_calibrated: bool,
    /// Each run covers so little of the temperatures that its own mean would hold the drift: the figures are about the mean of all
    /// runs.
    pub about_common_mean: bool,
    /// Part of the time of the runs of which no row is usable, 0 to 1: flagged, missing, unreadable.
    pub missing_fraction: f64,
    /// Part of the windows with a temperature beyond the fit's span by more than half a degree, 0 to 1.
    pub out_of_span_fraction: f64,
    /// Hours of the judged windows.
    pub hours: f64,
    /// Part of the rows that was excluded on request, 0 to 1; null where nothing was asked to be excluded.
    pub excluded_fraction: Option<f64>,
    /// Stretches that look like bumps, steps or start-up. They are judged unless they were asked to be excluded.
    pub suspects: Vec<Suspect>,
    /// Windows in which each status occurred.
    pub status_windows: BTreeMap<String, usize>,
    /// Limits, if any were given.
    pub limits: Vec<Verdict>,
    /// All limits that are asked of such a retest are met; null without limits.
    pub pass: Option<bool>,
}

/// The result of `sagnac verify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Verification {
    /// Program and version.
    pub program: String,
    /// Serial number of the gyro.
    pub serial: String,
    /// What the sensor is, as the setup says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// What it was tested on, as the setup says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<String>,
    /// Unit of the figures: `counts per window` or `deg/h`.
    pub unit: String,
    /// Length to which windows are scaled, s.
    pub window_s: f64,
    /// One entry per axis.
    pub axes: Vec<AxisVerification>,
    /// Windows and rows left out on both sides, by reason.
    pub excluded: Vec<Tally>,
    /// SHA-256 of the images' bytes, in the order of their axes.
    pub image_sha256: String,
    /// SHA-256 of the record that the images were made from, by the images.
    pub record_sha256: String,
    /// What it was held against, if limits were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSource>,
    /// The retest logs.
    pub inputs: Vec<LogFile>,
    /// Axes of the calibration that the retest does not have: with any of them the unit is not accepted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub untested_axes: Vec<char>,
    /// Those of them that the calibration was made from: with any of them this is no proof, and no limit can be met.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub training_overlap: Vec<String>,
    /// True for an image alone, which does not name its training logs: nothing shows that these are others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub training_unknown: bool,
}

impl Verification {
    /// The retest's logs are known not to be those of the fit.
    pub fn is_of_other_logs(&self) -> bool {
        !self.training_unknown && self.training_overlap.is_empty()
    }

    /// False when a limit is not met, or where limits were held against a log that the fit has seen.
    pub fn passed(&self) -> bool {
        let judged = self.axes.iter().any(|axis| axis.pass.is_some());
        let sound = self.training_overlap.is_empty() && self.untested_axes.is_empty();
        self.axes.iter().all(|axis| axis.pass != Some(false)) && (!judged || sound)
    }
}

/// How retest logs are replayed.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct VerifyOptions {
    /// Leave out what looks like bumps, steps or start-up: for a bench that was bumped.
    pub exclude_outliers: bool,
    /// Leave out `discard_initial_s` at the start of each run.
    pub exclude_start: bool,
}

impl VerifyOptions {
    /// Leaves out what looks like bumps, steps or start-up. How much is a limit of its own, `excluded_max`.
    #[must_use]
    pub fn exclude_outliers(self, exclude: bool) -> Self {
        Self { exclude_outliers: exclude, ..self }
    }

    /// Leaves out `discard_initial_s` at the start of each run. How much is a limit of its own, `excluded_max`.
    #[must_use]
    pub fn exclude_start(self, exclude: bool) -> Self {
        Self { exclude_start: exclude, ..self }
    }

    fn excludes(self) -> bool {
        self.exclude_outliers || self.exclude_start
    }
}

/// Replays retest logs through the images of a correction and compares both sides, window by window. Every window that has
/// counts is judged, unless the options exclude some.
///
/// # Errors
/// Logs that do not fit the correction, or too few windows for any figure.
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
    let mut test = setup.stages().test;
    // What the setup of the retest does not state is as the calibration had it.
    let of_calibration = correction.setup().stages().test.input_rate_dph;
    let letters = &logs.first()?.shape().axes;
    test.input_rate_dph = PerAxis::of_log(test.input_rate_dph.as_ref(), of_calibration.as_ref(), letters)?;
    let mut whole = PairedWindows::replayed(correction, logs, setup)?;
    whole.leave_out_unknown(&test)?;
    let kept = options.excludes().then(|| whole.excluding(options, setup.discard_initial_s));
    let pair = kept.as_ref().unwrap_or(&whole);
    let against = Against { correction, test: &test, sensor };
    let (mut axes, report_data) = against.figures(pair)?;
    let every_row = kept.as_ref().map(|_| against.figures(&whole)).transpose()?;
    for (axis, figures) in axes.iter_mut().enumerate() {
        figures.excluded_fraction = kept.as_ref().map(|kept| kept.excluded_fraction(&whole));
        figures.suspects = suspects(&whole.raw, axis);
    }
    let windows = &pair.raw;
    let verification = Verification {
        program: program(),
        serial: correction.serial(),
        sensor: setup.sensor.clone(),
        rig: setup.rig.clone(),
        unit: unit_of(windows).1.to_owned(),
        window_s: windows.shape.nominal_s,
        axes,
        excluded: windows.tallies.list(),
        image_sha256: correction.sha256(),
        record_sha256: correction.images.first().map_or(String::new(), |image| hex(&image.description().parent)),
        limits: None,
        untested_axes: untested_axes(correction, &windows.shape.axes),
        training_overlap: training_overlap(correction, &fit::log_files(windows)),
        training_unknown: correction.calibration.is_none(),
        inputs: fit::log_files(windows).into_iter().map(LogFile::named).collect(),
    };
    let several = pair.raw.runs.len() > 1 && !verification.axes.iter().any(|axis| axis.about_common_mean);
    let runs = if several { pair.raw.runs.len() } else { 0 };
    // A run too short for figures of its own is judged with the others.
    let one = |run: usize| {
        let alone = pair.of_run(run);
        let (mut axes, _) = against.figures(&alone).ok()?;
        let excluded = kept.as_ref().map(|_| alone.excluded_fraction(&whole.of_run(run)));
        for axis in &mut axes {
            (axis.excluded_fraction, axis.missing_fraction) = (excluded, pair.missing_fraction(Some(run)));
        }
        Some((pair.raw.runs[run].name(), axes))
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
/// a few rows lost, or in parts is no other test.
fn training_overlap(correction: &Correction, retests: &[LogFile]) -> Vec<String> {
    let of_fit = || correction.calibration.iter().flat_map(|calibration| &calibration.provenance.inputs);
    let sketch_of = |log: &LogFile| log.rows_sketch.clone();
    let fits: Vec<String> = of_fit().map(sketch_of).collect();
    let fits: Vec<&str> = fits.iter().map(String::as_str).collect();
    let all: Vec<&str> = retests.iter().map(|retest| retest.rows_sketch.as_str()).collect();
    let same_rows = |retest: &LogFile| share_rows(&[&retest.rows_sketch], &fits);
    let seen = |retest: &&LogFile| same_rows(retest) || of_fit().any(|input| input.sha256 == retest.sha256);
    let names = |of: &mut dyn Iterator<Item = &LogFile>| of.map(|retest| retest.file.clone()).collect::<Vec<_>>();
    let found = names(&mut retests.iter().filter(seen));
    // Parts of a log share few hashes with it each, and many together.
    if found.is_empty() && share_rows(&all, &fits) { names(&mut retests.iter()) } else { found }
}

#[cfg(test)]
mod tests {
    /// A cheap sequence without correlation, variance 1/12.
    pub(super) fn noise(i: usize) -> f64 {
        ((i * 7919 + i * i * 104_729) % 1009) as f64 / 1009.0 - 0.5
    }
}
