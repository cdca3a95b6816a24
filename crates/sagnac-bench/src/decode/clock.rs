//! The gyro's clock next to the computer's.
//!
//! ```text
//! Δ = arrival − time of the row        offset = least Δ of a minute (what came without delay)
//! jitter = median of Δ − offset        drift = slope of the offsets, ppm
//! ```
//!
//! A clock that begins again (a gyro that was switched off and on) goes on from the row before by the time between the arrivals. A single time that
//! is out of order is a damaged row, and stays as it is; the reader of the log rejects it.

use sagnac_units::s_from_ns;
use serde::Serialize;

/// Rows in a row that are behind before a clock counts as begun again.
const BEHIND: u32 = 5;
/// A clock that goes back by less has not begun again, ns.
const BACK_NS: i64 = 1_000_000_000;
/// Time of an offset, ns.
const MINUTE_NS: i64 = 60_000_000_000;
/// Offsets that are kept: when there are more, every other one goes.
const MOST_OFFSETS: usize = 512;
/// Drift is known after so many minutes.
const LEAST_MINUTES: usize = 10;

/// The gyro's clock next to the computer's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ClockReport {
    /// By how much rows arrive later than the quickest of their minute: the median, s. Values of instruments are aligned to within this.
    pub jitter_s: f64,
    /// How much faster the gyro's clock is, ppm; `None` before ten minutes.
    pub drift_ppm: Option<f64>,
    /// How often it began again.
    pub restarts: u32,
}

/// Follows the times of rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct RowClock {
    /// Added to every time of the gyro.
    offset_ns: i64,
    /// Time and arrival of the newest row in order.
    last: Option<(i64, i64)>,
    /// Rows in a row that are behind it, and the newest of them.
    behind: u32,
    behind_ns: i64,
    is_new_connection: bool,
    restarts: u32,
    delays: Delays,
}

impl RowClock {
    /// The next row may be of a clock that began again.
    pub(crate) fn connected(&mut self) {
        self.is_new_connection = true;
    }

    /// The time at which a row of this time counts; and whether the clock began again with it.
    pub(crate) fn at(&mut self, time_ns: i64, arrival_ns: i64) -> (i64, bool) {
        let mut now_ns = time_ns.saturating_add(self.offset_ns);
        let mut anew = false;
        if let Some((last_ns, last_arrival_ns)) = self.last
            && now_ns < last_ns.saturating_sub(BACK_NS)
        {
            self.behind = if now_ns > self.behind_ns { self.behind + 1 } else { 1 };
            self.behind_ns = now_ns;
            if !self.is_new_connection && self.behind < BEHIND {
                return (now_ns, false);
            }
            let since_ns = arrival_ns.saturating_sub(last_arrival_ns).max(1);
            now_ns = last_ns.saturating_add(since_ns);
            self.offset_ns = now_ns.saturating_sub(time_ns);
            self.restarts += 1;
            self.delays = Delays::default();
            anew = true;
        }
        self.behind = 0;
        self.behind_ns = i64::MIN;
        self.is_new_connection = false;
        self.last = Some((now_ns, arrival_ns));
        (now_ns, anew)
    }

    /// Rows up to the newest one arrived together.
    pub(crate) fn arrived(&mut self) {
        if let Some((time_ns, arrival_ns)) = self.last {
            self.delays.push(arrival_ns, arrival_ns.saturating_sub(time_ns));
        }
    }

    /// What is added to the times of the gyro.
    pub(crate) fn offset_ns(&self) -> i64 {
        self.offset_ns
    }

    /// The next row is the first of a connection.
    pub(crate) fn is_new_connection(&self) -> bool {
        self.is_new_connection
    }

    /// The newest row's time and arrival.
    pub(crate) fn last(&self) -> Option<(i64, i64)> {
        self.last
    }

    pub(crate) fn report(&self) -> ClockReport {
        ClockReport { jitter_s: self.delays.jitter_s(), drift_ppm: self.delays.drift_ppm(), restarts: self.restarts }
    }
}

