//! From windows to a calibration.
//!
//! ```text
//! Windows ─▶ problem (one axis as rows and columns) ─▶ selection (which model, in cross-validation and by grades) ─▶ one_model (its lags,
//!            coefficients, covariance) ─▶ uncertainty (what selection and test design add) ─▶ record (AxisCalibration)
//! prior:     instead of selection and one_model for a unit whose fleet says something
//! ```
//!
//! `docs/explanation/method.md` describes the method; the equation of each step is in its module.

mod calibrate;
mod one_model;
mod options;
mod prior;
mod problem;
mod progress;
mod record;
mod selection;
mod uncertainty;

pub use calibrate::{calibrate, calibrate_with_report_data};
pub(crate) use one_model::input_noise::thermometer_noise;
pub use options::{FitOptions, Model};
pub(crate) use problem::exclusions::{READINGS_HOLD, readings_do_not_hold};
pub(crate) use problem::unit_prior::ln_of_residual;
pub use problem::unit_prior::{ResidualOfFleet, UnitPrior};
pub use progress::{Doing, Progress};
pub use record::tradeoff::{FrontierPoint, frontier};
