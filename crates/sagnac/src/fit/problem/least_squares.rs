//! One axis as a least-squares problem: its rows, the columns before the terms, and the lags that may be tried.
//!
//! A problem does not change: another set of columns is another problem on the same rows.

use crate::diagnostics::profile::{TOGETHER, rate_explained};
use crate::diagnostics::{points, run_spans};
use crate::fit::problem::axis::Axis;
use crate::fit::problem::levels::{Level, levels};
use crate::fit::problem::rows::AxisRows;
use crate::model::input::Signal;
use crate::noise_model::factor::RunColumns;
use crate::window::Windows;
use sagnac_log::error::Result;
use std::ops::Deref;
use std::sync::Arc;

/// From so many runs on, the columns of each run are reduced by themselves.
const MANY_RUNS: usize = 4;

/// The rows of an axis with some columns before the terms.
#[derive(Clone)]
pub(crate) struct LeastSquares<'a> {
    rows: Arc<AxisRows<'a>>,
    levels: Vec<Level>,
    tau_from: Vec<usize>,
    without_main_rate: bool,
}

/// A test that only heats: temperature explains its rate, and the steps of a thermometer decide which of the two a fit takes.
fn rate_is_temperature(windows: &Windows, signal: Signal) -> bool {
    let Signal::Thermometer(sensor) = signal else { return false };
    let profile = points(windows, &run_spans(windows), Some(sensor), |_| 0.0, |_| 0.0);
    rate_explained(&profile).is_some_and(|part| part > TOGETHER)
}

impl<'a> Deref for LeastSquares<'a> {
    type Target = AxisRows<'a>;

    fn deref(&self) -> &AxisRows<'a> {
        &self.rows
    }
}

impl<'a> LeastSquares<'a> {
    /// The windows in which all of `signals` are known; the first of them is the thermometer of the fit.
    ///
    /// # Errors
    /// As [`AxisRows::new`].
    pub(crate) fn new(axis: &Axis<'a>, signals: &[Signal]) -> Result<Self> {
        let rows = AxisRows::new(axis, signals)?;
        let levels = levels(rows.turning.as_ref(), &rows.used, &rows.run, rows.runs.len());
        let without_main_rate = signals.first().is_some_and(|signal| rate_is_temperature(axis.windows, *signal));
        Ok(Self { levels, tau_from: vec![0; rows.inputs.len()], without_main_rate, rows: Arc::new(rows) })
    }

    /// Columns before the terms of a model.
    pub(crate) fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// With other columns before the terms.
    pub(crate) fn with_levels(&self, levels: Vec<Level>) -> Self {
        Self { levels, ..self.clone() }
    }

    /// With further columns behind its own.
    pub(crate) fn with_further(&self, further: &[Level]) -> Self {
        self.with_levels([&self.levels, further].concat())
    }

    /// Without rate terms over the thermometer of the fit among those that are tried.
    pub(crate) fn without_main_rate(self) -> Self {
        Self { without_main_rate: true, ..self }
    }

    /// Per input: place in the grid of the shortest τ that is tried.
    pub(crate) fn tau_from(&self) -> &[usize] {
        &self.tau_from
    }

    /// With no τ of an input before a place in the grid: its noise requires it.
    pub(crate) fn with_tau_from(&self, input: usize, place: usize) -> Self {
        let mut slower = self.clone();
        slower.tau_from[input] = place.max(slower.tau_from[input]);
        slower
    }

    /// True where rate terms over the thermometer of the fit may be selected: nowhere if temperature explains its own rate.
    pub(crate) fn tries_main_rate(&self) -> bool {
        self.has_rate() && !self.without_main_rate
    }

    /// Which of the levels are zero outside a single run. Of few runs none is set apart: there is nothing to be gained.
    pub(crate) fn run_columns(&self) -> RunColumns {
        self.run_columns_of(|_| true)
    }

    /// The same of those levels alone that may be set apart; the others count as shared.
    pub(crate) fn run_columns_of(&self, may: impl Fn(Level) -> bool) -> RunColumns {
        let mut columns = RunColumns { own: vec![Vec::new(); self.runs.len()], shared: Vec::new() };
        for (column, level) in self.levels.iter().enumerate() {
            match level {
                Level::Run(run) | Level::Drift(Some(run)) if self.runs.len() >= MANY_RUNS && may(*level) => {
                    columns.own[*run].push(column);
                }
                _ => columns.shared.push(column),
            }
        }
        columns
    }

    /// Index of a level among the parameters.
    pub(crate) fn column_of(&self, level: Level) -> Option<usize> {
        self.levels.iter().position(|other| *other == level)
    }
}
