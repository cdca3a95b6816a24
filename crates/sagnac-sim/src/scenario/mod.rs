//! `scenario.toml`: gyro, test and faults in one file. This is the configuration; nothing here runs.
//!
//! Every table and key is declared once, in `tables.rs`, with default, range, unit and source. The same declaration
//! reads the file, checks the value and writes the manual ([`manual()`], `docs/reference/scenario.md`).
//!
//! A [`Scenario`] is what a person types, in Hz, V, s and °C. Reading refuses unknown keys, values out of range and
//! profiles that no chamber can follow, and names the key. [`Scenario::build`] turns it into a gyro and refuses what
//! cannot be built, such as a loop without the wanted phase margin.
//!
//! Fields are public, so that a program can change a scenario after reading it; `build` checks it again.

mod check;
mod error;
mod fault;
mod manual;
mod section;
mod tables;

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use serde::Deserialize;

pub use error::ScenarioError;
pub use fault::{Fault, FaultKind};
pub use manual::{TableDoc, manual};
pub use section::KeyDoc;
pub use tables::{
    Actuator, AxisDirection, BeatModel, BiasConfig, BlockConfig, CavityConfig, ChamberConfig, ChamberLeg,
    CountsPerFringe, DitherConfig, ElectronicsConfig, Fidelity, GeometryConfig, InputConfig, IntensityControlConfig,
    LoopModel, NoiseConfig, PathLengthControlConfig, RateTableLeg, ReadoutConfig, RunConfig, ScaleFactorConfig,
    SensorLocation, ThermometerConfig,
};

use crate::physics;

/// Tick of the gyro's processor, s.
pub const TICK_S: f64 = 1e-4;
/// Temperature at which the nominal values of a scenario apply, °C.
pub const REFERENCE_C: f64 = 25.0;

/// A scenario as it is in the file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Name.
    pub name: String,
    /// Description, one line.
    pub description: String,
    /// Seed of the random numbers, unless the program gives another.
    pub seed: u64,
    /// Level of detail and interval of the rows.
    pub run: RunConfig,
    /// Geometry of the ring.
    pub geometry: GeometryConfig,
    /// Losses, gain and backscatter.
    pub cavity: CavityConfig,
    /// Mechanical dither.
    pub dither: DitherConfig,
    /// Photodiodes and counter.
    pub readout: ReadoutConfig,
    /// Thermal expansion and lag of the block.
    pub block: BlockConfig,
    /// Bias by cause.
    pub bias: BiasConfig,
    /// Scale-factor errors.
    pub scale_factor: ScaleFactorConfig,
    /// Path-length control.
    pub path_length: PathLengthControlConfig,
    /// Intensity control.
    pub intensity: IntensityControlConfig,
    /// Noise.
    pub noise: NoiseConfig,
    /// Thermometers.
    pub thermometer: Vec<ThermometerConfig>,
    /// Clock and counter.
    pub electronics: ElectronicsConfig,
    /// Thermal chamber.
    pub chamber: ChamberConfig,
    /// Input rate.
    pub input: InputConfig,
    /// Faults.
    pub fault: Vec<Fault>,
}

impl FromStr for Scenario {
    type Err = ScenarioError;

    /// [`Scenario::from_toml`].
    fn from_str(text: &str) -> Result<Self, ScenarioError> {
        Self::from_toml(text)
    }
}

impl Scenario {
    /// Reads a scenario from TOML and checks it.
    ///
    /// # Errors
    /// Invalid TOML, an unknown key, a value out of range, an impossible profile; with key or line.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().and_then(|span| text.get(..span.start)).map(|before| 1 + before.matches('\n').count());
            ScenarioError { line: line.map(|line| line as u64), ..ScenarioError::new("", e.message().trim_end()) }
        })?;
        scenario.check()?;
        Ok(scenario)
    }

    /// Reads a scenario file and checks it.
    ///
    /// # Errors
    /// A file that cannot be read or is not UTF-8; what [`Self::from_toml`] refuses.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, ScenarioError> {
        /// A scenario has some kilobytes; a device may have no end.
        const MOST_BYTES: u64 = 1 << 20;
        let path = path.as_ref();
        let mut text = String::new();
        let file = File::open(path).and_then(|file| file.take(MOST_BYTES + 1).read_to_string(&mut text));
        let read = file.map_err(|e| ScenarioError::new("", format!("cannot read {}: {e}", path.display())))?;
        if read as u64 > MOST_BYTES {
            let message = format!("cannot read {}: more than {MOST_BYTES} bytes are no scenario", path.display());
            return Err(ScenarioError::new("", message));
        }
        Self::from_toml(&text)
    }

    /// Whether there is a dither: a frequency and an amplitude.
    pub fn is_dithered(&self) -> bool {
        self.dither.frequency_hz > 0.0 && self.dither.amplitude_arcsec > 0.0
    }

    /// Rotation per fringe, arcsec.
    pub fn arcsec_per_fringe(&self) -> f64 {
        physics::arcsec_per_fringe(self.geometry.shape, self.geometry.perimeter_m, self.geometry.wavelength_um * 1e-6)
    }

    /// Nominal scale factor S₀, arcsec per count.
    pub fn arcsec_per_count(&self) -> f64 {
        self.arcsec_per_fringe() / self.readout.counting.per_fringe()
    }

    /// Lock-in threshold, °/h ([`physics::lock_in_dph`]).
    pub fn lock_in_dph(&self) -> f64 {
        let c = &self.cavity;
        let r = [c.backscatter_1_ppm * 1e-6, c.backscatter_2_ppm * 1e-6];
        let epsilon = [c.backscatter_phase_1_deg.to_radians(), c.backscatter_phase_2_deg.to_radians()];
        physics::lock_in_dph(self.geometry.perimeter_m, self.arcsec_per_fringe(), r, epsilon)
    }

    /// Total angle random walk, °/√h: that of dithered lock-in and `noise.arw_deg_rt_h`, as root sum of squares.
    pub fn arw_deg_rt_h(&self) -> f64 {
        let d = &self.dither;
        let lock_in = if self.is_dithered() {
            physics::dithered_arw_deg_rt_h(
                self.lock_in_dph(),
                self.arcsec_per_fringe(),
                d.frequency_hz,
                d.amplitude_arcsec,
            )
        } else {
            0.0
        };
        libm::hypot(lock_in, self.noise.arw_deg_rt_h)
    }

    /// Constant input rate, °/h: `input.rate_dph` and the Earth's rate along the input axis.
    pub fn input_dph(&self) -> f64 {
        let latitude = self.input.latitude_deg.to_radians();
        self.input.rate_dph
            + match self.input.direction {
                AxisDirection::None => 0.0,
                AxisDirection::Up => physics::EARTH_RATE_DPH * libm::sin(latitude),
                AxisDirection::North => physics::EARTH_RATE_DPH * libm::cos(latitude),
            }
    }
}
