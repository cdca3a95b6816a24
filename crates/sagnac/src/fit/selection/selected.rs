//! A selected model, how it was found, and its fit once an image holds it and its thermometers are quiet enough.
//!
//! Thermometer noise through the rate terms may raise the angle random walk by 5 % at most
//! ([`crate::fit::one_model::input_noise`]). Beyond that the lag of the noisiest rate term is raised, or the term removed if the longer lag
//! costs more held-out error than the term gains. Noise through the value terms is reported only: without them there is no
//! correction.
//!
//! The fit goes through the code that writes images ([`ImageCheck`]). Instead of a model that no image can hold `auto` takes a smaller
//! one, and the record names it; a given one is refused.

use crate::calibration::{
    Candidate, CorrectionNoise, CrossValidation, RejectedInput, RejectedModel, SearchStep, SearchVerdict,
};
use crate::fit::one_model::design::effective_windows;
use crate::fit::one_model::input_noise::{INCREASE_MAX, correction_noise, loudest_rate};
use crate::fit::one_model::solution::{Fitted, fit};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::selection::criterion::needed_gain;
use crate::fit::selection::folds::{Trial, scheme_of};
use crate::fit::selection::grid::{candidate, rejected};
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::prices::CONDITION_MAX;
use crate::fit::selection::search::{inputs_read, shrunk};
use crate::model::price::{with_warm_up, work_of};
use crate::model::spec::ModelSpec;
use sagnac_log::error::{Error, Result};

/// A model with the windows for its fit.
pub(crate) struct Selected<'a> {
    pub(crate) problem: LeastSquares<'a>,
    pub(crate) spec: ModelSpec,
    pub(crate) taus_s: Vec<f64>,
    /// It was asked for; else `auto` found it.
    pub(crate) was_given: bool,
    /// Models of the thermometer of the fit that the selection chose from; the given one alone where it was given.
    pub(crate) grid: Vec<ModelSpec>,
    pub(crate) image: ImageCheck<'a>,
    pub(crate) log: SelectionLog,
}

/// How a model was found.
#[derive(Default)]
pub(crate) struct SelectionLog {
    /// Held out, (°/h)².
    pub(crate) mean_square: Option<f64>,
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) aside: Vec<RejectedInput>,
    pub(crate) path: Vec<SearchStep>,
    /// What would have been selected if an image could hold it.
    pub(crate) not_held: Vec<RejectedModel>,
}

