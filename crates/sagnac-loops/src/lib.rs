//! What a gyro's processor does besides compensation: hold the cavity, hold the discharge, count, strip dither.
//!
//! ```text
//! photodiode sum ─┬─▶ synchronous detector ─▶ PI ─▶ path-length actuator (+ modulation)      [path_length]
//!                 └─▶ mean over a period   ─▶ PI ─▶ discharge current (or pump)              [intensity]
//! A/B photodiodes ──▶ quadrature counter ──▶ counts ─┐
//! dither pickoff ────────────────────────────────────┴─▶ counts of whole dither periods      [quadrature, strip]
//! ```
//!
//! Each loop comes in three parts, as configured, built and running: a configuration in SI units
//! ([`PathLengthConfig`], [`IntensityConfig`]; feature `design`), whose `build` checks it and finds the gains; an
//! immutable table of integers ([`PathLength`], [`Intensity`]), which is what a target holds and reads from bytes
//! ([`LoopTable`]); and a state. A tick
//! takes the table, the state and one converter code and gives one converter code and a status, in bounded time,
//! without allocation, floating point, `unsafe` or a panic path (`cargo xtask no-panic`; the design is not part of that:
//! libm and the printing of floats have panic paths).
//!
//! Codes are those of the converters: any width up to [`MAX_CODE`]. Signs: more path-length code is a longer path;
//! more current code is more light.
//!
//! What it does not do: talk to converters, or know which tick it is; the caller calls it every tick.
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
pub use design::{DesignError, Pi, Plant, Wanted, open_loop, pi_gains};
pub use gain::Gain;
pub use intensity::{Intensity, IntensityOutput, IntensityPhase, IntensityState, IntensityStatus};
#[cfg(feature = "design")]
pub use intensity::{IntensityConfig, IntensityDesign};
pub use lockin::{Detector, MAX_TICKS_PER_PERIOD, Reference, Sums};
pub use path_length::{PathLength, PathLengthOutput, PathLengthPhase, PathLengthState, PathLengthStatus};
#[cfg(feature = "design")]
pub use path_length::{PathLengthConfig, PathLengthDesign};
pub use quadrature::{Multiplier, Quadrature, QuadratureState};
pub use strip::{Stripped, Stripper};
pub use table::{LoopTable, TABLE_LEN, TABLE_MAGIC, TABLE_VERSION, TableError};

/// Converter codes beyond ± this are clamped on their way in: a 24-bit converter fits.
pub const MAX_CODE: i32 = 1 << 23;
