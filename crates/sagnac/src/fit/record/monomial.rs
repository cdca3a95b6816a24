//! The fitted curve in the paper's form: powers of °C, with the offset of the first run.
//!
//! ```text
//! value = f·{C + Σ bᵢ·[Sᵢ(T) − Sᵢ(T0)] − Ω·1e-6·Σ e_k·[S_k(T) − S_k(T0)]} = Σ cₚ·Tᵖ        f: from °/h to the unit
//! ```
//!
//! One linear map from the parameters to the powers, so that the covariance goes with it. Scale terms are linearised at the
//! rate of that run, other inputs are at their references. A curve with a shape that has no powers has no monomial.

use crate::calibration::Monomial;
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::{ActsOn, BASIS_LEN};
use crate::window::WindowShape;
use sagnac_log::ingest::AngleUnit;

/// Factor from °/h to the monomial's unit, and the name of the unit.
fn unit_of(unit: AngleUnit, window_s: f64) -> (f64, &'static str) {
    match unit {
        AngleUnit::Quanta { arcsec_per_count, .. } => (window_s / arcsec_per_count, "counts per window"),
        AngleUnit::Arcsec => (1.0, "deg/h"),
    }
}

/// The curve in the zone of T0, and zone by zone where there are zones.
pub(crate) fn monomials(
    fitted: &Fitted,
    problem: &LeastSquares<'_>,
    shape: &WindowShape,
    reference_c: f64,
) -> (Option<Monomial>, Vec<Monomial>) {
    let span = problem.span();
    let knots: Vec<f64> = curve_terms(fitted).filter_map(|(_, term)| term.form.shape.joint()).collect();
    let mut borders = vec![span.lo];
    borders.extend(&knots);
    borders.push(span.hi);
    let pieces = borders.windows(2).map(|ends| monomial(fitted, problem, shape, reference_c, [ends[0], ends[1]]));
    let Some(mut zones) = pieces.collect::<Option<Vec<Monomial>>>() else { return (None, Vec::new()) };
    if knots.is_empty() {
        let whole = zones.pop().map(|curve| Monomial { range_c: None, ..curve });
        return (whole, Vec::new());
    }
    let of_reference = knots.iter().filter(|knot| reference_c >= **knot).count();
    (zones.get(of_reference).cloned(), zones)
}

/// Terms at rest over the thermometer of the fit, with their index.
fn curve_terms(fitted: &Fitted) -> impl Iterator<Item = (usize, &TermColumn)> {
    fitted.terms.iter().enumerate().filter(|(_, term)| term.input == 0 && !term.form.times_rate)
}

/// Powers of °C between two temperatures; `None` where a shape has none.
fn monomial(
    fitted: &Fitted,
    problem: &LeastSquares<'_>,
    shape: &WindowShape,
    reference_c: f64,
    piece: [f64; 2],
) -> Option<Monomial> {
    let (span, levels) = (problem.span(), problem.levels().len());
    let (factor, unit) = unit_of(shape.unit, shape.nominal_s);
    // On a table the curve is that of a gyro that is not turned.
    let omega = if problem.turning.is_some() { 0.0 } else { -problem.run_rate[0] * 1e-6 };
    let mut maps = vec![vec![0.0; fitted.covariance.nrows()]; BASIS_LEN];
    maps[0][0] = factor;
    let mut order = 0;
    for (at, term) in curve_terms(fitted) {
        let mut powers = term.form.shape.powers(span, piece)?;
        order = order.max(term.form.shape.degree()?);
        powers[0] -= term.form.shape.value(span, reference_c);
        let acts = match term.form.acts_on {
            ActsOn::Bias => 1.0,
            ActsOn::ScaleFactor => omega,
        };
        maps.iter_mut().zip(powers).for_each(|(map, power)| map[levels + at] = factor * acts * power);
    }
    maps.truncate(order + 1);
    let coefficients = maps.iter().map(|map| map.iter().zip(&fitted.theta).map(|(m, t)| m * t).sum());
    let sigma = maps.iter().map(|map| {
        let map = nalgebra::DVector::from_column_slice(map);
        (map.transpose() * &fitted.covariance * &map)[(0, 0)].max(0.0).sqrt()
    });
    Some(Monomial {
        run: problem.runs[0] as u32,
        unit: unit.to_owned(),
        window_s: shape.nominal_s,
        coefficients: coefficients.collect(),
        sigma: Some(sigma.collect()),
        range_c: Some(piece),
    })
}
