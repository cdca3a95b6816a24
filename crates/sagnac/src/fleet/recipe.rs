//! What is done with each unit, in a form that another machine can be sent.
//!
//! A recipe is all that a result depends on next to the unit's own logs: so a unit's record has the same bytes wherever it is made. What a
//! run may take of memory is a fact of the machine and not part of it.

use serde::{Deserialize, Serialize};

use super::{PriorFile, Unit};
use crate::calibration::program;
use crate::fit::{FitOptions, Model};
use crate::verify::{Limits, LimitsSource};
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::Setup;

/// What is done with each unit.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Recipe {
    /// What the logs cannot say, for units without a setup of their own.
    pub setup: Setup,
    /// The model of all, or the search for one; that of the prior where there is one.
    pub model: Model,
    /// Takes the place of the newest sample's time in records, s.
    pub source_date_epoch: Option<i64>,
    /// What is known of the units before their tests.
    pub prior: Option<PriorFile>,
    /// The limits of a retest.
    pub limits: Option<Limits>,
}

/// A recipe as it is sent.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sent {
    program: String,
    setup: Setup,
    model: String,
    source_date_epoch: Option<i64>,
    /// The prior, and the hash of its file.
    prior: Option<(String, String)>,
    limits: Option<(Limits, LimitsSource)>,
}

impl Recipe {
    /// A setup and a model.
    pub fn new(setup: Setup, model: Model) -> Self {
        Self { setup, model, source_date_epoch: None, prior: None, limits: None }
    }

    /// With the time of SOURCE_DATE_EPOCH instead of that of the newest input sample.
    #[must_use]
    pub fn source_date_epoch(self, source_date_epoch: Option<i64>) -> Self {
        Self { source_date_epoch, ..self }
    }

    /// With what is known of the units before their tests.
    #[must_use]
    pub fn prior(self, prior: Option<PriorFile>) -> Self {
        Self { prior, ..self }
    }

    /// With limits for the retests.
    #[must_use]
    pub fn limits(self, limits: Option<Limits>) -> Self {
        Self { limits, ..self }
    }

    /// As text, for another machine.
    ///
    /// # Errors
    /// A number that JSON does not have.
    pub fn to_json(&self) -> Result<String> {
        let Self { setup, model, source_date_epoch, prior, limits } = self.clone();
        let prior = prior.map(|file| file.prior.to_json().map(|text| (text, file.sha256))).transpose()?;
        let limits = limits.map(|limits| (limits.clone(), limits.source));
        let sent = Sent { program: program(), setup, model: model.to_string(), source_date_epoch, prior, limits };
        serde_json::to_string(&sent).map_err(|e| Error::defect(format!("cannot write the recipe: {e}")))
    }

    /// From text.
    ///
    /// # Errors
    /// What is no recipe, or one of another version of this program: records of two versions do not belong into one fleet.
    pub fn from_json(text: &str) -> Result<Self> {
        let broken = |e: &dyn std::fmt::Display| {
            Error::input(format!("not a recipe of a fleet: {e}"), "run the same version of the program everywhere")
        };
        let recipe: serde_json::Value = serde_json::from_str(text).map_err(|e| broken(&e))?;
        let theirs = recipe.get("program").and_then(serde_json::Value::as_str).unwrap_or_default();
        if theirs != program() {
            return Err(Error::input(
                format!("the scheduler runs {theirs}, and this executor runs {}", program()),
                "run the same version on all machines",
            ));
        }
        let Sent { setup, model, source_date_epoch, prior, limits, program: _ } =
            serde_json::from_value(recipe).map_err(|e| broken(&e))?;
        // What was sent may be anything.
        setup.check()?;
        limits.iter().try_for_each(|(limits, _)| limits.check())?;
        let of_file =
            |(text, sha256): (String, String)| super::Prior::from_json(&text).map(|prior| PriorFile { prior, sha256 });
        Ok(Self {
            setup,
            model: model.parse()?,
            source_date_epoch,
            prior: prior.map(of_file).transpose()?,
            limits: limits.map(|(limits, source)| Limits { source, ..limits }),
        })
    }

    /// How a unit is fitted: with what is known of its lot, where there is a prior.
    ///
    /// # Errors
    /// A lot that the prior does not know.
    pub(super) fn options_of(&self, unit: &Unit) -> Result<FitOptions> {
        let lot = Some(unit.lot.as_str()).filter(|lot| !lot.is_empty());
        let prior = self.prior.as_ref().map(|prior| prior.of_unit(lot)).transpose()?;
        let model = if prior.is_some() { Model::Auto } else { self.model.clone() };
        Ok(FitOptions::new(model).source_date_epoch(self.source_date_epoch).prior(prior))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is sent is what arrives; of another version it is refused.
    #[test]
    fn a_recipe_survives_its_way() {
        let setup = Setup { arcsec_per_count: Some(1.059), sample_interval_s: Some(0.1), ..Setup::default() };
        let limits = Limits::named_or_read("navigation-grade").unwrap();
        for model in ["auto", "bias 3, rate 1, slow rate 0", "bias 2, harmonic(path_length_v) 25.3000000001"] {
            let recipe = Recipe::new(setup.clone(), model.parse().unwrap());
            let recipe = recipe.limits(Some(limits.clone())).source_date_epoch(Some(7));
            let text = recipe.to_json().unwrap();
            let again = Recipe::from_json(&text).unwrap();
            assert_eq!((&again.setup, &again.model, &again.limits), (&setup, &recipe.model, &recipe.limits));
            assert_eq!(
                (again.limits.as_ref().unwrap().source.clone(), again.source_date_epoch),
                (limits.source.clone(), Some(7))
            );
            let other = text.replace(&program(), "sagnac 0.0.1");
            assert!(Recipe::from_json(&other).unwrap_err().what.contains("the scheduler runs sagnac 0.0.1"));
        }
        for text in ["", "{}", "[1]", "{\"program\":7}"] {
            assert!(Recipe::from_json(text).is_err(), "{text}");
        }
    }
}
