//! From SI units to the integers of the path-length loop.

use super::{MAX_EVIDENCE, MOST_CURVATURE_Q8, PathLength};
use crate::MAX_CODE;
use crate::design::{DesignError, LoopGoal, PiGains, Plant, open_loop, pi_gains, within};
use crate::gain::LoopGain;
use crate::lockin::{MAX_TICKS_PER_PERIOD, Reference};

/// Configuration in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLengthConfig {
    /// Time between ticks, s.
    pub tick_s: f64,
    /// Modulation frequency, Hz; the nearest even number of ticks per period is used.
    pub modulation_hz: f64,
    /// Amplitude of the modulation, wavelengths of path.
    pub modulation_waves: f64,
    /// The modulation has a separate fast actuator (a heater is too slow for it).
    pub separate_modulator: bool,
    /// Delay of converters and electronics between the output of a modulation and the reading of its response, ticks.
    /// The tick between one call and the next is not part of it.
    pub answer_ticks: u8,
    /// Range of the actuator in its unit (V, or W for a heater).
    pub range: [f64; 2],
    /// Wavelengths of path per that unit.
    pub waves_per_unit: f64,
    /// Scale of its converter, codes per unit.
    pub codes_per_unit: f64,
    /// First-order lag of the actuator, s: smallest and largest (a heater cools more slowly than it heats).
    pub lag_s: [f64; 2],
    /// Code of the photodiode at the peak.
    pub peak_code: f64,
    /// c of I = I₀(1 − c·x²), x in wavelengths.
    pub curvature: f64,
    /// Noise of a reading of the light, standard deviation relative to the light at the peak.
    pub noise: f64,
    /// Bandwidth and phase margin.
    pub goal: LoopGoal,
    /// Distance from the ends of the range at which a mode reset starts, wavelengths.
    pub reset_margin_waves: f64,
    /// Time of a mode reset per wavelength, s.
    pub reset_s: f64,
    /// Settling time of the actuator after a search or reset, s.
    pub settle_s: f64,
    /// Time of the search through one wavelength, s: at least eight lags. 0 for no search: the loop then closes in the
    /// middle of the range as soon as there is light, so there must be light at every position.
    pub sweep_s: f64,
    /// Largest error of a locked loop, wavelengths.
    pub lock_waves: f64,
}

/// A designed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathLengthDesign {
    /// The loop for the target.
    pub integers: PathLength,
    /// The plant with the smallest lag.
    pub plant: Plant,
    /// Gains after rounding to integers.
    pub pi: PiGains,
    /// Phase margin with the largest lag, degrees.
    pub slow_margin_deg: f64,
}

impl PathLengthConfig {
    /// Ticks of a modulation period.
    fn ticks(&self) -> Result<usize, DesignError> {
        let tick_s = within("tick_s", self.tick_s, 1e-7, 0.1)?;
        let most = MAX_TICKS_PER_PERIOD as f64;
        within("modulation_hz", self.modulation_hz, 1.0 / (most * tick_s), 1.0 / (4.0 * tick_s))?;
        Ok(2 * libm::round(0.5 / (self.modulation_hz * tick_s)) as usize)
    }

