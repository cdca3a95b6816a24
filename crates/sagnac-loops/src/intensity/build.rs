//! From SI units to the integers of the intensity loop.

use super::Intensity;
use crate::MAX_CODE;
use crate::design::{DesignError, LoopGoal, PiGains, Plant, pi_gains, within};
use crate::gain::LoopGain;

/// Configuration in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntensityConfig {
    /// Time between ticks, s.
    pub tick_s: f64,
    /// Ticks per update: a whole number of path-length modulation periods.
    pub update_ticks: u16,
    /// Set point of the photodiode, code.
    pub set_code: f64,
    /// Change of that code per mA, at the set point.
    pub codes_per_ma: f64,
    /// First-order lag from current to light, s.
    pub lag_s: f64,
    /// Range of the current, mA.
    pub range_ma: [f64; 2],
    /// Scale of its converter, codes per mA.
    pub current_codes_per_ma: f64,
    /// Fastest change, mA/s.
    pub slew_ma_per_s: f64,
    /// Current while igniting, mA.
    pub ignition_ma: f64,
    /// Longest ignition try, s.
    pub ignition_s: f64,
    /// Pause between tries, s.
    pub rest_s: f64,
    /// Tries after the first.
    pub tries: u8,
    /// Below this fraction of the set point the light is low.
    pub low_part: f64,
    /// Bandwidth and phase margin.
    pub goal: LoopGoal,
}

/// A designed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntensityDesign {
    /// The loop for the target.
    pub integers: Intensity,
    /// The plant.
    pub plant: Plant,
    /// Gains after rounding to integers.
    pub pi: PiGains,
}

impl IntensityConfig {
    /// Checks the configuration and computes the gains.
    ///
    /// # Errors
    /// A value out of its range, by name; a margin that is not possible; a gain that does not fit.
    pub fn build(&self) -> Result<IntensityDesign, DesignError> {
        self.check()?;
        let ticks = f64::from(self.update_ticks);
        let period_s = ticks * self.tick_s;
        let set_point = self.set_code * ticks;
        let error_shift = libm::ceil(libm::log2(set_point) - 29.0).clamp(0.0, 40.0) as u8;
        let scale = libm::ldexp(ticks, -i32::from(error_shift));
        let plant = Plant {
            gain: self.codes_per_ma / self.current_codes_per_ma * scale,
            lag_s: self.lag_s,
            // Half an update of mean, half of hold.
            delay_s: period_s,
        };
        let ideal = pi_gains(plant, period_s, self.goal)?;
        let gain = |name, value| LoopGain::from_f64(value).ok_or(DesignError::Gain { name, value });
        let (kp, ki) = (gain("kp", ideal.kp)?, gain("ki", ideal.ki)?);
        let code = |ma: f64| libm::round(ma * self.current_codes_per_ma) as i32;
        let updates = |seconds: f64| libm::ceil(seconds / period_s).clamp(1.0, 1e9) as u32;
        let part = |part: f64| libm::round(part * set_point) as i64;
        let integers = Intensity {
            ticks: self.update_ticks,
            set_point: part(1.0),
            error_shift,
            kp,
            ki,
            least: code(self.range_ma[0]),
            most: code(self.range_ma[1]),
            slew: code(self.slew_ma_per_s * period_s).clamp(1, MAX_CODE),
            ignition: code(self.ignition_ma),
            ignition_updates: updates(self.ignition_s),
            rest_updates: updates(self.rest_s),
            tries: self.tries,
            dark_sum: part(0.05),
            low_sum: part(self.low_part),
            dark_updates: updates(0.1),
            end_updates: updates(1.0),
            settled_error: libm::ldexp(0.01 * set_point, -i32::from(error_shift)).clamp(1.0, 1e9) as i32,
        };
        Ok(IntensityDesign { integers, plant, pi: PiGains { kp: kp.to_f64(), ki: ki.to_f64(), ..ideal } })
    }

    fn check(&self) -> Result<(), DesignError> {
        within("tick_s", self.tick_s, 1e-7, 0.1)?;
        within("update_ticks", f64::from(self.update_ticks), 1.0, 65_535.0)?;
        within("set_code", self.set_code, 16.0, f64::from(MAX_CODE))?;
        within("codes_per_ma", self.codes_per_ma, 1e-3, 1e9)?;
        within("current_codes_per_ma", self.current_codes_per_ma, 1e-3, 1e9)?;
        // A range computed from the width of the converter may differ in the last bit.
        let most = f64::from(MAX_CODE) / self.current_codes_per_ma * (1.0 + 1e-12);
        within("range_ma[0]", self.range_ma[0], 0.0, most)?;
        within("range_ma[1]", self.range_ma[1], self.range_ma[0], most)?;
        within("ignition_ma", self.ignition_ma, self.range_ma[0], self.range_ma[1])?;
        within("slew_ma_per_s", self.slew_ma_per_s, 1e-6, 1e6)?;
        within("ignition_s", self.ignition_s, 0.0, 1e4)?;
        within("rest_s", self.rest_s, 0.0, 1e4)?;
        within("low_part", self.low_part, 0.05, 1.0)?;
        Ok(())
    }
}
