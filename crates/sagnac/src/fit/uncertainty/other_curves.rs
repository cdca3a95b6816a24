//! Other curves next to the fitted one: what they add to its uncertainty, and where the rows contradict its shape.

use crate::calibration::{CurveSpread, LackOfFit};
use crate::fit::one_model::solution::Fitted;
use crate::fit::selection::grades::grade;
use crate::fit::selection::grid::affordable;
use crate::fit::selection::prices::GIVEN_TAUS;
use crate::fit::selection::selected::Selected;
use crate::fit::uncertainty::curve_spread::{Rival, rivals_of, spread};
use crate::fit::uncertainty::rivals::{OfRows, lack_of_fit, rivals_of_shape};
use crate::model::spec::{InputTerms, ModelSpec};
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;

/// Other curves next to the fitted one, which gives value and variance at a temperature: what that adds to its uncertainty, and
/// where the rows contradict its shape. Neither for models of more than series and zones over one thermometer.
///
/// Next to a model that was asked for nothing counts unless the rows contradict it.
pub(crate) fn spread_and_lack_of_fit(
    selected: &Selected<'_>,
    fitted: &Fitted,
    noise: SlowNoise,
    curve: impl Fn(f64) -> (f64, f64),
) -> (Option<CurveSpread>, Option<LackOfFit>) {
    let problem = &selected.problem;
    let is_of_series = |terms: &InputTerms| terms.harmonics.is_empty() && terms.slow_rate.is_none();
    if selected.spec.inputs().len() > 1 || !is_of_series(selected.spec.thermometer()) {
        return (None, None);
    }
    let is_given = selected.was_given;
    let of_all = if is_given { affordable(problem).unwrap_or_default() } else { selected.grid.clone() };
    let mut specs: Vec<ModelSpec> = of_all.into_iter().filter(|spec| spec.thermometer().zones < 2).collect();
    if selected.spec.thermometer().zones < 2 && !specs.contains(&selected.spec) {
        specs.push(selected.spec.clone());
    }
    let whitening = Whitening::new(problem.noise_rows(), noise);
    // Any lag near the best shows that a rate term is missing.
    let taus_s: Vec<f64> = selected.taus_s.iter().copied().step_by(if is_given { GIVEN_TAUS } else { 1 }).collect();
    let Some(grades) = grade(problem, &whitening, &specs, &taus_s) else { return (None, None) };
    let of_rows = OfRows { whitening: &whitening, variance: grades.variance, taus: taus_s.len() };
    let series = rivals_of(grades, problem, &specs);
    let shapes = rivals_of_shape(problem, fitted, of_rows, &curve);
    // Of the series the selection has judged.
    let judged = if is_given { series.iter().chain(&shapes).collect() } else { shapes.iter().collect::<Vec<_>>() };
    let lack = lack_of_fit(problem, fitted, of_rows, &judged, &curve);
    if is_given && lack.is_none() {
        return (None, None);
    }
    let rivals: Vec<Rival> = series.into_iter().chain(shapes).collect();
    (spread(problem, &rivals, curve), lack)
}
