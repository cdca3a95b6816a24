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
mod replay;
mod residual;
mod residual_diagnostics;
mod stats;
mod strapdown;
mod turned;

use std::collections::BTreeMap;

use sagnac_core::{Image, Status};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use compensate::{CorrectedFormat, compensate, status_text};
pub use flight::{Corner, Flight, FlightAxis, PositionError};
pub use limits::{Applies, Bound, Judged, LimitSpec, Limits, LimitsSource, SETS, SPECS, Verdict};
pub use readings::{LogColumn, Readings};
pub use replay::{Corrected, Replay};
pub use residual::{Plateaus, RandomWalk, Residual};
pub use residual_diagnostics::{Estimate, GapSteps, ResidualDiagnostics};
pub use stats::{Figures, expected_range};
pub use strapdown::{Channel, Strapdown, noise_m, positions_m};
pub use turned::{PlateauProof, ScaleFigures, ScaleProof};

use crate::calibration::{Calibration, LogFile, LogUnit, program};
use crate::diagnostics::{AxisReportData, Point, ReportData, points, run_spans};
use crate::fit;
use crate::verify::paired::PairedWindows;
use crate::verify::turned::{Drifts, PairedDrifts};
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, LogReader, LogShape, Tally, hex, sha256};
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
    /// Those of them that the calibration was made from: with any of them this is no proof, and no limit can be met.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub training_overlap: Vec<String>,
}

impl Verification {
    /// False when a limit is not met, or where limits were held against a log that the fit has seen.
    pub fn passed(&self) -> bool {
        let judged = self.axes.iter().any(|axis| axis.pass.is_some());
        self.axes.iter().all(|axis| axis.pass != Some(false)) && (!judged || self.training_overlap.is_empty())
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
        self.verification.limits = Some(limits.source.clone());
        Ok(self)
    }

    /// False when a limit is not met, or where limits were applied to a log that the fit has seen.
    pub fn passed(&self) -> bool {
        self.verification.passed()
    }
}

impl AxisVerification {
    fn judge(&mut self, limits: &Limits, points: &[Point]) -> Result<()> {
        if let Some(flight) = &limits.flight {
            let n = self.residual.random_walk.map(|walk| walk.after_deg_rt_h);
            match flight.fly(points, n) {
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
    /// Judge the windows that look like outliers too.
    pub keep_outliers: bool,
}

impl VerifyOptions {
    /// Judges the windows that look like outliers too.
    #[must_use]
    pub fn keep_outliers(self, keep: bool) -> Self {
        Self { keep_outliers: keep, ..self }
    }
}

/// Replays retest logs through the images of a correction and compares both sides, window by window.
///
/// # Errors
/// Logs that do not fit the correction, or too few windows for any figure.
pub fn verify(correction: &Correction, logs: Vec<LogReader>, setup: &Setup, options: VerifyOptions) -> Result<Proof> {
    let fits = |log: &LogReader| correction.fit_to(log.shape(), setup).map_err(|e| e.file(log.summary().file));
    let sensor = logs.first().map(fits).transpose()?.and_then(|(_, readings)| readings.thermometer);
    let test = setup.stages().test;
    let mut pair = PairedWindows::replayed(correction, logs, setup, options.keep_outliers)?;
    pair.leave_out_unknown(&test)?;
    let used = pair.used();
    let drifts = PairedDrifts::of(&pair, &used, &test)?;
    let report_data = report_data(&pair, &drifts, &used, sensor);
    let windows = &pair.raw;
    let axes = (0..windows.shape.axes.len()).map(|axis| {
        let mut figures = axis_figures(&pair, &drifts, &used, &report_data, axis, correction, &test)?;
        figures.scale_factor = drifts.scale_proof(&used, axis, sensor);
        let image = correction.images.iter().find(|image| char::from(image.description().axis) == figures.axis);
        figures.coverage = image.zip(sensor).and_then(|(image, sensor)| Coverage::of(image, windows, &used, sensor));
        Ok(figures)
    });
    let axes: Result<Vec<AxisVerification>> = axes.collect();
    let verification = Verification {
        program: program(),
        serial: correction.serial(),
        sensor: setup.sensor.clone(),
        rig: setup.rig.clone(),
        unit: unit_of(windows).1.to_owned(),
        window_s: windows.shape.nominal_s,
        axes: axes?,
        excluded: windows.tallies.list(),
        image_sha256: correction.sha256(),
        record_sha256: correction.images.first().map_or(String::new(), |image| hex(&image.description().parent)),
        limits: None,
        training_overlap: training_overlap(correction, &fit::log_files(windows)),
        inputs: fit::log_files(windows),
    };
    Ok(Proof { verification, report_data })
}

/// Names of the retests whose bytes the calibration was made from.
fn training_overlap(correction: &Correction, retests: &[LogFile]) -> Vec<String> {
    let of_fit = || correction.calibration.iter().flat_map(|calibration| &calibration.provenance.inputs);
    let seen = |retest: &&LogFile| of_fit().any(|input| input.sha256 == retest.sha256);
    retests.iter().filter(seen).map(|retest| retest.file.clone()).collect()
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
    let axis = |axis: usize| {
        let [before, after] = [&drifts.raw, &drifts.corrected].map(|drift| {
            let means: Vec<f64> = (0..runs.len()).map(|run| mean(drift, axis, run as u32)).collect();
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

fn axis_figures(
    pair: &PairedWindows,
    drifts: &PairedDrifts<'_>,
    used: &[usize],
    report_data: &ReportData,
    axis: usize,
    correction: &Correction,
    test: &TestConfig,
) -> Result<AxisVerification> {
    let windows = &pair.raw;
    let scale = unit_of(windows).0;
    let dph_per_unit = windows.shape.unit.arcsec() / scale;
    let figures = |side: &Windows, drift: &Drifts<'_>| {
        let angle = &side.rows.angle[axis];
        // What the table turned, in the unit of the figures; exactly nothing without one.
        let turned = |i: usize| (side.rate_dph(axis, i) - drift.rate_dph(axis, i)) / dph_per_unit;
        let value = |i: usize| angle[i] * scale / windows.duration_s(i) - turned(i);
        let values: Vec<(u32, f64)> = used.iter().map(|i| (windows.rows.run[*i], value(*i))).collect();
        Figures::of(&values, dph_per_unit).ok_or_else(|| {
            Error::refused(format!("{} usable windows; before and after need at least two per run", used.len()))
                .help("give a longer retest or a shorter --window")
        })
    };
    let (before, after) = (figures(windows, &drifts.raw)?, figures(&pair.corrected, &drifts.corrected)?);
    let ratio = |before: f64, after: f64| (after > 0.0).then_some(before / after);
    let status_windows = Status::NAMES
        .iter()
        .map(|(bit, name)| ((*name).to_owned(), used.iter().filter(|i| pair.status[axis][**i].contains(*bit)).count()));
    let letter = windows.shape.axes[axis];
    let noise_floor = noise_floor(windows, used, axis, correction, test, dph_per_unit);
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
        limits: Vec::new(),
        pass: None,
    })
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
    let mean_square =
        used.iter().map(|i| terms.floor_dph(windows.duration_s(*i)).powi(2)).sum::<f64>() / used.len() as f64;
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
