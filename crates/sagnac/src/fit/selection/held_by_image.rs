//! Whether an image can hold a fitted model: asked of the code that writes images, before a model is selected.

use crate::calibration::AxisCorrection;
use crate::fit::one_model::recorded::{recorded_inputs, terms};
use crate::fit::one_model::solution::Fitted;
use crate::fit::one_model::warm_up::value as warm_up_value;
use crate::fit::problem::least_squares::LeastSquares;
use crate::image::Holder;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::Setup;

/// Asks the code that writes images whether one can hold a fitted model.
#[derive(Clone, Copy)]
pub(crate) struct ImageCheck<'a> {
    pub(crate) windows: &'a Windows,
    pub(crate) setup: &'a Setup,
    /// Thermometer of the fit.
    pub(crate) sensor: usize,
    pub(crate) axis: char,
    pub(crate) holder: Holder,
    /// A warm-up since power-on is a part of the correction.
    pub(crate) corrects_warm_up: bool,
}

impl ImageCheck<'_> {
    /// # Errors
    /// What does not fit, as a refusal of the model.
    pub(crate) fn check(&self, fitted: &Fitted, problem: &LeastSquares<'_>) -> Result<()> {
        let inputs = recorded_inputs(fitted, None, problem, self.windows, self.setup, self.sensor);
        let terms = terms(fitted, problem, &inputs);
        let warm_up = self.corrects_warm_up.then(|| warm_up_value(problem, fitted)).flatten();
        let correction = AxisCorrection { model: fitted.spec.to_string(), inputs, terms, warm_up, fixed_bias: None };
        self.holder.check(self.axis, &correction).map_err(Error::as_refusal)
    }
}
