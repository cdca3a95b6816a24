//! The noise that a thermometer adds to the corrected angle.
//!
//! A sample of white noise σ every h seconds passes through the slope of the value terms and is held for h. Through the rate
//! terms it moves the lag filter by α:
//!
//! ```text
//! N = σ·(|Σ ±d'(T)|·h + 60·|Σ ±c(T)·α|)/√h        arcsec/√s,   α = 1 − e^(−h/τ),  d' °/h per °C, c °/h per °C/min, rms over the rows
//! ```
//!
//! The sums run over every input that contains the thermometer: itself, and differences with their sign. The random walk
//! through the value terms is unbounded. That through the rate terms is bounded by 60·c·T_lag and grows only over times
//! shorter than τ. The two are added in amplitude, thermometers as independent. h is the interval between new readings. σ
//! comes from second differences of the track, over √6: for a column, which may jump, 1.4826 times their median magnitude; for
//! a thermometer their root mean square, so that converter steps count.
//!
//! Not included: noise at the threshold of a step, and through terms of the scale factor. Fails where noise is slower than h:
//! it then counts as temperature, as in the fit.

use crate::calibration::{CorrectionNoise, InputNoise};
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::ActsOn;
use crate::model::input::{SampledInput, Signal};
use crate::window::{WindowShape, Windows};
use sagnac_units::{ARCSEC_RT_S_PER_DEG_RT_H, s_from_ns};

/// The corrected angle random walk may exceed the raw one by this fraction.
pub(crate) const INCREASE_MAX: f64 = 0.05;
const NORMAL_MEDIAN: f64 = 1.4826;

/// Noise of every thermometer and column that the terms depend on, and the raw angle random walk if it is known.
pub(crate) fn correction_noise(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    n_deg_rt_h: Option<f64>,
) -> CorrectionNoise {
    let read = read_by(problem, fitted);
    let inputs: Vec<InputNoise> = read.iter().map(|source| of_source(problem, fitted, *source)).collect();
    let total = inputs.iter().map(|noise| (noise.value_deg_rt_h + noise.rate_deg_rt_h).powi(2)).sum::<f64>();
    let value = inputs.iter().map(|noise| noise.value_deg_rt_h.powi(2)).sum::<f64>();
    let raw = n_deg_rt_h.filter(|n| *n > 0.0);
    let increase = |added: f64| raw.map(|n| (1.0 + added / n.powi(2)).sqrt() - 1.0);
    CorrectionNoise {
        inputs,
        deg_rt_h: total.sqrt(),
        increase: increase(total),
        increase_by_value: increase(value),
        limit: INCREASE_MAX,
    }
}

/// Which input's rate terms make the most of it.
pub(crate) fn loudest_rate(problem: &LeastSquares<'_>, fitted: &Fitted) -> Option<usize> {
    let noise = |input: &usize| {
        let sources = parts(problem.inputs[*input].signal);
        let sigma =
            sources.iter().map(|(source, _)| TrackNoise::of(problem, *source).sigma.powi(2)).sum::<f64>().sqrt();
        let h = sources.first().map_or(1.0, |(source, _)| TrackNoise::of(problem, *source).interval_s);
        let sensed = Sensed::of(problem, fitted, *input, h);
        sigma * rms(sensed.rate_alpha.iter().copied()) / h.sqrt()
    };
    fitted.taus.iter().map(|tau| tau.input).max_by(|a, b| noise(a).total_cmp(&noise(b)))
}

/// Thermometers and columns behind the inputs that have terms.
fn read_by(problem: &LeastSquares<'_>, fitted: &Fitted) -> Vec<Signal> {
    let mut all: Vec<Signal> = Vec::new();
    for term in &fitted.terms {
        for (source, _) in parts(problem.inputs[term.input].signal) {
            if !all.contains(&source) {
                all.push(source);
            }
        }
    }
    all
}

/// What an input is read from, with its sign.
fn parts(signal: Signal) -> Vec<(Signal, f64)> {
    match signal {
        Signal::Difference { of, less } => vec![(Signal::Thermometer(of), 1.0), (Signal::Thermometer(less), -1.0)],
        other => vec![(other, 1.0)],
    }
}

fn of_source(problem: &LeastSquares<'_>, fitted: &Fitted, source: Signal) -> InputNoise {
    let TrackNoise { sigma, interval_s } = TrackNoise::of(problem, source);
    let mut value = vec![0.0; problem.len()];
    let mut rate = value.clone();
    for (at, input) in problem.inputs.iter().enumerate() {
        let Some((_, sign)) = parts(input.signal).into_iter().find(|(part, _)| *part == source) else { continue };
        let sensed = Sensed::of(problem, fitted, at, interval_s);
        value.iter_mut().zip(&sensed.slope).for_each(|(sum, slope)| *sum += sign * slope);
        rate.iter_mut().zip(&sensed.rate_alpha).for_each(|(sum, c)| *sum += sign * c);
    }
    let walk = sigma / interval_s.sqrt() / ARCSEC_RT_S_PER_DEG_RT_H;
    InputNoise {
        input: source.name(&problem.windows().shape),
        sigma,
        value_deg_rt_h: walk * rms(value.into_iter()) * interval_s,
        rate_deg_rt_h: walk * 60.0 * rms(rate.into_iter()),
    }
}

/// Longest interval between readings of a thermometer, s, and changes that show it.
const LONGEST_HOLD_S: f64 = 600.0;
const MANY_CHANGES: usize = 32;

