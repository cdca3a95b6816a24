//! The temperature rate as the target will see it, in `f64`.
//!
//! ```text
//! T_lag[n] = T_lag[n−1] + α·(T[n] − T_lag[n−1])   α = 1 − e^(−Δt/τ), T_lag[0] = T[0]
//! Ṫ[n]     = 60·(T_lag[n] − T_lag[n−1])/Δt         °C/min, valid from grid point n to n + 1
//! ```
//!
//! The same recursion as `sagnac_core::InputSpec` on the same grid with the same zero-order hold;
//! a window's mean of Ṫ·T_j(x) is the difference of a running sum at its ends.

use std::borrow::Cow;

use crate::model::basis::Span;
use crate::model::spec::MAX_RATE_ORDER;

/// Columns of a full rate series, c₀ … c₃.
pub(crate) const RATE_COLUMNS: usize = MAX_RATE_ORDER as usize + 1;

/// The lag on one run's track.
pub(crate) struct LagRate<'a> {
    pub(crate) track_c: Cow<'a, [f64]>,
    pub(crate) span: Span,
    pub(crate) period_s: f64,
    pub(crate) tau_s: f64,
}

impl LagRate<'_> {
    /// Ṫ at each grid point, °C/min, with the temperature there.
    fn rates(&self) -> impl Iterator<Item = (f64, f64)> {
        let alpha = -(-self.period_s / self.tau_s).exp_m1();
        let mut lag = self.track_c.first().copied().unwrap_or(0.0);
        let per_minute = 60.0 / self.period_s;
        self.track_c.iter().map(move |&t_c| {
            let step = alpha * (t_c - lag);
            lag += step;
            (per_minute * step, t_c)
        })
    }

    /// Means of Ṫ·T_j(x) over windows (start, end], seconds from the start of the run, °C/min. Windows are in order and do
    /// not overlap, so one pass is enough and memory does not grow with the track.
    pub(crate) fn means(&self, windows: &[(f64, f64)]) -> Vec<[f64; RATE_COLUMNS]> {
        let track: &[f64] = &self.track_c;
        let mut sums = RunningSums::new(self, track.first().copied().unwrap_or(0.0));
        let mut next = 0;
        let mut up_to = |border_s: f64| {
            let position = (border_s / self.period_s).max(0.0);
            let whole = (position as usize).min(track.len());
            track[next..whole.max(next)].iter().for_each(|t_c| sums.take(*t_c));
            next = next.max(whole);
            // Linear between grid points; nothing behind the last.
            match track.get(whole) {
                Some(t_c) => sums.with_part(*t_c, position - whole as f64),
                None => sums.sums,
            }
        };
        let mean = |(start, end): &(f64, f64)| {
            let [from, to] = [*start, *end].map(&mut up_to);
            std::array::from_fn(|j| (to[j] - from[j]) / (end - start))
        };
        windows.iter().map(mean).collect()
    }

    /// Lowest and highest Ṫ at grid points within any of these windows; 0 is always within.
    pub(crate) fn extremes(&self, windows: &[(f64, f64)]) -> [f64; 2] {
        let index = |s: f64| (s / self.period_s) as usize;
        let (mut at, mut extremes) = (0, [0.0, 0.0]);
        for (n, (rate, _)) in self.rates().enumerate() {
            while windows.get(at).is_some_and(|(_, end)| index(*end) <= n) {
                at += 1;
            }
            let Some((start, _)) = windows.get(at) else { break };
            if index(*start) <= n {
                extremes = [rate.min(extremes[0]), rate.max(extremes[1])];
            }
        }
        extremes
    }
}

/// Sums of Ṫ·T_j(x)·Δt from the start of a run to a grid point.
struct RunningSums {
    span: Span,
    alpha: f64,
    period_s: f64,
    per_minute: f64,
    lag_c: f64,
    sums: [f64; RATE_COLUMNS],
}

