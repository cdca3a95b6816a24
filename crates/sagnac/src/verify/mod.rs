//! The proof: a retest log through the decoded image, before beside after.
//!
//! ```text
//! retest ─▶ Replay (sagnac-core at the true tick) ─▶ windows of raw and corrected counts ─▶ Figures
//! ```
//!
//! Both sides are summed over the same windows; which windows are left out is decided from the raw
//! counts alone. `docs/explanation/verification.md` defines every figure.

mod compensate;
mod flight;
mod limits;
mod paired;
mod readings;
mod repeatability;
mod replay;
mod residual;
mod residual_diagnostics;
mod stats;
mod strapdown;
mod suspects;
mod turned;

use std::collections::BTreeMap;

use sagnac_core::{Image, Status};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use compensate::{CorrectedFormat, compensate, status_text};
pub use flight::{Corner, Flight, FlightAxis, PositionError};
pub use limits::{Applies, Bound, Judged, LimitSpec, Limits, LimitsSource, SETS, SPECS, Verdict};
pub use readings::{LogColumn, Readings};
pub use repeatability::{BiasRepeatability, RunBias, TurnOns};
pub use replay::{Corrected, Replay};
pub use residual::{Plateaus, RandomWalk, Residual};
pub use residual_diagnostics::{Estimate, GapSteps, ResidualDiagnostics};
pub use stats::{Figures, expected_range};
pub use strapdown::{Channel, Strapdown, noise_m, positions_m};
pub use suspects::Suspect;
pub use turned::{PlateauProof, ScaleFigures, ScaleProof};

use crate::calibration::{AxisCalibration, Calibration, LogFile, LogUnit, PpmEstimate, program};
use crate::diagnostics::{
    AxisReportData, Point, ReportData, RunSpan, offsets_hide_drift, points, ramp_rates_cpm, rate_coverage, run_spans,
};
use crate::fit;
use crate::verify::paired::PairedWindows;
use crate::verify::repeatability::scale_difference;
use crate::verify::stats::Weighted;
use crate::verify::suspects::suspects;
use crate::verify::turned::{Drifts, PairedDrifts};
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, LogReader, LogShape, Reason, Tally, hex, sha256};
use sagnac_log::setup::{Setup, TestConfig};
use sagnac_noise::NoiseTerms;
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;
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
    /// Scale factor less that of the calibration at T0; null where a rate table did not turn both.
    pub scale_factor_difference: Option<PpmEstimate>,
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
}

impl Verification {
    /// False when a limit is not met, or where limits were held against a log that the fit has seen.
    pub fn passed(&self) -> bool {
        let judged = self.axes.iter().any(|axis| axis.pass.is_some());
        let sound = self.training_overlap.is_empty() && self.untested_axes.is_empty();
        self.axes.iter().all(|axis| axis.pass != Some(false)) && (!judged || sound)
    }
}

/// A verification and the windows behind it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Proof {
    /// The result.
    pub verification: Verification,
    /// The windows behind it, for a report.
    pub report_data: ReportData,
    /// Figures of every window, where some were excluded on request.
    every_row: Option<(Vec<AxisVerification>, ReportData)>,
    /// Each run alone, where there are several: a good run does not make up for a bad one.
    each_run: Vec<(String, Vec<AxisVerification>)>,
}

impl Proof {
    /// Judges every axis by limits, and flies the flight that they state.
    ///
    /// # Errors
    /// [`sagnac_log::ErrorKind::Refused`] where none of the limits applies to such a retest.
    pub fn limits(mut self, limits: &Limits) -> Result<Self> {
        for (axis, drawn) in self.verification.axes.iter_mut().zip(&self.report_data.axes) {
            axis.judge(limits, &drawn.points)?;
        }
        for (name, axes) in &self.each_run {
            for (run, axis) in axes.iter().zip(&mut self.verification.axes) {
                axis.take_worse(name, limits.judge(run));
            }
        }
        if let Some((axes, report_data)) = &mut self.every_row {
            for ((whole, drawn), axis) in axes.iter_mut().zip(&report_data.axes).zip(&mut self.verification.axes) {
                whole.judge(limits, &drawn.points)?;
                for verdict in &mut axis.limits {
                    let same = whole.limits.iter().find(|other| other.name == verdict.name);
                    verdict.value_of_every_row = same.and_then(|other| other.value);
                }
            }
        }
        self.verification.limits = Some(limits.source.clone());
        Ok(self)
    }

