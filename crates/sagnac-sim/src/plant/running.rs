//! Both loops' code, run tick by tick on the plant.

use rand_chacha::ChaCha8Rng;
use sagnac_loops::{IntensityState, IntensityStatus, PathLengthState, PathLengthStatus};

use crate::TICK_S;
use crate::noise::{Stream, generator, normal};
use crate::plant::{Design, Plant};

/// Loops and plant, running.
#[derive(Clone, Debug)]
pub struct Running {
    design: Design,
    path: PathLengthState,
    intensity: IntensityState,
    actuator_code: i32,
    modulation_code: i32,
    current_code: i32,
    /// Path that the actuator makes, wavelengths.
    made_waves: f64,
    /// What the discharge makes of the current.
    drive: f64,
    rise: f64,
    fall: f64,
    glow: f64,
    rng: ChaCha8Rng,
    /// What a test adds to the two outputs, codes.
    pub(crate) injected: [f64; 2],
}

/// What the loops did over a stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SecondOfLoops {
    /// Actuator without modulation, V or W, at the end.
    pub actuator: f64,
    /// Whole wavelengths that resets have moved the path by since the start.
    pub modes: i32,
    /// Mean light; 1 is regulated.
    pub light: f64,
    /// Mean current, mA.
    pub current_ma: f64,
    /// Ticks that were invalid.
    pub invalid_ticks: u32,
    /// Σ of squared detunings over valid ticks, wavelengths².
    pub detuning_squares: f64,
    /// Valid ticks.
    pub valid_ticks: u32,
    /// Status of the path-length loop at the end.
    pub path_status: PathLengthStatus,
    /// Status of the intensity loop at the end.
    pub intensity_status: IntensityStatus,
}

/// Part of the way that a first-order lag goes in a tick.
fn part(lag_s: f64) -> f64 {
    if lag_s > 0.0 { 1.0 - libm::exp(-TICK_S / lag_s) } else { 1.0 }
}

impl Running {
    /// Loops at rest on a cold plant.
    pub fn new(design: &Design, seed: u64) -> Self {
        let (path, intensity) = (design.path_length.integers.start(), design.intensity.integers.start());
        let plant = &design.plant;
        Self {
            path,
            intensity,
            actuator_code: path.held(),
            modulation_code: 0,
            current_code: 0,
            made_waves: f64::from(path.held()) / plant.codes_per_unit * plant.waves_per_unit,
            drive: 0.0,
            rise: part(plant.lag_s[0]),
            fall: part(plant.lag_s[1]),
            glow: part(plant.light_lag_s),
            rng: generator(seed, Stream::Light),
            injected: [0.0; 2],
            design: design.clone(),
        }
    }

    /// Codes of actuator and current without what was injected.
    pub(crate) fn outputs(&self) -> [f64; 2] {
        [f64::from(self.path.held()), f64::from(self.current_code)]
    }

    /// One tick at a thermal path (wavelengths) and loss; `dark` puts the discharge out.
    pub(crate) fn tick(&mut self, thermal_waves: f64, loss: f64, dark: bool, sums: &mut SecondOfLoops) {
        let plant: &Plant = &self.design.plant;
        let waves_per_code = plant.waves_per_unit / plant.codes_per_unit;
        let modulation = f64::from(self.modulation_code);
        let (through, beside) = if plant.modulated_apart { (0.0, modulation) } else { (modulation, 0.0) };
        let target = (f64::from(self.actuator_code) + self.injected[0] + through) * waves_per_code;
        let way = target - self.made_waves;
        self.made_waves += way * if way > 0.0 { self.rise } else { self.fall };
        let path = thermal_waves + self.made_waves + beside * waves_per_code;
        let detuning = path - libm::round(path);
        let current_ma = (f64::from(self.current_code) + self.injected[1]) / plant.current_codes_per_ma;
        let target = if dark { 0.0 } else { plant.drive(current_ma) };
        self.drive += (target - self.drive) * self.glow;
        let light = plant.light(detuning, self.drive, loss);
        let noise = if plant.noise_code > 0.0 { plant.noise_code * normal(&mut self.rng) } else { 0.0 };
        let code = libm::round(light * plant.peak_code + noise).clamp(0.0, plant.full_code) as i32;
        let path_out = self.design.path_length.integers.tick(&mut self.path, code);
        let hold = path_out.status.contains(PathLengthStatus::HOLD_LIGHT);
        let light_out = self.design.intensity.integers.tick(&mut self.intensity, code, hold);
        (self.actuator_code, self.modulation_code) = (path_out.actuator, path_out.modulation);
        self.current_code = light_out.current;
        let low = IntensityStatus::LOW_INTENSITY;
        if path_out.status.contains(PathLengthStatus::INVALID) || light_out.status.contains(low) {
            sums.invalid_ticks += 1;
        } else {
            // Without the modulation, whose size and phase are known.
            let held = f64::from(self.path.held()) * waves_per_code;
            let steady = if plant.modulated_apart { self.made_waves } else { held };
            let off = thermal_waves + steady - libm::round(thermal_waves + steady);
            sums.detuning_squares += off * off;
            sums.valid_ticks += 1;
        }
        sums.light += light;
        sums.current_ma += current_ma;
        (sums.path_status, sums.intensity_status) = (path_out.status, light_out.status);
    }

    /// So many ticks while thermal path and loss go evenly from one value to another.
    pub fn stretch(&mut self, ticks: u32, thermal_waves: [f64; 2], loss: [f64; 2], dark: bool) -> SecondOfLoops {
        let mut sums = SecondOfLoops::default();
        let step = 1.0 / f64::from(ticks.max(1));
        for tick in 0..ticks {
            let along = f64::from(tick + 1) * step;
            let between = |[from, to]: [f64; 2]| from + (to - from) * along;
            self.tick(between(thermal_waves), between(loss), dark, &mut sums);
        }
        sums.light *= step;
        sums.current_ma *= step;
        sums.actuator = f64::from(self.path.held()) / self.design.plant.codes_per_unit;
        sums.modes = self.path.modes();
        sums
    }
}
