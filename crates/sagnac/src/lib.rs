//! Thermal calibration of ring laser gyros, on the host.
//!
//! ```
//! use sagnac::{Limits, Model, Setup};
//!
//! # let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/chamber");
//! # std::env::set_current_dir(root).unwrap();
//! let bench = Setup::read("bench.toml")?;
//! let calibration = sagnac::calibrate(&bench, ["cycle-1.csv.gz", "cycle-2.csv.gz"], Model::Auto)?;
//! let proof = calibration.verify(["retest.csv.gz"])?.limits(&Limits::read("limits.toml")?)?;
//! let image = calibration.image('z')?;
//! assert!(proof.passed() && calibration.evaluate(25.0, 0.0)?.drift_dph == 0.0);
//! assert_eq!(image.len(), 256);
//! # Ok::<(), sagnac::Error>(())
//! ```
//!
//! The modules, each using those before it (ARCHITECTURE.md):
//!
//! ```text
//! log ─window▶ Windows ─▶ model ─▶ calibration ─▶ diagnostics ─fit▶ Calibration ─image▶ Image ─▶ Compensator (sagnac-core)
//! retest log ──────────────────────────────── verify: replays through that same Compensator ◀──┘ ─▶ Proof
//! ```
//!
//! The library reads and writes the given files only; it uses no terminal and no clock. Its threads parse a log ahead of the
//! caller, and distribute fits over the caller's rayon pool. Sign: `d` is the bias drift referred to the input in °/h,
//! positive as the input rate; `ε` in ppm is the deviation of the scale factor S = S0·(1 + ε·1e-6), so ε > 0 means fewer
//! counts for the same angle. `docs/explanation/method.md` has the method, `docs/explanation/verification.md` the verification.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod allan;
pub mod calibration;
pub mod compare;
pub mod diagnostics;
pub mod export;
pub mod fit;
pub mod fleet;
mod image;
pub mod model;
mod noise_model;
pub mod notes;
pub mod plan;
mod rate_table;
pub mod survey;
pub mod verify;
pub mod window;
mod workflow;

pub use allan::NoiseBudget;
pub use calibration::{AxisCalibration, Calibration, Evaluation};
pub use fit::{FitOptions, Model};
pub use sagnac_log::{Error, ErrorKind, Place, Result, Setup};
pub use sagnac_noise::Taus;
pub use verify::{Limits, Proof, Verification};
// Types of these crates are in our signatures: readers and setup, deviations, the target's image.
pub use workflow::{allan, calibrate};
pub use {sagnac_core, sagnac_log, sagnac_noise};
