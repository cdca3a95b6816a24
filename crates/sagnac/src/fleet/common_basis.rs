//! The terms of units of different spans on one basis, so that they can be compared, averaged and charted.
//!
//! ```text
//! x = (T − 20 °C)/60 °C     bias n: T_n(x)     rate n: Ṫ·T_n(x)     scale n: T_n(x)     T_n: Chebyshev polynomial
//! ```
//!
//! The map from a record's own basis is linear and exact for polynomials: β' = M·β, Cov(β') = M·Cov(β)·Mᵀ. The constant of a series in
//! T belongs to the run offset and is not part of it; that of a rate series is `rate 0`. Fails for models with zones, steps, harmonics
//! or other inputs, which have no such basis: the curve at common temperatures stands for those.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::calibration::{AxisCalibration, Term};
use crate::model::powers::{powers_of_chebyshev, series_from_powers};
use crate::model::{Shape, Span};

/// Where x is −1 and 1, °C.
pub const COMMON_SPAN: Span = Span { lo: -40.0, hi: 80.0 };
/// Temperatures at which every curve is given where its span has them, °C.
pub const COMMON_TEMPERATURES_C: [f64; 33] = [
    -60.0, -55.0, -50.0, -45.0, -40.0, -35.0, -30.0, -25.0, -20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0,
    25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0,
];

/// Coefficients on the common basis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CommonBasis {
    /// Names: `bias 1`, `rate 0`, `slow rate 0`.
    pub terms: Vec<String>,
    /// Unit of each coefficient: `deg/h`, `deg/h per degC/min`, `ppm`.
    pub units: Vec<String>,
    /// Their values.
    pub coefficients: Vec<f64>,
    /// Their covariance: the lower triangle, row by row.
    pub covariance: Vec<f64>,
}

/// Some of the own terms, each with its weight.
type Weights = Vec<(usize, f64)>;

/// The terms of an axis on the common basis; `None` where a term is no polynomial in the temperature.
pub(super) fn on_common_basis(axis: &AxisCalibration) -> Option<CommonBasis> {
    let terms = &axis.correction.terms;
    // Name of each new term, with the own terms that it is made of and how much of each.
    let mut rows: BTreeMap<(usize, usize), (Term, Weights)> = BTreeMap::new();
    for (own, term) in terms.iter().enumerate() {
        let order = term.shape.order().filter(|_| axis.is_of_thermometer(term))?;
        let powers = powers_of_chebyshev(axis.span(), u8::try_from(order).ok()?);
        let least = usize::from(!term.times_rate);
        for (n, weight) in series_from_powers(COMMON_SPAN, &powers).into_iter().enumerate().take(order + 1).skip(least)
        {
            let like = Term { shape: Shape::Chebyshev { order: u8::try_from(n).ok()? }, ..term.clone() };
            let series = terms.iter().position(|other| is_of_series(other, term))?;
            let row = rows.entry((series, n)).or_insert_with(|| (like, Vec::new()));
            row.1.push((own, weight));
        }
    }
    let rows: Vec<(Term, Weights)> = rows.into_values().collect();
    let coefficient = |row: &[(usize, f64)]| row.iter().map(|(own, weight)| weight * terms[*own].value).sum();
    let in_covariance = |row: &[(usize, f64)]| -> Option<Weights> {
        row.iter().map(|(own, weight)| Some((axis.row_of(&terms[*own])?, *weight))).collect()
    };
    let weights: Vec<Weights> = rows.iter().map(|(_, row)| in_covariance(row)).collect::<Option<_>>()?;
    let lower = weights.iter().enumerate().flat_map(|(i, a)| weights[..=i].iter().map(move |b| (a, b)));
    Some(CommonBasis {
        coefficients: rows.iter().map(|(_, row)| coefficient(row)).collect(),
        covariance: lower.map(|(a, b)| axis.covariance_between(a, b)).collect(),
        terms: rows.iter().map(|(like, _)| axis.name_of(like)).collect(),
        units: rows.into_iter().map(|(like, _)| like.unit).collect(),
    })
}

fn is_of_series(one: &Term, other: &Term) -> bool {
    (one.acts_on, one.times_rate, &one.input) == (other.acts_on, other.times_rate, &other.input)
}

/// Drift at rest less that at the record's T0, with its σ, °/h, at the common temperatures within the span.
pub(super) fn common_curve(axis: &AxisCalibration) -> Vec<[f64; 3]> {
    let of = |celsius: f64| {
        let seen = axis.predict(celsius)?;
        let quantile = axis.residual()?.t_quantile_975;
        Some([celsius, seen.drift_dph, seen.curve_dph / quantile])
    };
    COMMON_TEMPERATURES_C.into_iter().filter_map(of).collect()
}
