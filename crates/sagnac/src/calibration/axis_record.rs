//! One axis as JSON has it: one flat object, so that scripts find `terms`, `residual` and `candidates` side by side.
//!
//! `reference_c`, `span_c`, `lag_s` and `rate_span_cpm` repeat the thermometer of the fit, `inputs[0]`; a record in which they
//! differ from it is refused. A diagnostic of the fit is one row of the list below: its words, its form in the file, its type.

use sagnac_log::ingest::Tally;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{
    Candidate, Collinearity, CorrectionNoise, CorrectionTerm, CrossValidation, CurveSpread, Entanglement, FitResidual,
    FixedBias, Hysteresis, Input, LackOfFit, Lag, MemoryAtRest, Misalignment, Monomial, NoiseFloor, PriorUse,
    RejectedInput, RejectedModel, RunOffset, ScaleFactor, SearchStep, SlowNoiseTerms, Soak, TimeEffect, WarmUp,
    WholeNoise,
};

/// Makes [`FitDiagnostics`] and [`AxisRecord`] of one list of diagnostics, in the order of the file.
macro_rules! diagnostics {
    (
        before { $($(#[$words:meta])* [$($form:tt)*] $before:ident: $type:ty,)* }
        after { $($(#[$late_words:meta])* [$($late_form:tt)*] $after:ident: $late_type:ty,)* }
    ) => {
        /// How a correction was found, and how sure it is.
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct FitDiagnostics {
            /// Residual of the fit.
            pub residual: FitResidual,
            $($(#[$words])* pub $before: $type,)*
            $($(#[$late_words])* pub $after: $late_type,)*
        }

        /// See [`crate::calibration::AxisCalibration`].
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[schemars(rename = "AxisCalibration")]
        pub(crate) struct AxisRecord {
            /// Axis letter.
            pub(crate) axis: char,
            /// In the words of `--model`.
            pub(crate) model: String,
            /// The terms.
            pub(crate) terms: Vec<CorrectionTerm>,
            /// The warm-up since power-on that the target corrects; absent where it corrects none.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub(crate) warm_up: Option<WarmUp>,
            /// The fixed bias that the target removes too; absent where it keeps it.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub(crate) fixed_bias: Option<FixedBias>,
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
            $($(#[$words])* #[serde($($form)*)] pub(crate) $before: $type,)*
            /// Residual of the fit; null where nothing was fitted here.
            pub(crate) residual: Option<FitResidual>,
            $($(#[$late_words])* #[serde($($late_form)*)] pub(crate) $after: $late_type,)*
        }

        impl AxisRecord {
            /// With the diagnostics of a fit.
            pub(crate) fn with(self, fit: FitDiagnostics) -> Self {
                let FitDiagnostics { residual, $($before,)* $($after,)* } = fit;
                Self { residual: Some(residual), $($before,)* $($after,)* ..self }
            }

            /// Takes the diagnostics out; `None` where nothing was fitted here.
            pub(crate) fn take_fit(&mut self) -> Option<FitDiagnostics> {
                let residual = self.residual.take()?;
                Some(FitDiagnostics {
                    residual,
                    $($before: std::mem::take(&mut self.$before),)*
                    $($after: std::mem::take(&mut self.$after),)*
                })
            }
        }
    };
}

diagnostics! {
    before {
        /// Conditioning of the terms; absent without terms.
        [default, skip_serializing_if = "Option::is_none"] collinearity: Option<Collinearity>,
        /// What the noise of thermometers does to the corrected angle; absent where nothing was fitted here.
        [default, skip_serializing_if = "Option::is_none"] correction_noise: Option<CorrectionNoise>,
        /// Inputs that the search did not try, and why.
        [default, skip_serializing_if = "Vec::is_empty"] rejected_inputs: Vec<RejectedInput>,
        /// Models that would have been selected, but no image can hold them.
        [default, skip_serializing_if = "Vec::is_empty"] rejected_models: Vec<RejectedModel>,
        /// The search from the grid's model to this one; empty where the model was given.
        [default, skip_serializing_if = "Vec::is_empty"] model_search: Vec<SearchStep>,
        /// Scale factor, from runs on a rate table.
        [default, skip_serializing_if = "Option::is_none"] scale_factor: Option<ScaleFactor>,
        /// Misalignment of the input axis, from runs in which another axis was turned.
        [default, skip_serializing_if = "Vec::is_empty"] misalignment: Vec<Misalignment>,
    }
    after {
        /// Noise floor; null where neither measured nor given.
        [] noise_floor: Option<NoiseFloor>,
        /// The residual by noise alone; absent without soaks of an hour or a stated B or K.
        [default, skip_serializing_if = "Option::is_none"] whole_noise: Option<WholeNoise>,
        /// Heating against cooling; absent where the test does not hold both.
        [default, skip_serializing_if = "Option::is_none"] hysteresis: Option<Hysteresis>,
        /// Memory of temperature at rest; absent where the test does not move both ways, or says that there is none.
        [default, skip_serializing_if = "Option::is_none"] memory: Option<MemoryAtRest>,
        /// σ of the effect of the temperature rate that a model without a rate term leaves open, °/h per °C/min; absent with rate terms.
        [default, skip_serializing_if = "Option::is_none"] rate_left_dph_per_cpm: Option<f64>,
        /// What the selection of the model, and a lag that is not resolved, add to the uncertainty of the curve; absent where nothing.
        [default, skip_serializing_if = "Option::is_none"] curve_spread: Option<CurveSpread>,
        /// What the rows contradict the model with; absent where they do not.
        [default, skip_serializing_if = "Option::is_none"] lack_of_fit: Option<LackOfFit>,
        /// Noise of the residual that is not white; absent where it is.
        [default, skip_serializing_if = "Option::is_none"] slow_noise: Option<SlowNoiseTerms>,
        /// The log shows more noise than the setup states, so that intervals go by the log; absent where it does not.
        [default, skip_serializing_if = "std::ops::Not::not"] noise_exceeds_setup: bool,
        /// Drift in time and warm-up, fitted next to the terms and not corrected; absent where none is justified.
        [default, skip_serializing_if = "Vec::is_empty"] time_effects: Vec<TimeEffect>,
        /// What moved together with temperature in the runs; absent where nothing did.
        [default, skip_serializing_if = "Vec::is_empty"] entanglement: Vec<Entanglement>,
        /// The prior of the unit's fleet; absent without one.
        [default, skip_serializing_if = "Option::is_none"] prior: Option<PriorUse>,
        /// σ of the run offsets, °/h, where runs cover so little of the temperatures each that their offsets can hold the drift;
        /// absent where they cannot.
        [default, skip_serializing_if = "Option::is_none"] hidden_in_offsets_dph: Option<f64>,
        /// Rates of the thermometer over the windows, °C/min: the 5th and the 95th percentile; absent without time.
        [default, skip_serializing_if = "Option::is_none"] ramp_rates_cpm: Option<[f64; 2]>,
        /// What more soaking would improve; absent where nothing was fitted here.
        [default, skip_serializing_if = "Option::is_none"] soak: Option<Soak>,
        /// Held-out residual; null where nothing was fitted here.
        [] cross_validation: Option<CrossValidation>,
        /// Models that were tried.
        [] candidates: Vec<Candidate>,
        /// Windows and rows that were excluded, and why.
        [] excluded: Vec<Tally>,
        /// Covariance of run offsets, terms and lags in the order of `covariance_of`; empty where not fitted.
        [] covariance: Vec<Vec<f64>>,
        /// Names of its rows.
        [] covariance_of: Vec<String>,
    }
}
