//! Whether a running test is complete, and its next step.
//!
//! ```text
//! Cov θ of the fit so far ─▶ error of the correction ─▶ P(within a share of every limit)      as for a planned test
//! a step (a soak, a ramp) is worth      I − I',   I = mean over T and ±Ṫ of Var δ(T, Ṫ),   Cov' = (Cov⁻¹ + Σ g·gᵀ/v)⁻¹
//! v = N_w²·τ_w/t + B²·ln 4/π + K²·t      variance of the mean of a piece of t seconds under the noise of the fit
//! ```
//!
//! The step of the largest I − I' per hour is the next one: I-optimal, one step at a time. Hours to go repeat it until the probability is reached.
//! The test is complete when that probability is reached on every axis and nothing below is open: the temperatures asked for were reached, heating
//! and cooling can be compared, temperature did not move together with time or its rate, the held-out residual beyond the noise floor is
//! within its limit, what the model misses of the residual over temperature, sweep by sweep, is within the share of its limit (the covariance takes the
//! model for granted, this does not), and each temperature was passed often enough for a change from one cycle to the next to show.
//! The next step goes where the test has not been yet, before anything else.
//!
//! Fails as the fit does: a term that no temperature so far has shown is in no covariance. So a caller asks for the same answer several times in a
//! row, over a growing record, before he ends a test. What the test's own shape cannot show is listed (`not_seen`).

use sagnac_log::setup::RateUnit;
use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde::Serialize;

use super::passes::{BIN_C, Passes, rested_from_both, sweeps};
use super::promise::{self, Expected, Promise};
use crate::calibration::{AxisCalibration, Calibration};
use crate::diagnostics::{Leg, ReportData, WindowPoint};
use crate::verify::Limits;

/// Temperatures over the span, ends included: of soaks that are compared, and of the criterion.
const TEMPERATURES: usize = 12;
/// A soak that is compared, h.
const SOAK_H: f64 = 1.0;
/// Pieces of a ramp.
const PIECES: usize = 8;
/// Most hours that are looked ahead.
const MOST_H: f64 = 48.0;
/// Shortest part of a sweep within a bin of temperature that has a mean of its own, windows.
const BIN_WINDOWS: f64 = 2.5;
/// A temperature counts as reached within this, °C.
const NEAR_C: f64 = 0.5;

/// What is asked of a test that runs.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct EnoughRequest {
    /// What the unit is to meet.
    pub limits: Limits,
    /// Probability that the error of the correction is within the share of every limit.
    pub probability: f64,
    /// Part of each limit that it may take.
    pub share: f64,
    /// Temperatures that the calibration is to cover, °C; those of the record without.
    pub span_c: Option<[f64; 2]>,
    /// Rate of the chamber's ramps, °C/min; that of the record without.
    pub rate_cpm: Option<f64>,
    /// How often each temperature is to be passed, up or down. A third pass is the second in one direction, so that a change from one cycle to the next can
    /// show. A span below 10 °C has no passes.
    pub passes: u32,
    /// Unit of the rates in open points.
    pub units: RateUnit,
}

impl EnoughRequest {
    /// With a probability of 0.95, half of each limit, and three passes.
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            probability: 0.95,
            share: 0.5,
            span_c: None,
            rate_cpm: None,
            passes: 3,
            units: RateUnit::default(),
        }
    }
}

/// What a chamber should do next.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NextStep {
    /// From this temperature, °C.
    pub from_c: f64,
    /// To this one; the same for a soak.
    pub to_c: f64,
    /// For so long, h.
    pub hours: f64,
    /// σ of the correction over temperatures and ramps after it, °/h; `None` where the test has not been yet.
    pub sigma_after_dph: Option<f64>,
}

impl NextStep {
    /// In words.
    pub fn words(&self) -> String {
        let c = |celsius: f64| format!("{celsius:.0} °C").replace('-', "−");
        let long =
            if self.hours >= 1.0 { format!("{:.1} h", self.hours) } else { format!("{:.0} min", 60.0 * self.hours) };
        if (self.from_c - self.to_c).abs() < NEAR_C {
            format!("soak at {} for {long}", c(self.to_c))
        } else {
            format!("ramp from {} to {} in {long}", c(self.from_c), c(self.to_c))
        }
    }
}

