//! Values of a retest: every axis over the used windows, before and after, next to the floor and the calibration.
//!
//! ```text
//! σ² = Σ w·(v − m)²/(n − runs)      v a window's value, w its length over the nominal one (at most 1), m its run's mean
//! standard errors                    of σ: 1/√(2ν), ν the windows less for neighbours that correlate; of max − min: Gumbel's
//! ```
//!
//! Runs that cover little of the temperatures each are taken about the mean of all: their own means would hold the drift.

use std::collections::BTreeMap;

use sagnac_core::{Image, Status};

use crate::calibration::{AxisCalibration, MovedTogether};
use crate::diagnostics::profile::{TOGETHER, rate_explained, time_explained};
use crate::diagnostics::{
    AxisReportData, ReportData, RunSpan, WindowPoint, offsets_hide_drift, points, ramp_rates_cpm, rate_coverage,
    run_spans,
};
use crate::noise_model::stated::noise_of;
use crate::verify::replay::correction::Correction;
use crate::verify::replay::flagged::FlaggedOff;
use crate::verify::replay::paired::PairedWindows;
use crate::verify::result::{AxisVerification, Coverage, RetestNoiseFloor};
use crate::verify::values::before_after::{DriftValues, Weighted, expected_range};
use crate::verify::values::diagnostics::residual_diagnostics;
use crate::verify::values::judged_windows;
use crate::verify::values::noise::RetestNoise;
use crate::verify::values::rate_table::{Drifts, PairedDrifts};
use crate::verify::values::repeatability::{BiasRepeatability, scale_difference};
use crate::verify::values::residual::{RandomWalk, residual};
use crate::verify::values::suspects::suspects;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Reason};
use sagnac_log::setup::Setup;
use sagnac_noise::{MeasuredNoise, NoiseTerms};
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;

/// What a retest is compared with.
pub(crate) struct Against<'a> {
    pub(crate) correction: &'a Correction,
    pub(crate) setup: &'a Setup,
    /// Thermometer of the fit.
    pub(crate) sensor: Option<usize>,
}

/// The windows of a retest, or of a run of it.
pub(crate) struct Retest<'a> {
    pub(crate) pair: &'a PairedWindows,
    /// Part of the time of which no row is usable, 0 to 1.
    pub(crate) missing_fraction: f64,
    /// Part of the rows that was excluded on request, 0 to 1; `None` where nothing was asked to be excluded.
    pub(crate) excluded_fraction: Option<f64>,
    /// Per axis the flagged rows that differ from their neighbours; empty of a run alone.
    pub(crate) flagged_off: &'a [Option<FlaggedOff>],
    /// Where bumps, steps and start-up are searched for.
    pub(crate) suspects_in: Option<&'a Windows>,
}

impl<'a> Retest<'a> {
    /// All windows of a retest, nothing excluded, nothing suspected.
    pub(crate) fn all(pair: &'a PairedWindows) -> Self {
        Self {
            pair,
            missing_fraction: pair.missing_fraction(None),
            excluded_fraction: None,
            flagged_off: &pair.flagged_off,
            suspects_in: None,
        }
    }
}

/// Windows prepared once for every axis.
struct PreparedWindows<'a> {
    retest: &'a Retest<'a>,
    used: Vec<usize>,
    drifts: PairedDrifts<'a>,
    /// Each run covers so little of the temperatures that its own mean would hold the drift.
    about_common_mean: bool,
    report_data: ReportData,
}

impl<'a> PreparedWindows<'a> {
    fn of(retest: &'a Retest<'a>, setup: &'a Setup, sensor: Option<usize>) -> Result<Self> {
        let pair = retest.pair;
        let used = pair.used();
        // Short windows alone say nothing of a floor, a plateau or a status.
        if used.is_empty() {
            return Err(too_few(&used));
        }
        let drifts = PairedDrifts::of(pair, &used, setup, sensor)?;
        let runs = run_spans(&pair.raw);
        let about_common_mean = offsets_hide_drift(&points(&pair.raw, &runs, sensor, |_| 0.0, |_| 0.0));
        let report_data = report_data(pair, &drifts, &used, runs, about_common_mean, sensor);
        Ok(Self { retest, used, drifts, about_common_mean, report_data })
    }

    /// °/h per unit of the values.
    fn dph_per_unit(&self) -> f64 {
        let windows = &self.retest.pair.raw;
        windows.shape.unit.arcsec() / unit_of(windows).0
    }

