//! A seeded ring laser gyro with its loops and its thermal chamber: logs with a known truth.
//!
//! A [`Scenario`] describes gyro, test and faults in the units a person types. [`Scenario::build`] turns it once into
//! the constants of a [`Gyro`]. [`Gyro::start`] adds the memory and the seed and gives a [`GyroRun`], which produces
//! the rows of a log ([`log`]) and, in a file of its own, the truth.
//!
//! ```text
//! scenario.toml ─▶ Scenario ─build▶ Gyro ─start▶ GyroRun ─each_row▶ log.csv, truth.csv
//!                     │
//!                     ├─build▶ LoopDesign ─start▶ LoopState      the loops alone   [plant]
//!                     └─build▶ Beat ─start▶ BeatState            the beat alone    [beat]
//! ```
//!
//! The fitter only gets a log and never sees the truth. The truth is not the fitter's polynomial: the block lags the
//! chamber, the bias has a knee, hysteresis, mode steps and ripple, and angle is counted in whole counts.
//!
//! Random numbers come from ChaCha8, one stream per source. sin, cos, exp and the normal generator are those of `libm`.
//! The same scenario and seed give the same bytes on any machine and any number of threads.
//!
//! # Modules
//!
//! Each module uses only modules above it: configuration, then what is built from it, then what runs.
//!
//! ```text
//! physics     random     profile
//!    └───────┐  │  ┌────────┘
//!            scenario                        configuration
//!     ┌──────┬──┴───┬───────┐
//!  thermal  noise  plant  beat               parts: build, start, advance
//!     └──────┴──┬───┴───────┘
//!              gyro ─▶ log                   a test, and its files
//!
//! rigs  (physics, random, profile, scenario, noise)
//! ```
//!
//! | module | purpose |
//! |---|---|
//! | [`physics`] | Closed forms of the ring laser, used by the parts and asserted in the tests. |
//! | `random` | Seeded streams of uniform and normal values that are equal on every machine. |
//! | [`profile`] | Chamber temperature over time, from soaks and ramps. |
//! | [`scenario`] | What a person types: every table and key with its range, and the checks. |
//! | [`thermal`] | Block, anode region and thermometers that follow the chamber. |
//! | `noise` | Flicker, rate random walk and rate ramp of the bias. |
//! | [`plant`] | Cavity, actuator and discharge, both loops designed for them, and their frequency sweep. |
//! | [`beat`] | Phase of the beat through dither, lock-in, counter and stripping. |
//! | [`gyro`] | All parts together: the test of a gyro, second by second and row by row. |
//! | [`log`] | Rows of log and truth as CSV text. |
//! | [`rigs`] | Small rigs of a few equations, for tests of the fitter. |
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod beat;
pub mod gyro;
pub mod log;
pub(crate) mod noise;
pub mod physics;
pub mod plant;
pub mod profile;
pub(crate) mod random;
pub mod rigs;
pub mod scenario;
pub mod thermal;

pub use beat::{Beat, BeatState, BeatTick};
pub use gyro::{ERROR_SOURCES, Gyro, GyroRun, LogRow, LoopSecond, Second};
pub use log::{BlockWriter, LogText, truth_header, write_truth};
pub use physics::RingShape;
pub use plant::{Bode, BodePoint, LoopAverages, LoopDesign, LoopName, LoopState, PlantConditions};
pub use profile::{Leg, Profile};
pub use rigs::{Factory, LaggedChamber, ManyInputs, PaperRig, RateTable, Resting, Row, csv_bytes, write_csv};
pub use scenario::{
    Actuator, AxisDirection, BeatModel, BiasConfig, BlockConfig, CavityConfig, ChamberConfig, ChamberLeg,
    CountsPerFringe, DitherConfig, ElectronicsConfig, Fault, FaultKind, Fidelity, GeometryConfig, InputConfig,
    IntensityControlConfig, KeyDoc, LoopModel, NoiseConfig, PathLengthControlConfig, RateTableLeg, ReadoutConfig,
    RunConfig, ScaleFactorConfig, Scenario, ScenarioError, SensorLocation, TICK_S, TableDoc, ThermometerConfig, manual,
};
pub use thermal::Temperatures;

pub use sagnac_loops::{IntensityDesign, IntensityStatus, PathLengthDesign, PathLengthStatus};
