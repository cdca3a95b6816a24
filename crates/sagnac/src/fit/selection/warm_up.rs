//! The τ of a warm-up beside a selected model.
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
use std::cell::RefCell;

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
    let worth = variance * (dropped * price(n) + TIME_DECISIVE);
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