    /// Values of an axis before and after.
    fn before_after(&self, axis: usize) -> Result<(DriftValues, DriftValues)> {
        let Self { retest, used, drifts, about_common_mean, .. } = self;
        let windows = &retest.pair.raw;
        let (scale, dph_per_unit) = (unit_of(windows).0, self.dph_per_unit());
        let run_of = |i: usize| if *about_common_mean { 0 } else { windows.rows.run[i] };
        let values_of = |side: &Windows, drift: &Drifts<'_>| {
            let angle = &side.rows.angle[axis];
            // What the table turned, in the unit of the values; exactly nothing without one.
            let turned = |i: usize| (side.rate_dph(axis, i) - drift.rate_dph(axis, i)) / dph_per_unit;
            let value = |i: usize| angle[i] * scale / windows.duration_s(i) - turned(i);
            let weighted = |i: usize| Weighted { run: run_of(i), value: value(i), weight: weight(windows, i) };
            // Short windows count by their length; on a table they are the transition between two rates.
            let is_judged = |i: &usize| match windows.rows.excluded[*i] {
                None => true,
                Some(reason) => reason == Reason::ShortWindow && !drifts.is_turned(),
            };
            let values: Vec<Weighted> = (0..windows.len()).filter(is_judged).map(weighted).collect();
            DriftValues::of(&values, dph_per_unit).ok_or_else(|| too_few(used))
        };
        Ok((values_of(windows, &drifts.raw)?, values_of(&retest.pair.corrected, &drifts.corrected)?))
    }

    /// N before and after: what the correction adds shows within windows, on the same rows. Of every window: a noise that comes and goes is the unit's. Turned, a counter's quantization is a saw that
    /// passes for a walk.
    fn random_walk(&self, axis: usize) -> Option<RandomWalk> {
        let PairedWindows { raw, corrected, .. } = self.retest.pair;
        let (before_deg_rt_h, ends) = Some(raw.noise_with_shaken(axis)?.n_deg_rt_h()).filter(|(n, _)| *n > 0.0)?;
        let added = raw.walk_added_in(corrected, axis)? / ARCSEC_RT_S_PER_DEG_RT_H.powi(2);
        let after = |n: f64| (n * n + added).max(0.0).sqrt();
        let (after_deg_rt_h, after_ends_deg_rt_h) = (after(before_deg_rt_h), ends.map(|ends| ends.map(after)));
        (!self.drifts.is_turned()).then_some(RandomWalk { before_deg_rt_h, after_deg_rt_h, after_ends_deg_rt_h })
    }

    /// Windows in which each status occurred.
    fn status_windows(&self, axis: usize) -> BTreeMap<String, usize> {
        let status = &self.retest.pair.status[axis];
        let count = |bit: Status| self.used.iter().filter(|i| status[**i].contains(bit)).count();
        let counts = Status::NAMES.iter().map(|(bit, name)| ((*name).to_owned(), count(*bit)));
        counts.filter(|(_, n)| *n > 0).collect()
    }
}

fn too_few(used: &[usize]) -> Error {
    Error::refused(
        format!("the retest has {} usable windows, and needs two per run", used.len()),
        "give a longer retest, or set a shorter --window",
    )
}

