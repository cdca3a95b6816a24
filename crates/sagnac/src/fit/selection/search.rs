//! Stepwise search from the grid's model: forward while a term improves the held-out error, then backward while a term can
//! be removed. "Improves" means by the factor of [`super::criterion`]; the reference is the least held-out error so far.
//!
//! ```text
//! forward:   candidates have one order (input, zone, set of steps, second lag) more; those must improve on the reference (m: candidates
//!            of this step), and the residual of their fit on that of the last model by as much: held-out errors of one record
//!            scatter more than residuals. Selected: the smallest that no other of them improves on.
//! backward:  candidates have one order less; the reference must not improve on them. Selected: the smallest.
//! ```
//!
//! With several inputs there are three searches: from the grid's best, from `bias 2` and from `bias 2, rate 0`. Of their
//! results that no other improves on, the one with the fewest inputs is selected, then the smallest.
//!
//! A candidate whose terms are nearly combinations of each other (condition over [`CONDITION_MAX`], levels projected out,
//! columns at unit length) is rejected: noise would determine its coefficients. Among candidates of equal size the one
//! with the least condition is selected. A candidate that no image can hold is rejected too: its fitted coefficients go through
//! the code that writes images.

use crate::calibration::{SearchStep, SearchVerdict};
use crate::fit::one_model::design::effective_windows;
use crate::fit::one_model::solution::fit;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::selection::criterion::{CvScore, is_undominated, needed_gain};
use crate::fit::selection::folds::Trial;
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::prices::{CONDITION_MAX, MOST_RATE, ZONES};
use crate::model::input::channels;
use crate::model::price::work_of;
use crate::model::spec::{InputTerms, MAX_RATE_ORDER, ModelSpec};
use rayon::prelude::*;

/// Highest orders that are tried over inputs other than the thermometer of the fit.
const MOST_BIAS: u8 = 3;
const MOST_SCALE: u8 = 2;
/// Limit on the steps of each direction.
const MOST_STEPS: usize = 24;

/// Result of a search, and its steps.
pub(crate) struct Path {
    pub(crate) spec: ModelSpec,
    pub(crate) mean_square: f64,
    windows: f64,
    pub(crate) steps: Vec<SearchStep>,
}

impl Path {
    fn held(&self) -> CvScore {
        CvScore { coefficients: self.spec.coefficients(), mean_square: self.mean_square }
    }
}

/// A model that was tried.
struct Tried {
    spec: ModelSpec,
    /// Effective number of windows, after the correlation of their residuals.
    windows: f64,
    /// Inputs that its image reads.
    inputs: usize,
    mean_square: Option<f64>,
    /// Sum of squares of the residuals of the fit.
    misfit: f64,
    condition: Option<f64>,
    /// An image can hold it.
    held: bool,
}

impl Tried {
    fn square(&self) -> f64 {
        self.mean_square.unwrap_or(f64::INFINITY)
    }

    fn held(&self) -> CvScore {
        CvScore { coefficients: self.spec.coefficients(), mean_square: self.square() }
    }

    fn step(&self, number: usize, verdict: SearchVerdict) -> SearchStep {
        SearchStep {
            step: number,
            model: self.spec.to_string(),
            coefficients: self.spec.coefficients(),
            held_out_dph: self.mean_square.map(f64::sqrt),
            condition: self.condition,
            slow_update_instructions: work_of(&self.spec, self.inputs).instructions(),
            verdict,
        }
    }
}

/// Searches from a model and, with several inputs, also from two small ones: the grid knows one input only, and its best
/// may be far from the best model of all inputs. `None` where nothing can be fitted out of sample.
pub(crate) fn walk(
    problem: &LeastSquares<'_>,
    start: &ModelSpec,
    taus_s: &[f64],
    image: &ImageCheck<'_>,
) -> Option<Path> {
    let mut starts = vec![start.clone()];
    if !problem.others().is_empty() {
        let rates = if problem.tries_main_rate() { vec![None, Some(0)] } else { vec![None] };
        let scale = start.thermometer().scale;
        let small = |rate| InputTerms { bias: 2, rate, scale, ..InputTerms::default() };
        starts.extend(rates.into_iter().map(|rate| ModelSpec::of_thermometer(small(rate))));
        starts.dedup();
    }
    let ends: Vec<Path> = starts.iter().filter_map(|start| walk_from(problem, start, taus_s, image)).collect();
    let held: Vec<CvScore> = ends.iter().map(Path::held).collect();
    let good = ends.into_iter().filter(|end| is_undominated(end.held(), &held, end.windows));
    // Each input costs a sensor line: fewer inputs come before fewer coefficients.
    good.min_by_key(|end| (inputs_read(problem, &end.spec), end.spec.coefficients()))
}

