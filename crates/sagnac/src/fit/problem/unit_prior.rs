//! What is known of a unit before its test: the scatter of its fleet, in the terms of a model.

use crate::model::spec::ModelSpec;

/// An autocorrelation is taken as within this.
const MOST_CORRELATED: f64 = 0.95;

/// What is known of a unit's coefficients before its test, on the common basis ([`crate::model::COMMON_SPAN`]).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct UnitPrior {
    /// The model, in the words of `--model`.
    pub model: ModelSpec,
    /// Names of the parameters: those of the terms, then `lag_s` and `slow lag_s`.
    pub terms: Vec<String>,
    /// μ.
    pub mean: Vec<f64>,
    /// Σ, with what is not known of it: the lower triangle, row by row.
    pub covariance: Vec<f64>,
    /// Degrees of freedom of Σ.
    pub degrees: f64,
    /// Temperatures that the tests of the fleet covered, °C.
    pub span_c: [f64; 2],
    /// Rates that they covered, °C/min: of the thermometer's first lag, then of its slow one.
    pub rate_spans_cpm: Vec<[f64; 2]>,
    /// Lag of the rate terms where the fleet's tests do not resolve one, s: that of their records.
    pub fixed_lag_s: Option<f64>,
    /// Bias instability of its units, °/h.
    pub bias_instability_dph: f64,
    /// Rate random walk of its units, °/h/√h.
    pub rate_random_walk_dph_rt_h: f64,
    /// How large residuals of the fleet are; `None` where its tests have windows of several lengths.
    pub residual: Option<ResidualOfFleet>,
    /// Axes behind it.
    pub axes: u64,
    /// The lot, where it is that of a lot.
    pub lot: Option<String>,
    /// SHA-256 of its file, hex.
    pub sha256: String,
}

/// Residuals of a fleet's tests: ln r is normal over its axes, r² = σ²·(1 + ρ)/(1 − ρ).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ResidualOfFleet {
    /// Nominal length of their windows, s.
    pub window_s: f64,
    /// Mean of ln r, r in °/h.
    pub ln_mean: f64,
    /// Its σ.
    pub ln_sigma: f64,
    /// Axes behind both.
    pub axes: u64,
}

/// ln of σ·√((1 + ρ)/(1 − ρ)): what a residual and its autocorrelation from window to window make of the mean of many.
pub(crate) fn ln_of_residual(sigma_dph: f64, correlation: f64) -> f64 {
    let rho = correlation.clamp(-MOST_CORRELATED, MOST_CORRELATED);
    sigma_dph.max(f64::MIN_POSITIVE).ln() + 0.5 * ((1.0 + rho) / (1.0 - rho)).ln()
}