    /// False when a limit is not met, or where limits were applied to a log that the fit has seen.
    pub fn passed(&self) -> bool {
        self.verification.passed()
    }
}

impl AxisVerification {
    /// Standard error of a spread of the corrected windows, as a part of it: 1/√(2ν), ν less where neighbours correlate.
    fn relative_sigma_of_spread(&self) -> f64 {
        let rho = self.residual_diagnostics.lag1_autocorrelation.map_or(0.0, |rho| rho.value.clamp(0.0, 0.95));
        let independent = self.after.n as f64 * (1.0 - rho * rho) / (1.0 + rho * rho);
        (2.0 * (independent - 1.0).max(1.0)).sqrt().recip()
    }

    /// √(σ² − floor²) with its standard error, by that of σ².
    fn sigma_beyond_floor(&self) -> Option<(f64, Option<f64>)> {
        let floor_dph = self.noise_floor.as_ref()?.value_dph;
        let square = self.after.sigma_dph.powi(2);
        let value = (square - floor_dph * floor_dph).max(0.0).sqrt();
        let sigma_of_square = 2.0 * square * self.relative_sigma_of_spread();
        Some((value, Some(sigma_of_square / (2.0 * value).max(sigma_of_square.sqrt()))))
    }

    /// Standard error of max − min of n normal windows, as a part of it: both ends are Gumbel variables, σ = π/√6/√(2 ln n).
    fn relative_sigma_of_range(&self) -> f64 {
        let n = (self.after.n as f64).max(3.0);
        let end = std::f64::consts::PI / 6.0_f64.sqrt() / (2.0 * n.ln()).sqrt();
        std::f64::consts::SQRT_2 * end / expected_range(self.after.n.max(2))
    }

    /// Verdicts of a run alone, where they are worse than those of all together.
    fn take_worse(&mut self, run: &str, of_run: Vec<Verdict>) {
        for verdict in of_run {
            let is_worse = |all: &&mut Verdict| all.name == verdict.name && verdict.is_worse_than(all);
            if let Some(all) = self.limits.iter_mut().find(is_worse) {
                *all = Verdict { run: Some(sagnac_units::format::file_name(run)), ..verdict };
            }
        }
        if self.pass.is_some() {
            self.pass = Some(self.limits.iter().all(|verdict| verdict.pass != Some(false)));
        }
    }

    fn judge(&mut self, limits: &Limits, points: &[Point]) -> Result<()> {
        if let Some(flight) = &limits.flight {
            let n = self.residual.random_walk.map(|walk| walk.after_deg_rt_h);
            let against = self.bias_repeatability.as_ref().ok_or(self.bias_repeatability_unavailable.as_deref());
            match flight.fly(points, n, against.map_err(Option::unwrap_or_default)) {
                Ok(flown) => self.flight = Some(flown),
                Err(why) => self.flight_unavailable = Some(why),
            }
        }
        self.limits = limits.judge(self);
        if limits.asks() && self.limits.iter().all(|verdict| verdict.pass.is_none()) {
            return Err(Error::refused(
                "none of the limits can be asked of this retest: it has no rate table, or only that",
            )
            .help("docs/reference/limits.md says which limits ask for which test"));
        }
        self.pass = limits.asks().then(|| self.limits.iter().all(|verdict| verdict.pass != Some(false)));
        Ok(())
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
pub fn verify(correction: &Correction, logs: Vec<LogReader>, setup: &Setup, options: VerifyOptions) -> Result<Proof> {
    let fits = |log: &LogReader| correction.fit_to(log.shape(), setup).map_err(|e| e.file(log.summary().file));
    let sensor = logs.first().map(fits).transpose()?.and_then(|(_, readings)| readings.thermometer);
    let mut test = setup.stages().test;
    // What the setup of the retest does not state is as the calibration had it.
    test.input_rate_dph = test.input_rate_dph.or(correction.setup().stages().test.input_rate_dph);
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
        figures.missing_fraction = whole.missing_fraction();
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
        inputs: fit::log_files(windows),
    };
    let several = pair.raw.runs.len() > 1 && !verification.axes.iter().any(|axis| axis.about_common_mean);
    let runs = if several { pair.raw.runs.len() } else { 0 };
    // A run too short for figures of its own is judged with the others.
    let one = |run: usize| Some((pair.raw.runs[run].name(), against.figures(&pair.only_run(run)).ok()?.0));
    let each_run = (0..runs).filter_map(one).collect();
    Ok(Proof { verification, report_data, every_row, each_run })
}

/// What a retest is compared with.
struct Against<'a> {
    correction: &'a Correction,
    test: &'a TestConfig,
    /// Thermometer of the fit.
    sensor: Option<usize>,
}

