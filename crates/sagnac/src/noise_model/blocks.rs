//! White and slow noise of rows in blocks, each block with columns of its own that are no noise.
//!
//! ```text
//! y = columns·θ + n        n: white + slow noise, each block by itself ([`crate::noise_model`])
//! ```
//!
//! The variances are those of greatest restricted likelihood over all blocks together. What is slower than a block is in the level that
//! its columns hold, and not in the noise.
//!
//! Fails with few rows, or where the columns explain all of them: nothing tells slow noise from none then.

use crate::noise_model::estimate::{FEWEST_FOR_NOISE, NoiseFit, SLOPE_STEP, estimate, restricted, t_quantile_975};
use crate::noise_model::factor::{Reducer, Solution};
use crate::noise_model::likelihood::{Block, Misfit, RestrictedLikelihood, Rows};
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;
use nalgebra::DMatrix;

/// Of a normal variable.
const NORMAL_QUANTILE_975: f64 = 1.959_964;
/// Residuals smaller than this part of the values, as squares, are rounding.
const EXACT: f64 = 1e-18;

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
    more_and_less: [RowNoise; 2],
    /// Rows less parameters.
    degrees: f64,
}

impl Estimated {
    /// White noise of a known variance.
    pub(crate) fn white(white: f64, degrees: f64) -> Self {
        let best = RowNoise { slow: SlowNoise::default(), white };
        Self { best, more_and_less: [best; 2], degrees }
    }

    /// By how much 1.96 standard errors of a value are to be widened to a 95 % interval, because the noise is an estimate: Student's t
    /// with degrees of freedom after Satterthwaite, as for the terms of a fit. `variance` is that of the value.
    pub(crate) fn widening(&self, variance: impl Fn(RowNoise) -> f64) -> f64 {
        let [more, less] = self.more_and_less.map(variance);
        let slope = if less > 0.0 { (more / less).ln() / (2.0 * SLOPE_STEP) } else { 0.0 };
        t_quantile_975(self.degrees, slope, self.best.slow) / NORMAL_QUANTILE_975
    }
}

/// The noise of blocks of rows. `None` where they do not tell it.
pub(crate) fn noise_of_blocks(blocks: Vec<Block>) -> Option<Estimated> {
    shown(&likelihood(blocks)?)
}

/// A stated noise, unless the blocks show more.
pub(crate) fn stated_or_shown(blocks: Vec<Block>, stated: RowNoise) -> RowNoise {
    let Some(likelihood) = likelihood(blocks) else { return stated };
    let Some(Estimated { best: shown, degrees, .. }) = shown(&likelihood) else { return stated };
    let noise_fit = |noise: RowNoise| {
        let Misfit { ssr, determinants } = likelihood.misfit(noise.slow)?;
        let variance = noise.white * (1.0 + noise.slow.parts_of_white());
        Some(NoiseFit { criterion: restricted(ssr, degrees, determinants, Some(noise.white)), variance })
    };
    let exceeds = noise_fit(shown).zip(noise_fit(stated)).is_some_and(|(shown, stated)| shown.exceeds(&stated));
    if exceeds { shown } else { stated }
}

/// `None` with few rows, with columns that explain them all, or that depend on each other.
fn likelihood(blocks: Vec<Block>) -> Option<RestrictedLikelihood> {
    let rows: usize = blocks.iter().map(|block| block.columns.nrows()).sum();
    let parameters: usize = blocks.iter().map(|block| block.columns.ncols() - 1).sum();
    let scale: f64 = blocks.iter().map(|block| block.columns.column(block.columns.ncols() - 1).norm_squared()).sum();
    if rows < FEWEST_FOR_NOISE || rows < 2 * parameters {
        return None;
    }
    RestrictedLikelihood::of(blocks).filter(|likelihood| likelihood.ssr_of_white() > EXACT * scale)
}

/// As rows show it.
fn shown(likelihood: &RestrictedLikelihood) -> Option<Estimated> {
    let degrees = likelihood.degrees;
    let slow = estimate(likelihood.nominal_s, |noise| likelihood.criterion(noise)).mixed;
    let with = |slow| likelihood.misfit(slow).map(|misfit| RowNoise { slow, white: misfit.ssr / degrees });
    let [more, less] = [SLOPE_STEP, -SLOPE_STEP].map(|step| with(slow.scaled(step.exp())));
    Some(Estimated { best: with(slow)?, more_and_less: [more?, less?], degrees })
}

/// Columns, the last of them measured, as independent rows: solved.
pub(crate) fn whitened(whitening: &Whitening, columns: &DMatrix<f64>) -> Option<Solution> {
    let mut filter = whitening.filter(columns.ncols());
    let mut rows = Reducer::new(columns.ncols());
    for (at, row) in columns.row_iter().enumerate() {
        let mut row: Vec<f64> = row.iter().copied().collect();
        filter.push(at, &mut row);
        rows.push(&row);
    }
    rows.finish().solve(&(0..columns.ncols() - 1).collect::<Vec<_>>())
}
