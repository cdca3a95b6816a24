//! Thermal calibration of ring laser gyros, on the host.
//!
//! ```text
//! log ─ingest▶ LogReader ─window▶ Windows ─fit▶ Calibration ─export▶ Image ─▶ Compensator (sagnac-core)
//!           └─allan▶ NoiseBudget     └─allan▶ ShortTau (N, Q, floor)               │
//! retest log ─────────────────── verify: replays through that same Compensator ◀───┘ ─▶ Verification
//! ```
//!
//! A folder per arrow. The library reads and writes what it is given; it holds no terminal and no clock,
//! and its threads only parse a log ahead of the one that asked for it. Sign: `d` is the bias drift referred to the input in °/h, positive as the input
//! rate; `ε` in ppm is the deviation of the scale factor S = S0·(1 + ε·1e-6), so ε > 0 means fewer
//! counts for the same angle. `docs/explanation/method.md` tells the method, `docs/explanation/verification.md` the proof.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod allan;
pub mod calibration;
pub mod compare;
pub mod diagnostics;
pub mod export;
pub mod fit;
pub mod model;
pub mod verify;
pub mod window;

pub use sagnac_log::{Error, ErrorKind, Place, Result};
