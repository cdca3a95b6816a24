//! Selects the model and its windows, and limits the noise that thermometers add.
//!
//! `auto` selects the best of the grid over the thermometer of the fit, then runs the [`super::search`] over all other
//! inputs, zones and steps. Thermometer noise through the rate terms may raise the angle random walk by 5 % at most
//! ([`crate::fit::one_model::input_noise`]). Beyond that the lag of the noisiest rate term is raised, or the term removed if the longer lag
//! costs more held-out error than the term gains. Noise through the value terms is reported only: without them there is no
//! correction.
//!
//! Whatever is selected goes through the code that writes images ([`ImageCheck`]). `auto` passes over a model that no image can
//! hold, and the record names it; a given one is refused.

use crate::calibration::{
    Candidate, CorrectionNoise, CrossValidation, CurveSpread, LackOfFit, PriorUse, RejectedInput, RejectedModel,
    SearchStep, SearchVerdict,
};
use crate::fit::one_model::input_noise::{INCREASE_MAX, correction_noise, loudest_rate};
use crate::fit::one_model::solution::{Fitted, fit, noise_of, shows_more_than, white_variance, with_slow_noise};
use crate::fit::options::Model;
use crate::fit::prior::with_prior::{WithPrior, fit_with_prior};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::problem::unit_prior::UnitPrior;
use crate::fit::record::tradeoff::SMALLER_WINS_WITHIN;
use crate::fit::selection::allowed_inputs::{
    candidate_inputs, check_channels, check_codes, check_scale_rates, count_steps, sources_of,
};
use crate::fit::selection::folds::{Trial, scheme_of};
use crate::fit::selection::grades::grade;
use crate::fit::selection::grid::{Best, affordable, best_of_grid, candidate, rejected};
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::nuisance::justified;
use crate::fit::selection::period::settle_periods;
use crate::fit::selection::prices::CONDITION_MAX;
use crate::fit::selection::search::{fits_image, inputs_read, shrunk, walk};
use crate::fit::selection::warm_up::refine;
use crate::fit::uncertainty::curve_spread::{Rival, rivals_of, spread};
use crate::fit::uncertainty::rivals::{OfRows, beside_series, lack_of_fit};
use crate::model::input::Signal;
use crate::model::price::{with_warm_up, work_of};
use crate::model::spec::{InputTerms, ModelSpec};
use crate::noise_model::estimate::Estimate;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;
use crate::window::{WindowShape, Windows};
use sagnac_log::error::{Error, Result};

/// Fraction of the windows in which all inputs of `auto` must be known.
const KNOWN_TOGETHER: f64 = 0.9;
/// Of the lags of the grid, one of so many judges a model that was asked for.
const GIVEN_TAUS: usize = 4;

/// A model with the windows for its fit, and how it was found.
pub(crate) struct Chosen<'a> {
    pub(crate) problem: LeastSquares<'a>,
    pub(crate) spec: ModelSpec,
    pub(crate) taus_s: Vec<f64>,
    pub(crate) mean_square: Option<f64>,
    candidates: Vec<Candidate>,
    pub(crate) aside: Vec<RejectedInput>,
    pub(crate) path: Vec<SearchStep>,
    /// Models of the thermometer of the fit that the selection chose from; the given one alone where it was given.
    grid: Vec<ModelSpec>,
    /// Slow noise of the residual.
    pub(crate) noise: Estimate,
    image: ImageCheck<'a>,
    /// What would have been selected if an image could hold it.
    pub(crate) not_held: Vec<RejectedModel>,
    /// As the setup states it, or a fit with a prior found it, with the white variance of a nominal window, (°/h)².
    pub(crate) stated: Option<(SlowNoise, f64)>,
    /// The log shows more noise than the setup states.
    pub(crate) noise_exceeds_setup: bool,
}

/// Makes the problem of an axis on the windows in which some inputs are known.
pub(crate) type MakeProblem<'a, 'b> = dyn Fn(&[Signal]) -> Result<LeastSquares<'a>> + 'b;

/// Chooses a model.
///
/// # Errors
/// Inputs that the log does not have; no candidate that can be fitted.
pub(crate) fn choose<'a>(
    windows: &'a Windows,
    main: Signal,
    image: ImageCheck<'a>,
    choice: &Model,
    make: &MakeProblem<'a, '_>,
) -> Result<Chosen<'a>> {
    let mut chosen = selected(windows, main, image, choice, make)?;
    refine(&mut chosen.problem, &chosen.spec, &chosen.taus_s);
    Ok(chosen)
}

