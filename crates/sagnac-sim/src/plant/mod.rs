//! What the loops control: cavity, actuator, discharge, photodiode.
//!
//! ```text
//! path        p = thermal(T) + u·(waves per unit), lagged                  a peak of the gain at every whole p
//! drive       D = (i/i₀)^γ, lagged                                         what the discharge makes of the current
//! gain        ρ = ρ₀·D/(1 + loss growth)·exp(−4 ln2·(δ·FSR/W)²)             δ = p − round(p)
//! light       I = max(ρ − 1, 0)/(ρ₀ − 1)                                   1 at the peak, nominal current, 25 °C
//! ```
//!
//! The light follows the detuning within some lifetimes of the cavity (microseconds: at once here), the discharge
//! its current within a millisecond.
//!
//! Stands for one longitudinal mode of an inhomogeneously broadened line, far from multimode operation. Near the
//! peak I = 1 − c·δ² with c = ρ₀/(ρ₀ − 1)·4 ln2·(FSR/W)², which is what the path-length loop is designed with.

mod bode;
mod running;

pub use bode::{Bode, BodePoint, LoopName, measure};
pub use running::{Running, SecondOfLoops};
use sagnac_loops::{DesignError, IntensityConfig, IntensityDesign, PathLengthConfig, PathLengthDesign, Wanted};

use crate::physics;
use crate::scenario::tables::{Actuator, Cavity, IntensityTable, PathLengthTable};
use crate::scenario::{Problem, Scenario, problem};

/// Bits of the current's converter.
const CURRENT_BITS: i32 = 20;

/// Both loops as designed for a scenario, and the plant they were designed for.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Path length.
    pub path_length: PathLengthDesign,
    /// Intensity.
    pub intensity: IntensityDesign,
    pub(crate) plant: Plant,
}

/// Constants of the plant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plant {
    pub(crate) waves_per_unit: f64,
    pub(crate) codes_per_unit: f64,
    pub(crate) range: [f64; 2],
    lag_s: [f64; 2],
    pub(crate) modulated_apart: bool,
    /// FSR over the width of the gain curve.
    detuning: f64,
    gain_ratio: f64,
    gain_exponent: f64,
    nominal_ma: f64,
    pub(crate) range_ma: [f64; 2],
    current_codes_per_ma: f64,
    light_lag_s: f64,
    loss_growth: f64,
    peak_code: f64,
    full_code: f64,
    noise_code: f64,
    expansion_waves_per_c: f64,
    bend_waves_per_c2: f64,
}

/// Temperature of the nominal values, °C.
pub(crate) const REFERENCE_C: f64 = 25.0;
/// Range over which `loss_growth` is given, °C.
const LOSS_SPAN_C: [f64; 2] = [-40.0, 70.0];

impl Plant {
    fn of(scenario: &Scenario) -> Self {
        let (path, light): (&PathLengthTable, &IntensityTable) = (&scenario.path_length, &scenario.intensity);
        let cavity: &Cavity = &scenario.cavity;
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

    /// Loss at a temperature over that at 25 °C.
    pub(crate) fn loss(&self, block_c: f64) -> f64 {
        let [lo, hi] = LOSS_SPAN_C;
        let at = |t: f64| 1.0 + self.loss_growth * (t - lo) / (hi - lo);
        (at(block_c) / at(REFERENCE_C)).max(0.1)
    }

    /// What the discharge makes of a current (mA), once it has settled; 1 at the nominal one.
    pub(crate) fn drive(&self, current_ma: f64) -> f64 {
        if current_ma <= 0.0 { 0.0 } else { libm::pow(current_ma / self.nominal_ma, self.gain_exponent) }
    }

    /// Light at a detuning (wavelengths), drive and loss.
    pub(crate) fn light(&self, detuning_waves: f64, drive: f64, loss: f64) -> f64 {
        let off = detuning_waves * self.detuning;
        let gain = self.gain_ratio * drive / loss * physics::gain_line(off);
        (gain - 1.0).max(0.0) / (self.gain_ratio - 1.0)
    }

    /// Current that keeps the light where it is nominal, mA.
    pub(crate) fn holding_ma(&self, loss: f64) -> f64 {
        self.nominal_ma * libm::pow(loss, 1.0 / self.gain_exponent)
    }

    /// c of I = 1 − c·δ².
    fn curvature(&self) -> f64 {
        self.gain_ratio / (self.gain_ratio - 1.0) * 4.0 * std::f64::consts::LN_2 * self.detuning * self.detuning
    }
}

impl Design {
    /// Growth of the path at a block temperature from that at 25 °C, wavelengths.
    pub fn thermal_waves(&self, block_c: f64) -> f64 {
        self.plant.thermal_waves(block_c)
    }

