//! What a report draws of a fit: its windows before and after, and the effect of each input.

use crate::diagnostics::Effect;
use crate::fit::one_model::effects::Parts;
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::model::ActsOn;
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
}