/// The result of an axis so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EnoughAxis {
    /// Axis letter.
    pub axis: char,
    /// Probability that the error of the correction is within the share of every limit.
    pub probability: f64,
    /// σ of the correction over temperatures and ramps, °/h.
    pub sigma_dph: f64,
    /// Each limit that a calibration test decides, with the error at 95 %.
    pub expected: Vec<Expected>,
    /// The step that is worth most.
    pub next: Option<NextStep>,
    /// Hours of the best steps until the probability is reached; `None` where two days do not do it.
    pub hours_to_go: Option<f64>,
}

/// The result of a test so far.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Enough {
    /// Enough: every axis, and nothing open.
    pub met: bool,
    /// Axis by axis.
    pub axes: Vec<EnoughAxis>,
    /// Further open points.
    pub open: Vec<String>,
    /// Hours until everything is met, as far as it can be said.
    pub hours_to_go: Option<f64>,
    /// Limits that are asked and that no calibration test decides.
    pub not_decided: Vec<String>,
    /// What a test of this shape cannot show.
    pub not_seen: Vec<String>,
}

/// Judges a fit of the record so far by its record and its windows.
pub fn enough(calibration: &Calibration, drawn: &ReportData, request: &EnoughRequest) -> Enough {
    let mut open = Vec::new();
    if promise::judged(&request.limits).is_empty() {
        open.push("no limit is asked that a calibration test decides".to_owned());
    }
    let window_s = calibration.setup.window().seconds().unwrap_or(calibration.sample_interval_s);
    for axis in &calibration.axes {
        let points = drawn.axes.iter().find(|drawn| drawn.axis == axis.axis).map_or(&[][..], |drawn| &drawn.points);
        open.extend(misfit_of(axis, points, window_s, request));
    }
    let so_far = |axis| axis_so_far(axis, window_s, request, &mut open);
    let mut axes: Vec<EnoughAxis> = calibration.axes.iter().filter_map(so_far).collect();
    if axes.len() < calibration.axes.len() {
        open.push("an axis has no uncertainty yet".to_owned());
    }
    let first = calibration.axes.first().zip(drawn.axes.first());
    let ways = first.map(|(axis, drawn)| Ways::of(axis, &drawn.points, request)).unwrap_or_default();
    open.extend(ways.open);
    for axis in &mut axes {
        // A temperature that was not reached comes first; passes come when nothing else is missing.
        let is_known = axis.probability >= request.probability;
        axis.next =
            ways.unreached.clone().or_else(|| ways.pass.clone().filter(|_| is_known)).or_else(|| axis.next.take());
    }
    open.sort();
    open.dedup();
    let all = axes.iter().all(|axis| axis.probability >= request.probability);
    let hours = axes.iter().map(|axis| axis.hours_to_go).try_fold(0.0_f64, |most, hours| Some(most.max(hours?)));
    Enough {
        met: all && open.is_empty() && !axes.is_empty(),
        hours_to_go: hours.filter(|_| !axes.is_empty()).map(|hours| hours.max(ways.pass_h) + ways.unreached_h),
        axes,
        open,
        not_decided: promise::not_planned(&request.limits),
        not_seen: ways.not_seen,
    }
}

/// Where the test has not been yet.
#[derive(Default)]
struct Ways {
    open: Vec<String>,
    not_seen: Vec<String>,
    /// The way to a temperature that was not reached.
    unreached: Option<NextStep>,
    /// The sweep that is missing.
    pass: Option<NextStep>,
    /// Hours until temperatures were reached, and until they were passed often enough.
    unreached_h: f64,
    pass_h: f64,
}

