//! Which model, on which windows, and what its thermometers' noise allows.
//!
//! `auto` takes the best of the grid over the thermometer of the fit, then goes the [`super::path`] over every other input,
//! zones and steps. Whatever was chosen, the noise of its thermometers may raise the angle random walk by 5 % at most
//! ([`super::input_noise`]): else the lag of the noisiest rate term is raised, or the term left out if that costs more on
//! held-out data than it is worth.

use crate::calibration::{Candidate, CorrectionNoise, CrossValidation, PathStep, PathVerdict};
use crate::error::{Error, Result};
use crate::fit::cost::Work;
use crate::fit::folds::{Trial, cross_validate, scheme_of};
use crate::fit::input::{Source, channels};
use crate::fit::input_noise::{INCREASE_MAX, correction_noise};
use crate::fit::model::ModelSpec;
use crate::fit::path::{CONDITION_MAX, inputs_read, walk};
use crate::fit::problem::{Level, Problem};
use crate::fit::robust::{Loss, robust_fit};
use crate::fit::solution::{Fitted, fit};
use crate::fit::{ModelChoice, SMALLER_WINS_WITHIN};
use crate::setup::Setup;
use crate::window::{WindowShape, Windows};

/// The grid's best.
struct Best {
    spec: ModelSpec,
    mean_square: Option<f64>,
    candidates: Vec<Candidate>,
}

/// A model on the windows it is to be fitted to, and how it was found.
pub(crate) struct Chosen<'a> {
    pub(crate) problem: Problem<'a>,
    pub(crate) spec: ModelSpec,
    pub(crate) taus_s: Vec<f64>,
    pub(crate) mean_square: Option<f64>,
    candidates: Vec<Candidate>,
    pub(crate) path: Vec<PathStep>,
}

/// Makes the problem of an axis on the windows in which some inputs are known.
pub(crate) type MakeProblem<'a, 'b> = dyn Fn(&[Source]) -> Result<Problem<'a>> + 'b;

/// Chooses a model.
///
/// # Errors
/// Inputs that the log does not have; no candidate that can be fitted.
pub(crate) fn choose<'a>(
    windows: &'a Windows,
    main: Source,
    setup: &Setup,
    choice: &ModelChoice,
    make: &MakeProblem<'a, '_>,
) -> Result<Chosen<'a>> {
    match choice {
        ModelChoice::Fixed(spec) => given(&windows.shape, main, spec, make),
        ModelChoice::Auto => {
            let grid = make(&[main])?;
            let taus_s = grid.tau_grid();
            let best = best_of_grid(&grid, &taus_s)?;
            let further = candidate_inputs(windows, main, setup, &grid.used)?;
            let with_all: Vec<Source> = std::iter::once(main).chain(further).collect();
            // Where too few windows know them all, the thermometer of the fit alone.
            let all = if with_all.len() > 1 { make(&with_all).unwrap_or(grid) } else { grid };
            let walked = walk(&all, &best.spec, &taus_s);
            let Some(path) = walked else {
                let Best { spec, mean_square, candidates } = best;
                return Ok(Chosen { problem: make(&[main])?, spec, taus_s, mean_square, candidates, path: Vec::new() });
            };
            let named = path.spec.further.iter().filter_map(|of| all.input(&of.input)).map(|at| all.inputs[at].source);
            let needed: Vec<Source> = std::iter::once(main).chain(named).collect();
            let (problem, mut spec) = (make(&needed)?, path.spec);
            count_steps(&problem, &mut spec)?;
            Ok(Chosen {
                problem,
                spec,
                taus_s,
                mean_square: Some(path.mean_square),
                candidates: best.candidates,
                path: path.steps,
            })
        }
    }
}

