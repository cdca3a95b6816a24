//! Values of a set of windows.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Values of one axis over the used windows, in the unit that the verification names.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DriftValues {
    /// Windows.
    pub n: usize,
    /// Lowest window.
    pub min: f64,
    /// Highest window.
    pub max: f64,
    /// Mean over all windows.
    pub mean: f64,
    /// Largest max − min within one run.
    pub peak_to_peak: f64,
    /// About each run's own mean, pooled with n − runs.
    pub sigma: f64,
    /// The same in °/h.
    pub sigma_dph: f64,
}

impl DriftValues {
    /// °/h per unit of the values; 0 where nothing scatters.
    pub fn dph_per_unit(&self) -> f64 {
        if self.sigma > 0.0 { self.sigma_dph / self.sigma } else { 0.0 }
    }

    /// From windows; `None` with fewer than two in some run. A window shorter than the nominal one has more noise and counts by
    /// its length: its distance from the run's mean is scaled by the root of `weight`.
    pub(crate) fn of(values: &[Weighted], dph_per_unit: f64) -> Option<Self> {
        let mut runs: Vec<u32> = values.iter().map(|window| window.run).collect();
        runs.sort_unstable();
        runs.dedup();
        let n = values.len();
        if n <= runs.len() {
            return None;
        }
        let (mut squares, mut peak_to_peak) = (0.0, 0.0_f64);
        let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
        for run in &runs {
            let members = || values.iter().filter(|window| window.run == *run);
            let mean = weighted_mean(members());
            let scaled = || members().map(|window| (window.value - mean) * window.weight.sqrt());
            squares += scaled().map(|away| away * away).sum::<f64>();
            let (lo, hi) = extremes(scaled());
            peak_to_peak = peak_to_peak.max(hi - lo);
            (min, max) = (min.min(mean + lo), max.max(mean + hi));
        }
        let sigma = (squares / (n - runs.len()) as f64).sqrt();
        let mean = weighted_mean(values.iter());
        Some(Self { n, min, max, mean, peak_to_peak, sigma, sigma_dph: sigma * dph_per_unit })
    }
}

/// A window of a value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weighted {
    pub(crate) run: u32,
    pub(crate) value: f64,
    /// Length over the nominal one, at most 1.
    pub(crate) weight: f64,
}

fn weighted_mean<'a>(windows: impl Iterator<Item = &'a Weighted>) -> f64 {
    let (sum, weights) = windows.fold((0.0, 0.0), |(sum, all), w| (sum + w.weight * w.value, all + w.weight));
    sum / weights
}

fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (v.min(lo), v.max(hi)))
}

/// Expected max − min of n independent normal values in units of σ: ∫ 1 − Φⁿ − (1 − Φ)ⁿ dx
/// (Tippett 1925), by the trapezoidal rule, which converges exponentially for this integrand.
pub fn expected_range(n: usize) -> f64 {
    let Ok(normal) = Normal::new(0.0, 1.0) else {
        return f64::NAN;
    };
    const STEP: f64 = 0.02;
    let n = n as f64;
    let integrand = |x: f64| {
        let below = normal.cdf(x);
        1.0 - below.powf(n) - (1.0 - below).powf(n)
    };
    (-600..=600).map(|i| integrand(f64::from(i) * STEP)).sum::<f64>() * STEP
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral by numpy.trapezoid with math.erfc, 240,001 points over ±12.
    #[test]
    fn expected_range_is_that_of_the_tables() {
        for (n, expected) in [(50, 4.498147), (100, 5.015187), (150, 5.298493), (288, 5.729478)] {
            assert!((expected_range(n) - expected).abs() < 1e-6, "{n}: {}", expected_range(n));
        }
    }

    #[test]
    fn sigma_is_pooled_about_each_runs_mean() {
        let window = |(run, value)| Weighted { run, value, weight: 1.0 };
        let values = [(0, 1.0), (0, 3.0), (1, 10.0), (1, 14.0)].map(window);
        let drift = DriftValues::of(&values, 2.0).unwrap();
        assert_eq!((drift.peak_to_peak, drift.mean, drift.n), (4.0, 7.0, 4));
        assert!((drift.sigma - 5.0_f64.sqrt()).abs() < 1e-15 && (drift.sigma_dph - 2.0 * drift.sigma).abs() < 1e-15);
        assert!(DriftValues::of(&values[..1], 1.0).is_none());
        // A quarter of the length: twice the noise, so half of the distance counts.
        let short = [Weighted { weight: 0.25, ..window((0, 5.0)) }, window((0, 0.0))];
        let drift = DriftValues::of(&short, 1.0).unwrap();
        assert_eq!((drift.mean, drift.peak_to_peak), (1.0, 3.0));
    }
}
