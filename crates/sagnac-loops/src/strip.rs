//! Dither stripping: counts of whole dither periods.
//!
//! The block swings under the gyro, so the counter sees Ω + θ̇_dither. Between two upward zeros of the dither
//! *angle* the swing adds nothing, whatever its amplitude did meanwhile. The pickoff (proportional to that angle) says
//! where the zeros are; the tick in which one falls is split in the proportion of the pickoff's own change:
//!
//! ```text
//! share before the zero = p₀/(p₀ − p₁)        p₀ < 0 ≤ p₁, pickoff at the two ends of the tick
//! ```
//!
//! Counts follow the same angle, so this split is exact for the dither part however it moves within the tick;
//! what is left is the counter's quantization and the pickoff's own noise. The share is rounded down and what
//! it leaves stays with the next period: Σ stripped + pending = Σ counts, always.
//!
//! Where it fails: without a swing there is no zero. After `longest` ticks without one the sum goes out as it is
//! and says [`Stripped::without_zero`].

/// Strips dither; one per gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stripper {
    longest: u16,
    sum: i64,
    ticks: u16,
    last: Option<i32>,
}

/// Counts of whole periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stripped {
    /// Counts.
    pub counts: i64,
    /// Ticks since the last output, this one included.
    pub ticks: u16,
    /// No zero was seen for as long as a period may be: the swing is still in there.
    pub without_zero: bool,
}

impl Stripper {
    /// Periods are at most `longest` ticks (at least 1): twice the nominal one is a good choice.
    pub const fn new(longest: u16) -> Self {
        Self { longest: if longest == 0 { 1 } else { longest }, sum: 0, ticks: 0, last: None }
    }

    /// Counts that no output has held yet.
    pub const fn pending(&self) -> i64 {
        self.sum
    }

    /// The counts of a tick and the pickoff at its end; what is stripped, where a period ends in this tick.
    pub fn take(&mut self, counts: i32, pickoff: i32) -> Option<Stripped> {
        let before = self.last.replace(pickoff);
        self.sum += i64::from(counts);
        self.ticks = self.ticks.saturating_add(1);
        match before {
            Some(from) if from < 0 && pickoff >= 0 => {
                let swing = i64::from(pickoff) - i64::from(from);
                let after = (i64::from(counts) * i64::from(pickoff)).div_euclid(swing.max(1));
                Some(self.give(self.sum - after, false))
            }
            _ if self.ticks >= self.longest => Some(self.give(self.sum, true)),
            _ => None,
        }
    }

    fn give(&mut self, counts: i64, without_zero: bool) -> Stripped {
        self.sum -= counts;
        let ticks = core::mem::take(&mut self.ticks);
        Stripped { counts, ticks, without_zero }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_count_is_lost(ticks in prop::collection::vec((-1000_i32..1000, any::<i32>()), 1..300), longest in 0_u16..40) {
            let mut stripper = Stripper::new(longest);
            let (mut given, mut taken) = (0_i64, 0_i64);
            for (counts, pickoff) in ticks {
                taken += i64::from(counts);
                given += stripper.take(counts, pickoff).map_or(0, |out| out.counts);
                prop_assert_eq!(given + stripper.pending(), taken);
            }
        }
    }

    /// 150 arcsec at 400 Hz under 0.6 arcsec per count: the swing is 248 counts, what is left of it below one.
    #[test]
    fn the_swing_goes_the_rate_stays() {
        let (mut stripper, mut before) = (Stripper::new(50), 0_i64);
        let (mut outputs, mut worst) = (0_i64, 0_i64);
        for tick in 1..=100_000_u32 {
            let phase = core::f64::consts::TAU * 0.04003 * f64::from(tick);
            // The amplitude breathes by a fifth.
            let angle = 150.0 * (1.0 + 0.2 * libm::sin(phase / 7.3)) * libm::sin(phase);
            let total = libm::floor((angle + 0.01 * f64::from(tick)) / 0.605) as i64;
            let counts = (total - before) as i32;
            before = total;
            if let Some(out) = stripper.take(counts, libm::round(angle * 1e4) as i32) {
                outputs += 1;
                assert!(!out.without_zero);
                // 24.98 ticks of 0.0165 counts.
                worst = worst.max(out.counts.abs());
            }
        }
        assert_eq!(outputs, 4003);
        assert!(worst <= 2, "{worst}");
    }

    #[test]
    fn without_a_swing_it_says_so() {
        let mut stripper = Stripper::new(10);
        let out = (0..10).find_map(|_| stripper.take(3, 100)).unwrap();
        assert!(out.without_zero && out.counts == 30);
    }
}
