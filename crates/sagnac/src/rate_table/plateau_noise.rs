//! The noise of the windows of a rate-table test, within their plateaus.
//!
//! ```text
//! y = level of the plateau's rate + n        n: white + slow noise, each plateau by itself ([`crate::noise_model`])
//! ```
//!
//! Variances of greatest restricted likelihood over all plateaus together, or as the setup states them where these windows show no more.
//! What is slower than a plateau is in its bias, and in none of the values. A level for each rate keeps what the gyro does to different rates out of the noise; where a
//! table moves too freely for that, a straight line takes its place.
//!
//! Of many windows neighbours are averaged for that ([`crate::noise_model::likelihood`]): the noise is that of all plateaus.
//!
//! Fails where the rates of a plateau lie in different runs: how the bias changes from run to run is not known within one.

use crate::noise_model::blocks::{RowNoise, noise_of_blocks, stated_or_shown, whitened};
use crate::noise_model::likelihood::{Block, Rows, mean};
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;
use crate::rate_table::turned_window::{KnownNoise, TurnedWindow};
use nalgebra::{DMatrix, DVector};

/// Noise of a window of nominal length.
pub(crate) struct PlateauNoise {
    slow: SlowNoise,
    /// White variance over all plateaus, (°/h)²; 0 where each has its own scatter alone.
    white: f64,
    longest_s: f64,
    nominal_s: f64,
}

impl PlateauNoise {
    /// Of the plateaus' windows, each with the place of its rate among those of its plateau.
    pub(crate) fn of(plateaus: &[Vec<TurnedWindow>], levels: &[Vec<usize>], known: KnownNoise) -> Self {
        let white = Self { slow: SlowNoise::default(), white: 0.0, longest_s: 0.0, nominal_s: 1.0 };
        let Some(nominal_s) = known.nominal_s else { return white };
        let longest_s = plateaus.iter().map(|windows| length_s(windows)).fold(0.0, f64::max) + nominal_s;
        let white = Self { longest_s, nominal_s, ..white };
        let all = plateaus.iter().map(Vec::len).sum();
        let block = |(windows, levels): (&Vec<TurnedWindow>, &Vec<usize>)| {
            let each = white.rows(windows);
            let (rows, groups) = Rows::averaged(each.view(), all);
            let columns = level_columns(windows, levels, groups.len());
            let averaged = |group: usize, column: usize| mean(&each.weight, &groups[group], |i| columns[(i, column)]);
            let columns = DMatrix::from_fn(groups.len(), columns.ncols(), averaged);
            Block { rows, own: columns.ncols() - 1, columns }
        };
        let blocks: Vec<Block> = plateaus.iter().zip(levels).map(block).collect();
        let noise = match known.stated {
            Some((slow, white)) => Some(stated_or_shown(blocks, RowNoise { slow, white })),
            None => noise_of_blocks(blocks).map(|estimated| estimated.best),
        };
        noise.map_or(white, |RowNoise { slow, white }| Self { slow, white, longest_s, nominal_s })
    }

    /// Variance of a window about a fit of some columns to its plateau; never less than over all plateaus. `None` where nothing is
    /// over to tell it.
    pub(crate) fn about(&self, windows: &[TurnedWindow], columns: &[fn(&TurnedWindow) -> f64]) -> Option<f64> {
        let y = columns.len();
        let value = |i: usize, j: usize| if j == y { windows[i].beyond_dph() } else { columns[j](&windows[i]) };
        self.variance(windows, &DMatrix::from_fn(windows.len(), y + 1, value))
    }

    /// The same about the levels of its rates.
    pub(crate) fn within(&self, windows: &[TurnedWindow], levels: &[usize]) -> Option<f64> {
        self.variance(windows, &level_columns(windows, levels, windows.len()))
    }

    fn variance(&self, windows: &[TurnedWindow], columns: &DMatrix<f64>) -> Option<f64> {
        let degrees = windows.len().checked_sub(columns.ncols() - 1).filter(|degrees| *degrees > 0)?;
        let rows = self.rows(windows);
        let solution = whitened(&Whitening::new(rows.view(), self.slow), columns)?;
        Some(self.white.max(solution.ssr / degrees as f64))
    }

    /// σ of a sum over the windows, each with its part, with a white variance of a window.
    pub(crate) fn sigma(&self, windows: &[TurnedWindow], parts: &DVector<f64>, variance: f64) -> f64 {
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

/// A column for each level, then what was measured; a straight line where there are too many levels for so many rows.
fn level_columns(windows: &[TurnedWindow], levels: &[usize], rows: usize) -> DMatrix<f64> {
    let mut different = levels.to_vec();
    different.sort_unstable();
    different.dedup();
    let count = different.len();
    if 2 * count > rows || count > MOST_LEVELS {
        return DMatrix::from_fn(windows.len(), 3, |i, j| match j {
            0 => 1.0,
            1 => windows[i].along_dph,
            _ => windows[i].beyond_dph(),
        });
    }
    let entry = |i: usize, j: usize| {
        if j == count { windows[i].beyond_dph() } else { f64::from(u8::from(levels[i] == different[j])) }
    };
    DMatrix::from_fn(windows.len(), count + 1, entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two plateaus of 4,000 windows of 1 s, two rates in turn; only the second has a random walk next to its white noise.
    #[test]
    fn slow_noise_of_a_later_plateau_is_seen_in_short_windows() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>();
        let mut walk = 0.0;
        let mut plateau = |run: usize| -> Vec<TurnedWindow> {
            let window = |at: usize| {
                walk += 0.05 * run as f64 * normal();
                let along_dph = if (at / 100).is_multiple_of(2) { 3600.0 } else { -3600.0 };
                let measured_dph = along_dph + 7.0 + walk + normal();
                TurnedWindow { run, middle_s: at as f64, temperature_c: 20.0, along_dph, measured_dph, weight: 1.0 }
            };
            (0..4000).map(window).collect()
        };
        let plateaus = [plateau(0), plateau(1)];
        let levels = [(); 2].map(|()| (0..4000).map(|at| at / 100 % 2).collect());
        let noise = PlateauNoise::of(&plateaus, &levels, KnownNoise { stated: None, nominal_s: Some(1.0) });
        assert!((0.8..1.3).contains(&noise.white), "{}", noise.white);
        // Of 2,000 windows each at two rates, next to the 1/√2000 of white noise alone.
        let parts = DVector::from_fn(4000, |at, _| if (at / 100).is_multiple_of(2) { 1.0 } else { -1.0 } / 2000.0);
        let sigma = noise.sigma(&plateaus[1], &parts, noise.white);
        assert!(sigma > 1.5 * (2.0 / 2000.0_f64).sqrt(), "{sigma}");
    }
}