/// Delays of arrival.
#[derive(Clone, Debug, Default)]
struct Delays {
    /// The minute that is being filled: its start, and all delays in it.
    minute_ns: i64,
    delays_ns: Vec<i64>,
    /// Of every minute: middle, least delay.
    offsets: Vec<(i64, i64)>,
    jitter_ns: i64,
}

/// Delays of a minute that are kept.
const MOST_DELAYS: usize = 4096;

impl Delays {
    fn push(&mut self, arrival_ns: i64, delay_ns: i64) {
        if self.delays_ns.is_empty() {
            self.minute_ns = arrival_ns;
        } else if arrival_ns.saturating_sub(self.minute_ns) >= MINUTE_NS {
            self.close();
            self.minute_ns = arrival_ns;
        }
        if self.delays_ns.len() < MOST_DELAYS {
            self.delays_ns.push(delay_ns);
        }
    }

    fn close(&mut self) {
        self.delays_ns.sort_unstable();
        let (Some(least), Some(middle)) = (self.delays_ns.first(), self.delays_ns.get(self.delays_ns.len() / 2)) else {
            return;
        };
        self.jitter_ns = middle - least;
        self.offsets.push((self.minute_ns + MINUTE_NS / 2, *least));
        if self.offsets.len() > MOST_OFFSETS {
            let mut at = 0;
            self.offsets.retain(|_| {
                at += 1;
                at % 2 == 1
            });
        }
        self.delays_ns.clear();
    }

    fn jitter_s(&self) -> f64 {
        s_from_ns(self.jitter_ns)
    }

    /// By least squares: a row that falls behind the computer's clock makes its offset grow.
    fn drift_ppm(&self) -> Option<f64> {
        let (first_ns, first_offset_ns) = *self.offsets.first()?;
        if self.offsets.len() < LEAST_MINUTES {
            return None;
        }
        let n = self.offsets.len() as f64;
        let points =
            || self.offsets.iter().map(|(at, offset)| ((at - first_ns) as f64, (offset - first_offset_ns) as f64));
        let (mean_t, mean_o) = points().fold((0.0, 0.0), |(t, o), (at, offset)| (t + at / n, o + offset / n));
        let across: f64 = points().map(|(at, offset)| (at - mean_t) * (offset - mean_o)).sum();
        let along: f64 = points().map(|(at, _)| (at - mean_t).powi(2)).sum();
        (along > 0.0).then(|| -1e6 * across / along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn a_clock_that_begins_anew_goes_on_by_arrival() {
        let mut clock = RowClock::default();
        assert_eq!(clock.at(100 * S, 1000 * S), (100 * S, false));
        // One damaged time stays what it is.
        assert_eq!(clock.at(3 * S, 1001 * S), (3 * S, false));
        assert_eq!(clock.at(102 * S, 1002 * S), (102 * S, false));
        clock.connected();
        assert_eq!(clock.at(S, 1010 * S), (110 * S, true));
        assert_eq!(clock.at(2 * S, 1011 * S), (111 * S, false));
        // Without a new connection five rows in order tell.
        assert_eq!(clock.at(50 * S, 1059 * S), (159 * S, false));
        let times: Vec<(i64, bool)> = (1..7).map(|i| clock.at(i * S, (1070 + i) * S)).collect();
        assert_eq!(times[4], (175 * S, true));
        assert_eq!(times[5], (176 * S, false));
        assert_eq!(clock.report().restarts, 2);
    }

    #[test]
    fn jitter_and_drift_are_measured() {
        let mut clock = RowClock::default();
        // 50 ppm fast, with delays of 0, 20, 40, 60 and 80 ms: the median is 40.
        for i in 0..3600_i64 {
            let arrival_ns = i * S;
            clock.at((arrival_ns as f64 * (1.0 + 50e-6)) as i64, arrival_ns + (i % 5) * 20_000_000);
            clock.arrived();
        }
        let report = clock.report();
        assert!((report.jitter_s - 0.04).abs() < 0.004, "{report:?}");
        assert!((report.drift_ppm.unwrap() - 50.0).abs() < 3.0, "{report:?}");
    }
}