impl Against<'_> {
    fn axis_figures(
        &self,
        pair: &PairedWindows,
        drifts: &PairedDrifts<'_>,
        used: &[usize],
        report_data: &ReportData,
        axis: usize,
    ) -> Result<AxisVerification> {
        let windows = &pair.raw;
        let scale = unit_of(windows).0;
        let dph_per_unit = windows.shape.unit.arcsec() / scale;
        let common = about_common_mean(windows, &report_data.runs, self.sensor);
        let run_of = |i: usize| if common { 0 } else { windows.rows.run[i] };
        let figures = |side: &Windows, drift: &Drifts<'_>| {
            let angle = &side.rows.angle[axis];
            // What the table turned, in the unit of the figures; exactly nothing without one.
            let turned = |i: usize| (side.rate_dph(axis, i) - drift.rate_dph(axis, i)) / dph_per_unit;
            let value = |i: usize| angle[i] * scale / windows.duration_s(i) - turned(i);
            let weighted = |i: usize| Weighted { run: run_of(i), value: value(i), weight: weight(windows, i) };
            // Fragments count, too, but on a table, where they are what a rate ends with.
            let is_judged = |i: &usize| match windows.rows.excluded[*i] {
                None => true,
                Some(reason) => reason == Reason::ShortWindow && !drifts.is_turned(),
            };
            let judged = (0..windows.len()).filter(is_judged);
            let values: Vec<Weighted> = judged.map(weighted).collect();
            Figures::of(&values, dph_per_unit).ok_or_else(|| {
                Error::refused(format!("{} usable windows; before and after need at least two per run", used.len()))
                    .help("give a longer retest or a shorter --window")
            })
        };
        let (before, after) = (figures(windows, &drifts.raw)?, figures(&pair.corrected, &drifts.corrected)?);
        let ratio = |before: f64, after: f64| (after > 0.0).then_some(before / after);
        let status_windows = Status::NAMES.iter().map(|(bit, name)| {
            ((*name).to_owned(), used.iter().filter(|i| pair.status[axis][**i].contains(*bit)).count())
        });
        let letter = windows.shape.axes[axis];
        let noise_floor = noise_floor(windows, used, axis, self.correction, self.test, dph_per_unit);
        let diagnostics = residual_diagnostics::residual_diagnostics(
            &report_data.axes[axis].points,
            noise_floor.as_ref().map(|floor| floor.value_dph),
        );
        // Turned, a counter's quantization is a saw that the short-τ fit takes for a walk.
        let walk = |side: &Windows| side.measured_noise(axis).map(|noise| noise.n_deg_rt_h()).filter(|n| *n > 0.0);
        let random_walk = walk(windows)
            .zip(walk(&pair.corrected))
            .map(|(before_deg_rt_h, after_deg_rt_h)| RandomWalk { before_deg_rt_h, after_deg_rt_h });
        Ok(AxisVerification {
            axis: letter,
            before,
            after,
            noise_floor,
            improvement: ratio(before.peak_to_peak, after.peak_to_peak),
            improvement_sigma: ratio(before.sigma, after.sigma),
            residual_diagnostics: diagnostics,
            status_windows: status_windows.filter(|(_, n)| *n > 0).collect(),
            coverage: None,
            residual: residual::residual(&report_data.axes[axis].points, random_walk.filter(|_| !drifts.is_turned())),
            turned: drifts.is_turned(),
            flight: None,
            flight_unavailable: None,
            scale_factor: None,
            bias_repeatability: None,
            bias_repeatability_unavailable: None,
            scale_factor_difference: None,
            rate_coverage: None,
            about_common_mean: common,
            missing_fraction: 0.0,
            out_of_span_fraction: 0.0,
            hours: used.iter().map(|i| windows.duration_s(*i)).sum::<f64>() / 3600.0,
            excluded_fraction: None,
            suspects: Vec::new(),
            limits: Vec::new(),
            pass: None,
        })
    }

    /// Figures of every axis over the used windows, and the points behind them.
    fn figures(&self, pair: &PairedWindows) -> Result<(Vec<AxisVerification>, ReportData)> {
        let used = pair.used();
        let drifts = PairedDrifts::of(pair, &used, self.test)?;
        let report_data = report_data(pair, &drifts, &used, self.sensor);
        let axes = (0..pair.raw.shape.axes.len()).map(|axis| {
            let mut figures = self.axis_figures(pair, &drifts, &used, &report_data, axis)?;
            self.compare_with_record(&mut figures, pair, &drifts, &used, axis);
            figures.rate_coverage = self.rate_coverage(figures.axis, &report_data.axes[axis].points);
            Ok(figures)
        });
        let axes: Result<Vec<AxisVerification>> = axes.collect();
        Ok((axes?, report_data))
    }

    /// The record of an axis.
    fn record(&self, axis: char) -> Option<&AxisCalibration> {
        self.correction.calibration.as_ref()?.axes.iter().find(|record| record.axis == axis)
    }

    fn rate_coverage(&self, axis: char, points: &[Point]) -> Option<f64> {
        let record = self.record(axis)?;
        record.rate_span_cpm()?;
        Some(rate_coverage(record.fit.as_ref()?.ramp_rates_cpm?, ramp_rates_cpm(points)?))
    }

    /// Coverage, bias and scale factor against the calibration.
    fn compare_with_record(
        &self,
        figures: &mut AxisVerification,
        pair: &PairedWindows,
        drifts: &PairedDrifts<'_>,
        used: &[usize],
        axis: usize,
    ) {
        let images = &self.correction.images;
        let image = images.iter().find(|image| char::from(image.description().axis) == figures.axis);
        figures.coverage =
            image.zip(self.sensor).and_then(|(image, sensor)| Coverage::of(image, &pair.raw, used, sensor));
        if let Some((image, sensor)) = image.zip(self.sensor) {
            figures.out_of_span_fraction = out_of_span(image, &pair.raw, used, sensor);
        }
        figures.scale_factor = drifts.scale_proof(used, axis, self.sensor);
        let record = self.record(figures.axis);
        figures.scale_factor_difference = scale_difference(figures.scale_factor.as_ref(), record);
        match BiasRepeatability::of(drifts, &pair.raw, used, axis, record, self.test.input_rate_dph) {
            Ok(found) => figures.bias_repeatability = Some(found),
            Err(why) => figures.bias_repeatability_unavailable = Some(why),
        }
    }
}

