//! Intervals that do not assume a normal distribution: the bootstrap, on demand.
//!
//! ```text
//! y* = fit + r*,   θ* = θ + (JᵀWJ)⁻¹JᵀW r*        r* drawn with replacement, times √(n/(n − p))·t/1.96:
//! slow noise       innovations of the residuals under it, put back through its filter
//! else             blocks of L neighbouring residuals of a run,   L = ⌈(√6·ρ/(1 − ρ²))^⅔ · n^⅓⌉
//! ```
//!
//! A block preserves correlation over its own length alone, so that noise slower than that needs its model
//! ([`super::slow_noise`]). L is the length of least mean square error for AR(1) residuals of lag-one autocorrelation ρ (Carlstein
//! 1986). t is the quantile of the fit, which knows how uncertain the variances of slow noise are. τ of a resolved rate term is one of
//! the columns, linearised. Intervals are quantiles, 95 %.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::fit::progress::Progress;
use crate::fit::slow_noise::Whitening;

const SEED: u64 = 0x424c_4f43_4b53;
const TAIL: f64 = 0.025;
const NORMAL_QUANTILE_975: f64 = 1.959_963_985;

/// Residuals of a fit and the matrix from residuals to parameters.
pub(crate) struct Resampling<'a> {
    /// Residuals times the root of their weight.
    pub(crate) residuals: &'a [f64],
    /// Run of each.
    pub(crate) run: &'a [usize],
    /// (JᵀWJ)⁻¹JᵀW^½: a row per parameter.
    pub(crate) gain: &'a DMatrix<f64>,
    pub(crate) autocorrelation: f64,
    /// Half a 95 % interval of the fit in units of σ.
    pub(crate) t_quantile_975: f64,
    /// Of the slow noise of the residuals, if there is any, with the weights of the rows.
    pub(crate) slow: Option<(&'a Whitening, &'a [f64])>,
    pub(crate) progress: &'a Progress,
}

impl Resampling<'_> {
    /// Windows of a block.
    pub(crate) fn block(&self) -> usize {
        let rho = self.autocorrelation.clamp(0.0, 0.99);
        let n = self.residuals.len() as f64;
        let length = (6.0_f64.sqrt() * rho / (1.0 - rho * rho)).powf(2.0 / 3.0) * n.cbrt();
        (length.ceil() as usize).clamp(1, self.residuals.len().max(1))
    }

    /// 95 % intervals of every parameter about its value, from so many draws.
    pub(crate) fn intervals(&self, theta: &[f64], draws: usize) -> Vec<[f64; 2]> {
        let (n, p) = (self.residuals.len(), self.gain.nrows());
        let grow = (n as f64 / n.saturating_sub(p).max(1) as f64).sqrt() * self.t_quantile_975 / NORMAL_QUANTILE_975;
        let starts = self.starts();
        let innovations = self.innovations();
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut drawn = vec![Vec::with_capacity(draws); p];
        let mut resampled = DVector::zeros(n);
        let part = self.progress.part("bootstrap", draws);
        for _ in 0..draws {
            part.one_more();
            match self.slow {
                Some(slow) => coloured(slow, &innovations, &mut rng, &mut resampled),
                None => self.draw_blocks(&starts, &mut rng, &mut resampled),
            }
            resampled *= grow;
            let shift = self.gain * &resampled;
            drawn.iter_mut().zip(shift.iter()).for_each(|(all, shift)| all.push(*shift));
        }
        let interval = |(all, value): (&mut Vec<f64>, &f64)| {
            all.sort_by(f64::total_cmp);
            // The k-th of n draws is the quantile k/(n + 1).
            let place = |part: f64| (part * (all.len() + 1) as f64).round() as usize;
            let at = |part: f64| all.get(place(part).clamp(1, all.len().max(1)) - 1).copied().unwrap_or(f64::NAN);
            [value - at(1.0 - TAIL), value - at(TAIL)]
        };
        drawn.iter_mut().zip(theta).map(interval).collect()
    }

    /// Rows at which a whole block follows within the run.
    fn starts(&self) -> Vec<usize> {
        let (n, block) = (self.residuals.len(), self.block());
        let starts: Vec<usize> = (0..n).filter(|i| i + block <= n && self.run[*i] == self.run[i + block - 1]).collect();
        if starts.is_empty() { (0..n).collect() } else { starts }
    }

    fn draw_blocks(&self, starts: &[usize], rng: &mut ChaCha8Rng, out: &mut DVector<f64>) {
        let (n, block) = (self.residuals.len(), self.block());
        let mut at = 0;
        while at < n {
            let start = starts[place(rng, starts.len())];
            for i in start..(start + block).min(n) {
                if at < n {
                    out[at] = self.residuals[i];
                    at += 1;
                }
            }
        }
    }

    /// Of the residuals under their slow noise; none without it.
    fn innovations(&self) -> Vec<f64> {
        let Some((whitening, weight)) = self.slow else { return Vec::new() };
        let mut filter = whitening.filter(1);
        let mut of_row = |i: usize| {
            let mut row = [self.residuals[i] / weight[i].sqrt()];
            filter.push(i, &mut row);
            row[0]
        };
        (0..self.residuals.len()).map(&mut of_row).collect()
    }
}

/// Innovations drawn one by one and put back through the filter.
fn coloured(
    (whitening, weight): (&Whitening, &[f64]),
    innovations: &[f64],
    rng: &mut ChaCha8Rng,
    out: &mut DVector<f64>,
) {
    let mut filter = whitening.filter(1);
    for (i, value) in out.iter_mut().enumerate() {
        let mut row = [innovations[place(rng, innovations.len())]];
        filter.colour(i, &mut row);
        *value = row[0] * weight[i].sqrt();
    }
}

fn place(rng: &mut ChaCha8Rng, of: usize) -> usize {
    (rng.next_u64() % of.max(1) as u64) as usize
}
