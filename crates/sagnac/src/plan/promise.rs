//! What a test promises: the error that its correction will have, checked against the limits that it decides.
//!
//! ```text
//! δ(T) = f(T)ᵀ(θ̂ − θ),   ρ(T) = ∂δ/∂Ṫ         (δ, ρ) at twelve temperatures ~ N(0, W·Cov θ·Wᵀ), drawn
//! temperature_residual   √mean (δ − δ̄)²      plateau_offset   max |δ − δ̄|      drift_per_c   |slope of δ over T|
//! drift_per_cpm          |mean ρ|             hysteresis       2·Ṫ·|mean ρ|
//! ```

use std::sync::LazyLock;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::calibration::AxisCalibration;
use crate::verify::Limits;

/// Temperatures over the span, ends included.
const TEMPERATURES: usize = 12;
/// Draws of the error: a probability of 0.95 is known to 0.005. The same for every candidate, so that they are compared alike.
const DRAWS: usize = 2000;
const SEED: u64 = 20_261_124;
/// Quantile that is shown of each value.
const SHOWN: f64 = 0.95;

/// Limits that a test decides.
pub(super) const NAMES: [&str; 5] = [
    "temperature_residual_dph_max",
    "plateau_offset_dph_max",
    "drift_dph_per_c_max",
    "drift_dph_per_cpm_max",
    "hysteresis_dph_max",
];

/// A limit, and what the correction alone is expected to take of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Expected {
    /// Its key.
    pub limit: String,
    /// The limit.
    pub bound: f64,
    /// The error of the correction is below this with a probability of 0.95.
    pub value_95: f64,
    /// Unit of both.
    pub unit: String,
}

/// What a test promises.
#[derive(Clone, Debug)]
pub(super) struct Promise {
    pub(super) probability: f64,
    pub(super) sigma_dph: f64,
    pub(super) expected: Vec<Expected>,
}

/// The limits that are asked and that a test decides: place among the names, bound.
pub(super) fn judged(limits: &Limits) -> Vec<(usize, f64)> {
    let given = limits.given();
    let bound = |name: &str| given.iter().find(|(spec, _)| spec.key == name).map(|(_, bound)| *bound);
    NAMES.iter().enumerate().filter_map(|(at, name)| Some((at, bound(name)?))).collect()
}

/// The others that are asked.
pub(super) fn not_planned(limits: &Limits) -> Vec<String> {
    let given = limits.given();
    given.iter().map(|(spec, _)| spec.key.to_owned()).filter(|name| !NAMES.contains(&name.as_str())).collect()
}

impl Promise {
    /// By the covariance of a fit, for ramps of a rate, °C/min; the error may take `share` of each limit. `None` where the fit has no covariance.
    pub(super) fn of(axis: &AxisCalibration, limits: &Limits, share: f64, rate_cpm: f64) -> Option<Self> {
        let [lo, hi] = axis.span_c();
        let celsius: Vec<f64> =
            (0..TEMPERATURES).map(|at| lo + (hi - lo) * at as f64 / (TEMPERATURES - 1) as f64).collect();
        let reference_c = axis.reference_c();
        let mut weights: Vec<Vec<(usize, f64)>> = celsius.iter().map(|c| axis.drift_weights(*c, reference_c)).collect();
        weights.extend(celsius.iter().map(|c| axis.rate_weights(*c)));
        let n = weights.len();
        let mut covariance = DMatrix::from_fn(n, n, |i, j| axis.covariance_between(&weights[i], &weights[j]));
        // Models next to the selected one have other curves.
        for (at, celsius) in celsius.iter().enumerate() {
            covariance[(at, at)] += axis.spread_variance(*celsius);
        }
        let SymmetricEigen { eigenvectors, eigenvalues } =
            SymmetricEigen::new((&covariance + covariance.transpose()) / 2.0);
        let root = eigenvectors * DMatrix::from_diagonal(&eigenvalues.map(|value| value.max(0.0).sqrt()));
        // Where the correction is used: at rest, and on ramps in both directions.
        let on_ramps: f64 =
            (0..TEMPERATURES).map(|at| rate_cpm.powi(2) * covariance[(TEMPERATURES + at, TEMPERATURES + at)]).sum();
        let at_rest: f64 = (0..TEMPERATURES).map(|at| covariance[(at, at)]).sum();
        let sigma_dph = ((at_rest + on_ramps) / TEMPERATURES as f64).sqrt();
        let judged = judged(limits);
        let (mut values, mut good) = (vec![Vec::with_capacity(DRAWS); judged.len()], 0_usize);
        for draw in DRAWN.iter() {
            let all = values_of(&celsius, &(&root * DVector::from_column_slice(draw)), rate_cpm);
            let is_within = |(at, bound): &(usize, f64)| all[*at] <= share * bound;
            good += usize::from(judged.iter().all(is_within));
            judged.iter().zip(&mut values).for_each(|((at, _), drawn)| drawn.push(all[*at]));
        }
        let expected = judged.iter().zip(values).map(|((at, bound), mut drawn)| {
            drawn.sort_by(f64::total_cmp);
            let value_95 = drawn.get((SHOWN * DRAWS as f64) as usize).copied().unwrap_or(f64::NAN);
            let given = limits.given();
            let unit = given.iter().find(|(spec, _)| spec.key == NAMES[*at]).map_or("", |(spec, _)| spec.unit);
            Expected { limit: NAMES[*at].to_owned(), bound: *bound, value_95, unit: unit.to_owned() }
        });
        let expected: Vec<Expected> = expected.collect();
        let is_known = sigma_dph.is_finite() && sigma_dph > 0.0;
        is_known.then(|| Self { probability: good as f64 / DRAWS as f64, sigma_dph, expected })
    }
}

fn values_of(celsius: &[f64], error: &DVector<f64>, rate_cpm: f64) -> [f64; NAMES.len()] {
    let n = TEMPERATURES as f64;
    let at_rest = &error.as_slice()[..TEMPERATURES];
    let mean = at_rest.iter().sum::<f64>() / n;
    let mean_c = celsius.iter().sum::<f64>() / n;
    let rms = (at_rest.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt();
    let most = at_rest.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    let across: f64 = celsius.iter().zip(at_rest).map(|(c, value)| (c - mean_c) * value).sum();
    let along: f64 = celsius.iter().map(|c| (c - mean_c).powi(2)).sum();
    let of_rate = (error.as_slice()[TEMPERATURES..].iter().sum::<f64>() / n).abs();
    [rms, most, (across / along).abs(), of_rate, 2.0 * rate_cpm * of_rate]
}

/// Standard normal vectors: errors at the temperatures, then their slopes.
static DRAWN: LazyLock<Vec<[f64; 2 * TEMPERATURES]>> = LazyLock::new(|| {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let normal = Normal::standard();
    let mut one = || normal.inverse_cdf(random.random::<f64>().clamp(1e-12, 1.0 - 1e-12));
    (0..DRAWS).map(|_| std::array::from_fn(|_| one())).collect()
});
