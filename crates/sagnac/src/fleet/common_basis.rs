//! What a unit's record says on the basis that all units share ([`crate::model::COMMON_SPAN`]): coefficients of the series, then the lags.
//!
//! Fails for models with zones, steps, harmonics or other inputs, which have no such basis: the curve at common temperatures stands for
//! those. A lag that the test does not resolve is not part of it.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::calibration::{AxisCalibration, CorrectionTerm, Lag};
use crate::model::common_basis::{SeriesTerm, onto_common};

/// Temperatures at which every curve is given where its span has them, °C.
pub const COMMON_TEMPERATURES_C: [f64; 33] = [
    -60.0, -55.0, -50.0, -45.0, -40.0, -35.0, -30.0, -25.0, -20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0,
    25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0,
];

/// Coefficients on the common basis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CommonBasis {
    /// Names: `bias 1`, `rate 0`, `slow rate 0`, `lag_s`, `slow lag_s`.
    pub terms: Vec<String>,
    /// Unit of each: `deg/h`, `deg/h per degC/min`, `ppm`, `s`.
    pub units: Vec<String>,
    /// Their values.
    pub coefficients: Vec<f64>,
    /// Their covariance: the lower triangle, row by row.
    pub covariance: Vec<f64>,
}

/// A parameter as it is made of the record's own: name, unit, value, rows of the covariance with their weights.
struct ParameterRow {
    name: String,
    unit: String,
    value: f64,
    of: Vec<(usize, f64)>,
}

/// The terms and lags of an axis on the common basis; `None` where a term is no polynomial in the temperature.
pub(super) fn on_common_basis(axis: &AxisCalibration) -> Option<CommonBasis> {
    let rows: Vec<ParameterRow> = series(axis)?.into_iter().chain(lags(axis)).collect();
    let p = rows.len();
    let covariance = DMatrix::from_fn(p, p, |i, j| axis.covariance_between(&rows[i].of, &rows[j].of));
    let (mut terms, mut units, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
    for ParameterRow { name, unit, value, .. } in rows {
        terms.push(name);
        units.push(unit);
        coefficients.push(value);
    }
    let covariance = (0..p).flat_map(|i| (0..=i).map(|j| covariance[(i, j)]).collect::<Vec<_>>()).collect();
    Some(CommonBasis { terms, units, coefficients, covariance })
}

fn series(axis: &AxisCalibration) -> Option<Vec<ParameterRow>> {
    let terms = &axis.correction.terms;
    let of_series = |term: &CorrectionTerm| -> Option<SeriesTerm> {
        let of_thermometer = axis.is_of_thermometer(term);
        let series = terms.iter().position(|other| is_of_series(other, term)).filter(|_| of_thermometer)?;
        Some(SeriesTerm { series, shape: term.shape, times_rate: term.times_rate })
    };
    let onto = onto_common(axis.span(), &terms.iter().map(of_series).collect::<Option<Vec<_>>>()?)?;
    let row = |(term, weights): (&CorrectionTerm, Vec<(usize, f64)>)| {
        let weighted_row = |(own, weight): &(usize, f64)| Some((axis.row_of(&terms[*own])?, *weight));
        Some(ParameterRow {
            name: axis.name_of(term),
            unit: term.unit.clone(),
            value: weights.iter().map(|(own, weight)| weight * terms[*own].value).sum(),
            of: weights.iter().map(weighted_row).collect::<Option<_>>()?,
        })
    };
    terms.iter().zip(onto).map(row).collect()
}

fn lags(axis: &AxisCalibration) -> impl Iterator<Item = ParameterRow> {
    let named = |(name, lag): (&str, Option<Lag>)| {
        let row = axis.fit.as_ref()?.covariance_of.iter().position(|row| row == name)?;
        Some(ParameterRow { name: name.to_owned(), unit: "s".to_owned(), value: lag?.value, of: vec![(row, 1.0)] })
    };
    [("lag_s", axis.lag_s()), ("slow lag_s", axis.slow_lag_s())].into_iter().filter_map(named)
}

fn is_of_series(one: &CorrectionTerm, other: &CorrectionTerm) -> bool {
    (one.acts_on, one.times_rate, &one.input) == (other.acts_on, other.times_rate, &other.input)
}

/// Drift at rest less that at the record's T0, with its σ, °/h, at the common temperatures within the span.
pub(super) fn common_curve(axis: &AxisCalibration) -> Vec<[f64; 3]> {
    let point = |celsius: f64| {
        let seen = axis.predict(celsius)?;
        let quantile = axis.residual()?.t_quantile_975;
        Some([celsius, seen.drift_dph, seen.curve_dph / quantile])
    };
    COMMON_TEMPERATURES_C.into_iter().filter_map(point).collect()
}