/// A model that was asked for.
fn given<'a>(shape: &WindowShape, main: Source, spec: &ModelSpec, make: &MakeProblem<'a, '_>) -> Result<Chosen<'a>> {
    let mut spec = spec.clone();
    let mut sources = vec![main];
    for of in &mut spec.further {
        let source = find_input(&of.input, main, shape).map_err(|e| e.column("--model"))?;
        of.input = source.name(shape);
        if sources.contains(&source) {
            return Err(Error::input("the same input under two names").column("--model").value(&of.input));
        }
        sources.push(source);
    }
    if channels(main, &sources[1..]).len() > sagnac_core::MAX_THERMOMETERS {
        let what = format!("an image reads {} thermometers, differences and columns", sagnac_core::MAX_THERMOMETERS);
        return Err(Error::refused(format!("`{spec}` needs more: {what}")).column("--model"));
    }
    let problem = make(&sources)?;
    count_steps(&problem, &mut spec)?;
    if spec.lags() > 0 && !problem.has_rate() {
        return Err(Error::refused("a rate term needs times, and the log has none").column("--model"));
    }
    let taus_s = problem.tau_grid();
    let mean_square = Trial::new(&problem, &spec, &taus_s).held_out();
    Ok(Chosen { problem, spec, taus_s, mean_square, candidates: Vec::new(), path: Vec::new() })
}

/// How many steps each stepped input has on these windows.
fn count_steps(problem: &Problem<'_>, spec: &mut ModelSpec) -> Result<()> {
    for of in spec.further.iter_mut().filter(|of| of.steps.is_some()) {
        let steps = problem.input(&of.input).map_or(0, |at| problem.inputs[at].thresholds().len());
        if steps == 0 {
            return Err(Error::refused(format!("`{}` does not step between 2 to 16 whole numbers", of.input))
                .column("--model")
                .help("give it a series instead: bias(...) 1"));
        }
        of.steps = u8::try_from(steps).ok();
    }
    Ok(())
}

fn find_input(name: &str, main: Source, shape: &WindowShape) -> Result<Source> {
    let found = Source::named(name, shape).ok_or_else(|| {
        let all: Vec<String> = Source::further(shape, usize::MAX).into_iter().map(|s| s.name(shape)).collect();
        Error::input("the log has no such input").value(name).help(format!("it has: {}", Error::choices(&all)))
    })?;
    if found == main {
        return Err(Error::input("is the thermometer of the fit; its terms stand without brackets").value(name));
    }
    if let Source::Difference { of, less } = found
        && of == less
    {
        return Err(Error::input("a thermometer less itself is nothing").value(name));
    }
    Ok(found)
}

/// Inputs besides the thermometer of the fit that `auto` may use: those named in the setup, else all that are known in
/// enough windows and move.
fn candidate_inputs(windows: &Windows, main: Source, setup: &Setup, used: &[usize]) -> Result<Vec<Source>> {
    let shape = &windows.shape;
    if let Some(names) = &setup.inputs {
        let found = names.iter().map(|name| find_input(name, main, shape).map_err(|e| e.column("inputs")));
        return found.collect();
    }
    let Source::Thermometer(at) = main else { return Ok(Vec::new()) };
    let all = Source::further(shape, at).into_iter();
    Ok(all.filter(|source| source.is_candidate(windows, used)).collect())
}

