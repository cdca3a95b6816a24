//! What selecting a model, and a lag that the data do not resolve, add to the uncertainty of the curve.
//!
//! ```text
//! weight                     w ∝ exp(−½·(SSR/s² + 2.5·k))           near Akaike's, so that a term that was nearly selected counts
//! variance at T              Σ w·(var_m(T) + (d_m(T) − d(T))²)      d the selected curve, d_m and var_m those of the others
//! ```
//!
//! after Buckland, Burnham and Augustin (1997): an interval that knows only the selected model holds the truth too rarely, for
//! a term that was nearly selected is in no coefficient. Where one model explains the data alone the sum is its own
//! variance.
//!
//! Over the models of the thermometer of the fit alone.

use crate::calibration::CurveSpread;
use crate::fit::problem::curve_points::{POINTS, temperature};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::selection::grades::{Graded, Grades};
use crate::fit::selection::prices::{CONDITION_MAX, LEAST_WEIGHT};
use crate::model::basis::chebyshev;
use crate::model::spec::ModelSpec;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Other curves than the selected one.
pub(crate) struct Rival {
    /// A model, or words for a curve that is none.
    pub(crate) name: String,
    /// −2·ln of its weight.
    pub(crate) criterion: f64,
    /// Value, °/h, and variance at every temperature of a spread, less those at the reference.
    pub(crate) curve: Vec<(f64, f64)>,
}

/// σ that rivals add to a curve, which gives value and variance at a temperature; `None` where there is nothing next to it.
pub(crate) fn spread(
    problem: &LeastSquares<'_>,
    rivals: &[Rival],
    curve: impl Fn(f64) -> (f64, f64),
) -> Option<CurveSpread> {
    let best = rivals.iter().map(|rival| rival.criterion).fold(f64::INFINITY, f64::min);
    let weighted = rivals.iter().map(|rival| ((0.5 * (best - rival.criterion)).exp(), &rival.curve));
    let near: Vec<(f64, &Vec<(f64, f64)>)> = weighted.filter(|(weight, _)| *weight > LEAST_WEIGHT).collect();
    let total: f64 = near.iter().map(|(weight, _)| weight).sum();
    let at = |point: usize| {
        let celsius = temperature(problem, point);
        let (drift_dph, own) = curve(celsius);
        let spread = |(weight, curve): &(f64, &Vec<(f64, f64)>)| {
            let (value, variance) = curve[point];
            weight / total * (variance + (value - drift_dph).powi(2))
        };
        let sum: f64 = near.iter().map(spread).sum();
        (celsius, (sum - own).max(0.0).sqrt())
    };
    let (temperature_c, sigma_dph): (Vec<f64>, Vec<f64>) = (0..POINTS).map(at).unzip();
    (near.len() > 1 && sigma_dph.iter().all(|sigma| sigma.is_finite()))
        .then_some(CurveSpread { temperature_c, sigma_dph })
}

/// The series as rivals, without those of hardly any weight.
pub(crate) fn rivals_of(grades: Grades, problem: &LeastSquares<'_>, specs: &[ModelSpec]) -> Vec<Rival> {
    let (variance, levels) = (grades.variance, problem.run_columns().shared.len());
    let criterion = |graded: &Graded| graded.solution.ssr / variance + graded.weight_price;
    let best = grades.all.iter().map(criterion).fold(f64::INFINITY, f64::min);
    let rival = |graded: Graded| {
        let criterion = criterion(&graded);
        let near = (0.5 * (best - criterion)).exp() > LEAST_WEIGHT;
        // A model that could not be selected, because its terms explain each other, is no rival.
        let conditioning = if near { graded.solution.conditioning(levels, &[]) } else { None };
        let near = near && conditioning.is_none_or(|conditioning| conditioning.condition <= CONDITION_MAX);
        let normal = near.then(|| graded.solution.inverse_normal()).flatten()?;
        let bias = usize::from(specs[graded.spec].thermometer().bias);
        let curve = of_series(problem, &graded.solution.theta, &normal, levels..levels + bias);
        let name = format!("`{}`", specs[graded.spec]);
        Some(Rival { name, criterion, curve: curve.map(|(value, own)| (value, variance * own)).collect() })
    };
    grades.all.into_iter().filter_map(rival).collect()
}

/// The bias series in some columns at every temperature of a spread, less that at the reference: value, and variance in units of s².
fn of_series<'a>(
    problem: &'a LeastSquares<'_>,
    theta: &'a DVector<f64>,
    normal: &'a DMatrix<f64>,
    columns: Range<usize>,
) -> impl Iterator<Item = (f64, f64)> + 'a {
    let span = problem.span();
    let at_reference = chebyshev(span.x(problem.inputs[0].reference));
    (0..POINTS).map(move |point| {
        let here = chebyshev(span.x(temperature(problem, point)));
        let weight = |column: usize| {
            let order = column - columns.start + 1;
            here[order] - at_reference[order]
        };
        let value = columns.clone().map(|column| weight(column) * theta[column]).sum();
        let mut square = 0.0;
        for i in columns.clone() {
            for j in columns.clone() {
                square += weight(i) * weight(j) * normal[(i, j)];
            }
        }
        (value, square)
    })
}
