//! What runs on the gyro: from a thermometer's code to the corrected count, in integers only.
//!
//! ```text
//!             every Δt (slow path)                                         every tick (fast path)
//! code ─▶ Thermometer ─▶ T ─▶ Lag ─▶ Ṫ ─┐                                 raw counts
//!                        └──▶ x ────────┴▶ series ─▶ k, increment ─(slew)─▶ acc += raw·k − increment ─▶ whole counts
//! ```
//!
//! The measurement model is the one of IEEE Std 647/952 turned round,
//! `n' = n·(1 + ε·1e-6) − d·dt/S0`, with the bias drift `d` in °/h and the scale-factor deviation
//! `ε` in ppm given as Chebyshev series of temperature, optionally times the temperature rate, with zones, steps and harmonics
//! beside them. What is called a thermometer may be the difference of two of them, or another number with a code.
//!
//! * [`Image`] is what flash holds: a validated, immutable table of thermometers and terms.
//!   If you have one, the arithmetic below cannot overflow; every check is made when it is built.
//! * [`Compensator`] holds an image and no memory; [`State`] is the memory. A new image can be
//!   swapped in between two ticks ([`Compensator::take_over`]).
//! * Everything is `i32`/`i64`; there is no allocation, no floating point, no `unsafe` and no panic
//!   path (a link check in `cargo xtask no-panic` holds that).
//!
//! Widths, rounding and ranges are listed in `docs/explanation/arithmetic.md`, bytes in `docs/reference/image-format.md`.
//!
//! What it does not do: count pulses, strip dither, read a thermometer or write flash.
//!
//! ```
//! use sagnac_core::{Compensator, Description, Image, State};
//!
//! // An image without terms corrects nothing: counts pass through.
//! let image = Image::new(Description::empty()).unwrap();
//! let gyro = Compensator::new(image);
//! let mut state = State::new();
//! gyro.update(&mut state, &[]).unwrap();
//! assert_eq!(gyro.tick(&mut state, 7).unwrap().counts, 7);
//! ```
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod bank;
pub mod bytes;
mod codec;
mod compensator;
mod harmonic;
mod image;
mod rounding;
mod series;
mod status;
mod thermometer;

pub use bank::{BANK_LEN, BankReport, Banks, Gyro, Loaded, Origin, REGION_ALIGNMENT, StoreError, Unfit};
pub use codec::{DecodeError, FORMAT_MINOR, FORMAT_VERSION, MAGIC, MAX_IMAGE_LEN};
pub use compensator::{Compensator, MAX_RAW, Misuse, Output, State};
pub use harmonic::MAX_TURNS_Q18;
pub use image::{
    Description, Image, ImageError, Kind, MAX_INCREMENT, MAX_TERMS, MAX_THERMOMETERS, Multiplier, Shape, Term,
};
pub use series::MAX_ORDER;
pub use status::Status;
pub use thermometer::{LagSpec, Scale, Source, Thermometer};
