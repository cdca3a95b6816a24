//! One term of a correction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::input::{Input, InputSource};
use crate::model::{ActsOn, Form, TermShape};

/// One term of a correction: what it acts on × input × shape × rate, and its estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct CorrectionTerm {
    /// What it acts on.
    pub acts_on: ActsOn,
    /// Name of its input in `inputs`.
    pub input: String,
    /// The function of the input.
    pub shape: TermShape,
    /// It is multiplied with the lagged rate of the input, per minute.
    pub times_rate: bool,
    /// Coefficient.
    pub value: f64,
    /// Standard deviation; null where the coefficient was not fitted here.
    pub sigma: Option<f64>,
    /// Unit of both.
    pub unit: String,
    /// |value| exceeds its 95 % interval; null without sigma.
    pub significant: Option<bool>,
    /// Variance inflation factor: by how much the other terms multiply its variance (1: not at all).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vif: Option<f64>,
}

impl CorrectionTerm {
    /// A term that was not fitted here, over an input of the record that repeats no other.
    pub fn given(form: Form, input: &Input, value: f64) -> Self {
        let in_celsius = !matches!(input.source, InputSource::Column(_));
        let Form { acts_on, shape, times_rate } = form;
        Self {
            acts_on,
            input: input.name.clone(),
            shape,
            times_rate,
            value,
            sigma: None,
            unit: form.unit(in_celsius).to_owned(),
            significant: None,
            vif: None,
        }
    }

    /// Without its input and its estimate.
    pub fn form(&self) -> Form {
        Form { acts_on: self.acts_on, shape: self.shape, times_rate: self.times_rate }
    }
}