/// Axes of a calibration that a retest does not have.
fn untested_axes(correction: &Correction, tested: &[char]) -> Vec<char> {
    let all = correction.calibration.iter().flat_map(|calibration| &calibration.axes);
    all.map(|axis| axis.axis).filter(|axis| !tested.contains(axis)).collect()
}

/// Names of the retests whose bytes the calibration was made from.
fn training_overlap(correction: &Correction, retests: &[LogFile]) -> Vec<String> {
    let of_fit = || correction.calibration.iter().flat_map(|calibration| &calibration.provenance.inputs);
    let seen = |retest: &&LogFile| of_fit().any(|input| input.sha256 == retest.sha256);
    retests.iter().filter(seen).map(|retest| retest.file.clone()).collect()
}

/// Half a degree beyond the span the correction at its border still holds.
const BEYOND_SPAN_C: f64 = 0.5;

/// Part of the used windows whose temperature leaves the span of an image.
fn out_of_span(image: &Image, windows: &Windows, used: &[usize], sensor: usize) -> f64 {
    let Some(spec) = image.inputs().first() else { return 0.0 };
    let [lo, hi] = [spec.span_lo_q24, spec.span_hi_q24].map(|q24| f64::from(q24) / 2.0_f64.powi(24));
    let (min_c, max_c) = (&windows.rows.min_c[sensor], &windows.rows.max_c[sensor]);
    let outside = |i: &&usize| min_c[**i] < lo - BEYOND_SPAN_C || max_c[**i] > hi + BEYOND_SPAN_C;
    used.iter().filter(outside).count() as f64 / used.len() as f64
}

