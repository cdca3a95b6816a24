//! Both loops' own code, run tick by tick on the plant.

use rand_chacha::ChaCha8Rng;
use sagnac_loops::{IntensityState, IntensityStatus, PathLengthState, PathLengthStatus};

use crate::plant::LoopDesign;
use crate::random::{Stream, generator, normal};

/// Memory of both loops and of their plant.
#[derive(Clone, Debug)]
pub struct LoopState {
    path: PathLengthState,
    intensity: IntensityState,
    actuator_code: i32,
    modulation_code: i32,
    current_code: i32,
    /// Path made by the actuator, wavelengths.
    actuator_waves: f64,
    /// Lagged effect of the current on the discharge.
    drive: f64,
    rng: ChaCha8Rng,
}

/// What acts on the plant over a number of ticks. Values at the start and at the end; linear in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantConditions {
    /// Growth of the path from 25 °C, wavelengths.
    pub thermal_waves: [f64; 2],
    /// Loss relative to that at 25 °C.
    pub loss: [f64; 2],
    /// The discharge is off.
    pub dark: bool,
}

impl Default for PlantConditions {
    /// 25 °C.
    fn default() -> Self {
        Self { thermal_waves: [0.0; 2], loss: [1.0; 2], dark: false }
    }
}

/// What the loops did over a number of ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LoopAverages {
    /// Actuator without modulation, V or W, at the end.
    pub actuator: f64,
    /// Sum of all mode resets since the start, wavelengths.
    pub modes: i32,
    /// Mean light; 1 is regulated.
    pub light: f64,
    /// Mean current, mA.
    pub current_ma: f64,
    /// Number of invalid ticks.
    pub invalid_ticks: u32,
    /// Sum of squared detunings over valid ticks, wavelengths².
    pub detuning_squares: f64,
    /// Number of valid ticks.
    pub valid_ticks: u32,
    /// Status of the path-length loop at the end.
    pub path_status: PathLengthStatus,
    /// Status of the intensity loop at the end.
    pub intensity_status: IntensityStatus,
}

/// What acts on the plant during one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickConditions {
    pub(crate) thermal_waves: f64,
    pub(crate) loss: f64,
    pub(crate) dark: bool,
    /// Test signal added to the outputs of the path-length and the intensity loop, codes.
    pub(crate) injected: [f64; 2],
}

impl LoopState {
    /// Output codes of the path-length and the intensity loop, without a test signal.
    pub(crate) fn outputs(&self) -> [f64; 2] {
        [f64::from(self.path.held()), f64::from(self.current_code)]
    }
}

impl LoopDesign {
    /// Both loops before ignition.
    pub fn start(&self, seed: u64) -> LoopState {
        let (path, intensity) = (self.path_length.integers.start(), self.intensity.integers.start());
        LoopState {
            path,
            intensity,
            actuator_code: path.held(),
            modulation_code: 0,
            current_code: 0,
            actuator_waves: f64::from(path.held()) / self.plant.codes_per_unit * self.plant.waves_per_unit,
            drive: 0.0,
            rng: generator(seed, Stream::Light),
        }
    }

    /// Conditions while the block goes from one temperature to another, °C.
    pub fn conditions(&self, block_c: [f64; 2]) -> PlantConditions {
        PlantConditions {
            thermal_waves: block_c.map(|t| self.plant.thermal_waves(t)),
            loss: block_c.map(|t| self.plant.loss(t)),
            dark: false,
        }
    }

    /// Runs both loops for a number of ticks.
    pub fn advance(&self, state: &mut LoopState, ticks: u32, conditions: &PlantConditions) -> LoopAverages {
        let mut sums = LoopAverages::default();
        let step = 1.0 / f64::from(ticks.max(1));
        for tick in 0..ticks {
            let along = f64::from(tick + 1) * step;
            let between = |[from, to]: [f64; 2]| from + (to - from) * along;
            let now = TickConditions {
                thermal_waves: between(conditions.thermal_waves),
                loss: between(conditions.loss),
                dark: conditions.dark,
                injected: [0.0; 2],
            };
            self.tick(state, &now, &mut sums);
        }
        sums.light *= step;
        sums.current_ma *= step;
        sums.actuator = f64::from(state.path.held()) / self.plant.codes_per_unit;
        sums.modes = state.path.modes();
        sums
    }

    /// One tick: actuator and discharge follow the codes, the photodiode is read, both loops answer.
    pub(crate) fn tick(&self, state: &mut LoopState, now: &TickConditions, sums: &mut LoopAverages) {
        let plant = &self.plant;
        let waves_per_code = plant.waves_per_unit / plant.codes_per_unit;
        // Actuator. The modulation goes through it, or through a fast element next to it.
        let modulation = f64::from(state.modulation_code);
        let (through, beside) = if plant.modulated_apart { (0.0, modulation) } else { (modulation, 0.0) };
        let target = (f64::from(state.actuator_code) + now.injected[0] + through) * waves_per_code;
        let way = target - state.actuator_waves;
        state.actuator_waves += way * if way > 0.0 { plant.rise } else { plant.fall };
        let path = now.thermal_waves + state.actuator_waves + beside * waves_per_code;
        let detuning = path - libm::round(path);
        // Discharge.
        let current_ma = (f64::from(state.current_code) + now.injected[1]) / plant.current_codes_per_ma;
        let target = if now.dark { 0.0 } else { plant.drive(current_ma) };
        state.drive += (target - state.drive) * plant.glow;
        // Photodiode and its converter.
        let light = plant.light(detuning, state.drive, now.loss);
        let noise = if plant.noise_code > 0.0 { plant.noise_code * normal(&mut state.rng) } else { 0.0 };
        let code = libm::round(light * plant.peak_code + noise).clamp(0.0, plant.full_code) as i32;
        // Both loops.
        let path_out = self.path_length.integers.tick(&mut state.path, code);
        let hold = path_out.status.contains(PathLengthStatus::HOLD_LIGHT);
        let light_out = self.intensity.integers.tick(&mut state.intensity, code, hold);
        (state.actuator_code, state.modulation_code) = (path_out.actuator, path_out.modulation);
        state.current_code = light_out.current;
        let low = light_out.status.contains(IntensityStatus::LOW_INTENSITY);
        if path_out.status.contains(PathLengthStatus::INVALID) || low {
            sums.invalid_ticks += 1;
        } else {
            // Without the modulation, whose amplitude and phase are known.
            let held = f64::from(state.path.held()) * waves_per_code;
            let steady = if plant.modulated_apart { state.actuator_waves } else { held };
            let off = now.thermal_waves + steady - libm::round(now.thermal_waves + steady);
            sums.detuning_squares += off * off;
            sums.valid_ticks += 1;
        }
        sums.light += light;
        sums.current_ma += current_ma;
        (sums.path_status, sums.intensity_status) = (path_out.status, light_out.status);
    }
}