fn walk_from(problem: &LeastSquares<'_>, start: &ModelSpec, taus_s: &[f64], image: &ImageCheck<'_>) -> Option<Path> {
    let mut here =
        try_all(problem, std::slice::from_ref(start), taus_s, image, 0).pop().filter(|t| t.mean_square.is_some())?;
    let mut steps = vec![here.step(0, SearchVerdict::Start)];
    let mut least = here.held();
    let mut number = 0;
    for forward in [true, false] {
        // Of one thermometer with one lag the grid has looked at every smaller model.
        if !forward && problem.others().is_empty() && here.spec.repeats() == 0 {
            break;
        }
        for _ in 0..MOST_STEPS {
            let next = if forward { grown(problem, &here.spec) } else { shrunk(&here.spec) };
            let needed = |spec: &ModelSpec| {
                let more = spec.coefficients().saturating_sub(here.spec.coefficients());
                needed_gain(here.windows, more, next.len().max(ZONES.len()))
            };
            let tried = try_all(problem, &next, taus_s, image, number + 1);
            let passes = |model: &Tried| {
                if !forward {
                    return is_undominated(model.held(), &[least], here.windows);
                }
                let needed = needed(&model.spec);
                model.square() * needed < least.mean_square && model.misfit * needed < here.misfit
            };
            let taken = best_of(&tried, here.windows, passes);
            number += 1;
            steps.extend(tried.iter().enumerate().map(|(at, model)| {
                let verdict = match (Some(at) == taken, model.mean_square.is_some(), collinear(model)) {
                    (true, ..) => SearchVerdict::Selected,
                    (_, _, true) => SearchVerdict::Collinear,
                    _ if !model.held => SearchVerdict::NotInImage,
                    (_, false, _) => SearchVerdict::NotFitted,
                    _ if forward => SearchVerdict::NoGain,
                    _ => SearchVerdict::Needed,
                };
                model.step(number, verdict)
            }));
            let Some(at) = taken else {
                number -= 1;
                break;
            };
            here = tried.into_iter().nth(at)?;
            if here.square() < least.mean_square {
                least = here.held();
            }
        }
    }
    Some(Path { mean_square: here.square(), windows: here.windows, spec: here.spec, steps })
}

fn collinear(model: &Tried) -> bool {
    model.condition.is_some_and(|condition| condition > CONDITION_MAX)
}

/// Of those that pass the smallest that none of them betters by what it must; of those of one size the least condition.
fn best_of(tried: &[Tried], windows: f64, passes: impl Fn(&Tried) -> bool) -> Option<usize> {
    let is_fair = |model: &Tried| !collinear(model) && model.mean_square.is_some() && passes(model);
    let fair: Vec<usize> = (0..tried.len()).filter(|at| is_fair(&tried[*at])).collect();
    let held: Vec<CvScore> = fair.iter().map(|at| tried[*at].held()).collect();
    let condition = |at: usize| tried[at].condition.unwrap_or(1.0);
    fair.iter().copied().filter(|at| is_undominated(tried[*at].held(), &held, windows)).min_by(|a, b| {
        let size = |at: usize| tried[at].spec.coefficients();
        size(*a).cmp(&size(*b)).then(condition(*a).total_cmp(&condition(*b)))
    })
}

fn try_all(
    problem: &LeastSquares<'_>,
    specs: &[ModelSpec],
    taus_s: &[f64],
    image: &ImageCheck<'_>,
    step: usize,
) -> Vec<Tried> {
    let part = problem.progress.part(format_args!("model search, step {step}"), specs.len());
    let tried = |spec: &ModelSpec| {
        let tried = try_one(problem, spec, taus_s, image);
        part.one_more();
        tried
    };
    specs.par_iter().map(tried).collect()
}

fn try_one(problem: &LeastSquares<'_>, spec: &ModelSpec, taus_s: &[f64], image: &ImageCheck<'_>) -> Tried {
    // A model that is refused for its terms needs no folds.
    let fitted = fit(problem, spec, taus_s).ok();
    let condition = fitted.as_ref().and_then(|f| f.conditioning.as_ref()).map(|near| near.condition);
    let held = fitted.as_ref().is_none_or(|fitted| image.check(fitted, problem).is_ok());
    let fair = fitted.is_some() && held && condition.is_none_or(|condition| condition <= CONDITION_MAX);
    let mean_square = if fair { Trial::new(problem, spec, taus_s).held_out() } else { None };
    let rho = fitted.as_ref().map_or(0.0, |f| f.autocorrelation);
    let windows = effective_windows(problem.len(), rho);
    let misfit = fitted.as_ref().map_or(f64::INFINITY, |fitted| fitted.misfit(problem));
    let inputs = inputs_read(problem, spec);
    Tried { spec: spec.clone(), windows, inputs, mean_square, misfit, condition, held }
}

/// An image can read all inputs of a model and hold all its terms.
pub(crate) fn fits_image(problem: &LeastSquares<'_>, spec: &ModelSpec) -> bool {
    let inputs = inputs_read(problem, spec);
    inputs <= sagnac_core::MAX_INPUTS && work_of(spec, inputs).terms as usize <= sagnac_core::MAX_TERMS
}

/// Thermometers, differences, columns and repeats for second lags that an image of a model describes.
pub(crate) fn inputs_read(problem: &LeastSquares<'_>, spec: &ModelSpec) -> usize {
    let named: Vec<_> = spec.inputs()[1..]
        .iter()
        .filter_map(|terms| problem.input(&terms.input))
        .map(|at| problem.inputs[at].signal)
        .collect();
    channels(problem.inputs[0].signal, &named).len() + spec.repeats()
}

