//! The plant of the loops (cavity, actuator, discharge, photodiode), and both loops designed for it.
//!
//! ```text
//! path        p = thermal(T) + u·(waves per unit), lagged                  a gain peak at every whole p
//! drive       D = (i/i₀)^γ, lagged                                         effect of the current on the discharge
//! gain        ρ = ρ₀·D/(1 + loss growth)·exp(−4 ln2·(δ·FSR/W)²)             δ = p − round(p)
//! light       I = max(ρ − 1, 0)/(ρ₀ − 1)                                   1 at the peak, nominal current, 25 °C
//! ```
//!
//! Near the peak I = 1 − c·δ² with c = ρ₀/(ρ₀ − 1)·4 ln2·(FSR/W)²; the path-length loop is designed with this c.
//!
//! The light follows a detuning at once (the cavity's lifetime is microseconds) and the current after a lag of about a
//! millisecond. Valid for one longitudinal mode of an inhomogeneously broadened line, far from multimode operation. A
//! piezo has no hysteresis, creep or resonance here; a heater has one lag up and a longer one down.
//!
//! In three parts, as in `sagnac-loops`: [`LoopDesign::build`] makes the constants of a scenario, [`LoopState`] is the
//! memory, and [`LoopDesign::advance`] runs the loops' own code on it.

mod design;
mod running;
mod sweep;

pub use design::LoopDesign;
pub use running::{LoopAverages, LoopState, PlantConditions};
pub use sweep::{Bode, BodePoint, LoopName};

use crate::physics;
use crate::scenario::{
    Actuator, CavityConfig, IntensityControlConfig, PathLengthControlConfig, REFERENCE_C, Scenario, TICK_S,
};

/// Resolution of the current's D/A converter, bits.
const CURRENT_BITS: i32 = 20;
/// Range over which `loss_growth` is given, °C.
const LOSS_SPAN_C: [f64; 2] = [-40.0, 70.0];

/// Constants of the plant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlantConstants {
    pub(crate) waves_per_unit: f64,
    codes_per_unit: f64,
    pub(crate) range: [f64; 2],
    /// Lag of the actuator, s: rising and falling.
    lag_s: [f64; 2],
    /// The modulation has a fast element of its own.
    modulated_apart: bool,
    /// FSR over the width of the gain curve.
    detuning: f64,
    gain_ratio: f64,
    gain_exponent: f64,
    nominal_ma: f64,
    pub(crate) range_ma: [f64; 2],
    current_codes_per_ma: f64,
    light_lag_s: f64,
    /// Fractions of the way covered in a tick: actuator rising and falling, discharge.
    rise: f64,
    fall: f64,
    glow: f64,
    loss_growth: f64,
    peak_code: f64,
    full_code: f64,
    noise_code: f64,
    expansion_waves_per_c: f64,
    bend_waves_per_c2: f64,
}

/// Fraction of the way that a first-order lag covers in a tick.
fn step_fraction(lag_s: f64) -> f64 {
    if lag_s > 0.0 { 1.0 - libm::exp(-TICK_S / lag_s) } else { 1.0 }
}

impl PlantConstants {
    fn build(scenario: &Scenario) -> Self {
        let path: &PathLengthControlConfig = &scenario.path_length;
        let light: &IntensityControlConfig = &scenario.intensity;
        let cavity: &CavityConfig = &scenario.cavity;
        let perimeter_m = scenario.geometry.perimeter_m;
        let waves = perimeter_m / (scenario.geometry.wavelength_um * 1e-6);
        let full_code = libm::exp2(light.photodiode_bits - 1.0);
        let peak_code = light.part_of_range * full_code;
        Self {
            waves_per_unit: path.waves_per_unit,
            codes_per_unit: libm::exp2(path.converter_bits - 1.0) / path.range_low.abs().max(path.range_high.abs()),
            range: [path.range_low, path.range_high],
            lag_s: [path.rising_lag_s, path.falling_lag_s],
            modulated_apart: path.actuator == Actuator::Heater,
            detuning: physics::free_spectral_range_hz(perimeter_m) / (cavity.gain_width_mhz * 1e6),
            gain_ratio: cavity.gain_ratio,
            gain_exponent: light.gain_exponent,
            nominal_ma: light.nominal_ma,
            range_ma: [light.low_ma, light.high_ma],
            current_codes_per_ma: libm::exp2(f64::from(CURRENT_BITS)) / light.high_ma,
            light_lag_s: light.lag_s,
            rise: step_fraction(path.rising_lag_s),
            fall: step_fraction(path.falling_lag_s),
            glow: step_fraction(light.lag_s),
            loss_growth: light.loss_growth,
            peak_code,
            full_code,
            noise_code: light.noise * peak_code,
            expansion_waves_per_c: waves * scenario.block.expansion_ppm_per_c * 1e-6,
            bend_waves_per_c2: waves * scenario.block.expansion_bend_ppm_per_c2 * 1e-6,
        }
    }

    /// Growth of the path from 25 °C, wavelengths.
    pub(crate) fn thermal_waves(&self, block_c: f64) -> f64 {
        let from = block_c - REFERENCE_C;
        self.expansion_waves_per_c * from + 0.5 * self.bend_waves_per_c2 * from * from
    }

    /// Loss at a temperature relative to that at 25 °C.
    pub(crate) fn loss(&self, block_c: f64) -> f64 {
        let [lo, hi] = LOSS_SPAN_C;
        let at = |t: f64| 1.0 + self.loss_growth * (t - lo) / (hi - lo);
        (at(block_c) / at(REFERENCE_C)).max(0.1)
    }

    /// Settled effect of a current (mA) on the discharge; 1 at the nominal current.
    pub(crate) fn drive(&self, current_ma: f64) -> f64 {
        if current_ma <= 0.0 { 0.0 } else { libm::pow(current_ma / self.nominal_ma, self.gain_exponent) }
    }

    /// Light at a detuning (wavelengths), drive and loss.
    pub(crate) fn light(&self, detuning_waves: f64, drive: f64, loss: f64) -> f64 {
        let off = detuning_waves * self.detuning;
        let gain = self.gain_ratio * drive / loss * physics::gain_line(off);
        (gain - 1.0).max(0.0) / (self.gain_ratio - 1.0)
    }

    /// Current that holds the nominal light at a loss, mA.
    pub(crate) fn holding_ma(&self, loss: f64) -> f64 {
        self.nominal_ma * libm::pow(loss, 1.0 / self.gain_exponent)
    }

    /// c of I = 1 − c·δ².
    fn curvature(&self) -> f64 {
        self.gain_ratio / (self.gain_ratio - 1.0) * 4.0 * std::f64::consts::LN_2 * self.detuning * self.detuning
    }

    /// Change of the photodiode's code with the current at the peak and the nominal current, codes per mA.
    fn light_codes_per_ma(&self) -> f64 {
        let slope = self.gain_ratio * self.gain_exponent / (self.nominal_ma * (self.gain_ratio - 1.0));
        self.peak_code * slope
    }
}
