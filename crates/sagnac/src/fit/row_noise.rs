//! White and slow noise of rows in blocks, each block with columns of its own that are no noise.
//!
//! ```text
//! y = columns·θ + n        n: white + slow noise, each block by itself ([`super::slow_noise`])
//! ```
//!
//! The variances are those of greatest restricted likelihood over all blocks together. What is slower than a block is in the level that
//! its columns hold, and not in the noise.
//!
//! Fails with few rows, or where the columns explain all of them: nothing tells slow noise from none then.

use nalgebra::DMatrix;

use crate::fit::slow_noise::{self, NoiseFit, NoiseRows, SlowNoise, Whitening, restricted};
use crate::fit::solution::{FEWEST_FOR_NOISE, SLOPE_STEP, t_quantile_975};
use crate::fit::solve::{Factor, Solution};

/// Of a normal variable.
const NORMAL_QUANTILE_975: f64 = 1.959_964;
/// Residuals smaller than this part of the values, as squares, are rounding.
const EXACT: f64 = 1e-18;

/// Rows in the order of time within each run.
pub(crate) struct Rows {
    /// Of each row.
    pub(crate) run: Vec<usize>,
    /// Middle of its window, s.
    pub(crate) middle_s: Vec<f64>,
    /// Length of its window over the nominal one.
    pub(crate) weight: Vec<f64>,
    /// Length of the longest run of any block, s.
    pub(crate) longest_s: f64,
    /// Nominal length of a window, s.
    pub(crate) nominal_s: f64,
}

impl Rows {
    pub(crate) fn view(&self) -> NoiseRows<'_> {
        let Self { run, middle_s, weight, longest_s, nominal_s } = self;
        NoiseRows { run, middle_s, weight, longest_s: *longest_s, nominal_s: *nominal_s }
    }
}

/// Rows with their columns, the last of which was measured.
pub(crate) struct Block {
    pub(crate) rows: Rows,
    pub(crate) columns: DMatrix<f64>,
}

/// Noise of rows.
#[derive(Clone, Copy)]
pub(crate) struct RowNoise {
    /// As parts of the white variance.
    pub(crate) slow: SlowNoise,
    /// White variance of a nominal window, (°/h)².
    pub(crate) white: f64,
}

impl RowNoise {
    /// zᵀVz of some columns: V is this noise of the rows.
    pub(crate) fn between(&self, rows: &Rows, z: &DMatrix<f64>) -> DMatrix<f64> {
        self.slow.between(rows.view(), z) * self.white
    }
}

/// The noise as rows show it, and with more and with less slow noise, as far as [`SLOPE_STEP`].
#[derive(Clone, Copy)]
pub(crate) struct Estimated {
    pub(crate) best: RowNoise,
    beside: [RowNoise; 2],
    /// Rows less parameters.
    degrees: f64,
}

impl Estimated {
    /// White noise of a known variance.
    pub(crate) fn white(white: f64, degrees: f64) -> Self {
        let best = RowNoise { slow: SlowNoise::default(), white };
        Self { best, beside: [best; 2], degrees }
    }

    /// By how much 1.96 standard errors of a figure are to be widened to a 95 % interval, because the noise is an estimate: Student's t
    /// with degrees of freedom after Satterthwaite, as in [`super::solution::with_slow_noise`]. `variance` is that of the figure.
    pub(crate) fn widening(&self, variance: impl Fn(RowNoise) -> f64) -> f64 {
        let [more, less] = self.beside.map(variance);
        let slope = if less > 0.0 { (more / less).ln() / (2.0 * SLOPE_STEP) } else { 0.0 };
        t_quantile_975(self.degrees, slope, self.best.slow) / NORMAL_QUANTILE_975
    }
}

/// The noise of blocks of rows. `None` where they do not tell it.
pub(crate) fn noise_of_blocks(blocks: &[Block], nominal_s: f64) -> Option<Estimated> {
    let rows: usize = blocks.iter().map(|block| block.columns.nrows()).sum();
    let parameters: usize = blocks.iter().map(|block| block.columns.ncols() - 1).sum();
    let scale: f64 = blocks.iter().map(|block| block.columns.column(block.columns.ncols() - 1).norm_squared()).sum();
    let of_white = misfit(blocks, SlowNoise::default()).map_or(0.0, |(ssr, _)| ssr);
    if rows < FEWEST_FOR_NOISE || rows < 2 * parameters || of_white <= EXACT * scale {
        return None;
    }
    let degrees = (rows - parameters) as f64;
    let criterion =
        |noise| misfit(blocks, noise).map_or(f64::INFINITY, |(ssr, determinants)| degrees * ssr.ln() + determinants);
    let slow = slow_noise::estimate(nominal_s, criterion).mixed;
    let with = |slow| misfit(blocks, slow).map(|(ssr, _)| RowNoise { slow, white: ssr / degrees });
    let [more, less] = [SLOPE_STEP, -SLOPE_STEP].map(|step| with(slow.scaled(step.exp())));
    Some(Estimated { best: with(slow)?, beside: [more?, less?], degrees })
}

/// A stated noise, unless the blocks show more.
pub(crate) fn stated_or_shown(blocks: &[Block], nominal_s: f64, stated: RowNoise) -> RowNoise {
    let Some(Estimated { best: shown, degrees, .. }) = noise_of_blocks(blocks, nominal_s) else { return stated };
    let of = |noise: RowNoise| {
        let (ssr, determinants) = misfit(blocks, noise.slow)?;
        let variance = noise.white * (1.0 + noise.slow.parts_of_white());
        Some(NoiseFit { criterion: restricted(ssr, degrees, determinants, Some(noise.white)), variance })
    };
    let exceeds = of(shown).zip(of(stated)).is_some_and(|(shown, stated)| shown.exceeds(&stated));
    if exceeds { shown } else { stated }
}

/// Columns, the last of them measured, as independent rows: solved.
pub(crate) fn whitened(whitening: &Whitening, columns: &DMatrix<f64>) -> Option<Solution> {
    let mut filter = whitening.filter(columns.ncols());
    let mut out = columns.clone();
    let mut row = vec![0.0; columns.ncols()];
    for at in 0..columns.nrows() {
        row.iter_mut().zip(columns.row(at).iter()).for_each(|(to, from)| *to = *from);
        filter.push(at, &mut row);
        row.iter().enumerate().for_each(|(j, value)| out[(at, j)] = *value);
    }
    Factor::of(out).solve(&(0..columns.ncols() - 1).collect::<Vec<_>>())
}

/// Over all blocks under some noise: sum of squares, and the logarithms of the determinants of the restricted likelihood.
fn misfit(blocks: &[Block], noise: SlowNoise) -> Option<(f64, f64)> {
    blocks.iter().try_fold((0.0, 0.0), |(ssr, determinants), Block { rows, columns }| {
        let whitening = Whitening::new(rows.view(), noise);
        let solution = whitened(&whitening, columns)?;
        Some((ssr + solution.ssr, determinants + whitening.log_determinant + solution.log_determinant()))
    })
}
