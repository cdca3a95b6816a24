//! The noise of the windows of a rate-table test, within their plateaus.
//!
//! ```text
//! y = level of the plateau's rate + n        n: white + slow noise, each plateau by itself ([`super::slow_noise`])
//! ```
//!
//! Variances of greatest restricted likelihood over all plateaus together, or as the setup states them where these windows show no more.
//! What is slower than a plateau is in its bias, and in none of the figures. A level for each rate keeps what the gyro does to different rates out of the noise; where a
//! table moves too freely for that, a straight line takes its place.
//!
//! Fails where the rates of a plateau lie in different runs: how the bias changes from run to run is not known within one.

use nalgebra::{DMatrix, DVector};

use crate::fit::likelihood::{Block, MOST_ROWS, Rows};
use crate::fit::plateaus::{KnownNoise, TurnedWindow};
use crate::fit::row_noise::{RowNoise, noise_of_blocks, stated_or_shown, whitened};
use crate::fit::slow_noise::{SlowNoise, Whitening};

/// Noise of a window of nominal length.
pub(super) struct PlateauNoise {
    slow: SlowNoise,
    /// White variance over all plateaus, (°/h)²; 0 where each has its own scatter alone.
    white: f64,
    longest_s: f64,
    nominal_s: f64,
}

impl PlateauNoise {
    /// Of the plateaus' windows, each with the place of its rate among those of its plateau.
    pub(super) fn of(plateaus: &[Vec<TurnedWindow>], levels: &[Vec<usize>], known: KnownNoise) -> Self {
        let white = Self { slow: SlowNoise::default(), white: 0.0, longest_s: 0.0, nominal_s: 1.0 };
        let Some(nominal_s) = known.nominal_s else { return white };
        let longest_s = plateaus.iter().map(|windows| length_s(windows)).fold(0.0, f64::max) + nominal_s;
        let white = Self { longest_s, nominal_s, ..white };
        let mut rest = MOST_ROWS;
        let few = plateaus.iter().zip(levels).map(|(windows, levels)| {
            let count = windows.len().min(rest);
            rest -= count;
            (&windows[..count], &levels[..count])
        });
        let blocks: Vec<Block> = few
            .filter(|(windows, _)| !windows.is_empty())
            .map(|(windows, levels)| {
                let columns = level_columns(windows, levels);
                Block { rows: white.rows(windows), own: columns.ncols() - 1, columns }
            })
            .collect();
        let found = match known.stated {
            Some((slow, white)) => Some(stated_or_shown(blocks, RowNoise { slow, white })),
            None => noise_of_blocks(blocks).map(|found| found.best),
        };
        found.map_or(white, |RowNoise { slow, white }| Self { slow, white, longest_s, nominal_s })
    }

    /// Variance of a window about a fit of some columns to its plateau; never less than over all plateaus. `None` where nothing is
    /// over to tell it.
    pub(super) fn about(&self, windows: &[TurnedWindow], columns: &[fn(&TurnedWindow) -> f64]) -> Option<f64> {
        let y = columns.len();
        let value = |i: usize, j: usize| if j == y { windows[i].beyond_dph() } else { columns[j](&windows[i]) };
        self.variance(windows, &DMatrix::from_fn(windows.len(), y + 1, value))
    }

    /// The same about the levels of its rates.
    pub(super) fn within(&self, windows: &[TurnedWindow], levels: &[usize]) -> Option<f64> {
        self.variance(windows, &level_columns(windows, levels))
    }

    fn variance(&self, windows: &[TurnedWindow], columns: &DMatrix<f64>) -> Option<f64> {
        let degrees = windows.len().checked_sub(columns.ncols() - 1).filter(|degrees| *degrees > 0)?;
        let rows = self.rows(windows);
        let solution = whitened(&Whitening::new(rows.view(), self.slow), columns)?;
        Some(self.white.max(solution.ssr / degrees as f64))
    }

    /// σ of a sum over the windows, each with its part, beside a white variance of a window.
    pub(super) fn sigma(&self, windows: &[TurnedWindow], parts: &DVector<f64>, variance: f64) -> f64 {
        let column = DMatrix::from_column_slice(parts.len(), 1, parts.as_slice());
        let of_white = self.slow.between(self.rows(windows).view(), &column)[(0, 0)];
        (variance * of_white).max(0.0).sqrt()
    }

    fn rows(&self, windows: &[TurnedWindow]) -> Rows {
        let (run, middle_s) = windows.iter().map(|w| (w.run, w.middle_s)).unzip();
        let weight = windows.iter().map(|w| w.weight).collect();
        Rows { run, middle_s, weight, longest_s: self.longest_s, nominal_s: self.nominal_s }
    }
}

/// Rates of a plateau that have a level each.
const MOST_LEVELS: usize = 24;

/// Time from the first to the last window, the longest of any run in it.
fn length_s(windows: &[TurnedWindow]) -> f64 {
    let of_run = windows.chunk_by(|a, b| a.run == b.run);
    of_run.map(|run| run[run.len() - 1].middle_s - run[0].middle_s).fold(0.0, f64::max)
}

/// A column for each level, then what was measured; a straight line where there are too many levels.
fn level_columns(windows: &[TurnedWindow], levels: &[usize]) -> DMatrix<f64> {
    let mut different = levels.to_vec();
    different.sort_unstable();
    different.dedup();
    let count = different.len();
    if 2 * count > windows.len() || count > MOST_LEVELS {
        return DMatrix::from_fn(windows.len(), 3, |i, j| match j {
            0 => 1.0,
            1 => windows[i].along_dph,
            _ => windows[i].beyond_dph(),
        });
    }
    let of = |i: usize, j: usize| {
        if j == count { windows[i].beyond_dph() } else { f64::from(u8::from(levels[i] == different[j])) }
    };
    DMatrix::from_fn(windows.len(), count + 1, of)
}
