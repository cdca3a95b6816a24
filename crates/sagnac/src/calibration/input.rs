//! The inputs of a correction: what its terms depend on, and how the target reads it.

use sagnac_log::setup::{AuxSetup, ThermometerSetup};
use sagnac_units::format::on_scale;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::Span;
use crate::model::input::{label, plausible_about, unit_exponent};

/// Replay's own temperature code: 2⁻²⁴ °C.
const CODE_C: f64 = 1.0 / (1 << 24) as f64;

/// A fitted lag.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lag {
    /// τ, s.
    pub value: f64,
    /// Standard deviation; null where τ is not resolved: then it is the smallest whose misfit is within Δχ² = 4 of the least.
    pub sigma: Option<f64>,
}

/// Where the numbers of an input come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InputSource {
    /// The log's thermometer of this name (empty for a plain `temperature_c`).
    Thermometer(String),
    /// The first thermometer less the second.
    Difference(String, String),
    /// The log's auxiliary column of this name.
    Column(String),
    /// The input of this name once more, for a second lag.
    Repeat(String),
}

/// An input: what its terms mean and how the target reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Input {
    /// Its name in models and terms.
    pub name: String,
    /// Where its numbers come from.
    pub source: InputSource,
    /// Value at which its terms are zero, in its own unit (°C for thermometers and differences); T0 of the thermometer of
    /// the fit.
    pub reference: f64,
    /// Values of the fit. Outside, the correction is the one at the border.
    pub span: [f64; 2],
    /// Lag of its rate terms; null without any.
    pub lag_s: Option<Lag>,
    /// Rates of the fit and half as much again, units per minute; null without rate terms.
    pub rate_span_per_min: Option<[f64; 2]>,
    /// Value at code 0. Without the setup's own conversion a thermometer's code is 2⁻²⁴ °C.
    pub offset: f64,
    /// Units per code.
    pub gain_per_code: f64,
    /// Values outside are rejected.
    pub valid_range: [f64; 2],
    /// Root mean square of what its own terms make over the windows of the fit, about their mean, °/h; null where nothing
    /// was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_dph: Option<f64>,
    /// Time without a value after which the correction is STALE, s.
    pub stale_after_s: f64,
    /// Largest step between two temperature periods that the target takes for a value at once, in its own unit; 0 for any step. The image
    /// widens it up to the way of 20 s at the largest rate, where its rate terms make no error of that.
    #[serde(default)]
    pub max_step: f64,
    /// How fast a value may move, its own unit per second: after samples were missing, one farther from the last is a step. After a step the
    /// status is SETTLING until the input steps back. 0: a step is not held open.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub max_rate_per_s: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A target, and a retest, may read an input as rarely, s: so far it may move at its largest rate where that does no harm.
pub(crate) const SAMPLED_S: f64 = 20.0;
/// Largest step of a thermometer of which nothing is known, °C.
const MAX_STEP_C: f64 = 5.0;

impl Input {
    /// A thermometer as set up, over the span and with the reference of a fit.
    pub(crate) fn thermometer(setup: ThermometerSetup, span: Span, reference: f64) -> Self {
        Self {
            name: label(&setup.name).to_owned(),
            source: InputSource::Thermometer(setup.name),
            reference,
            span: [span.lo, span.hi],
            lag_s: None,
            rate_span_per_min: None,
            offset: setup.offset_c.unwrap_or(0.0),
            gain_per_code: setup.gain_c_per_code.unwrap_or(CODE_C),
            valid_range: setup.valid_range_c,
            rms_dph: None,
            stale_after_s: setup.stale_after_s,
            max_step: setup.max_step_c.unwrap_or(MAX_STEP_C),
            max_rate_per_s: 0.0,
        }
    }

    /// The difference of two thermometers, stale when either is.
    pub(crate) fn difference(name: String, of: [ThermometerSetup; 2], span: Span, reference: f64) -> Self {
        let stale_after_s = of.iter().map(|setup| setup.stale_after_s).fold(0.0, f64::max);
        let [of, less] = of;
        Self {
            name,
            source: InputSource::Difference(of.name.clone(), less.name),
            valid_range: DIFFERENCE_RANGE_C,
            stale_after_s,
            max_step: 0.0,
            max_rate_per_s: 0.0,
            ..Self::thermometer(ThermometerSetup { offset_c: None, gain_c_per_code: None, ..of }, span, reference)
        }
    }

    /// An auxiliary column as set up.
    pub(crate) fn column(name: String, setup: AuxSetup, span: Span, reference: f64) -> Self {
        let span = [span.lo, span.hi];
        let valid_range = setup.valid_range.unwrap_or_else(|| plausible_about(span));
        let code = CODE_C * 2.0_f64.powi(unit_exponent(valid_range).into());
        Self {
            name,
            source: InputSource::Column(setup.name),
            reference,
            span,
            lag_s: None,
            rate_span_per_min: None,
            offset: setup.offset.unwrap_or(0.0),
            gain_per_code: setup.gain_per_code.unwrap_or(code),
            valid_range,
            rms_dph: None,
            stale_after_s: setup.stale_after_s,
            max_step: setup.max_step.unwrap_or(0.0),
            max_rate_per_s: 0.0,
        }
    }

    /// An input once more, behind a second lag.
    pub(crate) fn repeat(self, name: String) -> Self {
        Self { source: InputSource::Repeat(self.name), name, max_step: 0.0, max_rate_per_s: 0.0, ..self }
    }

    /// The name of the input that it repeats for a second lag.
    pub fn repeats(&self) -> Option<&str> {
        match &self.source {
            InputSource::Repeat(of) => Some(of),
            InputSource::Thermometer(_) | InputSource::Difference(..) | InputSource::Column(_) => None,
        }
    }

    /// The target reads it as a code; else it makes it from other inputs.
    pub fn has_code(&self) -> bool {
        matches!(self.source, InputSource::Thermometer(_) | InputSource::Column(_))
    }

    /// Its span as a scaling to −1 … 1.
    pub fn scaling(&self) -> Span {
        Span { lo: self.span[0], hi: self.span[1] }
    }

    /// A value of it for people: no finer than a ten-thousandth of its span.
    pub fn on_its_scale(&self, value: f64) -> String {
        on_scale(value, self.span[1] - self.span[0])
    }
}

/// What the codes of an image hold of a difference, °C.
const DIFFERENCE_RANGE_C: [f64; 2] = [-127.0, 127.0];
