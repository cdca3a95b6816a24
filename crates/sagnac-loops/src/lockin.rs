//! Synchronous detection over whole periods.
//!
//! ```text
//! I = Σ s[k]·sin(2πk/n)      C = Σ s[k]·cos(4πk/n − 2φ)      M = Σ s[k]         k = 0 … n−1, one period of n ticks
//! ```
//!
//! I has the sign of the slope of the light, C that of its curvature: positive at a peak, negative at a trough. A mirror
//! that answers in counterphase changes the sign of I, and leaves that of C. φ is the phase by which the lag of the actuator
//! delays the modulation.
//!
//! Both references are tables of one period in Q15. n is even; the second half of the sine is the first with its sign
//! changed, and that of the cosine is the first again. Both add up to exactly zero, so a constant signal gives I = C = 0,
//! and neither sees the signal of the other. A signal that changes within a period leaks: a ramp of r codes per tick gives
//! |I| ≤ r·n²/2π and |C| ≤ r·n²/4π.

use crate::MAX_CODE;

/// Longest period, ticks.
pub const MAX_TICKS_PER_PERIOD: usize = 64;

/// One period of the reference, and the delay of the response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reference {
    /// Q15 sine; the first `ticks` are used.
    sine_q15: [i16; MAX_TICKS_PER_PERIOD],
    /// Q15 cosine of the second harmonic, delayed by the lag of the actuator; the first `ticks` are used.
    second_q15: [i16; MAX_TICKS_PER_PERIOD],
    /// Ticks of a period: even, 4 to [`MAX_TICKS_PER_PERIOD`].
    ticks: u8,
    /// Ticks between the output of a modulation and the reading of its response.
    delay: u8,
}

/// Sums over one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    /// In phase with the modulation.
    pub in_phase: i64,
    /// In phase with the second harmonic that a peak of the light makes of the modulation.
    pub second: i64,
    /// Of the signal itself.
    pub plain: i64,
}

/// Memory of the detector: the sums so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Detector {
    sums: Sums,
    index: u8,
}

impl Reference {
    /// A reference of `ticks` per period whose response is read `delay` ticks later, and whose actuator delays the
    /// modulation by `lag_rad` of its phase. `None` for an odd number of ticks, one out of range, or a delay of a period or
    /// more.
    #[cfg(feature = "design")]
    pub fn new(ticks: usize, delay: usize, lag_rad: f64) -> Option<Self> {
        if !(4..=MAX_TICKS_PER_PERIOD).contains(&ticks) || !ticks.is_multiple_of(2) || delay >= ticks {
            return None;
        }
        let mut sine_q15 = [0; MAX_TICKS_PER_PERIOD];
        let half = ticks / 2;
        for (k, entry) in sine_q15.iter_mut().take(ticks).enumerate() {
            // The second half is the first with its sign changed, to the bit.
            let (sign, within) = if k < half { (1.0, k) } else { (-1.0, k - half) };
            let phase = core::f64::consts::PI * within as f64 / half as f64;
            *entry = (sign * libm::round(f64::from(i16::MAX) * libm::sin(phase))) as i16;
        }
        let second_q15 = second_harmonic(ticks, lag_rad);
        Some(Self { sine_q15, second_q15, ticks: ticks as u8, delay: delay as u8 })
    }

    /// A reference from its tables. Check it with [`Self::is_valid`].
    pub(crate) const fn from_tables(
        sine_q15: [i16; MAX_TICKS_PER_PERIOD],
        second_q15: [i16; MAX_TICKS_PER_PERIOD],
        ticks: u8,
        delay: u8,
    ) -> Self {
        Self { sine_q15, second_q15, ticks, delay }
    }

    /// True for an even number of ticks, a second half that is the first with its sign changed (for the second harmonic
    /// the first again, with a sum of zero), and zeros after them.
    pub(crate) fn is_valid(&self) -> bool {
        let ticks = usize::from(self.ticks);
        let [first, second] = [&self.sine_q15, &self.second_q15]
            .map(|table| move |index: usize| table.get(index).map_or(0, |entry| i32::from(*entry)));
        let turned = (0..ticks / 2).all(|k| first(k) == -first(k + ticks / 2));
        let repeated = (0..ticks / 2).all(|k| second(k) == second(k + ticks / 2));
        let balanced = (0..ticks).map(second).sum::<i32>() == 0;
        let rest = (ticks..MAX_TICKS_PER_PERIOD).all(|k| first(k) == 0 && second(k) == 0);
        let sound = turned && repeated && balanced && rest;
        (4..=MAX_TICKS_PER_PERIOD).contains(&ticks) && ticks % 2 == 0 && self.delay < self.ticks && sound
    }

    /// Ticks of a period.
    pub const fn ticks(&self) -> u8 {
        self.ticks
    }

    /// Ticks between the output of a modulation and the reading of its response.
    pub const fn delay(&self) -> u8 {
        self.delay
    }

    /// Q15 sine at a tick of the period.
    #[inline]
    pub fn sine_q15(&self, index: u8) -> i16 {
        self.sine_q15.get(usize::from(index)).copied().unwrap_or(0)
    }

    /// Q15 cosine of the second harmonic at a tick of the period.
    #[inline]
    pub fn second_q15(&self, index: u8) -> i16 {
        self.second_q15.get(usize::from(index)).copied().unwrap_or(0)
    }

