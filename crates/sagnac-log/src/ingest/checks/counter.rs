//! Steps of a cumulative counter: across wraps and lost rows, but not across a reset.
//!
//! The total is known on both sides of a gap, so the counts within the gap are known too. Three cases need care:
//!
//! * A counter of known width wraps: the step nearest to the mean step so far is used. The step is unknown if it does not
//!   determine the number of wraps.
//! * A counter of unknown width wraps: the log is refused, and the message names the apparent width.
//! * A counter is reset: its total is near zero and its step is far from all earlier ones.
//!
//! A counter that goes on from one file to the next says that both are of one run, although the clock restarts
//! ([`StepStatistics::is_next`]).

/// Steps that must have been seen before a step can be called unusual.
const FEWEST_STEPS: u32 = 4;
/// Weight of the newest step in the mean.
const NEWEST: f64 = 1.0 / 16.0;
/// Smallest tolerance of a step, quanta.
const SOME_QUANTA: f64 = 16.0;
/// Most quanta in a gap.
const MOST_EXPECTED: f64 = 1e18;
/// A step this many times as far from the mean as any before it is a reset.
const FAR: f64 = 4.0;

/// Interpretation of a step from one total to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CounterStep {
    /// This many quanta were counted.
    Counted(i64),
    /// The counter was reset.
    Reset,
    /// It may have wrapped more than once.
    Unknown,
    /// A counter of this many bits wrapped although the setup does not state its width; its step.
    Wrap(u32, i64),
}

/// Statistics of the steps of one axis so far, quanta per interval.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepStatistics {
    steps: u32,
    mean: f64,
    /// Largest distance of a step from the mean.
    spread: f64,
    /// The largest step, with its sign.
    largest: f64,
}

impl StepStatistics {
    /// The step from one total to the next, over a number of intervals.
    pub(crate) fn step(&self, before: i64, now: i64, intervals: i64, bits: Option<u8>) -> CounterStep {
        let difference = now - before;
        let over = intervals as f64;
        let expected = self.mean * over;
        let ambiguous = bits.is_some_and(|bits| FAR * self.uncertain(over) > 2.0_f64.powi(i32::from(bits)));
        if intervals > 1 && (ambiguous || expected.abs() > MOST_EXPECTED) {
            return CounterStep::Unknown;
        }
        let step = match bits {
            None => difference,
            Some(bits) => {
                let width = 1_i64 << bits;
                // Adjacent rows and the first ones: the smaller of the two possible steps.
                let about = if intervals > 1 && self.is_known() { expected.round() as i64 } else { 0 };
                about + (difference - about + width / 2).rem_euclid(width) - width / 2
            }
        };
        if bits.is_none()
            && let Some(wrap) = self.wrap(step, over)
        {
            return CounterStep::Wrap(wrap, step);
        }
        if self.is_reset(now, step as f64 - expected, over) {
            return CounterStep::Reset;
        }
        CounterStep::Counted(step)
    }

    /// Adds a used step to the statistics.
    pub(crate) fn take(&mut self, step: i64, intervals: i64) {
        let one = step as f64 / intervals as f64;
        if self.steps > 0 {
            self.spread = self.spread.max((one - self.mean).abs());
        }
        self.mean = if self.steps == 0 { one } else { self.mean + NEWEST * (one - self.mean) };
        self.steps = self.steps.saturating_add(1);
        if one.abs() > self.largest.abs() {
            self.largest = one;
        }
    }

    /// True where a total in the first row of another file is what one interval after the last total of this one would bring.
    pub(crate) fn is_next(&self, before: i64, now: i64, bits: Option<u8>) -> bool {
        let CounterStep::Counted(step) = self.step(before, now, 1, bits) else { return false };
        self.is_known() && (step as f64 - self.mean).abs() <= 2.0 * self.spread + SOME_QUANTA
    }

    /// True for a total that a counter which began again has soon, too.
    pub(crate) fn stands_near_zero(&self, total: i64) -> bool {
        total.abs() as f64 <= FAR * (self.largest.abs() + SOME_QUANTA)
    }

    fn is_known(&self) -> bool {
        self.steps >= FEWEST_STEPS
    }

