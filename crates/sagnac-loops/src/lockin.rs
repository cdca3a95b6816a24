//! Synchronous detection over whole periods.
//!
//! ```text
//! I = Σ s[k]·sin(2πk/n)      M = Σ s[k]         k = 0 … n−1, one period of n ticks
//! ```
//!
//! The reference is a table of one period in Q15. n is even and the second half is the first with its sign changed, so
//! the entries add up to exactly zero and a constant signal gives I = 0. A signal that changes within a period leaks: a
//! ramp of r codes per tick gives
//! |I| ≤ r·n²/2π.

use crate::MAX_CODE;

/// Longest period, ticks.
pub const MAX_TICKS_PER_PERIOD: usize = 64;

/// One period of the reference, and the delay of the response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reference {
    /// Q15 sine; the first `ticks` are used.
    sine_q15: [i16; MAX_TICKS_PER_PERIOD],
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
    /// A reference of `ticks` per period whose response is read `delay` ticks later. `None` for an odd number of ticks,
    /// one out of range, or a delay of a period or more.
    #[cfg(feature = "design")]
    pub fn new(ticks: usize, delay: usize) -> Option<Self> {
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
        Some(Self { sine_q15, ticks: ticks as u8, delay: delay as u8 })
    }

    /// A reference from a table. Check it with [`Self::is_valid`].
    pub(crate) const fn from_table(sine_q15: [i16; MAX_TICKS_PER_PERIOD], ticks: u8, delay: u8) -> Self {
        Self { sine_q15, ticks, delay }
    }

    /// True for an even number of ticks, a second half that is the first with its sign changed, and zeros after them.
    pub(crate) fn is_valid(&self) -> bool {
        let ticks = usize::from(self.ticks);
        let at = |index: usize| self.sine_q15.get(index).map_or(0, |entry| i32::from(*entry));
        let turned = (0..ticks / 2).all(|k| at(k) == -at(k + ticks / 2));
        let rest = (ticks..MAX_TICKS_PER_PERIOD).all(|k| at(k) == 0);
        (4..=MAX_TICKS_PER_PERIOD).contains(&ticks) && ticks % 2 == 0 && self.delay < self.ticks && turned && rest
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
            let reference = Reference::new(ticks, 1).unwrap();
            let mut detector = Detector::default();
            let steady = (0..ticks).find_map(|_| detector.update(&reference, 1_234_567)).unwrap();
            assert_eq!((steady.in_phase, steady.plain), (0, 1_234_567 * ticks as i64));
            let mut last = None;
            for k in 0..ticks {
                let answer = libm::sin(core::f64::consts::TAU * (k as f64 - 1.0) / ticks as f64);
                last = detector.update(&reference, libm::round(1e6 * answer) as i32);
            }
            let amplitude = last.unwrap().in_phase as f64 / reference.power() / f64::from(i16::MAX) * 32_767.0;
            assert!((amplitude - 1e6).abs() < 40.0, "{ticks} ticks: {amplitude}");
        }
    }

    #[test]
    fn invalid_periods_are_refused() {
        assert!(Reference::new(3, 0).is_none() && Reference::new(66, 0).is_none() && Reference::new(7, 0).is_none());
        assert!(Reference::new(8, 8).is_none());
    }
}
