//! One axis as JSON has it: one flat object, so that scripts find `terms`, `residual` and `candidates` side by side.
//!
//! `reference_c`, `span_c`, `lag_s` and `rate_span_cpm` repeat the thermometer of the fit, `inputs[0]`; a record in which they
//! differ from it is refused.

use sagnac_log::ingest::Tally;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{
    Candidate, Collinearity, CorrectionNoise, CrossValidation, CurveSpread, Entanglement, Hysteresis, Input, LackOfFit,
    Lag, Misalignment, Monomial, NoiseFloor, PriorUse, RejectedInput, RejectedModel, Residual, RunOffset, ScaleFactor,
    SearchStep, SlowNoiseTerms, Soak, Term, TimeEffect, WarmUp,
};

/// See [`crate::calibration::AxisCalibration`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "AxisCalibration")]
pub(crate) struct AxisRecord {
    /// Axis letter.
    pub(crate) axis: char,
    /// In the words of `--model`.
    pub(crate) model: String,
    /// The terms.
    pub(crate) terms: Vec<Term>,
    /// The warm-up since power-on that the target corrects; absent where it corrects none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) warm_up: Option<WarmUp>,
    /// Lag of the rate terms over the thermometer of the fit; null without any.
    pub(crate) lag_s: Option<Lag>,
    /// T0, °C.
    pub(crate) reference_c: f64,
    /// Temperatures of the fit, °C. Outside, the correction is the one at the border.
    pub(crate) span_c: [f64; 2],
    /// Temperature rates of the fit, °C/min; null without a rate term.
    pub(crate) rate_span_cpm: Option<[f64; 2]>,
    /// What the terms depend on, and the thermometers that differences need. The first is the thermometer of the fit.
    pub(crate) inputs: Vec<Input>,
    /// Offsets of the runs.
    pub(crate) run_offsets: Vec<RunOffset>,
    /// The curve in the paper's form; null where it is no polynomial of the temperature.
    pub(crate) monomial: Option<Monomial>,
    /// The curve zone by zone, coldest first, where the span is cut into zones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) zones: Vec<Monomial>,
    /// Conditioning of the terms; absent without terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) collinearity: Option<Collinearity>,
    /// What the noise of thermometers does to the corrected angle; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) correction_noise: Option<CorrectionNoise>,
    /// Inputs that the search did not try, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) rejected_inputs: Vec<RejectedInput>,
    /// Models that would have been selected, but no image can hold them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) rejected_models: Vec<RejectedModel>,
    /// The search from the grid's model to this one; empty where the model was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) model_search: Vec<SearchStep>,
    /// Scale factor, from runs on a rate table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) scale_factor: Option<ScaleFactor>,
    /// Misalignment of the input axis, from runs in which another axis was turned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) misalignment: Vec<Misalignment>,
    /// Residual of the fit; null where nothing was fitted here.
    pub(crate) residual: Option<Residual>,
    /// Noise floor; null where neither measured nor given.
    pub(crate) noise_floor: Option<NoiseFloor>,
    /// Heating against cooling; absent where the test does not hold both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) hysteresis: Option<Hysteresis>,
    /// What the selection of the model, and a lag that is not resolved, add to the uncertainty of the curve; absent where nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) curve_spread: Option<CurveSpread>,
    /// What the rows contradict the model with; absent where they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) lack_of_fit: Option<LackOfFit>,
    /// Noise of the residual that is not white; absent where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) slow_noise: Option<SlowNoiseTerms>,
    /// The log shows more noise than the setup states, so that intervals go by the log; absent where it does not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) noise_exceeds_setup: bool,
    /// Drift in time and warm-up, fitted beside the terms and not corrected; absent where none is justified.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) time_effects: Vec<TimeEffect>,
    /// What moved together with temperature in the runs; absent where nothing did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) entanglement: Vec<Entanglement>,
    /// The prior of the unit's fleet; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) prior: Option<PriorUse>,
    /// σ of the run offsets, °/h, where runs cover so little of the temperatures each that their offsets can hold the drift;
    /// absent where they cannot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) hidden_in_offsets_dph: Option<f64>,
    /// Rates of the thermometer over the windows, °C/min: the 5th and the 95th percentile; absent without time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) ramp_rates_cpm: Option<[f64; 2]>,
    /// What more soaking would improve; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) soak: Option<Soak>,
    /// Held-out residual; null where nothing was fitted here.
    pub(crate) cross_validation: Option<CrossValidation>,
    /// Models that were tried.
    pub(crate) candidates: Vec<Candidate>,
    /// Windows and rows that were excluded, and why.
    pub(crate) excluded: Vec<Tally>,
    /// Covariance of run offsets, terms and lags in the order of `covariance_of`; empty where not fitted.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// Names of its rows.
    pub(crate) covariance_of: Vec<String>,
}