    /// Σ sine² of a period: the in-phase sum of a signal equal to the reference, in 2^-15 of its amplitude.
    #[cfg(feature = "design")]
    pub(crate) fn power(&self) -> f64 {
        let squares = self.sine_q15.iter().map(|s| f64::from(*s) * f64::from(*s));
        squares.sum::<f64>() / f64::from(i16::MAX)
    }

    fn back(&self, index: u8, by: u8) -> u8 {
        if index >= by { index - by } else { index + self.ticks - by }
    }
}

/// cos(2(2πk/n − φ)) in Q15, scaled to full size, its sum exactly zero.
#[cfg(feature = "design")]
fn second_harmonic(ticks: usize, lag_rad: f64) -> [i16; MAX_TICKS_PER_PERIOD] {
    let half = ticks / 2;
    let at = |k: usize| libm::cos(core::f64::consts::TAU * k as f64 / half as f64 - 2.0 * lag_rad);
    let largest = (0..half).map(|k| libm::fabs(at(k))).fold(0.0, f64::max);
    let mut table = [0; MAX_TICKS_PER_PERIOD];
    // A period of four ticks has two samples of the harmonic: both are zero at a lag of an eighth of a period.
    if largest < 0.01 {
        return table;
    }
    let mut sum = 0;
    for k in 0..half {
        let value = libm::round(f64::from(i16::MAX) * at(k) / largest) as i32;
        sum += value;
        if let Some(entry) = table.get_mut(k) {
            *entry = value as i16;
        }
    }
    // Rounding may leave the sum some units from zero: as many entries give up one.
    for entry in table.iter_mut().take(half).filter(|entry| entry.unsigned_abs() < 32_767) {
        let step = sum.signum();
        *entry -= step as i16;
        sum -= step;
    }
    for k in 0..half {
        let value = table.get(k).copied().unwrap_or(0);
        if let Some(entry) = table.get_mut(k + half) {
            *entry = value;
        }
    }
    table
}

impl Detector {
    /// Index of the next tick in the period.
    pub const fn index(&self) -> u8 {
        self.index
    }

    /// Takes one sample. Returns the sums if it was the last one of a period.
    #[inline]
    pub fn update(&mut self, reference: &Reference, code: i32) -> Option<Sums> {
        let code = i64::from(code.clamp(-MAX_CODE, MAX_CODE));
        let at = reference.back(self.index, reference.delay);
        self.sums.in_phase += code * i64::from(reference.sine_q15(at));
        self.sums.second += code * i64::from(reference.second_q15(at));
        self.sums.plain += code;
        self.index += 1;
        if self.index < reference.ticks {
            return None;
        }
        self.index = 0;
        Some(core::mem::take(&mut self.sums))
    }
}

#[cfg(all(test, feature = "design"))]
mod tests {
    use super::*;

    #[test]
    fn a_constant_signal_gives_zero_and_a_sine_its_amplitude() {
        for ticks in (4..=64).step_by(2) {
            let reference = Reference::new(ticks, 1, 0.2).unwrap();
            assert!(reference.is_valid());
            let mut detector = Detector::default();
            let steady = (0..ticks).find_map(|_| detector.update(&reference, 1_234_567)).unwrap();
            assert_eq!((steady.in_phase, steady.second, steady.plain), (0, 0, 1_234_567 * ticks as i64));
            let mut last = None;
            for k in 0..ticks {
                let answer = libm::sin(core::f64::consts::TAU * (k as f64 - 1.0) / ticks as f64);
                last = detector.update(&reference, libm::round(1e6 * answer) as i32);
            }
            let amplitude = last.unwrap().in_phase as f64 / reference.power() / f64::from(i16::MAX) * 32_767.0;
            assert!((amplitude - 1e6).abs() < 40.0, "{ticks} ticks: {amplitude}");
            // The tables of 16 bits let a ten-thousandth of the sine through at most.
            let through = last.unwrap().second as f64 / (1e6 * 32_767.0 * ticks as f64 / 2.0);
            assert!(through.abs() < 1e-5, "{ticks} ticks: {through}");
        }
    }

    /// A peak curves the light down and a trough up, on either side of a resonance.
    #[test]
    fn the_second_harmonic_has_the_sign_of_the_curvature() {
        for (ticks, lag_rad) in [(4, 0.1), (6, 1.0), (8, 0.0), (10, 1.1), (64, 0.7)] {
            let reference = Reference::new(ticks, 2, lag_rad).unwrap();
            for (curvature, answer) in [(1e6, 1.0), (1e6, -1.0), (-1e6, 1.0), (-1e6, -1.0)] {
                let mut detector = Detector::default();
                let mut last = None;
                for k in 0..ticks {
                    let phase = core::f64::consts::TAU * (k as f64 - 2.0) / ticks as f64 - lag_rad;
                    let x = answer * 0.1 * libm::sin(phase);
                    last = detector.update(&reference, libm::round(2e6 - curvature * x * x) as i32);
                }
                let second = last.unwrap().second;
                assert_eq!(second.signum(), curvature as i64 / 1_000_000, "{ticks} ticks, {lag_rad}");
            }
        }
    }

    #[test]
    fn invalid_periods_are_refused() {
        assert!([3, 66, 7].iter().all(|ticks| Reference::new(*ticks, 0, 0.0).is_none()));
        assert!(Reference::new(8, 8, 0.0).is_none());
    }
}
