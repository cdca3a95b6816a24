//! Huber's loss on demand: windows far from the fit get a lower weight; none is excluded.
//!
//! ```text
//! ρ(r) = r²/2 for |r| ≤ k·s, else k·s·|r| − (k·s)²/2        k = 1.345 (95 % efficient on normal residuals), s = 1.4826·median|r|
//! ```
//!
//! by re-weighting until the coefficients converge. Covariance: (JᵀWJ)⁻¹·[Σψ²/(n − p)]/(mean ψ')² (Huber 1981), widened for
//! the residuals' autocorrelation as in least squares. The selection of the model and the cross-validation use least squares.

use crate::fit::one_model::solution::{Fitted, fit};
use crate::fit::problem::least_squares::LeastSquares;
use crate::model::spec::ModelSpec;
use sagnac_log::error::Result;

const TUNING: f64 = 1.345;
const NORMAL_MEDIAN: f64 = 1.4826;
const MOST_ROUNDS: usize = 50;
/// Coefficients have converged when none moves by more than this fraction of its σ.
const STILL: f64 = 1e-4;

/// Loss of a residual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Its square.
    #[default]
    Squares,
    /// Its square near the fit, its size far from it.
    Huber,
}

/// Fits a model with Huber's loss; restores the problem's weights.
pub(crate) fn robust_fit(problem: &mut LeastSquares<'_>, spec: &ModelSpec, taus_s: &[f64]) -> Result<Fitted> {
    let base = problem.weight.clone();
    // Covariance and σ are those of least squares until the end.
    let mut fitted = fit(problem, spec, taus_s)?;
    let mut bend = 0.0;
    for _ in 0..MOST_ROUNDS {
        let scaled: Vec<f64> = fitted.residuals.iter().zip(&base).map(|(r, w)| r * w.sqrt()).collect();
        bend = TUNING * NORMAL_MEDIAN * median(scaled.iter().map(|r| r.abs()).collect());
        if bend <= 0.0 {
            break;
        }
        problem.weight =
            base.iter().zip(&scaled).map(|(w, r)| if r.abs() > bend { w * bend / r.abs() } else { *w }).collect();
        let next = fit(problem, spec, taus_s);
        problem.weight.clone_from(&base);
        let next = next?;
        let sigma = |i: usize| fitted.sigma(i).max(f64::MIN_POSITIVE);
        let moved = (0..next.theta.len()).map(|i| (next.theta[i] - fitted.theta[i]).abs() / sigma(i));
        let moved = moved.fold(0.0, f64::max);
        (fitted.theta, fitted.residuals) = (next.theta, next.residuals);
        // The first fit decides which lags are in the covariance.
        fitted.taus.iter_mut().zip(next.taus).for_each(|(tau, next)| tau.value_s = next.value_s);
        if moved < STILL {
            break;
        }
    }
    let clipped = |r: f64| r.clamp(-bend, bend);
    let scaled: Vec<f64> = fitted.residuals.iter().zip(&base).map(|(r, w)| r * w.sqrt()).collect();
    let within = scaled.iter().filter(|r| r.abs() <= bend).count() as f64 / scaled.len() as f64;
    let degrees = scaled.len().saturating_sub(fitted.covariance.nrows()).max(1) as f64;
    let psi = scaled.iter().map(|r| clipped(*r).powi(2)).sum::<f64>() / degrees;
    if within > 0.0 && fitted.sigma_dph > 0.0 {
        fitted.covariance *= psi / within.powi(2) / fitted.sigma_dph.powi(2);
    }
    Ok(fitted)
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
