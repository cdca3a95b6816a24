//! Dither stripping: counts over whole dither periods.
//!
//! The dither turns the block, so the counter sees Ω + θ̇_dither. Between two upward zeros of the dither *angle* the
//! dither adds nothing, for any change of its amplitude. The pickoff is proportional to that angle and gives the zeros.
//! The tick in which a zero falls is split in proportion to the change of the pickoff:
//!
//! ```text
//! share before the zero = p₀/(p₀ − p₁)        p₀ < 0 ≤ p₁, pickoff at the two ends of the tick
//! ```
//!
//! Counts follow the same angle, so the split is exact for the dither part, for any motion within the tick. The
//! quantization of the counter and the noise of the pickoff remain. The share is rounded down, and its remainder goes
//! to the next period: Σ stripped + pending = Σ counts, always.
//!
//! Without dither there is no zero. After `longest` ticks without one, the sum is output as it is, with
//! [`Stripped::without_zero`]. The noise of a pickoff at rest has zeros of its own. So the pickoff must also move by a least swing in
//! each half of `longest` ticks; [`Stripper::has_dither`] tells both. It fails where the least swing is below the pickoff's noise, and
//! a gyro whose dither is only too small is in lock-in before this sees it.

/// Strips the dither of one gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stripper {
    longest: u16,
    sum: i64,
    ticks: u16,
    last: Option<i32>,
    least_swing: u32,
    /// Ticks of the stretch so far, and the lowest and highest pickoff in it.
    stretch: u16,
    lowest: i32,
    highest: i32,
    /// The last whole stretch had the least swing; the last period had a zero.
    swings: bool,
    has_zeros: bool,
}

/// Counts of one dither period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stripped {
    /// Counts.
    pub counts: i64,
    /// Ticks since the last output, including this one.
    pub ticks: u16,
    /// No zero within the longest period: the dither is still in the counts.
    pub without_zero: bool,
}

impl Stripper {
    /// A stripper for periods of at most `longest` ticks (at least 1). Twice the nominal period is a good choice.
    ///
    /// `least_swing`: least change of the pickoff in half of `longest` ticks, in its own unit; half the smallest amplitude of a
    /// working dither is a good choice. 0 accepts any.
    pub const fn new(longest: u16, least_swing: u32) -> Self {
        Self {
            longest: if longest == 0 { 1 } else { longest },
            sum: 0,
            ticks: 0,
            last: None,
            least_swing,
            stretch: 0,
            lowest: i32::MAX,
            highest: i32::MIN,
            swings: true,
            has_zeros: true,
        }
    }

    /// The same as it was before its first tick.
    pub const fn at_start(&self) -> Self {
        Self::new(self.longest, self.least_swing)
    }

    /// False from the moment on at which no dither is found, at most `longest` ticks after it ended; true again with the next stretch
    /// and period that have it. True before the first of them.
    pub const fn has_dither(&self) -> bool {
        self.swings && self.has_zeros
    }

    /// Counts that have not been output yet.
    pub const fn pending(&self) -> i64 {
        self.sum
    }

    /// Takes the counts of a tick and the pickoff at its end. Returns the stripped counts if a period ends in this tick.
    pub fn update(&mut self, counts: i32, pickoff: i32) -> Option<Stripped> {
        let before = self.last.replace(pickoff);
        self.watch(pickoff);
        self.sum += i64::from(counts);
        self.ticks = self.ticks.saturating_add(1);
        match before {
            Some(from) if from < 0 && pickoff >= 0 => {
                let swing = i64::from(pickoff) - i64::from(from);
                let after = (i64::from(counts) * i64::from(pickoff)).div_euclid(swing.max(1));
                Some(self.emit(self.sum - after, false))
            }
            _ if self.ticks >= self.longest => Some(self.emit(self.sum, true)),
            _ => None,
        }
    }

    /// The swing of each half of `longest` ticks.
    fn watch(&mut self, pickoff: i32) {
        (self.lowest, self.highest) = (self.lowest.min(pickoff), self.highest.max(pickoff));
        self.stretch = self.stretch.saturating_add(1);
        if self.stretch >= self.longest.div_ceil(2) {
            self.swings = self.highest.abs_diff(self.lowest) >= self.least_swing;
            (self.stretch, self.lowest, self.highest) = (0, i32::MAX, i32::MIN);
        }
    }

    fn emit(&mut self, counts: i64, without_zero: bool) -> Stripped {
        self.has_zeros = !without_zero;
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
            let mut stripper = Stripper::new(longest, 1000);
            let (mut stripped, mut counted) = (0_i64, 0_i64);
            for (counts, pickoff) in ticks {
                counted += i64::from(counts);
                stripped += stripper.update(counts, pickoff).map_or(0, |out| out.counts);
                prop_assert_eq!(stripped + stripper.pending(), counted);
            }
        }
    }

    /// 150 arcsec at 400 Hz with 0.6 arcsec per count: the dither is 248 counts, its residual below one.
    #[test]
    fn the_dither_is_removed_and_the_rate_stays() {
        let (mut stripper, mut before) = (Stripper::new(50, 1 << 20), 0_i64);
        let (mut outputs, mut worst) = (0_i64, 0_i64);
        for tick in 1..=100_000_u32 {
            let phase = core::f64::consts::TAU * 0.04003 * f64::from(tick);
            // The amplitude varies by a fifth.
            let angle = 150.0 * (1.0 + 0.2 * libm::sin(phase / 7.3)) * libm::sin(phase);
            let total = libm::floor((angle + 0.01 * f64::from(tick)) / 0.605) as i64;
            let counts = (total - before) as i32;
            before = total;
            if let Some(out) = stripper.update(counts, libm::round(angle * 1e4) as i32) {
                outputs += 1;
                assert!(!out.without_zero && stripper.has_dither());
                // 24.98 ticks of 0.0165 counts.
                worst = worst.max(out.counts.abs());
            }
        }
        assert_eq!(outputs, 4003);
        assert!(worst <= 2, "{worst}");
    }

    #[test]
    fn without_dither_it_is_reported() {
        let mut stripper = Stripper::new(10, 0);
        let out = (0..10).find_map(|_| stripper.update(3, 100)).unwrap();
        assert!(out.without_zero && out.counts == 30 && !stripper.has_dither());
    }

    /// A dither of 25 ticks that dies at any phase is missed within two periods, whatever the pickoff does then: rest anywhere, or noise
    /// about zero, whose zeros look like periods. When it returns, it is found within three.
    #[test]
    fn a_dither_that_dies_is_missed_within_two_periods() {
        let swing = |tick: u32| (1e6 * libm::sin(core::f64::consts::TAU * f64::from(tick) / 25.0)) as i32;
        for dies in 1000..1025_u32 {
            for rest in [None, Some(0), Some(70_000), Some(-70_000), Some(i32::MAX), Some(i32::MIN)] {
                let mut stripper = Stripper::new(50, 250_000);
                let mut dice = dies;
                for tick in 0..2000_u32 {
                    dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let noise = (dice >> 16) as i32 - 32_768;
                    let dead = (dies..1500).contains(&tick);
                    let pickoff = if dead { rest.unwrap_or(noise) } else { swing(tick).saturating_add(noise / 8) };
                    stripper.update(1, pickoff);
                    match tick {
                        _ if tick < dies || tick >= 1575 => assert!(stripper.has_dither(), "{dies} {rest:?} {tick}"),
                        _ if (dies + 50..1500).contains(&tick) => {
                            assert!(!stripper.has_dither(), "{dies} {rest:?} {tick}")
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}
