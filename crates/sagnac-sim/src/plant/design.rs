//! Both loops built for a scenario: from its SI units to the integers of `sagnac-loops`.

use sagnac_loops::{DesignError, IntensityConfig, IntensityDesign, LoopGoal, PathLengthConfig, PathLengthDesign};

use crate::plant::PlantConstants;
use crate::scenario::{Scenario, ScenarioError, TICK_S};

/// Both loops as designed for a scenario, and the plant they were designed for. Nothing in it changes during a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoopDesign {
    /// Path-length loop.
    pub path_length: PathLengthDesign,
    /// Intensity loop.
    pub intensity: IntensityDesign,
    pub(crate) plant: PlantConstants,
}

impl LoopDesign {
    /// Designs both loops.
    ///
    /// # Errors
    /// A loop that cannot be built, with the key to change.
    pub fn build(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let plant = PlantConstants::build(scenario);
        let path_length = path_config(scenario, &plant)?.build().map_err(|e| in_scenario("path_length", &e))?;
        let update_ticks = u16::from(path_length.integers.ticks_per_period());
        let intensity = light_config(scenario, &plant, update_ticks)?.build();
        let intensity = intensity.map_err(|e| in_scenario("intensity", &e))?;
        Ok(Self { path_length, intensity, plant })
    }
}

fn path_config(scenario: &Scenario, plant: &PlantConstants) -> Result<PathLengthConfig, ScenarioError> {
    let path = &scenario.path_length;
    if path.range_high <= path.range_low {
        let message = format!("is {}, not above range_low", path.range_high);
        return Err(ScenarioError::new("path_length.range_high", message));
    }
    if path.falling_lag_s < path.rising_lag_s {
        let message = format!(
            "is {} s, less than rising_lag_s: give as much or more, since this actuator cannot fall faster than it rises",
            path.falling_lag_s
        );
        return Err(ScenarioError::new("path_length.falling_lag_s", message));
    }
    Ok(PathLengthConfig {
        tick_s: TICK_S,
        modulation_hz: path.modulation_hz,
        modulation_waves: path.modulation_waves,
        separate_modulator: plant.modulated_apart,
        answer_ticks: 0,
        range: plant.range,
        waves_per_unit: plant.waves_per_unit,
        codes_per_unit: plant.codes_per_unit,
        lag_s: plant.lag_s,
        peak_code: plant.peak_code,
        curvature: plant.curvature(),
        noise: scenario.intensity.noise,
        goal: LoopGoal { bandwidth_hz: path.bandwidth_hz, phase_margin_deg: path.phase_margin_deg },
        reset_margin_waves: path.reset_margin_waves,
        reset_s: path.reset_s,
        settle_s: path.settle_s,
        sweep_s: path.sweep_s,
        lock_waves: path.lock_waves,
    })
}

fn light_config(
    scenario: &Scenario,
    plant: &PlantConstants,
    update_ticks: u16,
) -> Result<IntensityConfig, ScenarioError> {
    let light = &scenario.intensity;
    if !(light.low_ma < light.nominal_ma && light.nominal_ma < light.high_ma) {
        let message = format!("is {}, not between low_ma and high_ma", light.nominal_ma);
        return Err(ScenarioError::new("intensity.nominal_ma", message));
    }
    Ok(IntensityConfig {
        tick_s: TICK_S,
        update_ticks,
        set_code: plant.peak_code,
        codes_per_ma: plant.light_codes_per_ma(),
        lag_s: plant.light_lag_s,
        range_ma: plant.range_ma,
        current_codes_per_ma: plant.current_codes_per_ma,
        slew_ma_per_s: light.slew_ma_per_s,
        ignition_ma: light.ignition_ma,
        ignition_s: light.ignition_s,
        rest_s: light.rest_s,
        tries: light.ignition_tries as u8,
        low_part: light.low_part,
        goal: LoopGoal { bandwidth_hz: light.bandwidth_hz, phase_margin_deg: light.phase_margin_deg },
    })
}

/// A loop's refusal in terms of the scenario's keys.
fn in_scenario(table: &str, error: &DesignError) -> ScenarioError {
    let name = match error {
        DesignError::OutOfRange { name, .. } => *name,
        DesignError::Margin { .. } => "bandwidth_hz",
        DesignError::ShortRange { .. } => "range_high",
        DesignError::Faint { .. } => "modulation_waves",
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
    ScenarioError::new(&key, format!("makes a loop that cannot be built: {error}"))
}
