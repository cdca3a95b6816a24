//! Values of a fit that the record states: offsets of the runs, residual, floor, held-out error, models that were tried.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The offset of one run: fixed bias plus input rate. Never part of the correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct RunOffset {
    /// Index of the run.
    pub run: u32,
    /// Rate at T0 and Ṫ = 0, °/h.
    pub value_dph: f64,
    /// Standard deviation; null where it was not fitted here.
    pub sigma_dph: Option<f64>,
    /// The offset less the known input rate: the fixed bias, °/h; null where the input rate is not
    /// known or the log has several axes.
    pub fixed_bias_dph: Option<f64>,
}

/// The curve at Ṫ = 0 in the paper's form: value = Σ coefficientᵢ·Tⁱ, T in °C.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Monomial {
    /// Run whose offset it holds.
    pub run: u32,
    /// `counts per window` or `deg/h`.
    pub unit: String,
    /// The window, s.
    pub window_s: f64,
    /// Ascending powers of °C.
    pub coefficients: Vec<f64>,
    /// Standard deviations; null where not fitted here.
    pub sigma: Option<Vec<f64>>,
    /// Temperatures between which it holds, °C, where the span is cut into zones: that of T0; `zones` has them all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_c: Option<[f64; 2]>,
}

/// Residual of the fit, about the fitted curve. In-sample: quote the cross-validation instead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct FitResidual {
    /// Windows.
    pub n: usize,
    /// σ with the lost degrees of freedom counted, °/h.
    pub sigma_dph: f64,
    /// Largest minus smallest, °/h.
    pub peak_to_peak_dph: f64,
    /// Correlation of neighbouring residuals, by which the intervals were widened.
    pub lag1_autocorrelation: f64,
    /// Half a 95 % interval in units of σ: Student's t at as many degrees of freedom as that correlation leaves.
    pub t_quantile_975: f64,
}

impl FitResidual {
    /// σ of a window in a mean of many, °/h: widened by the correlation of neighbours.
    pub(crate) fn widened_sigma_dph(&self) -> f64 {
        self.sigma_dph * ((1.0 + self.lag1_autocorrelation) / (1.0 - self.lag1_autocorrelation)).sqrt()
    }
}

/// What noise alone makes of the mean of a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct NoiseFloor {
    /// √(N²/τ + 2Q²/τ²) for the nominal window, °/h.
    pub value_dph: f64,
    /// Angle random walk N, °/√h.
    pub n_deg_rt_h: f64,
    /// Quantization Q, arcsec.
    pub q_arcsec: f64,
    /// Where N and Q come from.
    pub source: String,
    /// −3 dB frequency of the low-pass filter behind which the rows were logged, Hz, to about a fifth; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter_hz: Option<f64>,
    /// How neighbouring rows correlate: σ² at two rows over that at one, 0.25 of rounding, 0.5 of white noise, more behind a filter; absent
    /// where the rows do not show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_over_first: Option<f64>,
    /// Interval of a row, s; absent without times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_s: Option<f64>,
}

/// The fixed bias that a correction removes, with the drift over temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct FixedBias {
    /// Mean over the runs of run offset less input rate, at T0, °/h.
    pub value_dph: f64,
    /// Its standard deviation: that of the fit, or from the scatter of the runs, whichever is larger, °/h.
    pub sigma_dph: f64,
    /// Runs behind it. A bias changes at each turn-on.
    pub runs: usize,
}

impl FixedBias {
    /// Of runs whose input rate is known; `None` without any.
    pub(crate) fn of(offsets: &[RunOffset]) -> Option<Self> {
        let biases: Vec<f64> = offsets.iter().filter_map(|offset| offset.fixed_bias_dph).collect();
        let n = biases.len() as f64;
        let value_dph = biases.iter().sum::<f64>() / n;
        let own: f64 = offsets.iter().map(|offset| offset.sigma_dph.unwrap_or(0.0).powi(2)).sum::<f64>() / n;
        let scatter = biases.iter().map(|b| (b - value_dph).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        (!biases.is_empty()).then(|| Self { value_dph, sigma_dph: (own.max(scatter) / n).sqrt(), runs: biases.len() })
    }
}

/// The residual that the gyro's noise alone makes, white and slow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WholeNoise {
    /// Expected σ of the windows about the means of their runs, °/h.
    pub sigma_dph: f64,
    /// Fewer than 2 % of tests have a larger σ by noise alone, °/h.
    pub bound_dph: f64,
    /// `soaks` of this test, or the `setup`.
    pub source: String,
}

/// Held-out residual.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct CrossValidation {
    /// What is held out.
    pub scheme: String,
    /// How many folds.
    pub folds: usize,
    /// Root mean square of held-out residuals, °/h.
    pub sigma_dph: f64,
}

/// One model that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Candidate {
    /// In the words of `--model`.
    pub model: String,
    /// Coefficients without constants, lag included.
    pub coefficients: usize,
    /// Root mean square of held-out residuals, °/h; null where a fold could not be fitted.
    pub held_out_dph: Option<f64>,
    /// Instructions of its slow update on a Cortex-M4F; the tick costs the same for all.
    #[serde(default)]
    pub slow_update_instructions: Option<u32>,
    /// It was selected.
    pub chosen: bool,
}
