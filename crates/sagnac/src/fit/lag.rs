//! The temperature rate as the target will see it, in `f64`.
//!
//! ```text
//! T_lag[n] = T_lag[n−1] + α·(T[n] − T_lag[n−1])   α = 1 − e^(−Δt/τ), T_lag[0] = T[0]
//! Ṫ[n]     = 60·(T_lag[n] − T_lag[n−1])/Δt         °C/min, valid from grid point n to n + 1
//! ```
//!
//! The same recursion as `sagnac_core::Thermometer` on the same grid with the same zero-order hold;
//! a window's mean of Ṫ·T_j(x) is the difference of a running sum at its ends.

use crate::fit::basis::{Span, chebyshev};
use crate::fit::model::MAX_RATE_ORDER;

/// Columns of a full rate series, c₀ … c₃.
pub(crate) const RATE_COLUMNS: usize = MAX_RATE_ORDER as usize + 1;

/// Running sums of Ṫ·T_j(x)·Δt over one run, °C/min·s.
pub(crate) struct RateSums {
    /// `sums[n]`: over the grid points before n.
    sums: Vec<[f64; RATE_COLUMNS]>,
    /// Ṫ at each grid point, °C/min.
    rates: Vec<f64>,
    period_s: f64,
}

impl RateSums {
    pub(crate) fn new(track_c: &[f64], span: Span, period_s: f64, tau_s: f64) -> Self {
        let alpha = -(-period_s / tau_s).exp_m1();
        let mut lag = track_c.first().copied().unwrap_or(0.0);
        let mut running = [0.0; RATE_COLUMNS];
        let (mut sums, mut rates) = (Vec::with_capacity(track_c.len() + 1), Vec::with_capacity(track_c.len()));
        sums.push(running);
        for &t_c in track_c {
            let step = alpha * (t_c - lag);
            lag += step;
            let rate = 60.0 * step / period_s;
            let basis = chebyshev(span.x(t_c));
            for (sum, value) in running.iter_mut().zip(basis) {
                *sum += rate * value * period_s;
            }
            sums.push(running);
            rates.push(rate);
        }
        Self { sums, rates, period_s }
    }

    /// Means of Ṫ·T_j(x) over (start, end], seconds from the start of the run, °C/min.
    pub(crate) fn means(&self, start_s: f64, end_s: f64) -> [f64; RATE_COLUMNS] {
        let (from, to) = (self.at(start_s), self.at(end_s));
        std::array::from_fn(|j| (to[j] - from[j]) / (end_s - start_s))
    }

    /// Lowest and highest Ṫ at grid points within (start, end].
    pub(crate) fn extremes(&self, start_s: f64, end_s: f64) -> (f64, f64) {
        let index = |s: f64| ((s / self.period_s) as usize).min(self.rates.len());
        let within = &self.rates[index(start_s)..index(end_s).max(index(start_s))];
        within.iter().fold((0.0, 0.0), |(lo, hi), r| (r.min(lo), r.max(hi)))
    }

    /// The running sum at a time, linear between grid points.
    fn at(&self, s: f64) -> [f64; RATE_COLUMNS] {
        let position = (s / self.period_s).max(0.0);
        let n = (position as usize).min(self.sums.len() - 1);
        let next = (n + 1).min(self.sums.len() - 1);
        let part = position - n as f64;
        std::array::from_fn(|j| self.sums[n][j] + part.min(1.0) * (self.sums[next][j] - self.sums[n][j]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form: a ramp's lag follows at the ramp's own rate once e^(−t/τ) is gone.
    #[test]
    fn a_ramp_shows_its_own_rate() {
        let track: Vec<f64> = (0..4000).map(|n| f64::from(n) / 60.0).collect();
        let span = Span { lo_c: 0.0, hi_c: 70.0 };
        let sums = RateSums::new(&track, span, 1.0, 120.0);
        let means = sums.means(3000.0, 3100.0);
        assert!((means[0] - 1.0).abs() < 1e-9, "{}", means[0]);
        assert!((means[1] - span.x(3049.5 / 60.0)).abs() < 1e-6);
    }

    #[test]
    fn a_window_on_the_grid_sees_the_change_of_the_lag() {
        let track: Vec<f64> = (0..200).map(|n| ((n * 37) % 11) as f64).collect();
        let sums = RateSums::new(&track, Span { lo_c: 0.0, hi_c: 10.0 }, 1.0, 7.0);
        let alpha = 1.0 - (-1.0_f64 / 7.0).exp();
        let mut lags = vec![track[0]];
        for t in &track {
            let last = lags[lags.len() - 1];
            lags.push(last + alpha * (t - last));
        }
        let expected = 60.0 * (lags[150] - lags[50]) / 100.0;
        assert!((sums.means(50.0, 150.0)[0] - expected).abs() < 1e-12);
    }
}
