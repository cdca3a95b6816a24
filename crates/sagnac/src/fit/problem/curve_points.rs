//! The temperatures at which the spread of a curve is recorded: equal steps over the span of the fit.

use crate::fit::problem::least_squares::LeastSquares;

/// Temperatures at which the spread of a curve is recorded.
pub(crate) const POINTS: usize = 33;

/// Temperature of a point of the span.
pub(crate) fn temperature(problem: &LeastSquares<'_>, point: usize) -> f64 {
    let span = problem.span();
    span.lo + (span.hi - span.lo) * point as f64 / (POINTS - 1) as f64
}