/// Tries every model over the thermometer of the fit.
fn best_of_grid(problem: &Problem<'_>, taus_s: &[f64]) -> Result<Best> {
    let affordable = |spec: &ModelSpec| problem.len() >= 3 * (problem.levels.len() + spec.coefficients());
    let with_scale = problem.place_of(Level::Scale).is_some();
    let specs: Vec<ModelSpec> =
        ModelSpec::candidates(problem.has_rate(), with_scale).into_iter().filter(affordable).collect();
    if specs.is_empty() {
        return Err(Error::refused(format!(
            "{} windows in {} runs are too few even for constants; a fit needs three windows for each coefficient",
            problem.len(),
            problem.runs.len()
        ))
        .help("give more data or a shorter --window"));
    }
    let mean_square = cross_validate(problem, &specs, taus_s);
    if mean_square.iter().all(Option::is_none) {
        return Err(Error::refused("no candidate can be fitted with a part of the data held out")
            .help("give more data over more temperatures, or a fixed --model"));
    }
    let least = mean_square.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    // Specs stand smallest first; within one size no rate term, then the lower mean square wins.
    let good = (0..specs.len()).filter(|i| mean_square[*i].is_some_and(|m| m <= SMALLER_WINS_WITHIN * least));
    let chosen = good
        .min_by(|a, b| {
            // Of equal size the one without a lag to be found wins: a slow lag can look like a curve.
            let key = |i: usize| (specs[i].coefficients(), specs[i].rate.is_some());
            let square = |i: usize| mean_square[i].unwrap_or(f64::INFINITY);
            key(*a).cmp(&key(*b)).then(square(*a).total_cmp(&square(*b)))
        })
        .unwrap_or(0);
    let candidates = specs.iter().zip(&mean_square).map(|(spec, square)| candidate(spec, *square, 1)).collect();
    Ok(Best { spec: specs[chosen].clone(), mean_square: mean_square[chosen], candidates })
}

fn candidate(spec: &ModelSpec, mean_square: Option<f64>, inputs: usize) -> Candidate {
    Candidate {
        model: spec.to_string(),
        coefficients: spec.coefficients(),
        held_out_dph: mean_square.map(f64::sqrt),
        slow_update_instructions: Some(Work::of_model(spec, inputs).instructions()),
        chosen: false,
    }
}

