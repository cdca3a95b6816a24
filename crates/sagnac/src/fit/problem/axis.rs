//! What all problems of one axis have in common.

use crate::fit::problem::rate_columns::CommonRates;
use crate::fit::problem::unit_prior::UnitPrior;
use crate::fit::progress::Progress;
use crate::rate_table::input::RateTableInput;
use crate::window::Windows;

/// One axis of some windows, and how it is looked at.
pub(crate) struct Axis<'a> {
    pub(crate) windows: &'a Windows,
    /// Place among the axes of the windows.
    pub(crate) index: usize,
    /// T0, °C.
    pub(crate) reference_c: f64,
    /// Span that a fit needs, °C.
    pub(crate) min_span_c: f64,
    /// Rates of the table, where the axis was on one.
    pub(crate) turning: Option<RateTableInput>,
    pub(crate) prior: Option<&'a UnitPrior>,
    /// Told what is being done.
    pub(crate) progress: Progress,
    pub(crate) common: CommonRates,
}

#[cfg(test)]
impl<'a> Axis<'a> {
    /// The first axis, at rest, T0 at 25 °C.
    pub(crate) fn at_rest(windows: &'a Windows) -> Self {
        Self {
            windows,
            index: 0,
            reference_c: 25.0,
            min_span_c: 1.0,
            turning: None,
            prior: None,
            progress: Progress::default(),
            common: CommonRates::default(),
        }
    }
}
