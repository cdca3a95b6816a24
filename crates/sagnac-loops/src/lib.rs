//! Tasks of a gyro's processor besides the thermal correction: cavity and discharge control, fringe counting, dither
//! stripping.
//!
//! ```text
//! photodiode sum ─┬─▶ synchronous detector ─▶ PI ─▶ path-length actuator (+ modulation)      [path_length]
//!                 └─▶ mean over a period   ─▶ PI ─▶ discharge current (or pump)              [intensity]
//! A/B photodiodes ──▶ quadrature counter ──▶ counts ─┐
//! dither pickoff ────────────────────────────────────┴─▶ counts of whole dither periods      [quadrature, strip]
//! ```
//!
//! Each loop has three parts:
//!
//! * A configuration in SI units ([`PathLengthConfig`], [`IntensityConfig`]; feature `design`). Its `build` checks it and
//!   computes the gains.
//! * An immutable table of integers ([`PathLength`], [`Intensity`]), which the target reads from bytes ([`LoopTable`]).
//! * A state.
//!
//! A tick takes the table, the state and one converter code, and returns one converter code and a status. It runs in
//! bounded time, without allocation, floating point, `unsafe` or a panic path. `cargo xtask no-panic` checks this for all
//! but the design, because libm and the printing of floats have panic paths.
//!
//! Codes are those of the converters: any width up to [`MAX_CODE`]. Signs: more path-length code is a longer path; more
//! current code is more light.
//!
//! The crate accesses no converter and no timer: the caller calls it every tick.
//!
//! Two examples to copy from are in `examples/`: `lock_cavity` designs the path-length loop and locks a simulated
//! cavity; `strip_dither` counts fringes and removes the dither.
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

#[cfg(feature = "design")]
mod design;
mod gain;
mod intensity;
mod lockin;
mod path_length;
mod quadrature;
mod status;
mod strip;
mod table;

#[cfg(feature = "design")]
pub use design::{DesignError, LoopGoal, PiGains, Plant, open_loop, pi_gains};
pub use gain::LoopGain;
pub use intensity::{Intensity, IntensityOutput, IntensityPhase, IntensityState, IntensityStatus};
#[cfg(feature = "design")]
pub use intensity::{IntensityConfig, IntensityDesign};
pub use lockin::{Detector, MAX_TICKS_PER_PERIOD, Reference, Sums};
pub use path_length::{PathLength, PathLengthOutput, PathLengthPhase, PathLengthState, PathLengthStatus};
#[cfg(feature = "design")]
pub use path_length::{PathLengthConfig, PathLengthDesign};
pub use quadrature::{Counting, Quadrature, QuadratureState};
pub use strip::{Stripped, Stripper};
pub use table::{LoopTable, TABLE_LEN, TABLE_MAGIC, TABLE_VERSION, TableError};

/// Input codes beyond ± this are clamped. A 24-bit converter fits.
pub const MAX_CODE: i32 = 1 << 23;
