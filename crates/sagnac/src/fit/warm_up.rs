//! The warm-up since power-on: IEEE Std 647's turn-on. A part of the correction where that is asked for.
//!
//! ```text
//! a·e^(−t/τ)        t: time since power-on, which is the first row of every run
//! ```
//!
//! [`super::nuisance`] decides whether the runs hold one. Its τ from a grid of ratio two is refined here by parabolas, and the
//! uncertainties of a and τ are those of both together beside all terms, under the noise of the residuals.
//!
//! Fails where a run does not begin at power-on: then a belongs to the first row of the log, and nothing in a log says so.

use std::cell::RefCell;

use crate::calibration::{Lag, WarmUp};
use crate::fit::averaging::price;
use crate::fit::design::{LN_TAU_TOLERANCE, misfit};
use crate::fit::least_squares::{LeastSquares, Level};
use crate::fit::minimum::minimum;
use crate::fit::nuisance::DECISIVE;
use crate::fit::slow_noise::SlowNoise;
use crate::fit::solution::{Fitted, fit, weighted_rows};
use crate::model::spec::ModelSpec;

/// The warm-up among the levels of a problem: its column and τ, s.
fn find(problem: &LeastSquares<'_>) -> Option<(usize, f64)> {
    problem.levels.iter().enumerate().find_map(|(column, level)| Some((column, level.warm_up_s()?)))
}

/// Moves the τ of a problem's warm-up to that of least misfit beside a model. A drift in time beside it is kept only where it is still
/// decisive then, for it may have made up for the τ of the grid.
pub(crate) fn refine(problem: &mut LeastSquares<'_>, spec: &ModelSpec, taus_s: &[f64]) {
    let Some(with) = settle(problem, spec, taus_s) else { return };
    let levels = problem.levels.clone();
    problem.levels.retain(|level| !matches!(level, Level::Drift(_)));
    let dropped = (levels.len() - problem.levels.len()) as f64;
    if dropped == 0.0 {
        return;
    }
    let n = problem.len() as f64;
    let variance = with / (n - (levels.len() + spec.coefficients()) as f64).max(1.0);
    let worth = variance * (dropped * price(n) + DECISIVE);
    if settle(problem, spec, taus_s).is_none_or(|without| without - with > worth) {
        problem.levels = levels;
    }
}

/// Refines τ within one step of the grid; the misfit there.
fn settle(problem: &mut LeastSquares<'_>, spec: &ModelSpec, taus_s: &[f64]) -> Option<f64> {
    let (column, grid_s) = find(problem)?;
    let fitted = fit(problem, spec, taus_s).ok()?;
    let lags: Vec<(usize, f64)> = fitted.taus.iter().map(|tau| (tau.input, tau.value_s)).collect();
    let problem = RefCell::new(problem);
    let misfit_at = |ln_tau: f64| {
        problem.borrow_mut().levels[column] = Level::WarmUp { tau_s: ln_tau.exp() };
        misfit(&problem.borrow(), &fitted.terms, &lags)
    };
    let found = minimum((grid_s / 2.0).ln(), (grid_s * 2.0).ln(), LN_TAU_TOLERANCE, misfit_at);
    // The column stays at the best τ.
    Some(misfit_at(found.at))
}

/// The warm-up of a fit without its uncertainty; `None` where it has none.
pub(crate) fn value(problem: &LeastSquares<'_>, fitted: &Fitted) -> Option<WarmUp> {
    let (column, tau_s) = find(problem)?;
    Some(WarmUp { value_dph: fitted.theta[column], sigma_dph: None, tau_s: Lag { value: tau_s, sigma: None } })
}

/// The same with the uncertainty of its size and its τ, under this noise beside a white variance.
pub(crate) fn estimate(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise, white: f64) -> Option<WarmUp> {
    let (column, tau_s) = find(problem)?;
    let found = value(problem, fitted)?;
    // ∂/∂τ of a·e^(−t/τ) = a·e^(−t/τ)·t/τ².
    let slope = |row: usize| {
        let level = problem.level(row, Level::WarmUp { tau_s });
        found.value_dph * level * problem.since_start_s(row) / tau_s.powi(2)
    };
    let (normal, z) = weighted_rows(problem, fitted, Some((0..problem.len()).map(slope).collect()))?;
    let covariance = &normal * noise.between(problem.noise_rows(), &z) * &normal * white;
    let sigma = |at: usize| Some(covariance[(at, at)].max(0.0).sqrt()).filter(|sigma| sigma.is_finite());
    let tau_s = Lag { value: tau_s, sigma: sigma(covariance.nrows() - 1) };
    Some(WarmUp { sigma_dph: sigma(column), tau_s, ..found })
}
