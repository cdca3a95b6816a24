//! The temperature rate as the target will see it, in `f64`.
//!
//! ```text
//! T_lag[n] = T_lag[n−1] + α·(T[n] − T_lag[n−1])   α = 1 − e^(−Δt/τ), T_lag[0] = T[0]
//! Ṫ[n]     = 60·(T_lag[n] − T_lag[n−1])/Δt         °C/min, valid from grid point n to n + 1
//! ```
//!
//! The same recursion as `sagnac_core::InputSpec` on the same grid with the same zero-order hold;
//! a window's mean of Ṫ·T_j(x) is the difference of a running sum at its ends.

use crate::model::basis::Span;
use crate::model::spec::MAX_RATE_ORDER;
use std::borrow::Cow;

/// Columns of a full rate series, c₀ … c₃.
pub(crate) const RATE_COLUMNS: usize = MAX_RATE_ORDER as usize + 1;

/// Temperatures with the number of grid points that each stays. A thermometer is read less often than the grid has points, and between
/// two readings the lag has a closed form.
pub(crate) type Stretches = Vec<(f64, u32)>;

/// One run's temperatures on the grid.
pub(crate) enum LagTrack<'a> {
    /// Point by point.
    Points(Cow<'a, [f64]>),
    /// Stretch by stretch, where there are far fewer of these.
    Stretches(&'a [(f64, u32)]),
}

/// So many points to a stretch, at least, make it worth to keep the stretches: they take half of the track's memory or less.
const POINTS_OF_A_STRETCH: usize = 4;

/// The stretches of a track; `None` where there are too many of them.
pub(crate) fn stretches(temperatures_c: &[f64]) -> Option<Stretches> {
    let most = temperatures_c.len() / POINTS_OF_A_STRETCH + 1;
    let mut levels: Stretches = Vec::new();
    for celsius in temperatures_c {
        let here = levels.len();
        match levels.last_mut().filter(|(last, points)| last == celsius && *points < u32::MAX) {
            Some((_, points)) => *points += 1,
            None if here == most => return None,
            None => levels.push((*celsius, 1)),
        }
    }
    Some(levels)
}

impl LagTrack<'_> {
    /// A temperature and its points.
    #[inline]
    fn get(&self, at: usize) -> Option<(f64, u32)> {
        match self {
            Self::Points(all) => all.get(at).map(|celsius| (*celsius, 1)),
            Self::Stretches(all) => all.get(at).copied(),
        }
    }
}

/// The lag on one run's track.
pub(crate) struct LagRate<'a> {
    pub(crate) track: LagTrack<'a>,
    pub(crate) span: Span,
    pub(crate) period_s: f64,
    pub(crate) tau_s: f64,
}