fn selected<'a>(
    windows: &'a Windows,
    main: Signal,
    image: ImageCheck<'a>,
    choice: &Model,
    make: &MakeProblem<'a, '_>,
) -> Result<Chosen<'a>> {
    match choice {
        Model::Fixed(spec) => given(&windows.shape, main, spec, image, make),
        Model::Auto => {
            let mut grid = make(&[main])?;
            let specs = affordable(&grid)?;
            let taus_s = grid.tau_grid();
            let nuisance = justified(&mut grid, &specs, &taus_s);
            let with_time = searched(windows, main, image, make, &nuisance, false)?;
            let corrected = image.corrects_warm_up && nuisance.iter().any(|level| level.warm_up_s().is_some());
            if nuisance.is_empty()
                || corrected
                || candidate_inputs(windows, main, image.config, &grid.used)?.0.is_empty()
            {
                return Ok(with_time);
            }
            // An input that follows what this fit puts down to time can be corrected, time cannot. No rate term may take the
            // place of either.
            let has_rate = with_time.spec.thermometer().rate.is_some();
            let without = searched(windows, main, image, make, &[], !has_rate)?;
            let follows = without.spec.inputs().len() > with_time.spec.inputs().len();
            Ok(if follows { without } else { with_time })
        }
    }
}

/// The model of a grid and a search, some nuisance columns beside its terms.
fn searched<'a>(
    windows: &'a Windows,
    main: Signal,
    image: ImageCheck<'a>,
    make: &MakeProblem<'a, '_>,
    nuisance: &[Level],
    without_main_rate: bool,
) -> Result<Chosen<'a>> {
    let make: &MakeProblem<'a, '_> = &|signals: &[Signal]| {
        let mut problem = make(signals)?;
        problem.levels.extend(nuisance);
        problem.without_main_rate = without_main_rate;
        Ok(problem)
    };
    let grid = make(&[main])?;
    let taus_s = grid.tau_grid();
    let best = best_of_grid(&grid, affordable(&grid)?, &taus_s, &image)?;
    let config = image.config;
    let (further, mut aside) = candidate_inputs(windows, main, config, &grid.used)?;
    let all = known_together(main, further, config.inputs.is_some(), grid, make, &mut aside)?;
    let walked = walk(&all, &best.spec, &taus_s, &image);
    let Best { spec, mean_square, candidates, specs, not_held } = best;
    let chosen = |problem, spec, mean_square, path| Chosen {
        problem,
        spec,
        taus_s: taus_s.clone(),
        mean_square,
        candidates,
        aside,
        path,
        grid: specs,
        noise: Estimate::default(),
        image,
        not_held,
        stated: None,
        noise_exceeds_setup: false,
    };
    let Some(path) = walked else {
        return Ok(chosen(make(&[main])?, spec, mean_square, Vec::new()));
    };
    let named = path.spec.inputs()[1..].iter().filter_map(|of| all.input(&of.input)).map(|at| all.inputs[at].signal);
    let needed: Vec<Signal> = std::iter::once(main).chain(named).collect();
    let (problem, mut spec) = (make(&needed)?, path.spec);
    count_steps(&problem, &mut spec)?;
    // On all windows of its fit, which may be more than those in which every candidate is known.
    let same = problem.used == all.used;
    let mean_square = if same { Some(path.mean_square) } else { Trial::new(&problem, &spec, &taus_s).held_out() };
    Ok(chosen(problem, spec, mean_square, path.steps))
}

/// The problem of all other inputs on the windows in which they are known. Inputs that the setup does not name are excluded,
/// least known first, until nine tenths of the windows remain.
fn known_together<'a>(
    main: Signal,
    mut further: Vec<Signal>,
    named: bool,
    grid: LeastSquares<'a>,
    make: &MakeProblem<'a, '_>,
    aside: &mut Vec<RejectedInput>,
) -> Result<LeastSquares<'a>> {
    loop {
        if further.is_empty() {
            return Ok(grid);
        }
        let with_all: Vec<Signal> = std::iter::once(main).chain(further.iter().copied()).collect();
        let made = make(&with_all);
        let enough = |problem: &LeastSquares<'_>| problem.len() as f64 >= KNOWN_TOGETHER * grid.len() as f64;
        match made {
            Ok(problem) if named || enough(&problem) => return Ok(problem),
            Err(error) if named => {
                return Err(error.column("inputs").help("the inputs that are named must be known in the same windows"));
            }
            _ => {
                let known = |source: &Signal| {
                    grid.used.iter().filter(|i| source.in_window(grid.windows(), **i).0.is_finite()).count()
                };
                let least = (0..further.len()).min_by_key(|at| known(&further[*at])).unwrap_or(0);
                let name = further.remove(least).name(&grid.windows().shape);
                aside.push(RejectedInput {
                    input: name,
                    reason: "not known in the same windows as the others".to_owned(),
                });
            }
        }
    }
}

