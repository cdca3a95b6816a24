//! The residual that a gyro's noise alone makes, from its soaks or from the noise that a setup states: the measure of a fit that fails.
//!
//! ```text
//! soaks       rate = level + terms of the model + n       of each soak by itself; n white and slow noise by restricted likelihood
//! E σ²        tr(PV)/(n − runs)                           V the covariance of n over all windows, P takes the mean of each run away
//! bound       E·exp(Z·√(2·tr(PVPV)/tr(PV)² + (slow/all)²·Var ln slow))
//! ```
//!
//! The residual that is judged plays no part: the levels of the soaks are free, so whatever makes their means differ is not in n.
//!
//! Fails where a soak is shorter than the slow noise and where an input moves within the soaks: that passes for noise. A test without
//! soaks, whose setup states neither B nor K, has no such measure; neither has a test on a rate table.

use crate::calibration::WholeNoise;
use crate::diagnostics::{Leg, WindowPoint};
use crate::fit::one_model::solution::{Fitted, values};
use crate::fit::problem::least_squares::LeastSquares;
use crate::noise_model::blocks::{RowNoise, noise_of_blocks};
use crate::noise_model::likelihood::{Block, Rows};
use crate::noise_model::processes::SlowNoise;
use crate::window::level_stretches;
use nalgebra::DMatrix;

/// A soak of fewer windows is left out.
const FEWEST: usize = 12;
/// Rows at most whose covariance is computed; more are averaged.
const MOST_ROWS: usize = 200;
/// Standard deviations of ln σ² above its mean. The slow noise of few soaks is uncertain and most of the spread: a fit also takes part of the
/// slow noise away, so fewer than 2 % of right fits lie beyond.
const Z: f64 = 1.25;

/// As stated, otherwise as the soaks show it. `profile` has a point for every window.
pub(crate) fn whole_noise(
    problem: &LeastSquares<'_>,
    fitted: &Fitted,
    profile: &[WindowPoint],
    stated: Option<(SlowNoise, f64)>,
) -> Option<WholeNoise> {
    if problem.turning.is_some() {
        return None;
    }
    let (noise, source) = match stated {
        Some((slow, white)) => (RowNoise { slow, white }, "setup"),
        None => (noise_of_blocks(soaks(problem, fitted, profile))?.best, "soaks"),
    };
    let [all, spread] = of_residual(problem, noise)?;
    let bound = all * (Z * spread.sqrt()).exp();
    Some(WholeNoise { sigma_dph: all.sqrt(), bound_dph: bound.sqrt(), source: source.to_owned() })
}

/// Every soak with its own level and the terms of the model.
fn soaks(problem: &LeastSquares<'_>, fitted: &Fitted, profile: &[WindowPoint]) -> Vec<Block> {
    let is_steady = |row: &usize| {
        let point = &profile[problem.used[*row]];
        point.leg() == Leg::Steady && point.temperature_c.is_finite() && point.rate_cpm.is_finite()
    };
    let steady: Vec<usize> = (0..problem.len()).filter(is_steady).collect();
    let places = steady.iter().map(|row| (problem.run[*row], profile[problem.used[*row]].temperature_c));
    let rates = problem.rates(&values(&fitted.taus));
    let columns = fitted.terms.len() + 1;
    let block = |rows: &[usize]| {
        let value = |row: usize, column: usize| match column.checked_sub(1) {
            Some(term) => problem.regressor(&fitted.terms[term], rows[row], &rates),
            None => 1.0,
        };
        let of_rows = chosen(problem, rows);
        Block::at_right_angles(of_rows, DMatrix::from_fn(rows.len(), columns, value), |row| problem.y[rows[row]])
    };
    let stretches = level_stretches(places).into_iter().map(|stretch| &steady[stretch]);
    stretches.filter(|rows| rows.len() >= FEWEST.max(2 * columns)).filter_map(block).collect()
}

fn chosen(problem: &LeastSquares<'_>, rows: &[usize]) -> Rows {
    let all = problem.noise_rows();
    Rows {
        run: rows.iter().map(|row| all.run[*row]).collect(),
        middle_s: rows.iter().map(|row| all.middle_s[*row]).collect(),
        weight: rows.iter().map(|row| all.weight[*row]).collect(),
        longest_s: all.longest_s,
        nominal_s: all.nominal_s,
    }
}

/// Expected variance of all windows about the means of their runs, (°/h)², and the variance of its logarithm.
fn of_residual(problem: &LeastSquares<'_>, noise: RowNoise) -> Option<[f64; 2]> {
    let (rows, _) = Rows::at_most(problem.noise_rows(), MOST_ROWS);
    let n = rows.run.len();
    let runs: Vec<usize> = rows.run.chunk_by(|a, b| a == b).map(<[usize]>::len).collect();
    let mut about_runs = DMatrix::identity(n, n);
    let mut first = 0;
    for length in &runs {
        about_runs.view_mut((first, first), (*length, *length)).add_scalar_mut(-1.0 / *length as f64);
        first += length;
    }
    // White noise of the averaged rows is less than that of the windows: it is added as it is.
    let slow = (noise.slow.between(rows.view(), &about_runs) - SlowNoise::default().between(rows.view(), &about_runs))
        * noise.white;
    let degrees = (n - runs.len()) as f64;
    let of_slow = slow.trace() / degrees;
    let all = noise.white + of_slow;
    let scatter = 2.0 * (slow.norm_squared() / degrees.powi(2) + noise.white.powi(2) / problem.len() as f64);
    let estimated = noise.slow.log_variance * of_slow.powi(2);
    (degrees > 0.0 && all.is_finite() && all > 0.0).then(|| [all, (scatter + estimated) / (all * all)])
}
