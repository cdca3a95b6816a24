//! From windows to a calibration.
//!
//! ```text
//! Windows ─▶ Problem (one axis) ─▶ folds (held-out σ of every candidate of the grid) ─▶ path (further inputs, zones,
//!            steps) ─▶ solution (chosen model, covariance) ─▶ input noise ─▶ AxisCalibration
//! ```
//!
//! `docs/method.md` tells the method; each step's equation stands in its module.

mod bootstrap;
mod choose;
mod criterion;
mod effects;
mod folds;
mod further;
mod input_noise;
mod lag;
mod path;
mod plateaus;
mod problem;
mod record;
mod robust;
mod soak;
mod solution;
mod solve;
mod tradeoff;
mod turning;

pub(crate) use plateaus::{level_stretches, plateaus_of};
pub use record::{FitOptions, calibrate, calibrate_with_evidence};
pub(crate) use record::{inputs, noise_of};
pub use robust::Loss;
pub use tradeoff::{FrontierPoint, frontier};
pub(crate) use turning::{SAME_RATE, Turning};

/// A smaller model wins if its held-out mean square is within this factor of the least.
const SMALLER_WINS_WITHIN: f64 = 1.02;

use crate::model::ModelSpec;

/// Which model to fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    /// The best out of sample.
    Auto,
    /// This one.
    Fixed(ModelSpec),
}
