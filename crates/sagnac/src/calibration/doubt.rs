//! How sure a record is: predictions with their intervals, heating against cooling, what more soaking would buy.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::{AxisCalibration, Term, TermKind};
use crate::model::input::zone;
use crate::model::{BASIS_LEN, chebyshev};

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

/// A residual below this part of the floor is none of noise alone.
const BELOW_FLOOR: f64 = 0.9;

impl AxisCalibration {
    /// Why a residual well below the noise floor is no better than noise: then the floor holds more than noise.
    pub fn below_floor_note(&self) -> Option<&'static str> {
        let (residual, floor) = (self.residual.as_ref()?, self.floor.as_ref()?);
        let below = residual.sigma_dph < BELOW_FLOOR * floor.value_dph;
        if below && self.turned() {
            Some(
                "the residual is well below the noise floor: turned by a table, a counter's quantization is a saw that the floor takes for noise; \
                  give [noise] from a record at rest",
            )
        } else if below && !self.inputs.is_empty() {
            Some(
                "the residual is well below the noise floor, so the floor holds what an input moves within seconds; compare with the held-out σ \
                  of other models instead",
            )
        } else {
            None
        }
    }

    /// The drift at rest at a temperature within the span, with its intervals; `None` outside, or where nothing was
    /// fitted here.
    pub fn predict(&self, celsius: f64) -> Option<Prediction> {
        let residual = self.residual.as_ref()?;
        if !(self.span_c[0]..=self.span_c[1]).contains(&celsius) || self.covariance.is_empty() {
            return None;
        }
        let drift_dph = self.drift(celsius, self.reference_c);
        let variance = self.variance_of(&self.drift_weights(celsius, self.reference_c));
        let half = |variance: f64| residual.t95 * variance.sqrt();
        Some(Prediction {
            drift_dph,
            curve_dph: half(variance),
            window_dph: half(variance + residual.sigma_dph.powi(2)),
        })
    }

    /// What each term makes of the drift at rest between two temperatures, further inputs at their references: the term
    /// and its weight.
    fn at_rest(&self, celsius: f64, from_c: f64) -> impl Iterator<Item = (&Term, f64)> {
        let span = self.span();
        let (x, from) = (span.x(celsius), span.x(from_c));
        let (at, zero) = (chebyshev(x), chebyshev(from));
        self.terms.iter().filter(|term| self.is_main(term)).filter_map(move |term| {
            let weight = match (term.kind, term.at) {
                (TermKind::Bias, _) => at.get(usize::from(term.order))? - zero.get(usize::from(term.order))?,
                (TermKind::Zone, Some(knot_c)) => zone(x, span.x(knot_c)) - zone(from, span.x(knot_c)),
                _ => return None,
            };
            Some((term, weight))
        })
    }

    /// The drift at rest at a temperature less that at another, °/h.
    pub fn drift(&self, celsius: f64, from_c: f64) -> f64 {
        self.at_rest(celsius, from_c).map(|(term, weight)| term.value * weight).sum()
    }

    /// The same as rows of the covariance with their weights; empty where nothing was fitted here.
    pub(crate) fn drift_weights(&self, celsius: f64, from_c: f64) -> Vec<(usize, f64)> {
        let row = |term: &Term| self.covariance_of.iter().position(|name| *name == term.name(true));
        self.at_rest(celsius, from_c).filter_map(|(term, weight)| Some((row(term)?, weight))).collect()
    }

    /// Drift per unit of a further input at its reference and its σ; `None` without value terms over it.
    pub(crate) fn slope_of_input(&self, name: &str) -> Option<[f64; 2]> {
        const STEP: f64 = 1e-5;
        let input = self.inputs.iter().find(|input| input.name == name)?;
        let span = crate::model::Span { lo_c: input.span[0], hi_c: input.span[1] };
        let x0 = span.x(input.reference);
        let (above, below) = (chebyshev(x0 + STEP), chebyshev(x0 - STEP));
        let terms = self.terms.iter().filter(|term| term.kind == TermKind::Bias && term.sensor == name);
        let slopes: Vec<(&Term, f64)> = terms
            .map(|term| {
                let order = usize::from(term.order).min(BASIS_LEN - 1);
                (term, (above[order] - below[order]) / (2.0 * STEP) * span.slope())
            })
            .collect();
        let row = |term: &Term| self.covariance_of.iter().position(|name| *name == term.name(false));
        let weights: Vec<(usize, f64)> = slopes.iter().filter_map(|(term, slope)| Some((row(term)?, *slope))).collect();
        let value = slopes.iter().map(|(term, slope)| term.value * slope).sum();
        (!slopes.is_empty()).then(|| [value, self.variance_of(&weights).sqrt()])
    }

    /// Rows of the covariance that are terms of a kind over the thermometer of the fit, with their orders (`scale 0` is the
    /// scale factor at T0).
    pub fn rows_of(&self, kind: TermKind) -> impl Iterator<Item = (usize, usize)> {
        let named = self.covariance_of.iter().enumerate();
        named
            .filter_map(move |(row, name)| {
                Some((row, name.strip_prefix(kind.word())?.strip_prefix(' ')?.parse().ok()?))
            })
            .filter(|(_, order)| *order < BASIS_LEN)
    }

    /// Variance of a sum of parameters, each times its weight.
    pub fn variance_of(&self, weights: &[(usize, f64)]) -> f64 {
        let entry = |i: usize, j: usize| self.covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        let of = |(i, a): &(usize, f64)| weights.iter().map(|(j, b)| a * b * entry(*i, *j)).sum::<f64>();
        weights.iter().map(of).sum::<f64>().max(0.0)
    }

    /// A rate table turned it.
    pub fn turned(&self) -> bool {
        self.scale_factor.is_some() || !self.misalignment.is_empty()
    }
}
