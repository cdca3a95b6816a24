//! Counts of a row that are a running total instead.
//!
//! ```text
//! falls from row to row, of all pairs      white noise: half;  a total of a gyro that turns one way: none, or one for each wrap
//! ```
//!
//! Taken for counts of a row, a total has a rate and a drift of thousands of °/h, and a fit follows both without a complaint.
//!
//! Fails where the gyro turns so little that its total hardly moves from row to row. A log with the motion of a rate table is not
//! looked at: a slow sweep of the rate rises as well.

use crate::error::{Error, Result};
use crate::ingest::Batch;

/// Fewer pairs of rows show nothing.
const FEWEST: u64 = 100;
/// Part of the pairs that go one way, in a total.
const ONE_WAY: f64 = 0.9;

/// Counts the steps of each axis as a log is read.
pub(crate) struct RunningTotal {
    axes: Vec<Steps>,
}

#[derive(Clone, Default)]
struct Steps {
    last: Option<f64>,
    pairs: u64,
    rises: u64,
    falls: u64,
}

impl RunningTotal {
    pub(crate) fn new(axes: usize) -> Self {
        Self { axes: vec![Steps::default(); axes] }
    }

    /// The next rows.
    pub(crate) fn push(&mut self, batch: &Batch) {
        for (steps, angle) in self.axes.iter_mut().zip(&batch.angle) {
            let count = |of: fn(&f64, &f64) -> bool| angle.windows(2).filter(|pair| of(&pair[0], &pair[1])).count();
            let first = steps.last.zip(angle.first().copied());
            steps.rises += count(|a, b| a < b) as u64 + u64::from(first.is_some_and(|(a, b)| a < b));
            steps.falls += count(|a, b| a > b) as u64 + u64::from(first.is_some_and(|(a, b)| a > b));
            steps.pairs += angle.len().saturating_sub(1) as u64 + u64::from(first.is_some());
            steps.last = angle.last().copied().or(steps.last);
        }
    }

    /// At the end of the log.
    pub(crate) fn check(&self, letters: &[char]) -> Result<()> {
        for (Steps { pairs, rises, falls, .. }, letter) in self.axes.iter().zip(letters) {
            let (of, way) = if rises >= falls { (rises, "rise") } else { (falls, "fall") };
            if *pairs >= FEWEST && *of as f64 >= ONE_WAY * *pairs as f64 {
                let what = format!(
                    "the counts of axis {letter} {way} in {of} of {pairs} steps from row to row, as a running total does"
                );
                return Err(Error::input(what).column("counter").help(
                    "set counter = \"cumulative\" (--counter cumulative), with counter_bits if it wraps; counts of a row go up and down",
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(counts: impl Iterator<Item = f64>, pieces: usize) -> bool {
        let all: Vec<f64> = counts.collect();
        let mut watch = RunningTotal::new(1);
        for part in all.chunks(pieces) {
            watch.push(&Batch { angle: vec![part.to_vec()], end_ns: vec![0; part.len()], ..Batch::default() });
        }
        watch.check(&['x']).is_err()
    }

    #[test]
    fn a_total_is_found_and_noise_is_not() {
        let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 29);
        for pieces in [1, 7, 4096] {
            assert!(found((0..200).map(|i| 20.0 * f64::from(i) + noise(i)), pieces));
            assert!(found((0..200).map(|i| -20.0 * f64::from(i)), pieces));
            // One of 8 bits, which wraps each twelve rows.
            assert!(found((0..2000).map(|i| (20.0 * f64::from(i)) % 256.0), pieces));
            assert!(!found((0..2000).map(|i| 148.0 + noise(i)), pieces));
            assert!(!found((0..2000).map(|_| 148.0), pieces));
            // Counts that creep upward by one in each five rows.
            assert!(!found((0..2000).map(|i| f64::from(i / 5)), pieces));
            assert!(!found((0..90).map(|i| 20.0 * f64::from(i)), pieces), "too short");
        }
    }
}
