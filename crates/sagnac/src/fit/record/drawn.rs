//! What a report draws of a fit: its windows before and after, and the effect of each input.

use crate::calibration::RunOffset;
use crate::diagnostics::{AxisReportData, WindowPoint, points, run_spans};
use crate::fit::one_model::effects::Parts;
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::problem::rows::TermColumn;
use crate::model::ActsOn;
use std::collections::BTreeMap;

/// A used window, °/h.
#[derive(Clone, Copy)]
struct Shown {
    /// Minus its run offset; on a table also minus the effect of the scale factor on the rate. Neither is drift.
    before: f64,
    /// What the fit assigns to inputs other than the thermometer of the fit.
    inputs: f64,
    /// Residual of the fit.
    after: f64,
}

/// Every window of the axis, before less its run offset, after where the fit used it; and the effects.
pub(crate) fn drawn(
    fitted: &Fitted,
    problem: &LeastSquares<'_>,
    parts: &Parts<'_>,
    run_offsets: &[RunOffset],
    [axis, sensor]: [usize; 2],
) -> AxisReportData {
    let windows = problem.windows();
    let used = used_windows(fitted, problem, parts);
    let constant = |i: usize| {
        let run = windows.rows.run[i];
        run_offsets.iter().find(|offset| offset.run == run).map_or(f64::NAN, |offset| offset.value_dph)
    };
    // Rotation of a table is not drift: known for every used window, unknown for the others.
    let turned = problem.levels().iter().any(|level| matches!(level, Level::Scale | Level::Across(_)));
    let before = |i: usize| match turned {
        true => used.get(&i).map_or(f64::NAN, |shown| shown.before),
        false => windows.rate_dph(axis, i) - constant(i),
    };
    let after = |i: usize| used.get(&i).map_or(f64::NAN, |shown| shown.after);
    let points = points(windows, &run_spans(windows), Some(sensor), before, after).into_iter().enumerate();
    let inputs = |i: usize, point: &WindowPoint| used.get(&i).map_or(point.inputs_dph, |shown| shown.inputs);
    let points = points.map(|(i, point)| WindowPoint { inputs_dph: inputs(i, &point), ..point }).collect();
    AxisReportData { axis: windows.shape.axes[axis], points, effects: parts.effects() }
}

/// The windows of the fit by their place.
fn used_windows(fitted: &Fitted, problem: &LeastSquares<'_>, parts: &Parts<'_>) -> BTreeMap<usize, Shown> {
    let level = |row: usize| -> f64 {
        problem.levels().iter().zip(&fitted.theta).map(|(level, value)| problem.level(row, *level) * value).sum()
    };
    let of_scale = |term: &TermColumn| term.form.acts_on == ActsOn::ScaleFactor;
    let scaled = parts.made(|term| problem.turning.is_some() && of_scale(term));
    let inputs = parts.made(|term| !problem.is_main(term.input) && !of_scale(term));
    let shown = |row: usize| Shown {
        before: problem.y[row] - level(row) - scaled[row],
        inputs: inputs[row],
        after: fitted.residuals[row],
    };
    (0..problem.len()).map(|row| (problem.used[row], shown(row))).collect()
}
