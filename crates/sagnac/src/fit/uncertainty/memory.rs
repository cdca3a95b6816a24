//! Memory of temperature that no rate explains, as a calibration shows it at rest.
//!
//! ```text
//! soaks from both sides    difference of the bias at rest about the curve, after heating less after cooling    half of it from 2 σ on
//! none                     difference D of the ramps, heating less cooling, about the curve at rest           half of |D| + 2 σ: it may be memory
//! ```
//!
//! A long lag of a rate term takes on much of a memory, even in a soak: so the difference is that of the bias as logged, not of the residual.
//! On ramps, memory and an effect of the temperature rate are one. D is that of the middle half of the span: at its ends friction turns
//! over. Standard errors by the scatter of the residuals, widened by their
//! correlation. Fails for a memory that fades within a soak, and of a test that heats or cools alone: it shows neither.

use crate::calibration::{FitResidual, MemoryAtRest};
use crate::diagnostics::soaks::soak_pairs;
use crate::diagnostics::{WindowPoint, hysteresis_of};
use crate::fit::problem::least_squares::LeastSquares;

/// Windows of a leg that make a mean.
pub(crate) const LEAST_OF_LEG: usize = 10;
/// Standard errors from which on a difference is memory.
const SIGNIFICANT: f64 = 2.0;

/// Of the drawn windows of a fit; `curve` is the fitted one at rest. `None` on a rate table, and without heating and cooling.
pub(crate) fn memory_at_rest(
    problem: &LeastSquares<'_>,
    drawn: &[WindowPoint],
    residual: &FitResidual,
    curve: impl Fn(f64) -> f64,
) -> Option<MemoryAtRest> {
    if problem.turning.is_some() {
        return None;
    }
    let sigma = residual.widened_sigma_dph();
    let significant =
        |difference: f64, sigma: f64| if difference.abs() > SIGNIFICANT * sigma { difference } else { 0.0 };
    let used: Vec<&WindowPoint> = drawn.iter().filter(|p| p.excluded.is_none() && p.after_dph.is_finite()).collect();
    let away = |point: &WindowPoint| point.before_dph - curve(point.temperature_c);
    let of_pair = |(difference, per_sigma, celsius): (f64, f64, f64)| MemoryAtRest {
        difference_dph: Some(difference),
        sigma_dph: Some(per_sigma * sigma),
        temperature_c: Some(celsius),
        half_dph: 0.5 * significant(difference, per_sigma * sigma).abs(),
    };
    let pairs = soak_pairs(&used).into_iter().map(|pair| {
        let parts = pair.parts(used.len());
        let difference: f64 = parts.iter().zip(&used).map(|(part, point)| part * away(point)).sum();
        let per_sigma = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        of_pair((difference, per_sigma, pair.temperature_c))
    });
    let largest = pairs.max_by(|a, b| {
        a.difference_dph.map(f64::abs).partial_cmp(&b.difference_dph.map(f64::abs)).unwrap_or(std::cmp::Ordering::Equal)
    });
    largest.or_else(|| {
        let span = problem.span();
        let in_middle = |p: &&WindowPoint| span.x(p.temperature_c).abs() <= 0.5;
        let middle: Vec<WindowPoint> = drawn.iter().filter(in_middle).copied().collect();
        let ramps = hysteresis_of(&middle, LEAST_OF_LEG, away)?;
        let sigma = ramps.per_sigma * sigma;
        let difference = significant(ramps.difference_dph, sigma).abs();
        let half_dph = if difference > 0.0 { 0.5 * (difference + SIGNIFICANT * sigma) } else { 0.0 };
        let open = MemoryAtRest { difference_dph: None, sigma_dph: None, temperature_c: None, half_dph };
        (half_dph > 0.0).then_some(open)
    })
}
