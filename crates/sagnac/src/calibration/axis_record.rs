//! One axis as JSON has it: one flat object, so that scripts find `terms`, `residual` and `candidates` side by side.
//!
//! `reference_c`, `span_c`, `lag_s` and `rate_span_cpm` repeat the thermometer of the fit, `inputs[0]`; a record in which they
//! differ from it is refused.

use sagnac_log::ingest::Tally;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{
    AxisCalibration, AxisCorrection, Candidate, Collinearity, CorrectionNoise, CrossValidation, CurveSpread,
    Entanglement, FitDiagnostics, Hysteresis, Input, LackOfFit, Lag, Misalignment, Monomial, NoiseFloor, PriorUse,
    RejectedInput, RejectedModel, Residual, RunOffset, ScaleFactor, SearchStep, SlowNoiseTerms, Soak, Term, TimeEffect,
    WarmUp,
};

/// See [`AxisCalibration`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "AxisCalibration")]
pub(crate) struct AxisRecord {
    /// Axis letter.
    axis: char,
    /// In the words of `--model`.
    model: String,
    /// The terms.
    terms: Vec<Term>,
    /// The warm-up since power-on that the target corrects; absent where it corrects none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    warm_up: Option<WarmUp>,
    /// Lag of the rate terms over the thermometer of the fit; null without any.
    lag_s: Option<Lag>,
    /// T0, °C.
    reference_c: f64,
    /// Temperatures of the fit, °C. Outside, the correction is the one at the border.
    span_c: [f64; 2],
    /// Temperature rates of the fit, °C/min; null without a rate term.
    rate_span_cpm: Option<[f64; 2]>,
    /// What the terms depend on, and the thermometers that differences need. The first is the thermometer of the fit.
    inputs: Vec<Input>,
    /// Offsets of the runs.
    run_offsets: Vec<RunOffset>,
    /// The curve in the paper's form; null where it is no polynomial of the temperature.
    monomial: Option<Monomial>,
    /// The curve zone by zone, coldest first, where the span is cut into zones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    zones: Vec<Monomial>,
    /// Conditioning of the terms; absent without terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    collinearity: Option<Collinearity>,
    /// What the noise of thermometers does to the corrected angle; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    correction_noise: Option<CorrectionNoise>,
    /// Inputs that the search did not try, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    rejected_inputs: Vec<RejectedInput>,
    /// Models that would have been selected, but no image can hold them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    rejected_models: Vec<RejectedModel>,
    /// The search from the grid's model to this one; empty where the model was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    model_search: Vec<SearchStep>,
    /// Scale factor, from runs on a rate table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale_factor: Option<ScaleFactor>,
    /// Misalignment of the input axis, from runs in which another axis was turned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    misalignment: Vec<Misalignment>,
    /// Residual of the fit; null where nothing was fitted here.
    residual: Option<Residual>,
    /// Noise floor; null where neither measured nor given.
    noise_floor: Option<NoiseFloor>,
    /// Heating against cooling; absent where the test does not hold both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hysteresis: Option<Hysteresis>,
    /// What the selection of the model, and a lag that is not resolved, add to the uncertainty of the curve; absent where nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    curve_spread: Option<CurveSpread>,
    /// What the rows contradict the model with; absent where they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lack_of_fit: Option<LackOfFit>,
    /// Noise of the residual that is not white; absent where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    slow_noise: Option<SlowNoiseTerms>,
    /// The log shows more noise than the setup states, so that intervals go by the log; absent where it does not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    noise_exceeds_setup: bool,
    /// Drift in time and warm-up, fitted beside the terms and not corrected; absent where none is justified.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    time_effects: Vec<TimeEffect>,
    /// What moved together with temperature in the runs; absent where nothing did.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    entanglement: Vec<Entanglement>,
    /// The prior of the unit's fleet; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    prior: Option<PriorUse>,
    /// σ of the run offsets, °/h, where runs cover so little of the temperatures each that their offsets can hold the drift;
    /// absent where they cannot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hidden_in_offsets_dph: Option<f64>,
    /// Rates of the thermometer over the windows, °C/min: the 5th and the 95th percentile; absent without time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ramp_rates_cpm: Option<[f64; 2]>,
    /// What more soaking would improve; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    soak: Option<Soak>,
    /// Held-out residual; null where nothing was fitted here.
    cross_validation: Option<CrossValidation>,
    /// Models that were tried.
    candidates: Vec<Candidate>,
    /// Windows and rows that were excluded, and why.
    excluded: Vec<Tally>,
    /// Covariance of run offsets, terms and lags in the order of `covariance_of`; empty where not fitted.
    covariance: Vec<Vec<f64>>,
    /// Names of its rows.
    covariance_of: Vec<String>,
}