/// A requested model.
fn given<'a>(
    shape: &WindowShape,
    main: Signal,
    spec: &ModelSpec,
    image: ImageCheck<'a>,
    make: &MakeProblem<'a, '_>,
) -> Result<Chosen<'a>> {
    let mut spec = spec.clone();
    let sources = sources_of(&mut spec, main, shape)?;
    check_channels(&spec, &sources, shape)?;
    let mut problem = make(&sources)?;
    check_codes(&problem)?;
    check_scale_rates(&problem, &spec)?;
    count_steps(&problem, &mut spec)?;
    if !fits_image(&problem, &spec) {
        let most = sagnac_core::MAX_TERMS;
        return Err(Error::refused(format!("`{spec}` has more terms than an image holds ({most})")).column("--model"));
    }
    if spec.lags() > 0 && !problem.has_rate() {
        return Err(Error::refused("a rate term needs times, and the log has none").column("--model"));
    }
    let taus_s = problem.tau_grid();
    if image.corrects_warm_up {
        let specs = affordable(&problem)?;
        let found = justified(&mut problem, &specs, &taus_s);
        problem.levels.extend(found);
    }
    settle_periods(&problem, &mut spec, &taus_s)?;
    // What is held out of a short test says nothing of a fit that the prior holds together.
    let held_out = || Trial::new(&problem, &spec, &taus_s).held_out();
    let mean_square = if problem.has_prior() { None } else { held_out() };
    Ok(Chosen {
        problem,
        grid: vec![spec.clone()],
        spec,
        taus_s,
        mean_square,
        candidates: Vec::new(),
        aside: Vec::new(),
        path: Vec::new(),
        noise: Estimate::default(),
        image,
        not_held: Vec::new(),
        stated: None,
        noise_exceeds_setup: false,
    })
}

