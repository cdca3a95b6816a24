//! What to fit: the model, or `auto`, and what goes with it.

use crate::fit::problem::unit_prior::UnitPrior;
use crate::fit::progress::Progress;
use crate::model::ModelSpec;
use sagnac_log::error::{Error, Result};

/// Which model to fit.
#[derive(Clone, Debug, PartialEq)]
pub enum Model {
    /// The best in cross-validation.
    Auto,
    /// This one.
    Fixed(ModelSpec),
}

impl std::fmt::Display for Model {
    /// As [`std::str::FromStr`] reads it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Fixed(spec) => spec.fmt(f),
        }
    }
}

impl std::str::FromStr for Model {
    type Err = Error;

    /// `auto`, or the words of `--model`.
    fn from_str(text: &str) -> Result<Self> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Fixed) }
    }
}

/// What to fit.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FitOptions {
    /// Model.
    pub model: Model,
    /// SOURCE_DATE_EPOCH if it is set.
    pub source_date_epoch: Option<i64>,
    /// Whether a warm-up since power-on is a part of the correction, where the runs hold one; every run then begins at power-on.
    pub corrects_warm_up: bool,
    /// Whether the fixed bias at T0 is a part of the correction; every input rate is then known.
    pub removes_bias: bool,
    /// What is known of the unit before its test; its model takes the place of `model`.
    pub prior: Option<UnitPrior>,
    /// Told what the fit is doing.
    pub progress: Progress,
}

impl FitOptions {
    /// A model, by least squares.
    pub fn new(model: Model) -> Self {
        let progress = Progress::default();
        Self { model, source_date_epoch: None, corrects_warm_up: false, removes_bias: false, prior: None, progress }
    }

    /// With the time of SOURCE_DATE_EPOCH instead of that of the newest input sample.
    #[must_use]
    pub fn source_date_epoch(self, epoch_s: Option<i64>) -> Self {
        Self { source_date_epoch: epoch_s, ..self }
    }

    /// With a warm-up in the correction, where the runs hold one. Every run must begin at power-on.
    #[must_use]
    pub fn correct_warm_up(self, corrects_warm_up: bool) -> Self {
        Self { corrects_warm_up, ..self }
    }

    /// With the fixed bias at T0 in the correction. The input rate of every axis must be known.
    #[must_use]
    pub fn remove_bias(self, removes_bias: bool) -> Self {
        Self { removes_bias, ..self }
    }

    /// With what is known of the unit before its test.
    #[must_use]
    pub fn prior(self, prior: Option<UnitPrior>) -> Self {
        Self { prior, ..self }
    }

    /// With a listener to the progress of the fit.
    #[must_use]
    pub fn progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }
}

/// What a prior does not go with.
pub(crate) fn check_with_prior(options: &FitOptions) -> Result<()> {
    let what = match options {
        FitOptions { prior: None, .. } => return Ok(()),
        FitOptions { corrects_warm_up: true, .. } => "--warm-up",
        FitOptions { model: Model::Fixed(_), .. } => "--model",
        FitOptions { .. } => return Ok(()),
    };
    Err(Error::input(
        format!("{what} cannot be combined with a prior"),
        "remove one of the two: a prior has its own model",
    )
    .column("--prior"))
}