impl LagRate<'_> {
    /// Ṫ at each grid point, °C/min.
    fn rates(&self) -> impl Iterator<Item = f64> {
        let alpha = -(-self.period_s / self.tau_s).exp_m1();
        let mut lag = self.first_c();
        let per_minute = 60.0 / self.period_s;
        let levels = (0..).map_while(|at| self.track.get(at));
        let points = levels.flat_map(|(t_c, points)| std::iter::repeat_n(t_c, points as usize));
        points.map(move |t_c| {
            let step = alpha * (t_c - lag);
            lag += step;
            per_minute * step
        })
    }

    fn first_c(&self) -> f64 {
        self.track.get(0).map_or(0.0, |(t_c, _)| t_c)
    }

    /// Means of Ṫ·T_j(x) over windows (start, end], seconds from the start of the run, °C/min. Windows are in order and do
    /// not overlap, so one pass is enough and memory does not grow with the track.
    pub(crate) fn means(&self, windows: &[(f64, f64)]) -> Vec<[f64; RATE_COLUMNS]> {
        let mut sums = RunningSums::new(self, self.first_c());
        // The level that comes next, how many of its points are behind, and how many points altogether.
        let (mut level, mut of_level, mut behind) = (0, 0_u32, 0_usize);
        let mut up_to = |border_s: f64| {
            let position = (border_s / self.period_s).max(0.0);
            let whole = position as usize;
            while let Some((t_c, points)) = self.track.get(level).filter(|_| behind < whole) {
                let ahead = u32::try_from(whole - behind).unwrap_or(u32::MAX).min(points - of_level);
                sums.take(t_c, ahead);
                (of_level, behind) = (of_level + ahead, behind + ahead as usize);
                if of_level == points {
                    (level, of_level) = (level + 1, 0);
                }
            }
            // Linear between grid points; nothing behind the last.
            match self.track.get(level) {
                Some((t_c, _)) => sums.with_part(t_c, position - whole as f64),
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
        for (n, rate) in self.rates().enumerate() {
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
    /// (1 − α)ⁿ of the last stretch: most are of one length.
    kept: (u32, f64),
    sums: [f64; RATE_COLUMNS],
}

impl RunningSums {
    fn new(rate: &LagRate<'_>, first_c: f64) -> Self {
        let alpha = -(-rate.period_s / rate.tau_s).exp_m1();
        let (per_minute, sums) = (60.0 / rate.period_s, [0.0; RATE_COLUMNS]);
        Self { span: rate.span, alpha, period_s: rate.period_s, per_minute, lag_c: first_c, kept: (0, 1.0), sums }
    }

    /// So many grid points of one temperature: lag ← T + (1 − α)ⁿ·(lag − T), and the sums grow by the change of the lag.
    #[inline]
    fn take(&mut self, t_c: f64, points: u32) {
        let away = t_c - self.lag_c;
        if self.kept.0 != points {
            self.kept = (points, (1.0 - self.alpha).powi(points as i32));
        }
        let step = if points == 1 { self.alpha * away } else { away - away * self.kept.1 };
        self.lag_c += step;
        self.add(t_c, step, 1.0).iter().zip(&mut self.sums).for_each(|(value, sum)| *sum = *value);
    }

    /// The sums with a part of the next grid point.
    fn with_part(&self, t_c: f64, part: f64) -> [f64; RATE_COLUMNS] {
        self.add(t_c, self.alpha * (t_c - self.lag_c), part)
    }

    #[inline]
    fn add(&self, t_c: f64, step: f64, part: f64) -> [f64; RATE_COLUMNS] {
        let (rate, basis) = (self.per_minute * step, low_orders(self.span.x(t_c)));
        std::array::from_fn(|j| self.sums[j] + part * (rate * basis[j] * self.period_s))
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

    fn ramp(track: &[f64], span: Span, tau_s: f64) -> LagRate<'_> {
        LagRate { track: LagTrack::Points(Cow::Borrowed(track)), span, period_s: 1.0, tau_s }
    }

    /// A stretch of one temperature gives what its points give one by one.
    #[test]
    fn a_stretch_is_as_its_points() {
        let celsius: Vec<f64> = (0..3000).map(|n| f64::from((n / 17 * 37) % 11) + f64::from(n % 500 / 250)).collect();
        let found = stretches(&celsius).unwrap();
        assert!(found.len() < 300 && found.iter().map(|(_, n)| *n).sum::<u32>() == 3000);
        let other: Vec<f64> = (0..3000).map(f64::from).collect();
        assert!(stretches(&other).is_none());
        let windows: Vec<(f64, f64)> =
            (0..130).map(|w| (f64::from(w) * 23.3 + 0.4, f64::from(w) * 23.3 + 22.9)).collect();
        for tau_s in [0.3, 7.0, 400.0] {
            let span = Span { lo: 0.0, hi: 11.0 };
            let of_stretches = LagRate { track: LagTrack::Stretches(&found), span, period_s: 1.0, tau_s };
            let (a, b) = (of_stretches.means(&windows), ramp(&celsius, span, tau_s).means(&windows));
            let far = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(far < 1e-11, "{tau_s}: {far}");
        }
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
