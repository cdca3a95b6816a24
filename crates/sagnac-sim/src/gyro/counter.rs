//! Clock and counter: whole counts, time stamps, and the errors of both.
//!
//! ```text
//! true length of a nominal interval = nominal·(1 + drift)/(1 + fast)
//! ```
//!
//! An oscillator that is off by `fast` also times the log, so its stamps do not show it. A fault's `drift` is relative
//! to the clock of the log and does show. Angle that makes no whole count is carried to the next row.

use crate::scenario::{ElectronicsConfig, REFERENCE_C, Scenario};

/// Constants of clock and counter.
#[derive(Clone, Debug)]
pub(crate) struct Counter {
    electronics: ElectronicsConfig,
    /// Limit of the counter, counts.
    most: i64,
}

/// Clock and counter at the end of the latest row.
#[derive(Clone, Debug, Default)]
pub(crate) struct CounterState {
    /// Fraction of a count carried to the next row.
    carried: f64,
    /// The log's clock, s.
    time_s: f64,
    /// The same as stamped: in whole microseconds, or exactly on the row.
    pub(crate) time_ns: i64,
}

impl Counter {
    pub(crate) fn build(scenario: &Scenario) -> Self {
        let bits = scenario.electronics.counter_bits;
        let most = if bits >= 1.0 { (libm::exp2(bits - 1.0) - 1.0) as i64 } else { i64::MAX };
        Self { electronics: scenario.electronics.clone(), most }
    }

    /// Whether clock and counter have no errors; then [`CounterState::stamp`] and [`CounterState::whole`] suffice.
    pub(crate) fn is_exact(&self) -> bool {
        let e = &self.electronics;
        !(e.clock_ppm != 0.0 || e.clock_ppm_per_c != 0.0 || e.counter_bits > 0.0)
    }

    /// Advances the log's clock by a nominal interval; its true length.
    pub(crate) fn advance(&self, state: &mut CounterState, nominal_s: f64, block_c: f64, drift: f64) -> f64 {
        let e = &self.electronics;
        let fast = (e.clock_ppm + e.clock_ppm_per_c * (block_c - REFERENCE_C)) * 1e-6;
        state.time_s += nominal_s * (1.0 + drift);
        state.time_ns = libm::round(state.time_s * 1e6) as i64 * 1000;
        nominal_s * (1.0 + drift) / (1.0 + fast)
    }

    /// Counts of a row, limited by the width of the counter and by `fault_limit`. Counts beyond are lost.
    pub(crate) fn count(&self, state: &mut CounterState, counts: f64, fault_limit: i64) -> i64 {
        let most = self.most.min(fault_limit);
        state.whole(counts).clamp(-most, most)
    }
}

impl CounterState {
    /// Sets an exact time stamp.
    pub(crate) fn stamp(&mut self, time_ns: i64) {
        self.time_ns = time_ns;
        self.time_s = time_ns as f64 * 1e-9;
    }

    /// Whole counts of an angle in counts; the fraction is carried.
    #[inline]
    pub(crate) fn whole(&mut self, counts: f64) -> i64 {
        self.carried += counts;
        let whole = libm::floor(self.carried);
        self.carried -= whole;
        whole as i64
    }
}