    /// Largest distance from the mean of a step over a number of intervals; the step's own size before there is a mean.
    fn uncertain(&self, over: f64) -> f64 {
        if self.is_known() { self.spread * over + SOME_QUANTA } else { self.largest.abs() * over + SOME_QUANTA }
    }

    fn is_reset(&self, now: i64, away: f64, over: f64) -> bool {
        let usual = self.largest.abs() * over;
        self.is_known() && away.abs() > FAR * usual + SOME_QUANTA && now.abs() as f64 <= 2.0 * usual + SOME_QUANTA
    }

    /// The width of a counter that wrapped: a step back by a power of two minus the usual counts.
    fn wrap(&self, step: i64, over: f64) -> Option<u32> {
        let (size, usual) = (step.unsigned_abs(), self.largest.abs() * over);
        let turned = self.largest != 0.0 && (step.signum() as f64) != self.largest.signum();
        let bits = size.max(1).ilog2() + u32::from(!size.is_power_of_two());
        let of_a_wrap = (1_u64 << bits.min(62)).abs_diff(size) as f64 <= 1.5 * usual + SOME_QUANTA;
        (turned && bits >= 8 && size as f64 > FAR * usual && of_a_wrap).then_some(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A counter with 480 to 520 counts per interval.
    fn steps() -> StepStatistics {
        let mut steps = StepStatistics::default();
        (0..50).for_each(|k| steps.take(480 + (k * 7) % 41, 1));
        steps
    }

    #[test]
    fn wraps_and_losses_together() {
        let wrapped = |total: i64| total.rem_euclid(1 << 16);
        for intervals in 1..=500 {
            let now = 65_000 + 500 * intervals + 3;
            let step = steps().step(65_000, wrapped(now), intervals, Some(16));
            // 65 intervals are half a turn: the mean determines the turns until its spread is a quarter of one.
            match intervals {
                ..=400 => assert_eq!(step, CounterStep::Counted(500 * intervals + 3), "{intervals}"),
                _ => assert!(
                    [CounterStep::Unknown, CounterStep::Counted(500 * intervals + 3)].contains(&step),
                    "{intervals}: {step:?}"
                ),
            }
        }
        assert_eq!(steps().step(65_000, wrapped(65_000 + 500 * 5000), 5000, Some(16)), CounterStep::Unknown);
    }

    #[test]
    fn a_counter_goes_on_or_begins_anew() {
        let next = |before: i64, now: i64| steps().is_next(before, now, None);
        assert!(next(1_234_567, 1_235_067));
        assert!(!next(1_234_567, 1_234_567), "nothing was counted in an interval");
        assert!(!next(1_234_567, 1_235_567), "two intervals");
        assert!(!next(1_234_567, 500));
        assert!(!StepStatistics::default().is_next(1_234_567, 1_235_067, None), "nothing is known yet");
        assert!(steps().is_next(65_300, 264, Some(16)) && steps().stands_near_zero(264), "a wrap is no evidence");
        assert!(steps().stands_near_zero(-500) && !steps().stands_near_zero(10_000));
    }

    #[test]
    fn resets_and_wraps_are_told_apart() {
        assert_eq!(steps().step(1_234_567, 490, 1, None), CounterStep::Reset);
        assert_eq!(steps().step(1_234_567, 490, 1, Some(32)), CounterStep::Reset);
        assert_eq!(steps().step(1_234_567, 5_000, 12, None), CounterStep::Reset);
        assert_eq!(steps().step(65_300, 264, 1, None), CounterStep::Wrap(16, -65_036));
        assert_eq!(steps().step(1_234_567, 1_240_567, 12, None), CounterStep::Counted(6000));
        // A turn of the table is a step.
        assert_eq!(steps().step(1_234_567, 1_334_567, 1, None), CounterStep::Counted(100_000));
        assert_eq!(
            steps().step(-9_000_000_000_000_000, 9_000_000_000_000_000, i64::MAX / 4, Some(52)),
            CounterStep::Unknown
        );
        assert_eq!(
            StepStatistics::default().step(1_000_000, 3, 1, None),
            CounterStep::Counted(-999_997),
            "nothing is known yet"
        );
    }
}
