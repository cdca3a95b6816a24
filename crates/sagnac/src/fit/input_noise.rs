//! What a thermometer's noise does to the corrected angle.
//!
//! A sample of white noise σ every h seconds goes through the slope of the value terms and is held for h; through the rate
//! terms it moves the lag by α:
//!
//! ```text
//! N = σ·(|d'(T)|·h + 60·|c(T)|·α)/√h        arcsec/√s,   α = 1 − e^(−h/τ),  d' °/h per °C, c °/h per °C/min, rms over the rows
//! ```
//!
//! The value terms walk for ever; the rate terms are bounded, 60·c·T_lag, and walk like this for times shorter than τ only. The
//! two are added as if they pulled the same way, inputs as if they were independent. σ² is a sixth of the mean square
//! second difference of the track: drift drops out, a converter's steps count.
//!
//! Fails where noise is slower than h: it is then taken for temperature, as the fit does.

use crate::calibration::{CorrectionNoise, InputNoise, TermKind};
use crate::fit::basis::chebyshev;
use crate::fit::input::{Input, zone};
use crate::fit::problem::{Problem, TermPlace};
use crate::fit::solution::Fitted;
use crate::units::ARCSEC_RT_S_PER_DEG_RT_H;

/// The corrected angle random walk may exceed the raw one by this part.
pub(crate) const INCREASE_MAX: f64 = 0.05;
/// Step of x for the slope of a series.
const STEP: f64 = 1e-4;

/// Of all inputs with terms, beside the raw angle random walk `n_deg_rt_h` if it is known.
pub(crate) fn correction_noise(problem: &Problem<'_>, fitted: &Fitted, n_deg_rt_h: Option<f64>) -> CorrectionNoise {
    let used = (0..problem.inputs.len()).filter(|input| fitted.terms.iter().any(|term| term.input == *input));
    let inputs: Vec<InputNoise> = used.map(|input| of_input(problem, fitted, input)).collect();
    let total = inputs.iter().map(|noise| (noise.value_deg_rt_h + noise.rate_deg_rt_h).powi(2)).sum::<f64>();
    let raw = n_deg_rt_h.filter(|n| *n > 0.0);
    CorrectionNoise {
        inputs,
        deg_rt_h: total.sqrt(),
        increase: raw.map(|n| (1.0 + total / n.powi(2)).sqrt() - 1.0),
        limit: INCREASE_MAX,
    }
}

/// Seconds between two samples of the thermometers.
fn interval_s(problem: &Problem<'_>) -> f64 {
    let steps = (problem.windows().shape.sample_interval_s / problem.period_s()).round().max(1.0);
    steps * problem.period_s()
}

fn of_input(problem: &Problem<'_>, fitted: &Fitted, at: usize) -> InputNoise {
    let input = &problem.inputs[at];
    let sigma = sample_sigma(problem, input);
    let interval_s = interval_s(problem);
    let alpha = fitted.lag(at).map_or(0.0, |(tau_s, _)| -(-interval_s / tau_s).exp_m1());
    let terms: Vec<_> =
        fitted.terms.iter().zip(&fitted.theta[problem.levels.len()..]).filter(|(term, _)| term.input == at).collect();
    let value_at = |x: f64| -> f64 {
        let basis = chebyshev(x);
        let of = |term: &TermPlace| match (term.kind, term.at) {
            (TermKind::Bias, _) => basis[usize::from(term.order)],
            (TermKind::Zone, Some(knot)) => zone(x, knot),
            _ => 0.0,
        };
        terms.iter().map(|(term, value)| *value * of(term)).sum()
    };
    let slope = |x: &f64| (value_at(x + STEP) - value_at(x - STEP)) / (2.0 * STEP) * input.span.slope();
    let rate = |x: &f64| -> f64 {
        let basis = chebyshev(*x);
        terms
            .iter()
            .filter(|(term, _)| term.kind == TermKind::Rate)
            .map(|(t, c)| *c * basis[usize::from(t.order)])
            .sum()
    };
    let rms = |of: &dyn Fn(&f64) -> f64| {
        (input.x.iter().map(|x| of(x).powi(2)).sum::<f64>() / input.x.len().max(1) as f64).sqrt()
    };
    let walk = sigma / interval_s.sqrt() / ARCSEC_RT_S_PER_DEG_RT_H;
    InputNoise {
        input: input.name.clone(),
        sigma,
        value_deg_rt_h: walk * rms(&slope) * interval_s,
        rate_deg_rt_h: walk * 60.0 * rms(&rate) * alpha,
    }
}

/// σ of a sample; 0 where there is no track.
fn sample_sigma(problem: &Problem<'_>, input: &Input) -> f64 {
    let every = (interval_s(problem) / problem.period_s()).round().max(1.0) as usize;
    let (mut sum, mut count) = (0.0, 0_u64);
    for run in &problem.runs {
        let track = input.source.track(problem.windows(), *run);
        let last = track.len().saturating_sub(2 * every);
        for at in (0..last).step_by(every) {
            let second = track[at] - 2.0 * track[at + every] + track[at + 2 * every];
            if second.is_finite() {
                sum += second * second;
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { (sum / 6.0 / count as f64).sqrt() }
}
