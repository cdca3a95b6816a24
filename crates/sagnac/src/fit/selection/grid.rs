//! The best model of the thermometer of the fit: every series that the windows are enough for, graded or held out.
//!
//! ```text
//! bias 0 … 8 × no rate, rate 0 … 3 ─▶ condition ≤ 100, an image holds it ─▶ least grade where the residual is nearly white ([`super::grades`]),
//!                                                                       │   of those that no smaller one beats by far on held-out data
//!                                                                       └▶ else the smallest that held-out data justify ([`super::criterion`])
//! ```
//!
//! Fails with fewer than three windows for each coefficient, and where the data separate the terms of no candidate.

use crate::calibration::{Candidate, RejectedModel};
use crate::fit::one_model::design::effective_windows;
use crate::fit::one_model::residual_noise::noise_of;
use crate::fit::one_model::solution::fit;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::selection::criterion::{CvScore, is_undominated};
use crate::fit::selection::folds::cross_validate;
use crate::fit::selection::grades::{Grades, grade};
use crate::fit::selection::held_by_image::ImageCheck;
use crate::fit::selection::prices::{CONDITION_MAX, FAR_BEHIND, NEARLY_WHITE};
use crate::model::price::work_of;
use crate::model::spec::ModelSpec;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;
use sagnac_log::error::{Error, Result};

/// The best model of the grid.
pub(crate) struct Best {
    pub(crate) spec: ModelSpec,
    pub(crate) mean_square: Option<f64>,
    pub(crate) candidates: Vec<Candidate>,
    pub(crate) specs: Vec<ModelSpec>,
    pub(crate) not_held: Vec<RejectedModel>,
}

/// The models over the thermometer of the fit that the windows are enough for.
pub(crate) fn affordable(problem: &LeastSquares<'_>) -> Result<Vec<ModelSpec>> {
    let affordable = |spec: &ModelSpec| problem.len() >= 3 * (problem.levels().len() + spec.coefficients());
    let with_scale = problem.column_of(Level::Scale).is_some();
    let specs: Vec<ModelSpec> =
        ModelSpec::candidates(problem.tries_main_rate(), with_scale).into_iter().filter(affordable).collect();
    if specs.is_empty() {
        return Err(Error::refused(
            format!(
                "{} windows in {} runs are too few for constants: a fit needs three windows for each coefficient",
                problem.len(),
                problem.runs.len()
            ),
            "give more data, or set a shorter --window",
        ));
    }
    Ok(specs)
}

/// Tries every model over the thermometer of the fit.
pub(crate) fn best_of_grid(
    problem: &LeastSquares<'_>,
    specs: Vec<ModelSpec>,
    taus_s: &[f64],
    image: &ImageCheck<'_>,
) -> Result<Best> {
    let mean_square = cross_validate(problem, &specs, taus_s);
    if mean_square.iter().all(Option::is_none) {
        return Err(Error::refused(
            "every candidate fails without a part of the data",
            "give more data over more temperatures, or set a fixed --model",
        ));
    }
    let mut fair: Vec<usize> = (0..specs.len()).filter(|i| mean_square[*i].is_some()).collect();
    let grades = grades_if_white(problem, &fair, &specs, taus_s);
    let mut not_held = Vec::new();
    let mut refusal = Error::refused(
        "the data do not separate the terms of any candidate",
        "test so that temperature and its rate move independently, or set a fixed --model",
    );
    let chosen = loop {
        let best = match &grades {
            Some(grades) => grades.best(&not_far_behind(&fair, &specs, &mean_square)),
            None => best_held_out(problem, &fair, &specs, &mean_square, taus_s),
        };
        let Some(chosen) = best else { return Err(refusal) };
        let fitted = fit(problem, &specs[chosen], taus_s).ok();
        let near = fitted.as_ref().map(|f| f.conditioning.as_ref().map_or(1.0, |near| near.condition));
        match fitted.as_ref().map_or(Ok(()), |fitted| image.check(fitted, problem)) {
            Ok(()) if near.is_some_and(|condition| condition <= CONDITION_MAX) => break chosen,
            Ok(()) => (),
            Err(error) => {
                // The first alone: the next are what is selected in its place.
                if not_held.is_empty() {
                    not_held.push(rejected(&specs[chosen], &error));
                }
                refusal = error.of(&format!("`{}`", specs[chosen]));
            }
        }
        fair.retain(|other| *other != chosen);
    };
    let candidates = specs.iter().zip(&mean_square).map(|(spec, square)| candidate(spec, *square, 1)).collect();
    Ok(Best { spec: specs[chosen].clone(), mean_square: mean_square[chosen], candidates, specs, not_held })
}