impl Against<'_> {
    fn axis_values(&self, prepared: &PreparedWindows<'_>, axis: usize) -> Result<AxisVerification> {
        let PreparedWindows { retest, used, drifts, about_common_mean, report_data } = prepared;
        let windows = &retest.pair.raw;
        let letter = windows.shape.axes[axis];
        let record = self.record(letter);
        let in_span = self.image(letter).zip(self.sensor);
        let (before, after) = prepared.before_after(axis)?;
        let ratio = |before: f64, after: f64| (after > 0.0).then_some(before / after);
        let noise_floor = noise_floor(windows, used, axis, self.correction, self.setup, prepared.dph_per_unit());
        let floor_dph = noise_floor.as_ref().map(|floor| floor.value_dph);
        let points = &report_data.axes[axis].points;
        let noise = RetestNoise::of(&judged_windows::judged(points), *about_common_mean);
        let scale_factor = drifts.scale_proof(used, axis, self.sensor);
        let turn_ons = self.correction.calibration.as_ref().and_then(|calibration| calibration.setup.turn_ons);
        let bias = BiasRepeatability::of(drifts, windows, used, axis, &noise, (record, turn_ons), self.setup);
        Ok(AxisVerification {
            axis: letter,
            before,
            after,
            improvement: ratio(before.peak_to_peak, after.peak_to_peak),
            improvement_sigma: ratio(before.sigma, after.sigma),
            residual_diagnostics: residual_diagnostics(points, &noise, after.sigma_dph, floor_dph),
            noise_floor,
            coverage: in_span.and_then(|(image, sensor)| Coverage::of(image, windows, used, sensor)),
            ramp_rates_cpm: ramp_rates_cpm(points),
            turned: drifts.is_turned(),
            turned_about: drifts.is_turned_about(axis),
            turned_both_ways: drifts.is_turned_both_ways(used, axis),
            residual: residual(points, &noise, prepared.random_walk(axis)),
            flight: None,
            flight_unavailable: None,
            scale_factor_difference: scale_difference(scale_factor.as_ref(), record),
            scale_factor,
            bias_repeatability_unavailable: bias.as_ref().err().cloned(),
            bias_repeatability: bias.ok(),
            rate_coverage: record.and_then(|record| reached_rates(record, points)),
            repeats_profile: record.is_some_and(|record| repeats_profile(record, points)),
            scale_factor_calibrated: record.is_some_and(|record| record.scale_factor().is_some()),
            about_common_mean: *about_common_mean,
            missing_fraction: retest.missing_fraction,
            out_of_span_fraction: in_span.map_or(0.0, |(image, sensor)| out_of_span(image, windows, used, sensor)),
            hours: used.iter().map(|i| windows.duration_s(*i)).sum::<f64>() / 3600.0,
            excluded_fraction: retest.excluded_fraction,
            flagged_off: retest.flagged_off.get(axis).copied().flatten(),
            suspects: retest.suspects_in.map_or_else(Vec::new, |windows| suspects(windows, axis)),
            status_windows: prepared.status_windows(axis),
            limits: Vec::new(),
            pass: None,
        })
    }

    /// Values of every axis over the used windows, and the points behind them.
    pub(crate) fn values(&self, retest: &Retest<'_>) -> Result<(Vec<AxisVerification>, ReportData)> {
        let prepared = PreparedWindows::of(retest, self.setup, self.sensor)?;
        let axes = (0..retest.pair.raw.shape.axes.len()).map(|axis| self.axis_values(&prepared, axis));
        Ok((axes.collect::<Result<_>>()?, prepared.report_data))
    }

    /// The record of an axis.
    fn record(&self, axis: char) -> Option<&AxisCalibration> {
        self.correction.calibration.as_ref()?.axes.iter().find(|record| record.axis == axis)
    }

    /// The image of an axis.
    fn image(&self, axis: char) -> Option<&Image> {
        self.correction.images.iter().find(|image| char::from(image.description().axis) == axis)
    }
}

/// Part of the temperature rates of a fit that the ramps of a retest reach.
fn reached_rates(record: &AxisCalibration, points: &[WindowPoint]) -> Option<f64> {
    record.rate_span_cpm()?;
    Some(rate_coverage(record.fit.as_ref()?.ramp_rates_cpm?, ramp_rates_cpm(points)?))
}

/// What the calibration could not separate from temperature moves with it here, too.
fn repeats_profile(record: &AxisCalibration, points: &[WindowPoint]) -> bool {
    let entanglement = record.fit.as_ref().map(|fit| &fit.entanglement);
    let again = |with: MovedTogether| match with {
        MovedTogether::TemperatureRate => rate_explained(points),
        MovedTogether::Time => time_explained(points),
    };
    entanglement.into_iter().flatten().any(|of| again(of.with).is_some_and(|part| part > TOGETHER))
}

impl AxisVerification {
    /// Standard error of a spread of the corrected windows, as a part of it: 1/√(2ν), ν less where neighbours correlate.
    pub(crate) fn relative_sigma_of_spread(&self) -> f64 {
        let rho = self.residual_diagnostics.lag1_autocorrelation.map_or(0.0, |rho| rho.value.clamp(0.0, 0.95));
        let independent = self.after.n as f64 * (1.0 - rho * rho) / (1.0 + rho * rho);
        (2.0 * (independent - 1.0).max(1.0)).sqrt().recip()
    }

    /// Standard error of σ over the floor, as a part of it.
    pub(crate) fn relative_sigma_over_floor(&self) -> f64 {
        let of_floor = self.noise_floor.as_ref().map_or(0.0, |floor| floor.sigma_dph / floor.value_dph);
        self.relative_sigma_of_spread().hypot(of_floor)
    }

    /// √(σ² − floor²) with its standard error, by that of σ².
    pub(crate) fn sigma_beyond_floor(&self) -> Option<(f64, Option<f64>)> {
        let floor = self.noise_floor.as_ref()?;
        let square = self.after.sigma_dph.powi(2);
        // `clamp` keeps what is no number, where `max` would make it a value.
        let value = (square - floor.value_dph.powi(2)).clamp(0.0, f64::INFINITY).sqrt();
        let sigma_of_square = 2.0 * (square * self.relative_sigma_of_spread()).hypot(floor.value_dph * floor.sigma_dph);
        Some((value, Some(sigma_of_square / (2.0 * value).max(sigma_of_square.sqrt()))))
    }

