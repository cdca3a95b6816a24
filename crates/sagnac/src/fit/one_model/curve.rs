//! The curve of a fit: its drift at rest over the thermometer of the fit, every other input at its reference.
//!
//! ```text
//! d(T) = Σ bᵢ·[Sᵢ(T) − Sᵢ(T0)]        σ² = wᵀ·Cov·w, w the brackets in their rows
//! ```

use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::{ActsOn, TermShape};

/// The curve of a fit.
pub(crate) struct FittedCurve<'a> {
    problem: &'a LeastSquares<'a>,
    fitted: &'a Fitted,
    /// Row of the covariance of each term of the curve.
    terms: Vec<(usize, TermShape)>,
}

impl<'a> FittedCurve<'a> {
    pub(crate) fn of(problem: &'a LeastSquares<'a>, fitted: &'a Fitted) -> Self {
        let is_of_curve = |(_, term): &(usize, &TermColumn)| {
            term.input == 0 && !term.form.times_rate && term.form.acts_on == ActsOn::Bias
        };
        let rows = (problem.levels().len()..).zip(&fitted.terms).filter(is_of_curve);
        Self { problem, fitted, terms: rows.map(|(row, term)| (row, term.form.shape)).collect() }
    }

    /// True where drift at rest does not depend on temperature.
    pub(crate) fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Rows of the covariance with their weights at a temperature.
    pub(crate) fn weights(&self, celsius: f64) -> Vec<(usize, f64)> {
        let (span, reference) = (self.problem.span(), self.problem.inputs[0].reference);
        let weight = |shape: TermShape| shape.value(span, celsius) - shape.value(span, reference);
        self.terms.iter().map(|(row, shape)| (*row, weight(*shape))).collect()
    }

    /// Value, °/h, and variance at a temperature.
    pub(crate) fn at(&self, celsius: f64) -> (f64, f64) {
        let weights = self.weights(celsius);
        let value = weights.iter().map(|(row, weight)| self.fitted.theta[*row] * weight).sum();
        let covariance =
            |(i, a): &(usize, f64)| weights.iter().map(|(j, b)| a * b * self.fitted.covariance[(*i, *j)]).sum::<f64>();
        (value, weights.iter().map(covariance).sum::<f64>().max(0.0))
    }
}
