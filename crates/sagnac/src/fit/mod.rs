//! From windows to a calibration.
//!
//! ```text
//! Windows ─▶ Problem (one axis) ─▶ folds (held-out σ of every candidate of the grid) ─▶ path (further inputs, zones,
//!            steps) ─▶ solution (chosen model, covariance) ─▶ input noise ─▶ AxisCalibration
//! ```
//!
//! `docs/explanation/method.md` tells the method; each step's equation stands in its module.

mod basis;
mod bootstrap;
mod choose;
mod cost;
mod criterion;
mod effects;
mod folds;
mod further;
mod input;
mod input_noise;
mod lag;
mod model;
mod monomial;
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

pub use basis::{BASIS_LEN, Span, chebyshev};
pub use cost::{TICK_INSTRUCTIONS, WITHIN as PRICED_WITHIN, Work};
pub(crate) use input::{label, unit_exponent, zone};
pub use model::{MAX_RATE_ORDER, ModelSpec};
pub(crate) use monomial::{powers_from_series, series_from_powers};
pub(crate) use plateaus::{level_stretches, plateaus_of};
pub use record::{FitOptions, calibrate, calibrate_with_evidence};
pub(crate) use record::{inputs, noise_of, program};
pub use robust::Loss;
pub use tradeoff::{FrontierPoint, frontier};
pub(crate) use turning::{SAME_RATE, Turning};

/// A smaller model wins if its held-out mean square is within this factor of the least.
const SMALLER_WINS_WITHIN: f64 = 1.02;

/// Which model to fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    /// The best out of sample.
    Auto,
    /// This one.
    Fixed(ModelSpec),
}
