//! The noise budget of a log at rest.
//!
//! ```text
//! log ─▶ rows ─▶ sagnac_noise::Recorder, axis by axis ─▶ sagnac_noise::budget ─▶ NoiseBudget
//! curve of another program ─▶ sagnac_noise::budget_of_curve ─────────────────────┘
//! ```
//!
//! The mathematics is in `sagnac-noise`. This module reads logs and curves, watches for what would spoil a budget (a
//! temperature ramp, a table that turned) and takes the drift over temperature out first where that is wanted.

mod curve;
mod ramp;
mod read;

pub use curve::{budget_of_curves, is_curve, parse_curve, read_curve};
pub use read::{NoiseBudget, NoiseSoFar, Request, noise_budget};