/// What an input's terms make of a change of it, row by row: °/h per unit, and c·α of its rate terms.
struct Sensed {
    slope: Vec<f64>,
    rate_alpha: Vec<f64>,
}

impl Sensed {
    fn of(problem: &LeastSquares<'_>, fitted: &Fitted, at: usize, interval_s: f64) -> Self {
        let input: &SampledInput = &problem.inputs[at];
        let theta = &fitted.theta[problem.levels().len()..];
        let terms: Vec<(&TermColumn, &f64)> =
            fitted.terms.iter().zip(theta).filter(|(term, _)| term.input == at).collect();
        let alpha = fitted.lag(at).map_or(0.0, |(tau_s, _)| -(-interval_s / tau_s).exp_m1());
        let over = |wanted: bool| {
            terms.iter().filter(move |(term, _)| term.form.acts_on == ActsOn::Bias && term.form.times_rate == wanted)
        };
        let slope = |value: f64| -> f64 {
            over(false).map(|(term, theta)| *theta * term.form.shape.slope(input.span, value)).sum()
        };
        let rate = |value: f64| -> f64 {
            alpha * over(true).map(|(term, theta)| *theta * term.form.shape.value(input.span, value)).sum::<f64>()
        };
        let rows = 0..problem.len();
        Self {
            slope: rows.clone().map(|row| slope(input.value(row))).collect(),
            rate_alpha: rows.map(|row| rate(input.value(row))).collect(),
        }
    }
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1);
    (values.map(|v| v * v).sum::<f64>() / count as f64).sqrt()
}

/// Noise of a thermometer or column as its track shows it.
#[derive(Clone, Copy)]
struct TrackNoise {
    sigma: f64,
    /// Time after which a reading is a new one, s.
    interval_s: f64,
}

impl TrackNoise {
    fn of(problem: &LeastSquares<'_>, source: Signal) -> Self {
        let windows = problem.windows();
        let tracks: Vec<_> = problem.runs.iter().map(|run| source.track(windows, *run)).collect();
        let tracks: Vec<&[f64]> = tracks.iter().map(|track| &**track).collect();
        Self::of_tracks(&tracks, &windows.shape, source.in_celsius())
    }

    /// Of the tracks of one thermometer or column, run by run.
    fn of_tracks(tracks: &[&[f64]], shape: &WindowShape, in_celsius: bool) -> Self {
        let period_s = s_from_ns(shape.period_ns);
        let row = (shape.sample_interval_s / period_s).round().max(1.0) as usize;
        let points = tracks.iter().map(|track| renewal(track)).fold(0, gcd);
        // A value that changes only every few windows is not a held reading: a mode, a gain. Nor are temperatures that have changed a
        // few times, by a step of the converter: they are read more often than they change.
        let changes = || tracks.iter().flat_map(|track| track.windows(2)).filter(|pair| pair[0] != pair[1]).count();
        let most_s = if in_celsius && changes() >= MANY_CHANGES { LONGEST_HOLD_S } else { shape.nominal_s / 3.0 };
        let renewal = if points <= (most_s / period_s) as usize { points.max(row) } else { row };
        let mut seconds: Vec<f64> = Vec::new();
        for track in tracks {
            // From the first renewal on, one point of each reading.
            let first = track.windows(2).position(|pair| pair[0] != pair[1]).map_or(0, |at| at + 1);
            let readings: Vec<f64> = track.iter().skip(first).step_by(renewal).copied().collect();
            seconds.extend(readings.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).filter(|s| s.is_finite()));
        }
        let interval_s = renewal as f64 * period_s;
        if seconds.is_empty() {
            return Self { sigma: 0.0, interval_s };
        }
        let spread = if in_celsius {
            (seconds.iter().map(|s| s * s).sum::<f64>() / seconds.len() as f64).sqrt()
        } else {
            seconds.iter_mut().for_each(|s| *s = s.abs());
            let middle = seconds.len() / 2;
            NORMAL_MEDIAN * *seconds.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        Self { sigma: spread / 6.0_f64.sqrt(), interval_s }
    }
}

/// Noise of a thermometer, °C, and the interval between its readings, s, as its tracks show them.
pub(crate) fn thermometer_noise(windows: &Windows, thermometer: usize) -> (f64, f64) {
    let tracks: Vec<&[f64]> =
        windows.runs.iter().filter_map(|run| run.tracks.get(thermometer)).map(Vec::as_slice).collect();
    let TrackNoise { sigma, interval_s } = TrackNoise::of_tracks(&tracks, &windows.shape, true);
    (sigma, interval_s)
}

/// Points of a track after which its value may change: the greatest common divisor of the ways between changes; 0 without two
/// of them.
fn renewal(track: &[f64]) -> usize {
    let mut changes = track.windows(2).enumerate().filter(|(_, pair)| pair[0] != pair[1]).map(|(at, _)| at);
    let Some(first) = changes.next() else { return 0 };
    changes.fold(0, |divisor, at| gcd(divisor, at - first))
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_reading_is_new_after_its_hold() {
        let held: Vec<f64> = (0..100).map(|i| f64::from((i + 3) / 10 * 7 % 13)).collect();
        assert_eq!(renewal(&held), 10);
        let fresh: Vec<f64> = (0..100).map(|i| f64::from(i * 7 % 13)).collect();
        assert_eq!((renewal(&fresh), renewal(&[1.0; 9])), (1, 0));
    }
}