impl Selected<'_> {
    /// Fits it, with the lag that its thermometers' noise requires. Returns the fit and the noise of its correction.
    ///
    /// # Errors
    /// Terms that cannot be separated; for a requested model, noise that no lag reduces enough.
    pub(crate) fn settle(&mut self, n_deg_rt_h: Option<f64>) -> Result<(Fitted, CorrectionNoise)> {
        loop {
            let fitted = fit(&self.problem, &self.spec, &self.taus_s)?;
            self.check_condition(&fitted)?;
            if let Err(refusal) = self.image.check(&fitted, &self.problem) {
                self.shrink(refusal)?;
                continue;
            }
            if let Some(step) = self.log.path.last_mut().filter(|step| step.condition.is_none()) {
                step.condition = fitted.conditioning.as_ref().map(|near| near.condition);
            }
            let noise = correction_noise(&self.problem, &fitted, n_deg_rt_h);
            match self.too_loud(&fitted, &noise) {
                Some(input) => self.quieten(&fitted, &noise, input)?,
                None => return Ok((fitted, noise)),
            }
        }
    }

    /// The noise of a correction that is as it is.
    ///
    /// # Errors
    /// A correction that no image can hold, or that its thermometers' noise would spoil.
    pub(crate) fn check(&self, fitted: &Fitted, n_deg_rt_h: Option<f64>) -> Result<CorrectionNoise> {
        self.image.check(fitted, &self.problem)?;
        let noise = correction_noise(&self.problem, fitted, n_deg_rt_h);
        match self.too_loud(fitted, &noise) {
            Some(input) => Err(self.too_noisy(&noise, input)),
            None => Ok(noise),
        }
    }

    /// The input whose rate terms make most of a noise that is too large.
    fn too_loud(&self, fitted: &Fitted, noise: &CorrectionNoise) -> Option<usize> {
        noise.increase.filter(|increase| *increase > most_increase(noise))?;
        loudest_rate(&self.problem, fitted)
    }

    fn check_condition(&self, fitted: &Fitted) -> Result<()> {
        let Some(near) = fitted.conditioning.as_ref().filter(|near| near.condition > CONDITION_MAX) else {
            return Ok(());
        };
        let known = near.vif.iter().enumerate().filter_map(|(at, vif)| Some((at, (*vif)?)));
        let worst = known.max_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(at, _)| at);
        let term = &fitted.terms[worst];
        let input = self.problem.inputs[term.input].name.as_str();
        Err(Error::refused(
            format!(
                "the data do not separate the terms of `{}`: collinearity {:.0}, limit {CONDITION_MAX:.0}. The others \
             explain the term {} best",
                self.spec,
                near.condition,
                term.form.name((term.input > 0).then_some(input))
            ),
            "use fewer terms, or test so that the inputs move independently",
        ))
    }

    /// Takes the best model of one order less instead of one that no image can hold. The grid and the search have refused such
    /// models already; a raised lag or another loss may make one more.
    fn shrink(&mut self, refusal: Error) -> Result<()> {
        let smaller = if self.was_given { Vec::new() } else { shrunk(&self.spec) };
        let held_out = |spec: ModelSpec| {
            let square = Trial::new(&self.problem, &spec, &self.taus_s).held_out()?;
            Some((spec, square))
        };
        let best = smaller.into_iter().filter_map(held_out).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((spec, square)) = best else { return Err(refusal.of(&format!("`{}`", self.spec))) };
        self.log.not_held.push(rejected(&self.spec, &refusal));
        (self.spec, self.log.mean_square) = (spec, Some(square));
        self.note(SearchVerdict::Selected);
        Ok(())
    }

    /// Raises the lag of the noisiest rate term by a step of the grid, or leaves that term out.
    fn quieten(&mut self, fitted: &Fitted, noise: &CorrectionNoise, input: usize) -> Result<()> {
        let without = without_rate(&self.problem, &self.spec, input);
        let now_s = fitted.lag(input).map_or(0.0, |(tau_s, _)| tau_s);
        let next = self.taus_s.partition_point(|tau_s| *tau_s <= now_s * 1.0001);
        if next < self.taus_s.len() {
            self.problem = self.problem.with_tau_from(input, next);
            let raised = Trial::new(&self.problem, &self.spec, &self.taus_s).held_out();
            let alone = Trial::new(&self.problem, &without, &self.taus_s).held_out();
            let more = self.spec.coefficients().saturating_sub(without.coefficients());
            let needed = needed_gain(effective_windows(self.problem.len(), fitted.autocorrelation), more, 1);
            let worth = |raised: f64| alone.is_none_or(|alone| raised * needed < alone);
            if self.was_given || raised.is_some_and(worth) {
                self.log.mean_square = raised;
                self.note(SearchVerdict::LagRaised);
                return Ok(());
            }
        }
        if self.was_given {
            return Err(self.too_noisy(noise, input));
        }
        self.note(SearchVerdict::TooNoisy);
        self.log.mean_square = Trial::new(&self.problem, &without, &self.taus_s).held_out();
        self.spec = without;
        self.note(SearchVerdict::Selected);
        Ok(())
    }

    fn too_noisy(&self, noise: &CorrectionNoise, input: usize) -> Error {
        let part = noise.increase.unwrap_or(f64::NAN) * 100.0;
        let name = &self.problem.inputs[input].name;
        Error::refused(
            format!(
                "the noise of {name} through the rate terms of `{}` would raise the angle random walk by {part:.0} %, and {:.0} % are allowed",
                self.spec,
                INCREASE_MAX * 100.0
            ),
            "use a quieter thermometer, average its samples, or remove the rate terms from --model",
        )
    }

    /// One more row of the path; its condition comes with the next fit.
    fn note(&mut self, verdict: SearchVerdict) {
        let last = self.log.path.last();
        if last.is_some_and(|step| step.verdict == verdict && step.model == self.spec.to_string()) {
            self.log.path.pop();
        }
        self.log.path.push(SearchStep {
            step: self.log.path.last().map_or(0, |step| step.step + 1),
            model: self.spec.to_string(),
            coefficients: self.spec.coefficients(),
            held_out_dph: self.log.mean_square.map(f64::sqrt),
            condition: None,
            slow_update_instructions: work_of(&self.spec, inputs_read(&self.problem, &self.spec)).instructions(),
            verdict,
        });
    }

    /// Everything that was tried: the grid, then what the path looked at.
    pub(crate) fn candidates(&self) -> Vec<Candidate> {
        let chosen = self.spec.to_string();
        let mut all = self.log.candidates.clone();
        for step in &self.log.path {
            if all.iter().all(|other| other.model != step.model) {
                all.push(Candidate {
                    model: step.model.clone(),
                    coefficients: step.coefficients,
                    held_out_dph: step.held_out_dph,
                    slow_update_instructions: Some(step.slow_update_instructions),
                    chosen: false,
                });
            }
        }
        if all.iter().all(|other| other.model != chosen) {
            all.push(candidate(&self.spec, self.log.mean_square, inputs_read(&self.problem, &self.spec)));
        }
        for row in all.iter_mut().filter(|row| row.model == chosen) {
            row.chosen = true;
            row.held_out_dph = self.log.mean_square.map(f64::sqrt);
            if self.corrects_warm_up() {
                let work = with_warm_up(work_of(&self.spec, inputs_read(&self.problem, &self.spec)));
                row.slow_update_instructions = Some(work.instructions());
            }
        }
        all
    }

    fn corrects_warm_up(&self) -> bool {
        self.image.corrects_warm_up && self.problem.levels().iter().any(|level| level.warm_up_s().is_some())
    }

    pub(crate) fn cross_validation(&self) -> Option<CrossValidation> {
        let (scheme, folds) = scheme_of(&self.problem);
        Some(CrossValidation { scheme: scheme.to_owned(), folds, sigma_dph: self.log.mean_square?.sqrt() })
    }
}

/// By how much the noise of thermometers may raise the angle random walk. Where the value terms alone exceed the limit, it applies to
/// what the rate terms add.
fn most_increase(noise: &CorrectionNoise) -> f64 {
    let by_value = noise.increase_by_value.unwrap_or(0.0);
    if by_value > INCREASE_MAX { by_value + INCREASE_MAX } else { INCREASE_MAX }
}

/// A model without the rate terms of an input, or of its repeat.
fn without_rate(problem: &LeastSquares<'_>, spec: &ModelSpec, input: usize) -> ModelSpec {
    let mut spec = spec.clone();
    let repeats = problem.inputs[input].repeats;
    let source = repeats.unwrap_or(input);
    let name = if source == 0 { "" } else { problem.inputs[source].name.as_str() };
    spec.of_input(name).drop_rate(repeats.is_some());
    spec.drop_empty();
    spec
}
