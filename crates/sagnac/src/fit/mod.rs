//! From windows to a calibration.
//!
//! ```text
//! Windows ─▶ Problem (one axis) ─▶ folds (held-out σ of every candidate) ─▶ solution (chosen model,
//!            covariance) ─▶ AxisCalibration
//! ```
//!
//! `docs/method.md` tells the method; each step's equation stands in its module.

mod basis;
mod bootstrap;
mod cost;
mod folds;
mod lag;
mod model;
mod monomial;
mod plateaus;
mod problem;
mod record;
mod robust;
mod soak;
mod solution;
mod solve;
mod tradeoff;
mod turning;

pub use basis::{BASIS_LEN, Span, chebyshev};
pub use cost::{TICK_INSTRUCTIONS, WITHIN as PRICED_WITHIN, slow_update_instructions};
pub use model::{MAX_RATE_ORDER, ModelSpec};
pub(crate) use monomial::{powers_from_series, series_from_powers};
pub(crate) use plateaus::{level_stretches, plateaus_of};
pub use record::{FitOptions, calibrate, calibrate_with_evidence};
pub(crate) use record::{inputs, noise_of, program};
pub use robust::Loss;
pub use tradeoff::{FrontierPoint, frontier};
pub(crate) use turning::{SAME_RATE, Turning};

use crate::error::{Error, Result};
use crate::fit::folds::cross_validate;
use crate::fit::problem::{Level, Problem};

/// A smaller model wins if its held-out mean square is within this factor of the least.
const SMALLER_WINS_WITHIN: f64 = 1.02;

/// Which model to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    /// The best out of sample.
    Auto,
    /// This one.
    Fixed(ModelSpec),
}

/// What was tried, and what was taken.
struct Selection {
    chosen: usize,
    specs: Vec<ModelSpec>,
    mean_square: Vec<Option<f64>>,
    scheme: &'static str,
    folds: usize,
}

/// Tries what is asked for.
fn select(problem: &Problem<'_>, choice: ModelChoice, taus_s: &[f64]) -> Result<Selection> {
    let affordable = |spec: &ModelSpec| problem.len() >= 3 * (problem.levels.len() + spec.coefficients());
    let specs: Vec<ModelSpec> = match choice {
        ModelChoice::Fixed(spec) => vec![spec],
        ModelChoice::Auto => {
            let with_scale = problem.place_of(Level::Scale).is_some();
            ModelSpec::candidates(problem.has_rate(), with_scale).into_iter().filter(affordable).collect()
        }
    };
    if specs.is_empty() {
        return Err(Error::refused(format!(
            "{} windows in {} runs are too few even for constants; a fit needs three windows for each coefficient",
            problem.len(),
            problem.runs.len()
        ))
        .help("give more data or a shorter --window"));
    }
    let held_out = cross_validate(problem, &specs, taus_s);
    if choice == ModelChoice::Auto && held_out.mean_square.iter().all(Option::is_none) {
        return Err(Error::refused("no candidate can be fitted with a part of the data held out")
            .help("give more data over more temperatures, or a fixed --model"));
    }
    let least = held_out.mean_square.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    // Specs stand smallest first; within one size no rate term, then the lower mean square wins.
    let good = (0..specs.len()).filter(|i| held_out.mean_square[*i].is_some_and(|m| m <= SMALLER_WINS_WITHIN * least));
    let chosen = good
        .min_by(|a, b| {
            // Of equal size the one without a lag to be found wins: a slow lag can look like a curve.
            let key = |i: usize| (specs[i].coefficients(), specs[i].rate.is_some());
            let square = |i: usize| held_out.mean_square[i].unwrap_or(f64::INFINITY);
            key(*a).cmp(&key(*b)).then(square(*a).total_cmp(&square(*b)))
        })
        .unwrap_or(0);
    Ok(Selection { chosen, specs, mean_square: held_out.mean_square, scheme: held_out.scheme, folds: held_out.folds })
}
