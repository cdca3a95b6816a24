//! The τ of a warm-up next to a selected model.
//!
//! [`super::nuisance`] decides whether the runs hold one. Its τ from a grid of ratio two is refined here by parabolas.
//!
//! Fails where a run does not begin at power-on, as [`crate::fit::one_model::warm_up`] says.

use crate::fit::one_model::design::{LN_TAU_TOLERANCE, misfit};
use crate::fit::one_model::solution::fit;
use crate::fit::one_model::warm_up::find;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::selection::prices::{TIME_DECISIVE, price};
use crate::model::spec::ModelSpec;
use crate::noise_model::minimum::minimum;

/// A problem with the τ of its warm-up at the least misfit next to a model. A drift in time next to it is kept only where it is still
/// decisive then, for it may have made up for the τ of the grid.
pub(crate) fn refined<'a>(problem: LeastSquares<'a>, spec: &ModelSpec, taus_s: &[f64]) -> LeastSquares<'a> {
    let Some((with, misfit_with)) = settled(&problem, spec, taus_s) else { return problem };
    let no_drift: Vec<Level> =
        with.levels().iter().copied().filter(|level| !matches!(level, Level::Drift(_))).collect();
    let dropped = (with.levels().len() - no_drift.len()) as f64;
    if dropped == 0.0 {
        return with;
    }
    let n = problem.len() as f64;
    let variance = misfit_with / (n - (with.levels().len() + spec.coefficients()) as f64).max(1.0);
    let worth = variance * (dropped * price(n) + TIME_DECISIVE);
    match settled(&with.with_levels(no_drift), spec, taus_s) {
        Some((without, misfit)) if misfit - misfit_with <= worth => without,
        _ => with,
    }
}

/// The problem with τ refined within one step of the grid, and the misfit there.
fn settled<'a>(problem: &LeastSquares<'a>, spec: &ModelSpec, taus_s: &[f64]) -> Option<(LeastSquares<'a>, f64)> {
    let (column, grid_s) = find(problem)?;
    let fitted = fit(problem, spec, taus_s).ok()?;
    let lags: Vec<(usize, f64)> = fitted.taus.iter().map(|tau| (tau.input, tau.value_s)).collect();
    let at = |ln_tau: f64| {
        let mut levels = problem.levels().to_vec();
        levels[column] = Level::WarmUp { tau_s: ln_tau.exp() };
        problem.with_levels(levels)
    };
    let misfit_at = |ln_tau: f64| misfit(&at(ln_tau), &fitted.terms, &lags);
    let lowest = minimum((grid_s / 2.0).ln(), (grid_s * 2.0).ln(), LN_TAU_TOLERANCE, misfit_at);
    Some((at(lowest.at), misfit_at(lowest.at)))
}