    /// Checks the configuration and computes the gains.
    ///
    /// # Errors
    /// A value out of its range, by name; a range too short for a mode reset; a margin that is not possible; a gain
    /// that does not fit.
    pub fn build(&self) -> Result<PathLengthDesign, DesignError> {
        let ticks = self.ticks()?;
        let period_s = ticks as f64 * self.tick_s;
        // A tick outputs the modulation of the next sample, so the response comes with that sample.
        let answer = self.answer(ticks);
        let reference =
            Reference::new(ticks, self.answer_ticks.into(), answer.lag_rad).ok_or(DesignError::OutOfRange {
                name: "modulation_hz",
                value: self.modulation_hz,
                least: 0.0,
                most: 0.25 / self.tick_s,
            })?;
        let limits = self.limits()?;
        let error_shift = self.error_shift(ticks)?;
        let plant = self.plant(&reference, error_shift, period_s, &answer)?;
        let ideal = pi_gains(plant, period_s, self.goal)?;
        let gain = |name, value| LoopGain::from_f64(value).ok_or(DesignError::Gain { name, value });
        let (kp, ki) = (gain("kp", ideal.kp)?, gain("ki", ideal.ki)?);
        let evidence = self.evidence(&reference, &answer)?;
        let pi = PiGains { kp: kp.to_f64(), ki: ki.to_f64(), ..ideal };
        // Error per wavelength: the gain of the plant, per path.
        let per_wave = plant.gain * limits.wavelength;
        let error = |waves: f64| (waves * per_wave).clamp(1.0, 1_073_741_824.0) as i32;
        let periods = |seconds: f64| libm::ceil(seconds / period_s).clamp(0.0, 1e9) as u32;
        let response_s = 1.0 / self.goal.bandwidth_hz;
        // 2^-32 codes per period for one wavelength in a number of periods.
        let step = |periods: u32| libm::ldexp(limits.wavelength / f64::from(periods.max(1)), 32) as i64;
        let sweep_periods = periods(self.sweep_s);
        let integers = PathLength {
            reference,
            modulation: libm::round(limits.modulation) as i32,
            error_shift,
            kp,
            ki,
            low: libm::ceil(limits.low) as i32,
            high: libm::floor(limits.high) as i32,
            reset_low: libm::round(limits.low + limits.margin) as i32,
            reset_high: libm::round(limits.high - limits.margin) as i32,
            wavelength: libm::round(limits.wavelength) as i32,
            sweep_step_q32: step(sweep_periods),
            reset_step_q32: step(periods(self.reset_s)),
            sweep_periods,
            settle_periods: periods(self.settle_s),
            lock_periods: periods(response_s).max(evidence.periods).min(MAX_EVIDENCE),
            lost_periods: periods(response_s).max(evidence.periods).min(MAX_EVIDENCE),
            give_up_periods: periods(50.0 * response_s + 10.0 * self.lag_s[1]),
            lock_error: error(self.lock_waves),
            lost_error: error(limits.lost_waves),
            least_curvature_q8: evidence.least_q8,
            most_curvature_q8: evidence.most_q8,
            dark_sum: libm::round(0.1 * self.peak_code * ticks as f64) as i64,
        };
        Ok(PathLengthDesign { integers, plant, pi, slow_margin_deg: slow_margin(&plant, &pi, self.lag_s[1]) })
    }

    /// Limits in codes.
    fn limits(&self) -> Result<Limits, DesignError> {
        within("waves_per_unit", self.waves_per_unit, 1e-9, 1e6)?;
        within("codes_per_unit", self.codes_per_unit, 1e-6, 1e9)?;
        // A range computed from the width of the converter may differ in the last bit.
        let most = f64::from(MAX_CODE) / self.codes_per_unit * (1.0 + 1e-12);
        let lowest = within("range[0]", self.range[0], -most, most)?;
        within("range[1]", self.range[1], lowest, most)?;
        within("modulation_waves", self.modulation_waves, 1e-4, 0.1)?;
        let wavelength = self.codes_per_unit / self.waves_per_unit;
        let modulation = self.modulation_waves * wavelength;
        within("modulation in codes", modulation, 8.0, f64::from(MAX_CODE))?;
        let room = if self.separate_modulator { 0.0 } else { modulation };
        let (low, high) = (self.range[0] * self.codes_per_unit + room, self.range[1] * self.codes_per_unit - room);
        let room = (high - low) / wavelength;
        within("reset_margin_waves", self.reset_margin_waves, 0.0, 1e3)?;
        // After a reset the path is within half a wavelength of the middle, and that must lie between the limits.
        if room < 1.04 + 2.0 * self.reset_margin_waves {
            return Err(DesignError::ShortRange { waves: room });
        }
        within("reset_s", self.reset_s, 0.0, 1e4)?;
        within("settle_s", self.settle_s, 0.0, 1e4)?;
        within("lag_s[0]", self.lag_s[0], 0.0, 1e5)?;
        within("lag_s[1]", self.lag_s[1], self.lag_s[0], 1e5)?;
        if self.sweep_s != 0.0 {
            // The recorded brightest position lags by this.
            within("sweep_s", self.sweep_s, 8.0 * self.lag_s[1], 1e6)?;
        }
        within("curvature", self.curvature, 1e-3, 1e4)?;
        // The error of a Gaussian peak decreases beyond 0.43/√c of a wavelength, in units of its slope at the peak. The
        // lock is lost at half of that.
        let lost_waves = (10.0 * self.lock_waves).min(0.2 / libm::sqrt(self.curvature));
        within("lock_waves", self.lock_waves, 1e-5, lost_waves / 2.0)?;
        Ok(Limits { low, high, modulation, wavelength, margin: self.reset_margin_waves * wavelength, lost_waves })
    }

    /// In-phase sums at full modulation across the steepest part fit 2^30 after this shift.
    fn error_shift(&self, ticks: usize) -> Result<u8, DesignError> {
        within("peak_code", self.peak_code, 16.0, f64::from(MAX_CODE))?;
        let full = self.peak_code * ticks as f64 * 32_768.0;
        Ok(libm::ceil(libm::log2(full) - 30.0).clamp(0.0, 40.0) as u8)
    }