impl Ways {
    fn of(axis: &AxisCalibration, points: &[WindowPoint], request: &EnoughRequest) -> Self {
        let mut ways = Self::default();
        let [seen_lo, seen_hi] = axis.span_c();
        let rate_cpm = ramp_rate(axis, request);
        let hours = |by_c: f64| if rate_cpm > 0.0 { by_c / rate_cpm / 60.0 } else { 0.0 };
        let [lo, hi] = request.span_c.unwrap_or([seen_lo, seen_hi]);
        for (from_c, to_c, by_c) in [(seen_lo, lo, seen_lo - lo), (seen_hi, hi, hi - seen_hi)] {
            if by_c > NEAR_C {
                ways.open.push(format!("{to_c:.0} °C was not reached yet").replace('-', "−"));
                ways.unreached_h += hours(by_c);
                let step = NextStep { from_c, to_c, hours: hours(by_c), sigma_after_dph: None };
                ways.unreached.get_or_insert(step);
            }
        }
        if let Some(passes) = Passes::least(points, [seen_lo, seen_hi]) {
            let missing = request.passes.saturating_sub(passes.all());
            if missing > 0 {
                ways.open.push(format!(
                    "a temperature was passed {} × up and {} × down, of {} × in all",
                    passes.up, passes.down, request.passes
                ));
                let [from_c, to_c] = if passes.up <= passes.down { [seen_lo, seen_hi] } else { [seen_hi, seen_lo] };
                let sweep_h = hours(seen_hi - seen_lo);
                ways.pass = Some(NextStep { from_c, to_c, hours: sweep_h, sigma_after_dph: None });
                ways.pass_h = f64::from(missing) * sweep_h;
            }
            if passes.all() < 3 {
                ways.not_seen.push(format!(
                    "a change from one cycle to the next: a temperature was passed {} × up and {} × down",
                    passes.up, passes.down
                ));
            }
            if !rested_from_both(points) {
                ways.not_seen.push(
                    "a memory of the direction at rest: no temperature was soaked at after heating and after cooling"
                        .to_owned(),
                );
            }
        }
        ways
    }
}

/// Rate of the ramps: as stated, else the fastest of the record.
fn ramp_rate(axis: &AxisCalibration, request: &EnoughRequest) -> f64 {
    let seen = axis.fit.as_ref().and_then(|fit| fit.ramp_rates_cpm).map_or(0.0, |[lo, hi]| lo.abs().max(hi.abs()));
    request.rate_cpm.unwrap_or(seen)
}

fn axis_so_far(
    axis: &AxisCalibration,
    window_s: f64,
    request: &EnoughRequest,
    open: &mut Vec<String>,
) -> Option<EnoughAxis> {
    let fit = axis.fit.as_ref()?;
    let letter = axis.axis;
    let mut say = |is_open: bool, what: String| open.extend(is_open.then(|| format!("axis {letter}: {what}")));
    say(fit.hysteresis.is_none(), "heating and cooling cannot be compared yet".to_owned());
    fit.entanglement.iter().for_each(|entanglement| say(true, entanglement.note(request.units)));
    say(axis.noise_floor().is_none(), "the noise floor is not known, so a misfit of the model is not seen".to_owned());
    if let (Some(limit), Some(beyond)) = (request.limits.sigma_beyond_floor_dph_max, beyond_floor(axis)) {
        say(
            beyond > limit,
            format!(
                "the held-out residual is {} beyond the noise floor, more than the limit of {}",
                request.units.text(beyond, 3),
                request.units.text(limit, 3)
            ),
        );
    }
    let rate_cpm = ramp_rate(axis, request);
    let of_rates = if axis.rate_span_cpm().is_some() { rate_cpm } else { 0.0 };
    let promise = Promise::of(axis, &request.limits, request.share, of_rates)?;
    let ahead = Ahead::new(axis, window_s, of_rates, rate_cpm)?;
    let next = ahead.best();
    let hours_to_go = hours_to_go(axis, request, of_rates, promise.probability, &ahead);
    Some(EnoughAxis {
        axis: letter,
        probability: promise.probability,
        sigma_dph: promise.sigma_dph,
        expected: promise.expected,
        next: next.map(|(step, _)| step),
        hours_to_go,
    })
}

