//! Noise of a retest's corrected windows, and what it makes of the uncertainty of their means and slopes.
//!
//! ```text
//! r = level + series in T + q·Ṫ + n                 of each run, the series of the residual over temperature; n white and slow noise by restricted likelihood (`noise_model::blocks`)
//! a value Σ aᵢ·rᵢ has the variance aᵀVa             a about its mean within each run, as r is; V the covariance of n
//! ```
//!
//! From the retest alone, as its values are. Where few windows tell no slow noise, they count as white, widened by
//! (1 + ρ)/(1 − ρ) for neighbours that correlate with ρ.
//!
//! Fails where a drift that no column has is as slow as the noise: it counts as noise, and intervals are wider than they need to be.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::diagnostics::WindowPoint;
use crate::model::Span;
use crate::noise_model::blocks::{Estimated, RowNoise, noise_of_blocks};
use crate::noise_model::likelihood::{Block, Rows, mean};
use crate::verify::values::judged_windows::{lag1_autocorrelation, smooth_columns, smooth_order, spread};

/// Windows of a run that has such a series; shorter runs have a level alone.
const FEWEST_FOR_SERIES: usize = 20;

/// The noise of the judged windows of an axis.
pub(crate) struct RetestNoise {
    rows: Rows,
    noise: Estimated,
    /// The windows are about the mean of all runs, not each about its run's.
    about_common_mean: bool,
}

impl RetestNoise {
    /// Of the judged windows, in their order.
    pub(crate) fn of(used: &[&WindowPoint], about_common_mean: bool) -> Self {
        let nominal_s = used.iter().map(|p| p.length_h).fold(0.0, f64::max) * 3600.0;
        let runs: Vec<&[&WindowPoint]> = used.chunk_by(|a, b| a.run == b.run).collect();
        let longest_h = runs.iter().map(|run| run[run.len() - 1].hours - run[0].hours).fold(0.0, f64::max);
        let rows = |points: &[&WindowPoint]| Rows {
            run: points.iter().map(|p| p.run).collect(),
            middle_s: points.iter().map(|p| p.hours * 3600.0).collect(),
            weight: points.iter().map(|p| p.length_h * 3600.0 / nominal_s).collect(),
            longest_s: longest_h * 3600.0 + nominal_s,
            nominal_s,
        };
        let block = |run: &[&WindowPoint]| {
            // A window whose temperature is not known must not hide those of the others.
            let known: Vec<&WindowPoint> = run.iter().copied().filter(is_known).collect();
            let run = if known.len() < FEWEST_FOR_SERIES { run } else { &known };
            let each = rows(run);
            let (rows, groups) = Rows::averaged(each.view(), used.len());
            let averaged: Vec<WindowPoint> = groups.iter().map(|group| average(run, &each.weight, group)).collect();
            Block::at_right_angles(rows, columns(&averaged), |i| averaged[i].after_dph)
        };
        let blocks: Vec<Block> = runs.into_iter().filter_map(block).collect();
        let count = blocks.len();
        let noise = noise_of_blocks(blocks).unwrap_or_else(|| {
            let sigma = spread(used);
            let rho = lag1_autocorrelation(used, sigma).map_or(0.0, |rho| rho.value.clamp(0.0, 0.95));
            let degrees = used.len().saturating_sub(count).max(1) as f64;
            Estimated::white(sigma * sigma * (1.0 + rho) / (1.0 - rho), degrees)
        });
        Self { rows: rows(used), noise, about_common_mean }
    }

    /// Covariance of values, each the sum of the windows with the parts of a column, (°/h)²; and by how much standard errors from it are
    /// to be widened, because the noise is an estimate itself. `whole` makes the variance of one number of the covariance.
    pub(crate) fn covariance(&self, parts: &DMatrix<f64>, whole: impl Fn(&DMatrix<f64>) -> f64) -> (DMatrix<f64>, f64) {
        let mut about = parts.clone();
        for mut column in about.column_iter_mut() {
            let mut first = 0;
            for run in self.rows.run.chunk_by(|a, b| a == b || self.about_common_mean) {
                let mut own = column.rows_mut(first, run.len());
                let mean = own.mean();
                own.add_scalar_mut(-mean);
                first += run.len();
            }
        }
        let widening = self.noise.widening(|noise| whole(&noise.between(&self.rows, &about)));
        (self.noise.best.between(&self.rows, &about), widening)
    }

    /// Standard error of the mean of a run itself, °/h: slow noise moves it as a whole. A walk counts from the start of the run on.
    pub(crate) fn sigma_of_mean_dph(&self, run: usize) -> f64 {
        let parts = parts_of_mean(&self.rows, run);
        let variance = |noise: RowNoise| noise.between(&self.rows, &parts)[(0, 0)];
        self.noise.widening(variance) * variance(self.noise.best).max(0.0).sqrt()
    }

    /// Standard error of one such value, °/h, of which 1.96 are a 95 % interval.
    pub(crate) fn sigma_dph(&self, parts: &[f64]) -> f64 {
        let parts = DMatrix::from_column_slice(parts.len(), 1, parts);
        let (variance, widening) = self.covariance(&parts, |variance| variance[(0, 0)]);
        widening * variance[(0, 0)].max(0.0).sqrt()
    }
}

/// Windows with the parts that they have in a mean over their time.
fn parts_of_mean(rows: &Rows, run: usize) -> DMatrix<f64> {
    let of_run = |i: usize| if rows.run[i] == run { rows.weight[i] } else { 0.0 };
    let whole: f64 = (0..rows.run.len()).map(of_run).sum();
    DMatrix::from_fn(rows.run.len(), 1, |i, _| of_run(i) / whole)
}

/// The mean of a group of windows.
fn average(run: &[&WindowPoint], weight: &[f64], group: &Range<usize>) -> WindowPoint {
    let average = |value: fn(&WindowPoint) -> f64| mean(weight, group, |i| value(run[i]));
    let (temperature_c, rate_cpm, after_dph) =
        (average(|p| p.temperature_c), average(|p| p.rate_cpm), average(|p| p.after_dph));
    WindowPoint { temperature_c, rate_cpm, after_dph, ..*run[group.start] }
}

fn is_known(point: &&WindowPoint) -> bool {
    point.temperature_c.is_finite() && point.rate_cpm.is_finite()
}

/// The columns of a run's windows that are no noise: a level, or a series over temperature and a rate term.
fn columns(run: &[WindowPoint]) -> DMatrix<f64> {
    if run.len() < FEWEST_FOR_SERIES || !run.iter().all(|p| is_known(&p)) {
        return DMatrix::from_element(run.len(), 1, 1.0);
    }
    let (lo, hi) = run
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p.temperature_c), hi.max(p.temperature_c)));
    let span = Span { lo, hi: hi.max(lo + f64::EPSILON * lo.abs().max(1.0)) };
    let order = smooth_order(run.len());
    let series = smooth_columns(run.len(), order, span, |i| run[i].temperature_c);
    DMatrix::from_fn(run.len(), order + 2, |i, j| if j <= order { series[(i, j)] } else { run[i].rate_cpm })
}