impl RunningSums {
    fn new(of: &LagRate<'_>, first_c: f64) -> Self {
        let alpha = -(-of.period_s / of.tau_s).exp_m1();
        let (per_minute, sums) = (60.0 / of.period_s, [0.0; RATE_COLUMNS]);
        Self { span: of.span, alpha, period_s: of.period_s, per_minute, lag_c: first_c, sums }
    }

    /// What the next grid point adds, and its step of the lag.
    #[inline]
    fn added(&self, t_c: f64) -> ([f64; RATE_COLUMNS], f64) {
        let step = self.alpha * (t_c - self.lag_c);
        let (rate, basis) = (self.per_minute * step, low_orders(self.span.x(t_c)));
        (basis.map(|value| rate * value * self.period_s), step)
    }

    #[inline]
    fn take(&mut self, t_c: f64) {
        let (added, step) = self.added(t_c);
        self.lag_c += step;
        self.sums.iter_mut().zip(added).for_each(|(sum, value)| *sum += value);
    }

    /// The sums with a part of the next grid point.
    fn with_part(&self, t_c: f64, part: f64) -> [f64; RATE_COLUMNS] {
        let (added, _) = self.added(t_c);
        std::array::from_fn(|j| self.sums[j] + part * added[j])
    }
}

/// T₀(x) … T₃(x).
#[inline]
fn low_orders(x: f64) -> [f64; RATE_COLUMNS] {
    let second = 2.0 * x * x - 1.0;
    [1.0, x, second, 2.0 * x * second - x]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(track_c: &[f64], span: Span, tau_s: f64) -> LagRate<'_> {
        LagRate { track_c: Cow::Borrowed(track_c), span, period_s: 1.0, tau_s }
    }

    #[test]
    fn low_orders_are_those_of_the_basis() {
        for x in [-1.0, -0.3, 0.0, 0.7, 1.0] {
            let (low, all) = (low_orders(x), crate::model::basis::chebyshev(x));
            assert!(low.iter().zip(all).all(|(a, b)| (a - b).abs() < 1e-15));
        }
    }

    /// Closed form: the lagged track follows a ramp at the ramp's rate once e^(−t/τ) has decayed.
    #[test]
    fn a_ramp_shows_its_own_rate() {
        let track: Vec<f64> = (0..4000).map(|n| f64::from(n) / 60.0).collect();
        let span = Span { lo: 0.0, hi: 70.0 };
        let lag = ramp(&track, span, 120.0);
        let means = lag.means(&[(10.0, 20.0), (3000.0, 3100.0)]);
        assert!((means[1][0] - 1.0).abs() < 1e-9, "{}", means[1][0]);
        assert!((means[1][1] - span.x(3049.5 / 60.0)).abs() < 1e-6);
        let [lo, hi] = lag.extremes(&[(3000.0, 3100.0)]);
        assert!(lo == 0.0 && (hi - 1.0).abs() < 1e-9);
        assert!(lag.extremes(&[(0.0, 5.0)])[1] < 0.05);
    }

    #[test]
    fn a_window_on_the_grid_sees_the_change_of_the_lag() {
        let track: Vec<f64> = (0..200).map(|n| ((n * 37) % 11) as f64).collect();
        let alpha = 1.0 - (-1.0_f64 / 7.0).exp();
        let mut lags = vec![track[0]];
        for t in &track {
            let last = lags[lags.len() - 1];
            lags.push(last + alpha * (t - last));
        }
        let lag = ramp(&track, Span { lo: 0.0, hi: 10.0 }, 7.0);
        // Windows between grid points and up to the very end too.
        let means = lag.means(&[(50.0, 150.0), (150.25, 160.5), (190.0, 200.0)]);
        assert!((means[0][0] - 60.0 * (lags[150] - lags[50]) / 100.0).abs() < 1e-12);
        let at = |n: usize, part: f64| lags[n] + part * (lags[n + 1] - lags[n]);
        assert!((means[1][0] - 60.0 * (at(160, 0.5) - at(150, 0.25)) / 10.25).abs() < 1e-12);
        assert!((means[2][0] - 60.0 * (lags[200] - lags[190]) / 10.0).abs() < 1e-12);
    }
}