    /// Standard error of max − min of n normal windows, as a part of it: both ends are Gumbel variables, σ = π/√6/√(2 ln n).
    pub(crate) fn relative_sigma_of_range(&self) -> f64 {
        let n = (self.after.n as f64).max(3.0);
        let end = std::f64::consts::PI / 6.0_f64.sqrt() / (2.0 * n.ln()).sqrt();
        std::f64::consts::SQRT_2 * end / expected_range(self.after.n.max(2))
    }
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

/// Both sides of every window about their own means over the used windows: of the run, or of all runs.
fn report_data(
    pair: &PairedWindows,
    drifts: &PairedDrifts<'_>,
    used: &[usize],
    runs: Vec<RunSpan>,
    about_common_mean: bool,
    sensor: Option<usize>,
) -> ReportData {
    let windows = &pair.raw;
    let mean = |drift: &Drifts<'_>, axis: usize, run: u32| {
        let members = used.iter().filter(|i| windows.rows.run[**i] == run);
        let (sum, n) = members.fold((0.0, 0.0), |(sum, n), i| (sum + drift.rate_dph(axis, *i), n + 1.0));
        sum / n
    };
    let mean_of_all = |drift: &Drifts<'_>, axis: usize| {
        used.iter().map(|i| drift.rate_dph(axis, *i)).sum::<f64>() / used.len() as f64
    };
    let axis = |axis: usize| {
        let [before, after] = [&drifts.raw, &drifts.corrected].map(|drift| {
            let one =
                |run: usize| if about_common_mean { mean_of_all(drift, axis) } else { mean(drift, axis, run as u32) };
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

/// Values per unit of angle × nominal/duration: counts per window, or °/h.
pub(crate) fn unit_of(windows: &Windows) -> (f64, &'static str) {
    match windows.shape.unit {
        AngleUnit::Quanta { quantum, .. } => (quantum * windows.shape.nominal_s, "counts per window"),
        AngleUnit::Arcsec => (1.0, "deg/h"),
    }
}

/// Length of a window over the nominal one, at most 1.
fn weight(windows: &Windows, i: usize) -> f64 {
    (windows.duration_s(i) / windows.shape.nominal_s).min(1.0)
}

/// From the setup or the retest log, else from the calibration: N and Q, at the lengths that the windows really have. A setup that states
/// more than the log shows is not believed: what a correction left over would pass for noise.
fn noise_floor(
    windows: &Windows,
    used: &[usize],
    axis: usize,
    correction: &Correction,
    setup: &Setup,
    dph_per_unit: f64,
) -> Option<RetestNoiseFloor> {
    let letter = windows.shape.axes[axis];
    let calibrations = correction.calibration.iter().flat_map(|c| &c.axes);
    let earlier = || {
        let known = calibrations.into_iter().find(|a| a.axis == letter)?.fit.as_ref()?.noise_floor.as_ref()?;
        let n_arcsec_rt_s = known.n_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        windows.shape.window.seconds()?;
        let known_terms = NoiseTerms { n_arcsec_rt_s, q_arcsec: known.q_arcsec };
        Some((MeasuredNoise::stated(known_terms), format!("calibration ({})", known.source)))
    };
    let own = noise_of(windows, axis, setup).map(|(noise, source)| (noise, source.to_owned()));
    let shown = setup.noise.and_then(|_| windows.measured_noise(axis)).filter(|noise| noise.terms.n_arcsec_rt_s > 0.0);
    let nominal_s = windows.shape.nominal_s;
    let floor_dph = |noise: &MeasuredNoise| noise.terms.floor_dph(nominal_s);
    let own = match (own, shown) {
        (Some((stated, _)), Some(shown)) if floor_dph(&shown) < floor_dph(&stated) => {
            Some((shown, "Allan deviations of the log; the setup states more".to_owned()))
        }
        (own, _) => own,
    };
    let (noise, source) = own.or_else(earlier)?;
    // As in the values, a shorter window counts by its length.
    let square = |i: &usize| noise.terms.floor_dph(windows.duration_s(*i)).powi(2) * weight(windows, *i);
    let mean_square = used.iter().map(square).sum::<f64>() / used.len() as f64;
    let count = |run: usize| used.iter().filter(|i| windows.rows.run[**i] as usize == run).count();
    let largest = (0..windows.runs.len()).map(count).max()?;
    // A floor of nothing bounds nothing: it is not known.
    let value_dph = Some(mean_square.sqrt()).filter(|value| value.is_finite() && *value > 0.0)?;
    let value = value_dph / dph_per_unit;
    Some(RetestNoiseFloor {
        value_dph,
        sigma_dph: value_dph * noise.relative_sigma_of_floor(nominal_s),
        value,
        expected_peak_to_peak: expected_range(largest) * value,
        n: largest,
        source,
        second_over_first: windows.second_over_first(axis).map(|ratio| [ratio, windows.shape.sample_interval_s]),
    })
}