impl From<AxisCalibration> for AxisRecord {
    fn from(axis: AxisCalibration) -> Self {
        let main = axis.correction.inputs.first();
        let (lag_s, rate_span_cpm) = (main.and_then(|m| m.lag_s), main.and_then(|m| m.rate_span_per_min));
        let (reference_c, span_c) = main.map_or((f64::NAN, [f64::NAN; 2]), |m| (m.reference, m.span));
        let AxisCalibration { axis, correction, run_offsets, monomial, zones, fit } = axis;
        let AxisCorrection { model, inputs, terms, warm_up } = correction;
        let mut record = Self {
            axis,
            model,
            terms,
            warm_up,
            lag_s,
            reference_c,
            span_c,
            rate_span_cpm,
            inputs,
            run_offsets,
            monomial,
            zones,
            collinearity: None,
            correction_noise: None,
            rejected_inputs: Vec::new(),
            rejected_models: Vec::new(),
            model_search: Vec::new(),
            scale_factor: None,
            misalignment: Vec::new(),
            residual: None,
            noise_floor: None,
            hysteresis: None,
            ramp_rates_cpm: None,
            curve_spread: None,
            lack_of_fit: None,
            slow_noise: None,
            noise_exceeds_setup: false,
            time_effects: Vec::new(),
            entanglement: Vec::new(),
            prior: None,
            hidden_in_offsets_dph: None,
            soak: None,
            cross_validation: None,
            candidates: Vec::new(),
            excluded: Vec::new(),
            covariance: Vec::new(),
            covariance_of: Vec::new(),
        };
        if let Some(fit) = fit {
            record.add(fit);
        }
        record
    }
}

impl AxisRecord {
    fn add(&mut self, fit: FitDiagnostics) {
        let FitDiagnostics {
            residual,
            noise_floor,
            cross_validation,
            collinearity,
            correction_noise,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            scale_factor,
            misalignment,
            candidates,
            model_search,
            rejected_inputs,
            rejected_models,
            excluded,
            covariance,
            covariance_of,
        } = fit;
        self.residual = Some(residual);
        (self.noise_floor, self.cross_validation, self.collinearity) = (noise_floor, cross_validation, collinearity);
        (self.correction_noise, self.hysteresis, self.soak) = (correction_noise, hysteresis, soak);
        (self.curve_spread, self.lack_of_fit, self.slow_noise) = (curve_spread, lack_of_fit, slow_noise);
        self.noise_exceeds_setup = noise_exceeds_setup;
        (self.time_effects, self.entanglement, self.prior) = (time_effects, entanglement, prior);
        (self.ramp_rates_cpm, self.hidden_in_offsets_dph) = (ramp_rates_cpm, hidden_in_offsets_dph);
        (self.scale_factor, self.misalignment) = (scale_factor, misalignment);
        (self.candidates, self.model_search, self.rejected_inputs) = (candidates, model_search, rejected_inputs);
        self.rejected_models = rejected_models;
        (self.excluded, self.covariance, self.covariance_of) = (excluded, covariance, covariance_of);
    }
}

impl TryFrom<AxisRecord> for AxisCalibration {
    type Error = String;

    fn try_from(record: AxisRecord) -> Result<Self, String> {
        let Some(main) = record.inputs.first() else {
            return Err(format!("axis {}: `inputs` has no thermometer of the fit", record.axis));
        };
        let repeated = [
            ("reference_c", record.reference_c == main.reference),
            ("span_c", record.span_c == main.span),
            ("lag_s", record.lag_s == main.lag_s),
            ("rate_span_cpm", record.rate_span_cpm == main.rate_span_per_min),
        ];
        if let Some((name, _)) = repeated.iter().find(|(_, same)| !same) {
            return Err(format!("axis {}: `{name}` is not that of inputs[0], which it repeats", record.axis));
        }
        let AxisRecord {
            axis,
            model,
            terms,
            warm_up,
            lag_s: _,
            reference_c: _,
            span_c: _,
            rate_span_cpm: _,
            inputs,
            run_offsets,
            monomial,
            zones,
            collinearity,
            correction_noise,
            rejected_inputs,
            rejected_models,
            model_search,
            scale_factor,
            misalignment,
            residual,
            noise_floor,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            cross_validation,
            candidates,
            excluded,
            covariance,
            covariance_of,
        } = record;
        let fit = residual.map(|residual| FitDiagnostics {
            residual,
            noise_floor,
            cross_validation,
            collinearity,
            correction_noise,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            scale_factor,
            misalignment,
            candidates,
            model_search,
            rejected_inputs,
            rejected_models,
            excluded,
            covariance,
            covariance_of,
        });
        let correction = AxisCorrection { model, inputs, terms, warm_up };
        Ok(Self { axis, correction, run_offsets, monomial, zones, fit })
    }
}
