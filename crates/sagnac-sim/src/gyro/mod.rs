//! A thermal test of the gyro: chamber, loops, errors and counts, row by row.
//!
//! ```text
//! every second    chamber ─▶ block, anode ─▶ thermometers
//!                 loops ─▶ actuator, mode, light, current
//!                 bias = Σ errors            ε = −1e6·(mode/m) + sawtooth·actuator
//! every row       count level: angle = (input + bias)·dt + N·√dt·normal, counts = ⌊Σ angle/(S₀(1 + ε·1e-6))⌋, differenced
//!                 beat level:  that rate through the optics, tick by tick, stripped
//! ```
//!
//! The input is Ω; N is the angle random walk of dithered lock-in and of the scenario together. Without dither, or if
//! it fails, the counter sees Adler's mean rate, which is 0 inside the dead band.
//!
//! Only the beat level has the beat itself, dynamic lock-in zones, and the walk within a dither period. Sources of each
//! equation are in `bias.rs`, [`crate::physics`] and [`crate::plant`].
//!
//! [`Scenario::build`](crate::scenario::Scenario::build) makes a [`Gyro`] of constants; [`Gyro::start`] gives a [`GyroRun`],
//! which holds the memory:
//!
//! ```
//! use sagnac_sim::{GyroRun, Scenario, ScenarioError};
//!
//! let toml = "
//! [geometry]
//! perimeter_m = 0.28
//! [[thermometer]]
//! [chamber]
//! leg = [{ soak_s = 100 }]
//! [input]
//! rate_dph = 3600.0
//! ";
//! let scenario = Scenario::from_toml(toml)?;
//! let mut run: GyroRun = scenario.build()?.start(1);
//! let mut counts = 0;
//! run.each_row(|row, _truth| {
//!     counts += row.counts;
//!     Ok::<(), ScenarioError>(())
//! })?;
//! // 100 s at 1 °/s, reduced by lock-in: this gyro has no dither.
//! let ideal = 100.0 * 3600.0 / scenario.arcsec_per_count();
//! let locked = 1.0 - (scenario.lock_in_dph() / 3600.0).powi(2);
//! assert!((counts as f64 / (ideal * locked.sqrt()) - 1.0).abs() < 1e-4);
//! # Ok::<(), ScenarioError>(())
//! ```

mod bias;
mod build;
mod counter;
mod faults;
mod input;
mod loops;
mod rows;
mod second;

pub use bias::ERROR_SOURCES;
pub use build::Gyro;
pub use loops::LoopSecond;
pub use rows::{GyroRun, LogRow};
pub use second::Second;