/// What the model leaves of the residual over temperature, where it is more than the share of its limit. Means over [`BIN_C`], apart for each sweep and for
/// heating, cooling and rest, have a mean square beyond that of white noise and of the slow noise of the fit.
fn misfit_of(axis: &AxisCalibration, points: &[WindowPoint], window_s: f64, request: &EnoughRequest) -> Option<String> {
    let limit = request.share * request.limits.temperature_residual_dph_max?;
    let ahead = Ahead::new(axis, window_s, 0.0, 0.0)?;
    let mut bins: BTreeMap<(i64, u8, u32), (f64, f64)> = BTreeMap::new();
    let sweeps = sweeps(points);
    let known =
        points.iter().zip(&sweeps).filter(|(point, _)| point.after_dph.is_finite() && point.temperature_c.is_finite());
    for (point, sweep) in known {
        let leg = match point.leg() {
            Leg::Heating => 0,
            Leg::Cooling => 1,
            Leg::Steady => 2,
        };
        let bin = bins.entry(((point.temperature_c / BIN_C).floor() as i64, leg, *sweep)).or_default();
        bin.0 += point.after_dph * point.length_h;
        bin.1 += point.length_h;
    }
    bins.retain(|_, (_, hours)| *hours * 3600.0 >= BIN_WINDOWS * window_s);
    let of_noise = |hours: f64| ahead.white_h / hours + ahead.flicker;
    let beyond = bins.values().map(|(sum, hours)| (sum / hours).powi(2) - of_noise(*hours)).sum::<f64>();
    let misfit = (beyond / bins.len().max(1) as f64).max(0.0).sqrt();
    (misfit > limit).then(|| {
        format!(
            "axis {}: the model misses the residual over temperature, heating, cooling and rest by {}, more than the allowed {}",
            axis.axis,
            request.units.text(misfit, 3),
            request.units.text(limit, 3)
        )
    })
}

/// √(σ² − floor²) of the held-out residual.
fn beyond_floor(axis: &AxisCalibration) -> Option<f64> {
    let held_out = axis.cross_validation()?.sigma_dph;
    let floor = axis.noise_floor()?.value_dph;
    Some((held_out.powi(2) - floor.powi(2)).max(0.0).sqrt())
}

/// Hours of the best steps until the probability is reached.
fn hours_to_go(
    axis: &AxisCalibration,
    request: &EnoughRequest,
    of_rates: f64,
    now: f64,
    ahead: &Ahead<'_>,
) -> Option<f64> {
    let (mut ahead, mut hours, mut probability) = (ahead.clone(), 0.0, now);
    while probability < request.probability {
        let (step, covariance) = ahead.best()?;
        hours += step.hours;
        if hours > MOST_H {
            return None;
        }
        ahead.covariance = covariance;
        let mut after = axis.clone();
        if let Some(fit) = &mut after.fit {
            let size = fit.covariance.len();
            fit.covariance = (0..size).map(|i| (0..size).map(|j| ahead.covariance[(i, j)]).collect()).collect();
        }
        probability = Promise::of(&after, &request.limits, request.share, of_rates)?.probability;
    }
    Some(hours)
}

/// What steps would make of the covariance.
#[derive(Clone)]
struct Ahead<'a> {
    axis: &'a AxisCalibration,
    covariance: DMatrix<f64>,
    /// Row of the newest run's offset.
    offset: usize,
    /// Rate of the ramps of the criterion, and of those that the chamber makes, °C/min.
    of_rates: f64,
    chamber_cpm: f64,
    temperatures: Vec<f64>,
    /// White variance of an hour's mean; B²·ln 4/π; K² per hour; all in (°/h)².
    white_h: f64,
    flicker: f64,
    walk_per_h: f64,
}

impl<'a> Ahead<'a> {
    fn new(axis: &'a AxisCalibration, window_s: f64, of_rates: f64, chamber_cpm: f64) -> Option<Self> {
        let fit = axis.fit.as_ref()?;
        let size = fit.covariance.len();
        let offset = fit.covariance_of.iter().rposition(|name| name.starts_with("offset"))?;
        let covariance = DMatrix::from_fn(size, size, |i, j| fit.covariance[i].get(j).copied().unwrap_or(0.0));
        let [lo, hi] = axis.span_c();
        let width = (hi - lo) / (TEMPERATURES - 1) as f64;
        let slow = fit.slow_noise.as_ref();
        let square = |value: Option<f64>| value.map_or(0.0, |value| value * value);
        let white_dph = slow.map_or(fit.residual.sigma_dph, |slow| slow.white_dph);
        let markov = slow.map_or(0.0, |slow| square(slow.markov_sigma_dph));
        Some(Self {
            axis,
            covariance,
            offset,
            of_rates,
            chamber_cpm,
            temperatures: (0..TEMPERATURES).map(|i| lo + width * i as f64).collect(),
            white_h: white_dph.powi(2) * window_s / 3600.0,
            flicker: square(slow.and_then(|slow| slow.bias_instability_dph)) * 4_f64.ln() / std::f64::consts::PI
                + markov,
            walk_per_h: square(slow.and_then(|slow| slow.rate_random_walk_dph_rt_h)),
        })
    }

