//! Truth: a seeded ring laser gyro with its loops and its thermal chamber.
//!
//! ```text
//! scenario.toml ─▶ Scenario ─┬─▶ count level: chamber ─▶ block ─▶ errors, mode, scale ─▶ counts per interval  [count]
//!                            │                    plant of the loops, ideal or running sagnac-loops           [plant]
//!                            └─▶ beat level: dither + backscatter ─▶ phase ─▶ counter ─▶ stripping            [beat]
//!                                                     log (what a lab would have) + truth (its own file)      [log]
//! ```
//!
//! What fits and proves never sees what is in here; it gets a log. The truth is not the fitter's polynomial: block
//! temperature lags, bias has a knee, hysteresis, mode steps and ripple, and counts are counted.
//!
//! Random numbers come from ChaCha8 with a stream per source (module `noise`); sin, cos, exp and the normal generator are
//! those of `libm`: the same scenario and seed give the same bytes on any machine and any number of threads.
//!
//! [`rigs`] are two small rigs for tests of the fitter.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod beat;
pub mod fault;
pub mod gyro;
pub mod log;
pub(crate) mod noise;
pub mod physics;
pub mod plant;
pub mod rigs;
pub mod scenario;
pub mod thermal;

pub use rigs::{LaggedChamber, PaperRig, RateTable, Resting, Row, csv_bytes, write_csv};
pub use scenario::{Problem, Scenario};
pub use thermal::Leg;

/// Tick of the gyro's processor, s.
pub const TICK_S: f64 = 1e-4;
