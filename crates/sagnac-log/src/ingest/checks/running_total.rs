//! Counts of a row that are a running total instead.
//!
//! ```text
//! falls from row to row, of all moves      white noise: half;  a total of a gyro that turns one way: none, or one for each wrap
//! ```
//!
//! Taken for counts of a row, a total has a rate and a drift of thousands of °/h, and a fit follows both without a complaint.
//!
//! Fails where a total goes up and down: a gyro that hardly turns, a dither in it, a wrap in every few rows. Counts of long rows in a test
//! that sweeps the rate one way look like a total; a setup that states `counter` is believed, and a log with the motion of a rate table
//! is not looked at.

use crate::error::{Error, Result};
use crate::ingest::checks::batch::Batch;

/// Fewer rises and falls show nothing: of noise, 38 of 40 go one way in 1 of 10⁹ logs.
const FEWEST: u64 = 40;
/// Part of them that goes one way, in a total.
const ONE_WAY: f64 = 0.95;

/// Counts the steps of each axis as a log is read.
pub(crate) struct RunningTotal {
    axes: Vec<Moves>,
}

#[derive(Clone, Default)]
struct Moves {
    last: Option<f64>,
    rises: u64,
    falls: u64,
}

impl RunningTotal {
    pub(crate) fn new(axes: usize) -> Self {
        Self { axes: vec![Moves::default(); axes] }
    }

    /// The next rows.
    pub(crate) fn push(&mut self, batch: &Batch) {
        for (steps, angle) in self.axes.iter_mut().zip(&batch.angle) {
            let pairs = angle.windows(2).map(|pair| (pair[0], pair[1]));
            // Without branches, for noise goes either way.
            let count =
                |(rises, falls): (u64, u64), (a, b): (f64, f64)| (rises + u64::from(a < b), falls + u64::from(a > b));
            let first = steps.last.zip(angle.first().copied());
            (steps.rises, steps.falls) = pairs.fold(first.into_iter().fold((steps.rises, steps.falls), count), count);
            steps.last = angle.last().copied().or(steps.last);
        }
    }

    /// After some rows, or all.
    pub(crate) fn check(&self, letters: &[char]) -> Result<()> {
        for (Moves { rises, falls, .. }, letter) in self.axes.iter().zip(letters) {
            let ((of, way), moves) = (if rises >= falls { (rises, "rise") } else { (falls, "fall") }, rises + falls);
            if moves >= FEWEST && *of as f64 >= ONE_WAY * moves as f64 {
                let what = format!(
                    "the counts of axis {letter} {way} in {of} of the {moves} steps between different rows, like a running total"
                );
                return Err(Error::input(what, "set counter = \"cumulative\" (--counter cumulative) for a total, or counter = \"incremental\" for counts of each row").column("counter"));
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
            // One of 12 bits, which wraps each 200 rows; one of a slow gyro, with many rows alike; one of an hour of minutes.
            assert!(found((0..2000).map(|i| (20.0 * f64::from(i)) % 4096.0), pieces));
            assert!(found((0..2000).map(|i| f64::from(i / 5)), pieces));
            assert!(found((0..60).map(|i| 20.0 * f64::from(i)), pieces));
            assert!(!found((0..2000).map(|i| 148.0 + noise(i)), pieces));
            assert!(!found((0..2000).map(|_| 148.0), pieces));
            assert!(!found((0..40).map(|i| 20.0 * f64::from(i)), pieces), "too short");
        }
    }
}
