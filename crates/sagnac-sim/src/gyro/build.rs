//! From a scenario to the parts of a gyro: everything that does not change during a run.

use crate::beat::Beat;
use crate::gyro::bias::Bias;
use crate::gyro::counter::Counter;
use crate::gyro::faults::Faults;
use crate::gyro::input::InputRate;
use crate::gyro::loops::Loops;
use crate::noise::SlowNoise;
use crate::physics::{ARCSEC_RT_S_PER_DEG_RT_H, mode_number};
use crate::plant::LoopDesign;
use crate::scenario::{Fidelity, Scenario, ScenarioError};
use crate::thermal::Thermal;

/// A gyro and its test, built from a scenario. Nothing in it changes during a run.
#[derive(Clone, Debug)]
pub struct Gyro {
    pub(super) thermal: Thermal,
    pub(super) loops: Loops,
    pub(super) bias: Bias,
    pub(super) slow: SlowNoise,
    pub(super) input: InputRate,
    pub(super) faults: Faults,
    pub(super) counter: Counter,
    /// The optics; only at the beat level.
    pub(super) beat: Option<Beat>,
    /// Length of the test, s.
    pub(super) length_s: u64,
    pub(super) interval_s: f64,
    pub(super) start_c: f64,
    pub(super) thermometers: usize,
    pub(super) arcsec_per_count: f64,
    /// White noise that is added to the angle.
    pub(super) walk_arcsec_rt_s: f64,
    pub(super) lock_in_dph: f64,
    pub(super) dithered: bool,
    pub(super) mode_number: f64,
    pub(super) waves_per_unit: f64,
    pub(super) actuator_ppm_per_wave: f64,
}

impl Scenario {
    /// Builds the gyro and its test.
    ///
    /// # Errors
    /// What [`Scenario::check`] refuses; a beat too fast for its ticks; loops that cannot be designed.
    pub fn build(&self) -> Result<Gyro, ScenarioError> {
        self.check()?;
        let thermal = Thermal::build(self)?;
        let (beat, arw_deg_rt_h) = match self.run.fidelity {
            Fidelity::Count => (None, self.arw_deg_rt_h()),
            // The angle random walk of the dither is part of the beat.
            Fidelity::Beat => (Some(Beat::build(self)?), self.noise.arw_deg_rt_h),
        };
        Ok(Gyro {
            length_s: thermal.length_s() as u64,
            thermal,
            loops: Loops::build(self)?,
            bias: Bias::build(self),
            slow: SlowNoise::build(&self.noise),
            input: InputRate::build(self),
            faults: Faults(self.fault.clone()),
            counter: Counter::build(self),
            beat,
            interval_s: self.run.interval_s,
            start_c: self.chamber.start_c,
            thermometers: self.thermometer.len(),
            arcsec_per_count: self.arcsec_per_count(),
            walk_arcsec_rt_s: ARCSEC_RT_S_PER_DEG_RT_H * arw_deg_rt_h,
            lock_in_dph: self.lock_in_dph(),
            dithered: self.is_dithered(),
            mode_number: mode_number(self.geometry.perimeter_m, self.geometry.wavelength_um * 1e-6),
            waves_per_unit: self.path_length.waves_per_unit,
            actuator_ppm_per_wave: self.scale_factor.actuator_ppm_per_wave,
        })
    }
}

impl Gyro {
    /// Length of the test, s.
    pub fn length_s(&self) -> f64 {
        self.length_s as f64
    }

    /// Both loops as designed.
    pub fn loops(&self) -> &LoopDesign {
        self.loops.design()
    }
}