pub(crate) fn rejected(spec: &ModelSpec, refusal: &Error) -> RejectedModel {
    RejectedModel { model: spec.to_string(), reason: format!("{}: {}", refusal.what, refusal.help) }
}

/// Grades of all candidates ([`super::grades`]) where the residual of the largest is nearly white. Where it is not, a grade
/// mistakes what no model explains for noise, and what is held out decides.
fn grades_if_white(problem: &LeastSquares<'_>, fair: &[usize], specs: &[ModelSpec], taus_s: &[f64]) -> Option<Grades> {
    let largest = fair.iter().copied().max_by_key(|i| specs[*i].coefficients())?;
    let fitted = fit(problem, &specs[largest], taus_s).ok();
    let noise = fitted.map_or(SlowNoise::default(), |fitted| noise_of(problem, &fitted).best);
    if noise.parts_of_white() > NEARLY_WHITE {
        return None;
    }
    grade(problem, &Whitening::new(problem.noise_rows(), noise), specs, taus_s)
}

/// Those whose held-out error no smaller model undercuts by far. A grade knows the rows that were fitted alone: on one ramp a larger
/// model may follow them closely and be wrong by several times that next to them.
fn not_far_behind(fair: &[usize], specs: &[ModelSpec], mean_square: &[Option<f64>]) -> Vec<usize> {
    let square = |i: usize| mean_square[i].unwrap_or(f64::INFINITY);
    let undercuts = |small: usize, large: usize| {
        specs[small].coefficients() < specs[large].coefficients() && square(small) * FAR_BEHIND < square(large)
    };
    fair.iter().copied().filter(|large| !fair.iter().any(|small| undercuts(*small, *large))).collect()
}

/// The smallest model against which no other is justified ([`super::criterion`]). At equal size a model without rate term is
/// preferred, because a slow lag can look like a curve; then the lower mean square.
fn best_held_out(
    problem: &LeastSquares<'_>,
    fair: &[usize],
    specs: &[ModelSpec],
    mean_square: &[Option<f64>],
    taus_s: &[f64],
) -> Option<usize> {
    let square = |i: usize| mean_square[i].unwrap_or(f64::INFINITY);
    let least = fair.iter().copied().min_by(|a, b| square(*a).total_cmp(&square(*b)))?;
    let rho = fit(problem, &specs[least], taus_s).map_or(0.0, |fitted| fitted.autocorrelation);
    let windows = effective_windows(problem.len(), rho);
    let held = |i: usize| CvScore { coefficients: specs[i].coefficients(), mean_square: square(i) };
    let all: Vec<CvScore> = fair.iter().map(|i| held(*i)).collect();
    fair.iter().copied().filter(|i| is_undominated(held(*i), &all, windows)).min_by(|a, b| {
        let key = |i: usize| (specs[i].coefficients(), specs[i].thermometer().rate.is_some());
        key(*a).cmp(&key(*b)).then(square(*a).total_cmp(&square(*b)))
    })
}

pub(crate) fn candidate(spec: &ModelSpec, mean_square: Option<f64>, inputs: usize) -> Candidate {
    Candidate {
        model: spec.to_string(),
        coefficients: spec.coefficients(),
        held_out_dph: mean_square.map(f64::sqrt),
        slow_update_instructions: Some(work_of(spec, inputs).instructions()),
        chosen: false,
    }
}
