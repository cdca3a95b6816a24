//! What a report draws of a fit: its windows before and after, and the effect of each input.

use crate::calibration::AxisCalibration;
use crate::diagnostics::{Effect, WindowPoint, points, run_spans};
use crate::fit::one_model::effects::Parts;
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::ActsOn;
use crate::window::Windows;
use std::collections::BTreeMap;

/// A used window, °/h.
#[derive(Clone, Copy)]
pub(crate) struct Shown {
    /// Minus its run offset; on a table also minus the effect of the scale factor on the rate. Neither is drift.
    pub(crate) before: f64,
    /// What the fit assigns to inputs other than the thermometer of the fit.
    pub(crate) inputs: f64,
    /// Residual of the fit.
    pub(crate) after: f64,
}

/// What a report draws of a fit.
pub(crate) struct Drawn {
    pub(crate) windows: BTreeMap<usize, Shown>,
    pub(crate) effects: Vec<Effect>,
}

impl Drawn {
    pub(crate) fn of(fitted: &Fitted, problem: &LeastSquares<'_>, parts: &Parts<'_>) -> Self {
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
        let windows = (0..problem.len()).map(|row| (problem.used[row], shown(row))).collect();
        Self { windows, effects: parts.effects() }
    }

    /// Every window of the axis, before less its run offset, after where the fit used it.
    pub(crate) fn points(
        &self,
        record: &AxisCalibration,
        windows: &Windows,
        axis: usize,
        sensor: usize,
    ) -> Vec<WindowPoint> {
        let constant = |i: usize| {
            let run = windows.rows.run[i];
            record.run_offsets.iter().find(|offset| offset.run == run).map_or(f64::NAN, |offset| offset.value_dph)
        };
        // Rotation of a table is not drift: known for every used window, unknown for the others.
        let shown = |i: usize| self.windows.get(&i);
        let before = |i: usize| match record.turned() {
            true => shown(i).map_or(f64::NAN, |shown| shown.before),
            false => windows.rate_dph(axis, i) - constant(i),
        };
        let after = |i: usize| shown(i).map_or(f64::NAN, |shown| shown.after);
        let points = points(windows, &run_spans(windows), Some(sensor), before, after).into_iter().enumerate();
        let inputs = |i: usize, point: &WindowPoint| shown(i).map_or(point.inputs_dph, |shown| shown.inputs);
        points.map(|(i, point)| WindowPoint { inputs_dph: inputs(i, &point), ..point }).collect()
    }
}