    /// Loss at a block temperature over that at 25 °C.
    pub fn loss(&self, block_c: f64) -> f64 {
        self.plant.loss(block_c)
    }

    /// Builds both loops.
    ///
    /// # Errors
    /// A loop that cannot be built, with the key that is to be changed.
    pub fn of(scenario: &Scenario) -> Result<Self, Problem> {
        let plant = Plant::of(scenario);
        let path_length = path_config(scenario, &plant)?.build().map_err(|e| of_key("path_length", &e))?;
        let update_ticks = u16::from(path_length.integers.ticks_per_period());
        let intensity = light_config(scenario, &plant, update_ticks)?.build().map_err(|e| of_key("intensity", &e))?;
        Ok(Self { path_length, intensity, plant })
    }
}

fn path_config(scenario: &Scenario, plant: &Plant) -> Result<PathLengthConfig, Problem> {
    let path = &scenario.path_length;
    if path.range_high <= path.range_low {
        return Err(problem("path_length.range_high", format!("is {}, not above range_low", path.range_high)));
    }
    if path.falling_lag_s < path.rising_lag_s {
        return Err(problem(
            "path_length.falling_lag_s",
            format!(
                "is {} s, less than rising_lag_s: an actuator that sinks faster than it rises is not modelled",
                path.falling_lag_s
            ),
        ));
    }
    Ok(PathLengthConfig {
        tick_s: crate::TICK_S,
        modulation_hz: path.modulation_hz,
        modulation_waves: path.modulation_waves,
        modulated_apart: plant.modulated_apart,
        answer_ticks: 0,
        range: plant.range,
        waves_per_unit: plant.waves_per_unit,
        codes_per_unit: plant.codes_per_unit,
        lag_s: plant.lag_s,
        peak_code: plant.peak_code,
        curvature: plant.curvature(),
        wanted: Wanted { bandwidth_hz: path.bandwidth_hz, phase_margin_deg: path.phase_margin_deg },
        reset_margin_waves: path.reset_margin_waves,
        reset_s: path.reset_s,
        settle_s: path.settle_s,
        sweep_s: path.sweep_s,
        lock_waves: path.lock_waves,
    })
}

fn light_config(scenario: &Scenario, plant: &Plant, update_ticks: u16) -> Result<IntensityConfig, Problem> {
    let light = &scenario.intensity;
    if !(light.low_ma < light.nominal_ma && light.nominal_ma < light.high_ma) {
        let what = format!("is {}, not between low_ma and high_ma", light.nominal_ma);
        return Err(problem("intensity.nominal_ma", what));
    }
    // Change of the light with the current, at the peak and the nominal current.
    let slope = plant.gain_ratio * plant.gain_exponent / (plant.nominal_ma * (plant.gain_ratio - 1.0));
    Ok(IntensityConfig {
        tick_s: crate::TICK_S,
        update_ticks,
        set_code: plant.peak_code,
        codes_per_ma: plant.peak_code * slope,
        lag_s: plant.light_lag_s,
        range_ma: [light.low_ma, light.high_ma],
        current_codes_per_ma: plant.current_codes_per_ma,
        slew_ma_per_s: light.slew_ma_per_s,
        ignition_ma: light.ignition_ma,
        ignition_s: light.ignition_s,
        rest_s: light.rest_s,
        tries: light.ignition_tries as u8,
        low_part: light.low_part,
        wanted: Wanted { bandwidth_hz: light.bandwidth_hz, phase_margin_deg: light.phase_margin_deg },
    })
}

/// The refusal of a loop in the words of the scenario.
fn of_key(table: &str, error: &DesignError) -> Problem {
    let name = match error {
        DesignError::OutOfRange { name, .. } => *name,
        DesignError::Margin { .. } => "bandwidth_hz",
        DesignError::ShortRange { .. } => "range_high",
        DesignError::Gain { .. } => "",
    };
    let key = match name {
        "curvature" => "cavity.gain_width_mhz".to_owned(),
        "peak_code" | "set_code" => "intensity.photodiode_bits".to_owned(),
        "codes_per_unit" | "modulation in codes" => "path_length.converter_bits".to_owned(),
        "codes_per_ma" | "current_codes_per_ma" => "intensity.high_ma".to_owned(),
        "range[0]" => "path_length.range_low".to_owned(),
        "range[1]" => "path_length.range_high".to_owned(),
        "lag_s[0]" => "path_length.rising_lag_s".to_owned(),
        "lag_s[1]" => "path_length.falling_lag_s".to_owned(),
        "" | "plant gain" | "lag_s" | "delay_s" | "period_s" => table.to_owned(),
        same => format!("{table}.{same}"),
    };
    problem(&key, format!("makes a loop that cannot be built: {error}"))
}
