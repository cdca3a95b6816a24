//! How sure a record is: predictions with their intervals, heating against cooling, what more soaking would buy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{AxisCalibration, TermKind};
use crate::fit::{BASIS_LEN, chebyshev};

/// Mean while heating less mean while cooling: hysteresis, a gradient, a rate term.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatingLessCooling {
    /// About the runs' constants, °/h.
    pub before_dph: f64,
    /// Less the fit, °/h. In-sample: quote a proof's instead.
    pub after_dph: f64,
    /// Standard error of both by the residuals' scatter, widened by their correlation, °/h.
    pub sigma_dph: f64,
}

/// The doubt of the curve at one temperature, now and after soaking there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SoakRow {
    /// °C.
    pub temperature_c: f64,
    /// σ of the drift at rest now, °/h.
    pub sigma_dph: f64,
    /// The same after each of `hours` at this temperature, °/h.
    pub after_dph: Vec<f64>,
}

/// What more soaking would buy, by the covariance of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Soak {
    /// Hours that are forecast.
    pub hours: Vec<f64>,
    /// Temperature by temperature.
    pub rows: Vec<SoakRow>,
    /// Where the next hour makes the curve as a whole best known, °C.
    pub best_c: f64,
    /// Root mean square of σ over the rows now, °/h.
    pub mean_sigma_dph: f64,
    /// The same after that hour.
    pub mean_sigma_after_dph: f64,
}

/// What the fit says of a temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// d(T) at rest, °/h.
    pub drift_dph: f64,
    /// Half of its 95 % interval, °/h: the curve's own doubt.
    pub curve_dph: f64,
    /// Half of the 95 % interval of a further window of a run whose constant is known, °/h: the doubt and the noise.
    pub window_dph: f64,
}

impl AxisCalibration {
    /// The drift at rest at a temperature within the span, with its intervals; `None` outside, or where nothing was
    /// fitted here.
    pub fn predict(&self, celsius: f64) -> Option<Prediction> {
        let residual = self.residual.as_ref()?;
        if !(self.span_c[0]..=self.span_c[1]).contains(&celsius) || self.covariance.is_empty() {
            return None;
        }
        let span = crate::fit::Span { lo_c: self.span_c[0], hi_c: self.span_c[1] };
        let (at, at_reference) = (chebyshev(span.x(celsius)), chebyshev(span.x(self.reference_c)));
        let basis = |order: usize| at[order] - at_reference[order];
        let series = self.series(TermKind::Bias);
        let drift_dph = (1..BASIS_LEN).map(|order| series[order] * basis(order)).sum();
        let rows: Vec<(usize, f64)> = self.rows_of(TermKind::Bias).map(|(row, order)| (row, basis(order))).collect();
        let variance = self.variance_of(&rows);
        let half = |variance: f64| residual.t95 * variance.sqrt();
        Some(Prediction {
            drift_dph,
            curve_dph: half(variance),
            window_dph: half(variance + residual.sigma_dph.powi(2)),
        })
    }

    /// Rows of the covariance that are terms of a kind, with their orders (`scale 0` is the scale factor at T0).
    pub(crate) fn rows_of(&self, kind: TermKind) -> impl Iterator<Item = (usize, usize)> {
        let prefix = match kind {
            TermKind::Bias => "bias ",
            TermKind::Rate => "rate ",
            TermKind::Scale => "scale ",
        };
        let named = self.covariance_of.iter().enumerate();
        named
            .filter_map(move |(row, name)| Some((row, name.strip_prefix(prefix)?.parse().ok()?)))
            .filter(|(_, order)| *order < BASIS_LEN)
    }

    /// Variance of a sum of parameters, each times its weight.
    pub(crate) fn variance_of(&self, weights: &[(usize, f64)]) -> f64 {
        let entry = |i: usize, j: usize| self.covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        let of = |(i, a): &(usize, f64)| weights.iter().map(|(j, b)| a * b * entry(*i, *j)).sum::<f64>();
        weights.iter().map(of).sum::<f64>().max(0.0)
    }

    /// A rate table turned it.
    pub(crate) fn turned(&self) -> bool {
        self.scale_factor.is_some() || !self.misalignment.is_empty()
    }
}
