//! From windows to a calibration.
//!
//! ```text
//! Windows ─▶ LeastSquares (one axis) ─▶ folds (held-out σ of every candidate of the grid) ─▶ path (other inputs, zones,
//!            steps) ─▶ solution (chosen model, covariance) ─▶ input noise ─▶ AxisCalibration
//! ```
//!
//! `docs/explanation/method.md` describes the method; the equation of each step is in its module.

mod allowed_inputs;
mod averaging;
mod choose;
mod correction;
mod criterion;
mod design;
mod effects;
mod entanglement;
mod exclusions;
mod folds;
mod grid;
mod input_noise;
mod known_rates;
mod lag;
mod least_squares;
mod likelihood;
mod minimum;
mod monomial;
mod nuisance;
mod period;
mod plateau_noise;
mod plateaus;
mod prepared;
mod progress;
mod rate_table_input;
mod record;
mod rivals;
mod robust;
mod row_noise;
mod screening;
mod search;
mod slow_noise;
mod soak;
mod solution;
mod solve;
mod tradeoff;
mod two_lags;
mod warm_up;
mod with_prior;

pub(crate) use input_noise::thermometer_noise;
pub(crate) use least_squares::{READINGS_HOLD, readings_do_not_hold};
pub(crate) use likelihood::{Block, Rows, mean};
pub(crate) use plateaus::{level_stretches, plateaus_of};
pub use progress::{Doing, Progress};
pub(crate) use rate_table_input::{RateTableInput, SAME_RATE};
pub use record::{FitOptions, calibrate, calibrate_with_report_data};
pub(crate) use record::{log_files, noise_of, stated_noise};
pub use robust::Loss;
pub(crate) use row_noise::{Estimated, noise_of_blocks};
pub(crate) use slow_noise::SlowNoise;
pub use tradeoff::{FrontierPoint, frontier};
pub(crate) use with_prior::ln_of_residual;
pub use with_prior::{ResidualOfFleet, UnitPrior};

/// A smaller model wins if its held-out mean square is within this factor of the least.
const SMALLER_WINS_WITHIN: f64 = 1.02;

use sagnac_log::error::{Error, Result};

use crate::model::ModelSpec;

/// Which model to fit.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// The best in cross-validation.
    Auto,
    /// This one.
    Fixed(ModelSpec),
}

impl std::fmt::Display for Model {
    /// As [`std::str::FromStr`] reads it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Fixed(spec) => spec.fmt(f),
        }
    }
}

impl std::str::FromStr for Model {
    type Err = Error;

    /// `auto`, or the words of `--model`.
    fn from_str(text: &str) -> Result<Self> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Fixed) }
    }
}