/// Where each run covers little of the temperatures, its own mean would hold the drift.
fn about_common_mean(windows: &Windows, runs: &[RunSpan], sensor: Option<usize>) -> bool {
    offsets_hide_drift(&points(windows, runs, sensor, |_| 0.0, |_| 0.0))
}

/// Both sides of every window about their own means over the used windows of the run.
fn report_data(pair: &PairedWindows, drifts: &PairedDrifts<'_>, used: &[usize], sensor: Option<usize>) -> ReportData {
    let windows = &pair.raw;
    let runs = run_spans(windows);
    let mean = |drift: &Drifts<'_>, axis: usize, run: u32| {
        let members = used.iter().filter(|i| windows.rows.run[**i] == run);
        let (sum, n) = members.fold((0.0, 0.0), |(sum, n), i| (sum + drift.rate_dph(axis, *i), n + 1.0));
        sum / n
    };
    let common = about_common_mean(windows, &runs, sensor);
    let mean_of_all = |drift: &Drifts<'_>, axis: usize| {
        used.iter().map(|i| drift.rate_dph(axis, *i)).sum::<f64>() / used.len() as f64
    };
    let axis = |axis: usize| {
        let [before, after] = [&drifts.raw, &drifts.corrected].map(|drift| {
            let one = |run: usize| if common { mean_of_all(drift, axis) } else { mean(drift, axis, run as u32) };
            let means: Vec<f64> = (0..runs.len()).map(one).collect();
            move |i: usize| drift.rate_dph(axis, i) - means[windows.rows.run[i] as usize]
        });
        AxisReportData {
            axis: windows.shape.axes[axis],
            points: points(windows, &runs, sensor, before, after),
            effects: Vec::new(),
        }
    };
    let axes = (0..windows.shape.axes.len()).map(axis).collect();
    ReportData { timed: windows.shape.timed, axes, runs }
}

/// Figures per unit of angle × nominal/duration: counts per window, or °/h.
fn unit_of(windows: &Windows) -> (f64, &'static str) {
    match windows.shape.unit {
        AngleUnit::Quanta { quantum, .. } => (quantum * windows.shape.nominal_s, "counts per window"),
        AngleUnit::Arcsec => (1.0, "deg/h"),
    }
}

/// Length of a window over the nominal one, at most 1.
fn weight(windows: &Windows, i: usize) -> f64 {
    (windows.duration_s(i) / windows.shape.nominal_s).min(1.0)
}

/// From the retest log, else from the calibration: N and Q, at the lengths that the windows really have.
fn noise_floor(
    windows: &Windows,
    used: &[usize],
    axis: usize,
    correction: &Correction,
    test: &TestConfig,
    dph_per_unit: f64,
) -> Option<RetestNoiseFloor> {
    let letter = windows.shape.axes[axis];
    let calibrations = correction.calibration.iter().flat_map(|c| &c.axes);
    let earlier = || {
        let known = calibrations.into_iter().find(|a| a.axis == letter)?.fit.as_ref()?.noise_floor.as_ref()?;
        let n_arcsec_rt_s = known.n_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        windows.shape.window.seconds()?;
        Some((NoiseTerms { n_arcsec_rt_s, q_arcsec: known.q_arcsec }, format!("calibration ({})", known.source)))
    };
    let own = fit::noise_of(windows, axis, test).map(|(terms, source)| (terms, source.to_owned()));
    let (terms, source) = own.or_else(earlier)?;
    // As in the figures, a shorter window counts by its length.
    let square = |i: &usize| terms.floor_dph(windows.duration_s(*i)).powi(2) * weight(windows, *i);
    let mean_square = used.iter().map(square).sum::<f64>() / used.len() as f64;
    let count = |run: usize| used.iter().filter(|i| windows.rows.run[**i] as usize == run).count();
    let largest = (0..windows.runs.len()).map(count).max()?;
    let (value_dph, value) = (mean_square.sqrt(), mean_square.sqrt() / dph_per_unit);
    Some(RetestNoiseFloor {
        value_dph,
        value,
        expected_peak_to_peak: expected_range(largest) * value,
        n: largest,
        source,
    })
}

#[cfg(test)]
mod tests {
    /// A cheap sequence without correlation, variance 1/12.
    pub(super) fn noise(i: usize) -> f64 {
        ((i * 7919 + i * i * 104_729) % 1009) as f64 / 1009.0 - 0.5
    }
}
