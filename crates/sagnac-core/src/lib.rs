//! What runs on the gyro: from the code of a thermometer to the corrected count, in integers only.
//!
//! ```text
//!            every Δt (slow path)                                      every tick (fast path)
//! code ─▶ input ─▶ T ─▶ lag ─▶ Ṫ ─┐                                  raw counts
//!                  └──▶ x ────────┴▶ terms ─▶ k, increment ─(slew)─▶ acc += raw·k − increment ─▶ whole counts
//! ```
//!
//! The measurement model is that of IEEE Std 647/952, solved for the correction: `n' = n·(1 + ε·1e-6) − d·dt/S0`. The bias drift `d` in
//! °/h and the scale-factor deviation `ε` in ppm are sums of terms. A term is a coefficient times a function of one input
//! (Chebyshev polynomial, zone, step or harmonic), optionally times the rate of that input. An input is a temperature, the
//! difference of two inputs, or any other number with a code.
//!
//! * [`Image`] is what flash holds: a validated, immutable table of inputs and terms. [`Image::new`] makes every check, so the
//!   arithmetic that follows cannot overflow.
//! * [`Compensator`] holds an image and no memory; [`State`] is the memory. To change the image between two ticks, make a new
//!   compensator and call [`Compensator::migrate_state`].
//! * [`Banks`] keeps two images in flash, so that a power cut during an update never leaves the gyro without one.
//! * Everything is `i32`/`i64`. There is no allocation, no floating point, no `unsafe` and no panic path (`cargo xtask no-panic`
//!   checks that at link time).
//!
//! `docs/explanation/arithmetic.md` lists widths, rounding and ranges; `docs/reference/image-format.md` lists the bytes.
//!
//! It does not count pulses, strip dither, read a sensor or drive a flash part.
//!
//! ```
//! use sagnac_core::{Compensator, Description, Image, State};
//!
//! // An image without terms corrects nothing: counts pass through.
//! let image = Image::new(Description::empty())?;
//! let compensator = Compensator::new(image);
//! let mut state = State::new();
//! compensator.update(&mut state, &[])?;
//! assert_eq!(compensator.tick(&mut state, 7)?.counts, 7);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Two examples to copy from are in `examples/`: `correct_pulses` loads an image and corrects a minute of pulses; `flash_banks` stores
//! images in flash, rolls back and survives a cut store.
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod bank;
pub mod bytes;
mod checksum;
mod codec;
mod compensator;
mod error_bound;
mod harmonic;
mod image;
mod input;
mod rounding;
mod series;
mod signature;
mod slow_update;
mod status;
mod watch;
mod work;

pub use bank::{
    BANK_LEN, BankReport, Banks, Gyro, ImageMismatch, Loaded, Origin, REGION_ALIGNMENT, StoreError, TRIAL_STARTS,
};
pub use codec::{DecodeError, FORMAT_MINOR, FORMAT_VERSION, MAGIC, MAX_IMAGE_LEN};
pub use compensator::{Compensator, MAX_RAW, Misuse, Output, State};
pub use error_bound::{ErrorBound, UNBOUNDED};
pub use harmonic::MAX_TURNS_Q18;
pub use image::{
    Description, Image, ImageError, Kind, MAX_INCREMENT, MAX_INPUTS, MAX_SCALE, MAX_TERMS, Multiplier, Shape, Term,
};
pub use input::{Gain, InputSpec, LagSpec, STEADY_UPDATES, ValueSource};
pub use series::MAX_ORDER;
pub use signature::{
    CHALLENGE_LEN, MAX_SIGNED_LEN, NoKey, SIGNATURE_LEN, SignatureBlock, SignatureError, SignedMessage, Trust, Trusted,
    key_id, service_message,
};
pub use slow_update::SlowUpdate;
pub use status::Status;
pub use watch::{MOST_VOTERS, Vote, Watch, WatchSpec, vote};
pub use work::Work;
