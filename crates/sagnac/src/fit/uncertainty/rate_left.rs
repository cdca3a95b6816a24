//! The effect of the temperature rate that a model without a rate term leaves open.
//!
//! ```text
//! y = columns·θ + c·Ṫ + n        c next to all columns, σ_c by the noise of the rows        σ² = c² + σ_c²
//! ```
//!
//! A term that was not selected is not zero: the interval at a rate has its size and its uncertainty. Fails where temperature and its rate
//! moved together: then nothing tells c, and there is no value.

use crate::fit::one_model::solution::{Fitted, weighted_rows};
use crate::fit::problem::least_squares::LeastSquares;
use crate::noise_model::processes::SlowNoise;

/// σ in °/h per °C/min, under this noise with a white variance; `None` with rate terms, or where the rows do not tell it.
pub(crate) fn rate_left(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise, white: f64) -> Option<f64> {
    let of_main = fitted.spec.thermometer();
    if !problem.has_rate() || of_main.rate.is_some() || of_main.slow_rate.is_some() {
        return None;
    }
    let rates = problem.rate_columns(0, problem.period_s());
    let column: Vec<f64> = rates.iter().map(|row| row[0]).collect();
    let (normal, z) = weighted_rows(problem, fitted, Some(column))?;
    let last = normal.nrows() - 1;
    // What the residuals have in common with the column is left of its coefficient.
    let weights = &z * normal.column(last);
    let coefficient: f64 = weights.iter().zip(&fitted.residuals).map(|(weight, rest)| weight * rest).sum();
    let covariance = &normal * noise.between(problem.noise_rows(), &z) * &normal * white;
    Some((coefficient * coefficient + covariance[(last, last)]).sqrt()).filter(|sigma| sigma.is_finite())
}