/// Orders of the rates of an input with a second lag, or with one order more of it. A second lag may be found only with a slope over
/// the input, or only together with the first: one lag between the two may be no better than none.
fn slower(problem: &LeastSquares<'_>, terms: &InputTerms) -> Vec<(Option<u8>, Option<u8>)> {
    match (terms.rate, terms.slow_rate) {
        _ if !problem.has_rate() => Vec::new(),
        (None, _) => vec![(Some(0), Some(0))],
        (rate, None) => (0..=MOST_RATE).map(|slow| (rate, Some(slow))).collect(),
        (rate, Some(slow)) => (slow + 1..=MOST_RATE).take(1).map(|slow| (rate, Some(slow))).collect(),
    }
}

/// Every model with one order, zone table, set of steps or lag more.
pub(crate) fn grown(problem: &LeastSquares<'_>, from: &ModelSpec) -> Vec<ModelSpec> {
    let with_scale = problem.column_of(Level::Scale).is_some();
    let mut all = Vec::new();
    let mut add = |change: &dyn Fn(&mut ModelSpec)| {
        let mut spec = from.clone();
        change(&mut spec);
        all.push(spec);
    };
    let main = from.thermometer();
    // Of one thermometer alone the grid has looked at every series.
    let open = problem.inputs.len() > 1 || main.zones > 1;
    if open && main.bias < sagnac_core::MAX_ORDER {
        add(&|spec| spec.thermometer_mut().bias += 1);
    }
    if open && problem.tries_main_rate() && main.rate.is_none_or(|rate| rate < MAX_RATE_ORDER) {
        add(&|spec| spec.thermometer_mut().rate = Some(main.rate.map_or(0, |rate| rate + 1)));
    }
    if let Some(zones) = ZONES.into_iter().find(|zones| *zones > main.zones).filter(|_| main.bias > 0) {
        add(&|spec| spec.thermometer_mut().zones = zones);
    }
    for rates in slower(problem, main).into_iter().filter(|_| problem.tries_main_rate()) {
        add(&|spec| (spec.thermometer_mut().rate, spec.thermometer_mut().slow_rate) = rates);
    }
    for input in problem.others() {
        let name = input.name.as_str();
        let now = from.inputs()[1..].iter().find(|terms| terms.input == name);
        let (bias, scale) = now.map_or((0, 0), |terms| (terms.bias, terms.scale));
        let rate = now.and_then(|terms| terms.rate);
        if bias < MOST_BIAS {
            add(&|spec| spec.of_input(name).bias += 1);
        }
        if problem.has_rate() && rate.is_none_or(|rate| rate < MOST_RATE) {
            add(&|spec| spec.of_input(name).rate = Some(rate.map_or(0, |rate| rate + 1)));
        }
        for rates in slower(problem, now.unwrap_or(&InputTerms::default())) {
            add(&|spec| (spec.of_input(name).rate, spec.of_input(name).slow_rate) = rates);
        }
        if with_scale && scale < MOST_SCALE {
            add(&|spec| spec.of_input(name).scale += 1);
        }
        let steps = input.thresholds().len();
        if steps > 0 && now.is_none_or(|terms| terms.steps.is_none()) {
            add(&|spec| spec.of_input(name).steps = u8::try_from(steps).ok());
        }
    }
    let affordable = |spec: &ModelSpec| problem.len() >= 3 * (problem.levels().len() + spec.coefficients());
    all.retain(|spec| affordable(spec) && fits_image(problem, spec));
    all
}

/// Every model with one order, zone table or set of steps less.
pub(crate) fn shrunk(from: &ModelSpec) -> Vec<ModelSpec> {
    let mut all = Vec::new();
    let mut add = |change: &dyn Fn(&mut ModelSpec)| {
        let mut spec = from.clone();
        change(&mut spec);
        spec.drop_empty();
        all.push(spec);
    };
    let less = |rate: Option<u8>| rate.and_then(|rate| rate.checked_sub(1));
    for (at, of) in from.inputs().iter().enumerate() {
        if of.bias > 0 {
            add(&|spec| spec.inputs_mut()[at].bias -= 1);
        }
        if of.rate.is_some_and(|rate| rate > 0) || of.slow_rate.is_none() && of.rate.is_some() {
            add(&|spec| spec.inputs_mut()[at].rate = less(of.rate));
        }
        if of.slow_rate.is_some() {
            add(&|spec| spec.inputs_mut()[at].slow_rate = less(of.slow_rate));
        }
        if of.scale > 0 {
            add(&|spec| spec.inputs_mut()[at].scale -= 1);
        }
        if of.zones > 1 {
            let fewer = ZONES.into_iter().rfind(|zones| *zones < of.zones).unwrap_or(0);
            add(&|spec| spec.inputs_mut()[at].zones = fewer);
        }
        if of.steps.is_some() {
            add(&|spec| spec.inputs_mut()[at].steps = None);
        }
    }
    all
}
