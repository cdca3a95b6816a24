//! What a record says of inputs besides the thermometer of the fit, of the way to its model, and of what speaks against it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{Lag, Term};
use sagnac_units::format::{on_scale, significant};

/// Where the numbers of an input come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum InputSource {
    /// The log's thermometer of this name (empty for a plain `temperature_c`).
    Thermometer(String),
    /// The first thermometer less the second.
    Difference(String, String),
    /// The log's auxiliary column of this name.
    Column(String),
}

/// An input besides the thermometer of the fit: what its terms mean and how the target reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherInput {
    /// Its name in models and terms.
    pub name: String,
    /// Where its numbers come from.
    pub source: InputSource,
    /// Value at which its terms are zero, in its own unit (°C for thermometers and differences).
    pub reference: f64,
    /// Values of the fit. Outside, the correction is the one at the border.
    pub span: [f64; 2],
    /// Lag of its rate terms; null without any.
    pub lag_s: Option<Lag>,
    /// Rates of the fit, units per minute; null without rate terms.
    pub rate_span_per_min: Option<[f64; 2]>,
    /// Value at code 0.
    pub offset: f64,
    /// Units per code.
    pub gain_per_code: f64,
    /// Values outside are not believed.
    pub plausible: [f64; 2],
    /// Root mean square of what its own terms make over the windows of the fit, about their mean, °/h.
    #[serde(default)]
    pub rms_dph: f64,
    /// Time without a value after which the correction is STALE, s.
    pub hold_s: f64,
}

impl FurtherInput {
    /// A value of it for people: no finer than a ten-thousandth of its span.
    pub fn on_its_scale(&self, value: f64) -> String {
        on_scale(value, self.span[1] - self.span[0])
    }
}

/// What became of a model on the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathVerdict {
    /// Where the path begins: the best of the grid, or a small model.
    Start,
    /// Taken: better by what its coefficients must earn, or smaller and not bettered by that.
    Taken,
    /// A term more that does not earn its coefficients, or earns less than another.
    NoGain,
    /// A term less that is missed, or saves less than another.
    Missed,
    /// Refused: its terms are nearly combinations of each other.
    Collinear,
    /// A fold could not be fitted.
    NotFitted,
    /// Left: the noise of a thermometer through its rate terms would raise the angle random walk by over 5 %.
    TooNoisy,
    /// Kept with a longer lag, so that the noise of its thermometer stays within 5 %.
    LagRaised,
}

/// One model that the path looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathStep {
    /// Step of the path, from 0.
    pub step: usize,
    /// In the words of `--model`.
    pub model: String,
    /// Coefficients without constants, lags included.
    pub coefficients: usize,
    /// Root mean square of held-out residuals, °/h; null where it was not found.
    pub held_out_dph: Option<f64>,
    /// Condition of its terms; null where it was not found.
    pub condition: Option<f64>,
    /// Instructions of its slow update on a Cortex-M4F.
    pub slow_update_instructions: u32,
    /// What became of it.
    pub verdict: PathVerdict,
}

impl PathStep {
    /// The way for people, a row per step: its number, the model taken, held-out σ in °/h, condition, and out of how many.
    pub fn rows(steps: &[Self]) -> Vec<[String; 5]> {
        let kept = |step: &&Self| {
            use PathVerdict::{LagRaised, Start, Taken, TooNoisy};
            matches!(step.verdict, Start | Taken | LagRaised | TooNoisy)
        };
        let row = |step: &Self| {
            let beside = || steps.iter().filter(|other| other.step == step.step);
            let refused = beside().filter(|other| other.verdict == PathVerdict::Collinear).count();
            let words = match step.verdict {
                PathVerdict::Start => "start".to_owned(),
                PathVerdict::LagRaised => "lag raised for the thermometer's noise".to_owned(),
                PathVerdict::TooNoisy => "left: its thermometer is too noisy".to_owned(),
                _ if refused > 0 => format!("best of {} tried, {refused} refused as collinear", beside().count()),
                _ => format!("best of {} tried", beside().count()),
            };
            let number = |value: Option<f64>, digits| value.map_or("-".to_owned(), |v| significant(v, digits));
            [step.step.to_string(), step.model.clone(), number(step.held_out_dph, 4), number(step.condition, 3), words]
        };
        steps.iter().filter(kept).map(row).collect()
    }
}

/// A further input that `auto` did not look at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputAside {
    /// Its name.
    pub input: String,
    /// Why.
    pub why: String,
}

/// How near the terms are to being combinations of each other, levels taken out, columns at unit length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Collinearity {
    /// Largest over smallest singular value.
    pub condition: f64,
    /// Models beyond this are refused.
    pub limit: f64,
}

/// Noise that an input's terms add to the corrected angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputNoise {
    /// Name of the thermometer or column.
    pub input: String,
    /// σ of a sample, in its own unit, from second differences of its track.
    pub sigma: f64,
    /// Angle random walk through its value terms, °/√h.
    pub value_deg_rt_h: f64,
    /// Angle random walk through its rate terms at times shorter than their lag, °/√h.
    pub rate_deg_rt_h: f64,
}

/// Noise of the correction itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrectionNoise {
    /// Input by input.
    pub inputs: Vec<InputNoise>,
    /// Of all together, °/√h.
    pub deg_rt_h: f64,
    /// By what part the corrected angle random walk exceeds the raw one; null where that is not known.
    pub increase: Option<f64>,
    /// The same by the value terms alone, which no lag can make quieter.
    pub increase_by_value: Option<f64>,
    /// The part that is allowed.
    pub limit: f64,
}

impl Term {
    /// Its name: `bias 2`, `rate(cavity) 0`, `zone 35.2`.
    pub fn name(&self, main: bool) -> String {
        let word = self.kind.word();
        let of = if main { String::new() } else { format!("({})", self.sensor) };
        match self.at {
            Some(at) => format!("{word}{of} from {at:.4}"),
            None => format!("{word}{of} {}", self.order),
        }
    }
}