impl Chosen<'_> {
    /// Fits it, with as much lag as its thermometers' noise asks for; what that noise then does.
    ///
    /// # Errors
    /// Terms that cannot be told apart; for a model that was asked for, noise that no lag makes small enough.
    pub(crate) fn fit(
        &mut self,
        is_given: bool,
        n_deg_rt_h: Option<f64>,
        loss: Loss,
    ) -> Result<(Fitted, CorrectionNoise)> {
        loop {
            let fitted = match loss {
                Loss::Squares => fit(&self.problem, &self.spec, &self.taus_s)?,
                Loss::Huber => robust_fit(&mut self.problem, &self.spec, &self.taus_s)?,
            };
            self.check_condition(&fitted)?;
            let noise = correction_noise(&self.problem, &fitted, n_deg_rt_h);
            if noise.increase.is_none_or(|increase| increase <= INCREASE_MAX) {
                return Ok((fitted, noise));
            }
            self.quieten(&fitted, &noise, is_given)?;
        }
    }

    fn check_condition(&self, fitted: &Fitted) -> Result<()> {
        let Some(near) = fitted.nearness.as_ref().filter(|near| near.condition > CONDITION_MAX) else { return Ok(()) };
        let known = near.inflation.iter().enumerate().filter_map(|(at, inflation)| Some((at, (*inflation)?)));
        let worst = known.max_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(at, _)| at);
        let term = &fitted.terms[worst];
        let input = &self.problem.inputs[term.input].name;
        Err(Error::refused(format!(
            "the terms of `{}` cannot be told apart on these data: condition {:.0}, at most {CONDITION_MAX:.0}; the others \
             explain the {} term of order {} over {input} best",
            self.spec,
            near.condition,
            term.kind.word(),
            term.order
        ))
        .help("take fewer terms, or test so that the inputs move apart"))
    }

    /// Raises the lag of the noisiest rate term by a step of the grid, or leaves out the noisiest term.
    fn quieten(&mut self, fitted: &Fitted, noise: &CorrectionNoise, is_given: bool) -> Result<()> {
        let loudest = |of: fn(&crate::calibration::InputNoise) -> f64| {
            noise.inputs.iter().max_by(|a, b| of(a).total_cmp(&of(b))).map(|input| (of(input), input.input.clone()))
        };
        let (rate, rated) = loudest(|noise| noise.rate_deg_rt_h).unwrap_or_default();
        let (value, valued) = loudest(|noise| noise.value_deg_rt_h).unwrap_or_default();
        let by_rate = rate >= value;
        let input = self.problem.input(if by_rate { &rated } else { &valued }).unwrap_or(0);
        let without = less_of(&self.problem, &self.spec, input, by_rate);
        if by_rate {
            let now_s = fitted.lag(input).map_or(0.0, |(tau_s, _)| tau_s);
            let next = self.taus_s.partition_point(|tau_s| *tau_s <= now_s * 1.0001);
            if next < self.taus_s.len() {
                self.problem.tau_from[input] = next.max(self.problem.tau_from[input]);
                let raised = Trial::new(&self.problem, &self.spec, &self.taus_s).held_out();
                let alone = Trial::new(&self.problem, &without, &self.taus_s).held_out();
                let worth = |raised: f64| alone.is_none_or(|alone| raised * SMALLER_WINS_WITHIN < alone);
                if is_given || raised.is_some_and(worth) {
                    self.mean_square = raised;
                    self.note(PathVerdict::LagRaised, fitted);
                    return Ok(());
                }
            }
        }
        if is_given || without == self.spec {
            let part = noise.increase.unwrap_or(f64::NAN) * 100.0;
            let name = &self.problem.inputs[input].name;
            return Err(Error::refused(format!(
                "the noise of {name} through the terms of `{}` would raise the angle random walk by {part:.0} %, and {:.0} % are allowed",
                self.spec,
                INCREASE_MAX * 100.0
            ))
            .help("take a quieter thermometer or average its samples; or leave the terms out of --model"));
        }
        self.note(PathVerdict::TooNoisy, fitted);
        self.mean_square = Trial::new(&self.problem, &without, &self.taus_s).held_out();
        self.spec = without;
        self.note(PathVerdict::Taken, fitted);
        Ok(())
    }

    fn note(&mut self, verdict: PathVerdict, fitted: &Fitted) {
        let last = self.path.last();
        if last.is_some_and(|step| step.verdict == verdict && step.model == self.spec.to_string()) {
            self.path.pop();
        }
        self.path.push(PathStep {
            step: self.path.last().map_or(0, |step| step.step + 1),
            model: self.spec.to_string(),
            coefficients: self.spec.coefficients(),
            held_out_dph: self.mean_square.map(f64::sqrt),
            condition: fitted.nearness.as_ref().map(|near| near.condition),
            slow_update_instructions: Work::of_model(&self.spec, inputs_read(&self.problem, &self.spec)).instructions(),
            verdict,
        });
    }

    /// Everything that was tried: the grid, then what the path looked at.
    pub(crate) fn candidates(&self) -> Vec<Candidate> {
        let chosen = self.spec.to_string();
        let mut all = self.candidates.clone();
        for step in &self.path {
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
            all.push(candidate(&self.spec, self.mean_square, inputs_read(&self.problem, &self.spec)));
        }
        all.iter_mut().for_each(|row| row.chosen = row.model == chosen);
        all
    }

    pub(crate) fn cross_validation(&self) -> Option<CrossValidation> {
        let (scheme, folds) = scheme_of(&self.problem);
        Some(CrossValidation { scheme: scheme.to_owned(), folds, sigma_dph: self.mean_square?.sqrt() })
    }
}

/// A model without the rate terms of an input, or with one order less of its value terms.
fn less_of(problem: &Problem<'_>, spec: &ModelSpec, input: usize, rate: bool) -> ModelSpec {
    let mut spec = spec.clone();
    if input == 0 {
        if rate {
            spec.rate = None;
        } else if spec.zones > 1 {
            spec.zones = 0;
        } else {
            spec.bias = spec.bias.saturating_sub(1);
        }
        return spec;
    }
    let of = spec.of_input(&problem.inputs[input].name);
    if rate {
        of.rate = None;
    } else {
        of.bias = of.bias.saturating_sub(1);
    }
    spec.further.retain(|of| !of.is_empty());
    spec
}