    /// Variance of the mean of a piece of so many hours.
    fn variance(&self, hours: f64) -> f64 {
        self.white_h / hours + self.flicker + self.walk_per_h * hours
    }

    /// Regressors of a window at a temperature and rate.
    fn regressors(&self, celsius: f64, rate_cpm: f64) -> Vec<(usize, f64)> {
        let mut all = self.correction(celsius, rate_cpm);
        all.push((self.offset, 1.0));
        all
    }

    /// Weights of the correction at a temperature and rate.
    fn correction(&self, celsius: f64, rate_cpm: f64) -> Vec<(usize, f64)> {
        let mut all = self.axis.drift_weights(celsius, self.axis.reference_c());
        all.extend(self.axis.rate_weights(celsius).into_iter().map(|(row, weight)| (row, weight * rate_cpm)));
        all
    }

    /// Mean variance of the correction over temperatures, at rest and on ramps in both directions.
    fn criterion(&self, covariance: &DMatrix<f64>) -> f64 {
        let rates: &[f64] = if self.of_rates > 0.0 { &[0.0, self.of_rates, -self.of_rates] } else { &[0.0] };
        let variance = |celsius: f64, rate: f64| {
            let w = self.correction(celsius, rate);
            w.iter().map(|(i, a)| w.iter().map(|(j, b)| a * b * covariance[(*i, *j)]).sum::<f64>()).sum::<f64>()
        };
        let all = self.temperatures.iter().flat_map(|celsius| rates.iter().map(move |rate| variance(*celsius, *rate)));
        all.sum::<f64>() / (self.temperatures.len() * rates.len()) as f64
    }

    /// The covariance after pieces of so many hours each (Sherman and Morrison 1950).
    fn after(&self, pieces: impl Iterator<Item = Vec<(usize, f64)>>, hours: f64) -> DMatrix<f64> {
        let variance = self.variance(hours);
        let mut covariance = self.covariance.clone();
        for g in pieces {
            let size = covariance.nrows();
            let mut toward = nalgebra::DVector::zeros(size);
            g.iter().for_each(|(row, weight)| toward += covariance.column(*row) * *weight);
            let gain: f64 = variance + g.iter().map(|(row, weight)| toward[*row] * weight).sum::<f64>();
            covariance -= &toward * toward.transpose() / gain;
        }
        covariance
    }

    /// The step that is worth most per hour, and the covariance after it.
    fn best(&self) -> Option<(NextStep, DMatrix<f64>)> {
        let now = self.criterion(&self.covariance);
        let soak = |celsius: &f64| {
            let after = self.after(std::iter::once(self.regressors(*celsius, 0.0)), SOAK_H);
            (*celsius, *celsius, SOAK_H, after)
        };
        let mut steps: Vec<(f64, f64, f64, DMatrix<f64>)> = self.temperatures.iter().map(soak).collect();
        let [lo, hi] = self.axis.span_c();
        if self.chamber_cpm > 0.0 {
            let hours = (hi - lo) / self.chamber_cpm / 60.0;
            let ramp = |from: f64, to: f64| {
                let rate = self.chamber_cpm.copysign(to - from);
                let at = |piece: usize| from + (to - from) * (piece as f64 + 0.5) / PIECES as f64;
                let pieces = (0..PIECES).map(|piece| self.regressors(at(piece), rate));
                (from, to, hours, self.after(pieces, hours / PIECES as f64))
            };
            steps.extend([ramp(lo, hi), ramp(hi, lo)]);
        }
        let worth = |(.., hours, after): &(f64, f64, f64, DMatrix<f64>)| (now - self.criterion(after)) / hours;
        let best = steps.into_iter().max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
        let sigma_after_dph = self.criterion(&best.3).max(0.0).sqrt();
        let (from_c, to_c, hours, covariance) = best;
        Some((NextStep { from_c, to_c, hours, sigma_after_dph: Some(sigma_after_dph) }, covariance))
    }
}