    /// The modulation as the path has it. A lag attenuates and delays it: the code is held for a tick and the light is read
    /// at its end, H(z) = (1 − a)/(1 − a/z), a = e^(−tick/lag).
    fn answer(&self, ticks: usize) -> Answer {
        let lag_s = if self.separate_modulator { 0.0 } else { self.lag_s[0] };
        let a = if lag_s > 0.0 { libm::exp(-self.tick_s / lag_s) } else { 0.0 };
        let (sin, cos) = libm::sincos(core::f64::consts::TAU / ticks as f64);
        let (re, im) = (1.0 - a * cos, a * sin);
        let size = (1.0 - a) / libm::hypot(re, im);
        Answer { waves: self.modulation_waves * size, lag_rad: libm::atan2(im, re) }
    }

    /// The second harmonic that a peak makes of the modulation, computed on the reference's own table, and the periods
    /// after which half of it stands at six times its noise.
    fn evidence(&self, reference: &Reference, answer: &Answer) -> Result<PeakEvidence, DesignError> {
        within("noise", self.noise, 0.0, 0.1)?;
        let ticks = reference.ticks();
        let light = |k: u8| {
            let phase = core::f64::consts::TAU * f64::from(k) / f64::from(ticks) - answer.lag_rad;
            let x = answer.waves * libm::sin(phase);
            1.0 - self.curvature * x * x
        };
        let table = |k: u8| f64::from(reference.second_q15(k));
        let squares: f64 = (0..ticks).map(|k| table(k) * table(k)).sum();
        let peak: f64 = (0..ticks).map(|k| table(k) * light(k)).sum();
        // Amplitude of the harmonic, relative to the light.
        let amplitude = peak / squares.max(1.0) * f64::from(i16::MAX);
        // Less than half a code of the converter may not show at all; less than sixteen units of the table are coarse.
        let per_light_q8 = 0.5 * 256.0 * peak / f64::from(ticks);
        let shortfall = (0.5 / self.peak_code / amplitude.max(1e-30)).max(16.0 / per_light_q8.max(1e-30));
        if shortfall > 1.0 {
            let least_waves = self.modulation_waves * libm::sqrt(shortfall);
            return Err(DesignError::Faint { codes: amplitude * self.peak_code, least_waves });
        }
        let noise = libm::hypot(self.noise, 0.29 / self.peak_code);
        let readings = squares / (f64::from(i16::MAX) * f64::from(i16::MAX)) / f64::from(ticks);
        let needed = 144.0 * noise * noise / (amplitude * amplitude) / readings / f64::from(ticks);
        Ok(PeakEvidence {
            least_q8: per_light_q8.min(f64::from(u16::MAX)) as u16,
            most_q8: (4.0 * per_light_q8.max(512.0 * noise * libm::sqrt(squares) / f64::from(ticks)))
                .min(f64::from(MOST_CURVATURE_Q8)) as u32,
            periods: libm::ceil(needed).clamp(8.0, f64::from(MAX_EVIDENCE)) as u32,
        })
    }

    fn plant(
        &self,
        reference: &Reference,
        error_shift: u8,
        period_s: f64,
        answer: &Answer,
    ) -> Result<Plant, DesignError> {
        let waves_per_code = self.waves_per_unit / self.codes_per_unit;
        // Only the in-phase part counts.
        let modulation_waves = answer.waves * libm::cos(answer.lag_rad);
        let per_wave = 2.0 * self.curvature * self.peak_code * modulation_waves * reference.power();
        let gain = libm::ldexp(per_wave, -i32::from(error_shift)) * waves_per_code;
        // Half a period of averaging, half of hold, and the delay of the converters.
        Ok(Plant { gain, lag_s: self.lag_s[0], delay_s: period_s + f64::from(self.answer_ticks) * self.tick_s })
    }
}

/// The modulation of the path.
struct Answer {
    /// Amplitude, wavelengths.
    waves: f64,
    /// Phase by which the lag of the actuator delays it.
    lag_rad: f64,
}

/// What shows a peak.
struct PeakEvidence {
    /// Half of its second harmonic, 2^-23 of the light.
    least_q8: u16,
    /// What a period counts with at most, 2^-23 of the light: twice its harmonic, or four times its noise.
    most_q8: u32,
    /// Periods in which half of it stands at six times its noise.
    periods: u32,
}

struct Limits {
    low: f64,
    high: f64,
    modulation: f64,
    wavelength: f64,
    margin: f64,
    lost_waves: f64,
}

/// Phase margin with the largest lag: the lower crossover by bisection.
fn slow_margin(plant: &Plant, pi: &PiGains, lag_s: f64) -> f64 {
    let slow = Plant { lag_s, ..*plant };
    let (mut lo, mut hi) = (1e-6 / pi.period_s, 0.4 / pi.period_s);
    for _ in 0..100 {
        let middle = libm::sqrt(lo * hi);
        if open_loop(&slow, pi, middle).0 > 1.0 { lo = middle } else { hi = middle }
    }
    180.0 + open_loop(&slow, pi, lo).1
}
