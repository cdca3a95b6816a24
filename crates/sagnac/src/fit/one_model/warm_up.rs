//! The warm-up since power-on of a fit: IEEE Std 647's turn-on.
//!
//! ```text
//! a·e^(−t/τ)        t: time since power-on, which is the first row of every run
//! ```
//!
//! The uncertainties of a and τ are those of both together next to all terms, under the noise of the residuals.
//!
//! Fails where a run does not begin at power-on: then a belongs to the first row of the log, and nothing in a log says so.

use crate::calibration::{Lag, WarmUp};
use crate::fit::one_model::solution::{Fitted, weighted_rows};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::noise_model::processes::SlowNoise;

/// The warm-up among the levels of a problem: its column and τ, s.
pub(crate) fn find(problem: &LeastSquares<'_>) -> Option<(usize, f64)> {
    problem.levels().iter().enumerate().find_map(|(column, level)| Some((column, level.warm_up_s()?)))
}

/// The warm-up of a fit without its uncertainty; `None` where it has none.
pub(crate) fn value(problem: &LeastSquares<'_>, fitted: &Fitted) -> Option<WarmUp> {
    let (column, tau_s) = find(problem)?;
    Some(WarmUp { value_dph: fitted.theta[column], sigma_dph: None, tau_s: Lag { value: tau_s, sigma: None } })
}

/// The same with the uncertainty of its size and its τ, under this noise with a white variance.
pub(crate) fn estimate(problem: &LeastSquares<'_>, fitted: &Fitted, noise: SlowNoise, white: f64) -> Option<WarmUp> {
    let (column, tau_s) = find(problem)?;
    let warm_up = value(problem, fitted)?;
    // ∂/∂τ of a·e^(−t/τ) = a·e^(−t/τ)·t/τ².
    let slope = |row: usize| {
        let level = problem.level(row, Level::WarmUp { tau_s });
        warm_up.value_dph * level * problem.since_start_s(row) / tau_s.powi(2)
    };
    let (normal, z) = weighted_rows(problem, fitted, Some((0..problem.len()).map(slope).collect()))?;
    let covariance = &normal * noise.between(problem.noise_rows(), &z) * &normal * white;
    let sigma = |at: usize| Some(covariance[(at, at)].max(0.0).sqrt()).filter(|sigma| sigma.is_finite());
    let tau_s = Lag { value: tau_s, sigma: sigma(covariance.nrows() - 1) };
    Some(WarmUp { sigma_dph: sigma(column), tau_s, ..warm_up })
}
