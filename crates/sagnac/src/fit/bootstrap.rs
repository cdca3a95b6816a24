//! Intervals without a model of the residuals: the block bootstrap, on demand.
//!
//! ```text
//! y* = fit + r*,   r* = blocks of L neighbouring residuals of a run, drawn with replacement, times √(n/(n − p))
//! θ* = θ + (JᵀWJ)⁻¹JᵀW r*        L = ⌈(√6·ρ/(1 − ρ²))^⅔ · n^⅓⌉
//! ```
//!
//! L is the length of least mean square error for AR(1) residuals of lag-one autocorrelation ρ (Carlstein 1986). Correlation
//! within L windows is preserved. τ of a resolved rate term is one of the columns, linearised. Intervals are
//! quantiles, 95 %.

use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SEED: u64 = 0x424c_4f43_4b53;
const TAIL: f64 = 0.025;

/// Residuals of a fit and the matrix from residuals to parameters.
pub(crate) struct Resampling<'a> {
    /// Residuals times the root of their weight.
    pub(crate) residuals: &'a [f64],
    /// Run of each.
    pub(crate) run: &'a [usize],
    /// (JᵀWJ)⁻¹JᵀW^½: a row per parameter.
    pub(crate) gain: &'a DMatrix<f64>,
    pub(crate) autocorrelation: f64,
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
        let (n, p, block) = (self.residuals.len(), self.gain.nrows(), self.block());
        let grow = (n as f64 / n.saturating_sub(p).max(1) as f64).sqrt();
        // A block starts where a whole one follows within the run.
        let starts: Vec<usize> = (0..n).filter(|i| i + block <= n && self.run[*i] == self.run[i + block - 1]).collect();
        let starts = if starts.is_empty() { (0..n).collect() } else { starts };
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut drawn = vec![Vec::with_capacity(draws); p];
        let mut resampled = nalgebra::DVector::zeros(n);
        for _ in 0..draws {
            let mut at = 0;
            while at < n {
                let start = starts[(rng.next_u64() % starts.len() as u64) as usize];
                for i in start..(start + block).min(n) {
                    if at < n {
                        resampled[at] = grow * self.residuals[i];
                        at += 1;
                    }
                }
            }
            let shift = self.gain * &resampled;
            drawn.iter_mut().zip(shift.iter()).for_each(|(all, shift)| all.push(*shift));
        }
        let interval = |(all, value): (&mut Vec<f64>, &f64)| {
            all.sort_by(f64::total_cmp);
            let at = |part: f64| all.get((part * all.len() as f64) as usize).copied().unwrap_or(f64::NAN);
            [value - at(1.0 - TAIL), value - at(TAIL)]
        };
        drawn.iter_mut().zip(theta).map(interval).collect()
    }
}