impl Chosen<'_> {
    /// Fits it, with the lag that its thermometers' noise requires. Returns the fit and the noise of its correction.
    ///
    /// # Errors
    /// Terms that cannot be separated; for a requested model, noise that no lag reduces enough.
    pub(crate) fn fit(&mut self, is_given: bool, n_deg_rt_h: Option<f64>) -> Result<(Fitted, CorrectionNoise)> {
        loop {
            let mut fitted = fit(&self.problem, &self.spec, &self.taus_s)?;
            self.noise = self.noise_by(&fitted);
            if self.stated.is_some() || self.noise.best != SlowNoise::default() {
                let white = self.white_variance(&fitted, self.noise.mixed);
                fitted = with_slow_noise(&self.problem, fitted, self.noise.mixed, white);
            }
            self.check_condition(&fitted)?;
            if let Err(refusal) = self.image.check(&fitted, &self.problem) {
                self.shrink(refusal, is_given)?;
                continue;
            }
            if let Some(step) = self.path.last_mut().filter(|step| step.condition.is_none()) {
                step.condition = fitted.conditioning.as_ref().map(|near| near.condition);
            }
            let noise = correction_noise(&self.problem, &fitted, n_deg_rt_h);
            let loudest = loudest_rate(&self.problem, &fitted);
            match loudest {
                Some(input) if noise.increase.is_some_and(|increase| increase > most_increase(&noise)) => {
                    self.quieten(&fitted, &noise, input, is_given)?;
                }
                _ => return Ok((fitted, noise)),
            }
        }
    }

    /// Fits it with a prior. Returns the fit, the noise of its correction, and what was made of the prior.
    ///
    /// # Errors
    /// As [`fit_with_prior`]; a correction that no image can hold, or that its thermometers' noise would spoil.
    pub(crate) fn fit_with_prior(
        &mut self,
        prior: &UnitPrior,
        n_deg_rt_h: Option<f64>,
    ) -> Result<(Fitted, CorrectionNoise, PriorUse)> {
        let WithPrior { fitted, noise, white_variance, used } =
            fit_with_prior(&self.problem, &self.spec, prior, self.stated)?;
        (self.noise, self.stated) = (Estimate::known(noise), Some((noise, white_variance)));
        self.image.check(&fitted, &self.problem)?;
        let noise = correction_noise(&self.problem, &fitted, n_deg_rt_h);
        match loudest_rate(&self.problem, &fitted) {
            Some(input) if noise.increase.is_some_and(|increase| increase > most_increase(&noise)) => {
                Err(self.too_noisy(&noise, input))
            }
            _ => Ok((fitted, noise, used)),
        }
    }

    /// What the curve may be beside the fitted one, which gives value and variance at a temperature: what that adds to its uncertainty, and
    /// where the rows contradict its shape. Neither for models of more than series and zones over one thermometer.
    ///
    /// Beside a model that was asked for nothing counts unless the rows contradict it.
    pub(crate) fn beside_curve(
        &self,
        fitted: &Fitted,
        curve: impl Fn(f64) -> (f64, f64),
    ) -> (Option<CurveSpread>, Option<LackOfFit>) {
        let is_of_series = |of: &InputTerms| of.harmonics.is_empty() && of.slow_rate.is_none();
        if self.spec.inputs().len() > 1 || !is_of_series(self.spec.thermometer()) {
            return (None, None);
        }
        let is_given = self.grid.len() == 1;
        let of_all = if is_given { affordable(&self.problem).unwrap_or_default() } else { self.grid.clone() };
        let mut specs: Vec<ModelSpec> = of_all.into_iter().filter(|spec| spec.thermometer().zones < 2).collect();
        if self.spec.thermometer().zones < 2 && !specs.contains(&self.spec) {
            specs.push(self.spec.clone());
        }
        let whitening = Whitening::new(self.problem.noise_rows(), self.noise.best);
        // Any lag near the best shows that a rate term is missing.
        let taus_s: Vec<f64> = self.taus_s.iter().copied().step_by(if is_given { GIVEN_TAUS } else { 1 }).collect();
        let Some(grades) = grade(&self.problem, &whitening, &specs, &taus_s) else { return (None, None) };
        let of_rows = OfRows { whitening: &whitening, variance: grades.variance, taus: taus_s.len() };
        let series = rivals_of(grades, &self.problem, &specs);
        let shapes = beside_series(&self.problem, fitted, of_rows, &curve);
        // Of the series the selection has judged.
        let judged = if is_given { series.iter().chain(&shapes).collect() } else { shapes.iter().collect::<Vec<_>>() };
        let lack = lack_of_fit(&self.problem, fitted, of_rows, &judged, &curve);
        if is_given && lack.is_none() {
            return (None, None);
        }
        let rivals: Vec<Rival> = series.into_iter().chain(shapes).collect();
        (spread(&self.problem, &rivals, curve), lack)
    }

    /// White variance of a nominal window, (°/h)²: stated, else that of the fit beside this slow noise.
    pub(crate) fn white_variance(&self, fitted: &Fitted, noise: SlowNoise) -> f64 {
        self.stated.map_or_else(|| white_variance(&self.problem, fitted, noise), |(_, white)| white)
    }

    /// Noise of the residuals: as the setup states it, unless the log shows more.
    fn noise_by(&mut self, fitted: &Fitted) -> Estimate {
        let shown = noise_of(&self.problem, fitted);
        if let Some(stated) = self.stated {
            self.noise_exceeds_setup = shows_more_than(&self.problem, fitted, stated, shown.mixed);
            if !self.noise_exceeds_setup {
                return Estimate::known(stated.0);
            }
            self.stated = None;
        }
        shown
    }

    fn check_condition(&self, fitted: &Fitted) -> Result<()> {
        let Some(near) = fitted.conditioning.as_ref().filter(|near| near.condition > CONDITION_MAX) else {
            return Ok(());
        };
        let known = near.vif.iter().enumerate().filter_map(|(at, vif)| Some((at, (*vif)?)));
        let worst = known.max_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(at, _)| at);
        let term = &fitted.terms[worst];
        let input = self.problem.inputs[term.input].name.as_str();
        Err(Error::refused(format!(
            "the terms of `{}` are not separated by these data: condition {:.0}, at most {CONDITION_MAX:.0}; the others \
             explain the term {} best",
            self.spec,
            near.condition,
            term.form.name((term.input > 0).then_some(input))
        ))
        .help("take fewer terms, or test so that the inputs move apart"))
    }

    /// Takes the best model of one order less in place of one that no image can hold. The grid and the search have refused such
    /// models already; a raised lag may make one more.
    fn shrink(&mut self, refusal: Error, is_given: bool) -> Result<()> {
        let smaller = if is_given { Vec::new() } else { shrunk(&self.spec) };
        let held_out = |spec: ModelSpec| {
            let square = Trial::new(&self.problem, &spec, &self.taus_s).held_out()?;
            Some((spec, square))
        };
        let best = smaller.into_iter().filter_map(held_out).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((spec, square)) = best else { return Err(refusal.of(&format!("`{}`", self.spec))) };
        self.not_held.push(rejected(&self.spec, &refusal));
        (self.spec, self.mean_square) = (spec, Some(square));
        self.note(SearchVerdict::Selected);
        Ok(())
    }

    /// Raises the lag of the noisiest rate term by a step of the grid, or leaves that term out.
    fn quieten(&mut self, fitted: &Fitted, noise: &CorrectionNoise, input: usize, is_given: bool) -> Result<()> {
        let without = without_rate(&self.problem, &self.spec, input);
        let now_s = fitted.lag(input).map_or(0.0, |(tau_s, _)| tau_s);
        let next = self.taus_s.partition_point(|tau_s| *tau_s <= now_s * 1.0001);
        if next < self.taus_s.len() {
            self.problem.tau_from[input] = next.max(self.problem.tau_from[input]);
            let raised = Trial::new(&self.problem, &self.spec, &self.taus_s).held_out();
            let alone = Trial::new(&self.problem, &without, &self.taus_s).held_out();
            let worth = |raised: f64| alone.is_none_or(|alone| raised * SMALLER_WINS_WITHIN < alone);
            if is_given || raised.is_some_and(worth) {
                self.mean_square = raised;
                self.note(SearchVerdict::LagRaised);
                return Ok(());
            }
        }
        if is_given {
            return Err(self.too_noisy(noise, input));
        }
        self.note(SearchVerdict::TooNoisy);
        self.mean_square = Trial::new(&self.problem, &without, &self.taus_s).held_out();
        self.spec = without;
        self.note(SearchVerdict::Selected);
        Ok(())
    }

    fn too_noisy(&self, noise: &CorrectionNoise, input: usize) -> Error {
        let part = noise.increase.unwrap_or(f64::NAN) * 100.0;
        let name = &self.problem.inputs[input].name;
        Error::refused(format!(
            "the noise of {name} through the rate terms of `{}` would raise the angle random walk by {part:.0} %, and {:.0} % are allowed",
            self.spec,
            INCREASE_MAX * 100.0
        ))
        .help("take a quieter thermometer or average its samples; or leave the rate terms out of --model")
    }

    /// One more row of the path; its condition comes with the next fit.
    fn note(&mut self, verdict: SearchVerdict) {
        let last = self.path.last();
        if last.is_some_and(|step| step.verdict == verdict && step.model == self.spec.to_string()) {
            self.path.pop();
        }
        self.path.push(SearchStep {
            step: self.path.last().map_or(0, |step| step.step + 1),
            model: self.spec.to_string(),
            coefficients: self.spec.coefficients(),
            held_out_dph: self.mean_square.map(f64::sqrt),
            condition: None,
            slow_update_instructions: work_of(&self.spec, inputs_read(&self.problem, &self.spec)).instructions(),
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
        for row in all.iter_mut().filter(|row| row.model == chosen) {
            row.chosen = true;
            row.held_out_dph = self.mean_square.map(f64::sqrt);
            if self.corrects_warm_up() {
                let work = with_warm_up(work_of(&self.spec, inputs_read(&self.problem, &self.spec)));
                row.slow_update_instructions = Some(work.instructions());
            }
        }
        all
    }

    fn corrects_warm_up(&self) -> bool {
        self.image.corrects_warm_up && self.problem.levels.iter().any(|level| level.warm_up_s().is_some())
    }

    pub(crate) fn cross_validation(&self) -> Option<CrossValidation> {
        let (scheme, folds) = scheme_of(&self.problem);
        Some(CrossValidation { scheme: scheme.to_owned(), folds, sigma_dph: self.mean_square?.sqrt() })
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
    let of = repeats.unwrap_or(input);
    let name = if of == 0 { "" } else { problem.inputs[of].name.as_str() };
    spec.of_input(name).drop_rate(repeats.is_some());
    spec.drop_empty();
    spec
}
