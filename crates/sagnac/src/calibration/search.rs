//! How a model was found: the steps of the search, rejected inputs, conditioning, and the noise of the correction.

use sagnac_log::setup::RateUnit;
use sagnac_units::format::{counted, significant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The outcome of a model in the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SearchVerdict {
    /// Where the search begins: the best of the grid, or a small model.
    Start,
    /// Selected: its additional coefficients are justified, or it is smaller and no larger one is justified.
    Selected,
    /// One term more, not justified, or less so than another. Without a held-out residual where even its own residual could not fall enough.
    NoGain,
    /// One term less, and the fit needs it, or another saves more.
    Needed,
    /// Refused: its terms are nearly combinations of each other.
    Collinear,
    /// Refused: an image cannot hold its coefficients.
    NotInImage,
    /// A fold could not be fitted.
    NotFitted,
    /// Rejected: the noise of a thermometer through its rate terms would raise the angle random walk by over 5 %.
    TooNoisy,
    /// Selected with a longer lag, so that the noise of its thermometer stays within 5 %.
    LagRaised,
}

/// One model that the search tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct SearchStep {
    /// Step of the search, from 0.
    pub step: usize,
    /// In the words of `--model`.
    pub model: String,
    /// Coefficients without constants, lags included.
    pub coefficients: usize,
    /// Root mean square of held-out residuals, °/h; null where it was not found, or not looked for because the terms gain too little.
    pub held_out_dph: Option<f64>,
    /// Condition of its terms; null where it was not found.
    pub condition: Option<f64>,
    /// Instructions of its slow update on a Cortex-M4F.
    pub slow_update_instructions: u32,
    /// Its outcome.
    pub verdict: SearchVerdict,
}

impl SearchStep {
    /// The search for people, a row per step: its number, the model selected, held-out σ, condition, and out of how many.
    pub fn rows(steps: &[Self], units: RateUnit) -> Vec<[String; 5]> {
        let kept = |step: &&Self| {
            use SearchVerdict::{LagRaised, Selected, Start, TooNoisy};
            matches!(step.verdict, Start | Selected | LagRaised | TooNoisy)
        };
        let row = |step: &Self| {
            let beside = || steps.iter().filter(|other| other.step == step.step);
            let count = |verdict| beside().filter(|other| other.verdict == verdict).count();
            let part = |n: usize, why: &str| if n > 0 { format!(", {n} refused as {why}") } else { String::new() };
            let collinear = part(count(SearchVerdict::Collinear), "collinear");
            let large = part(count(SearchVerdict::NotInImage), "too large for an image");
            let words = match step.verdict {
                SearchVerdict::Start => "start".to_owned(),
                SearchVerdict::LagRaised => "lag raised for the thermometer's noise".to_owned(),
                SearchVerdict::TooNoisy => "rejected: its thermometer is too noisy".to_owned(),
                _ => format!("best of {} tried{collinear}{large}", beside().count()),
            };
            let number = |value: Option<f64>, digits| value.map_or("-".to_owned(), |v| significant(v, digits));
            [
                step.step.to_string(),
                step.model.clone(),
                number(step.held_out_dph.map(|dph| units.of_dph(dph)), 4),
                number(step.condition, 3),
                words,
            ]
        };
        steps.iter().filter(kept).map(row).collect()
    }
}

/// An input that the search did not try.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct RejectedInput {
    /// Its name.
    pub input: String,
    /// Why.
    pub reason: String,
}

/// A model that would have been selected, but no image can hold it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct RejectedModel {
    /// In the words of `--model`.
    pub model: String,
    /// Why: axis, term, limit, and what would hold it.
    pub reason: String,
}

/// Conditioning of the terms: run offsets projected out, columns at unit length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Collinearity {
    /// Largest over smallest singular value.
    pub condition: f64,
    /// Models beyond this are refused.
    pub limit: f64,
}

/// Noise that an input's terms add to the corrected angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
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
#[non_exhaustive]
pub struct CorrectionNoise {
    /// Input by input.
    pub inputs: Vec<InputNoise>,
    /// Of all together, °/√h.
    pub deg_rt_h: f64,
    /// Fraction by which the corrected angle random walk exceeds the raw one; null where that is not known.
    pub increase: Option<f64>,
    /// The same by the value terms alone, which no lag reduces.
    pub increase_by_value: Option<f64>,
    /// The fraction that is allowed.
    pub limit: f64,
}

/// The prior of a fleet in a fit, and how far the unit's test is from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct PriorUse {
    /// SHA-256 of the prior's file, hex.
    pub sha256: String,
    /// The lot whose prior it is; null for the whole fleet's.
    pub lot: Option<String>,
    /// Axes behind it.
    pub axes: u64,
    /// Mahalanobis distance of the test from what the fleet expects of it.
    pub distance: f64,
    /// Its bound: one unit of the fleet in a hundred is farther.
    pub distance_max: f64,
    /// Directions in which units differ by more than the test's noise: those that the distance is of.
    pub directions: usize,
    /// Distance in the other directions, in which units are alike within the test's noise; 0 where there are none.
    pub misfit: f64,
    /// Its bound: one test in two hundred has more by its noise alone.
    pub misfit_max: f64,
    /// Error of the drift at rest about its mean over the span, °/h, with which a unit whose coefficients are not like its fleet's passes both
    /// bounds in one of ten tests, in the worst single direction; null where the test does not show a direction at all.
    pub unnoticed_dph: Option<f64>,
    /// The same of the drift with the temperature rate, °/h per °C/min.
    pub unnoticed_dph_per_cpm: Option<f64>,
    /// Residual of a window with what its autocorrelation adds, σ·√((1 + ρ)/(1 − ρ)), °/h.
    pub residual_dph: Option<f64>,
    /// Its bound: one unit in two hundred like the fleet has more; null where the fleet's windows are of another length.
    pub residual_max_dph: Option<f64>,
    /// Parameters of the prior.
    pub parameters: usize,
    /// How many of them the test determines: the sum over all directions of the part that is the test's.
    pub determined: f64,
}

impl PriorUse {
    /// What it is and how far the test is from it, for people.
    pub fn words(&self, units: RateUnit) -> String {
        let lot = self.lot.as_ref().map_or(String::new(), |lot| format!(" of lot {lot}"));
        format!(
            "prior of {} axes{lot}: the test determines {} of {} parameters, the fleet the others; Mahalanobis distance {} in {}, \
             at most {}; misfit in the others {}, at most {}; a unit with other coefficients may pass with an error of {}",
            self.axes,
            significant(self.determined, 2),
            self.parameters,
            significant(self.distance, 2),
            counted(self.directions, "direction", "directions"),
            significant(self.distance_max, 2),
            significant(self.misfit, 2),
            significant(self.misfit_max, 2),
            self.unnoticed_dph.map_or("any size".to_owned(), |dph| format!("up to {}", units.text(dph, 2)))
        )
    }
}
