//! What a model costs on the target, instructions of a Cortex-M4F.
//!
//! ```text
//! slow update = BASE + SERIES·[any term] + INPUT·(inputs − 1) + LAG·(lags) + TERM·(terms) + Σ price of each term's shape
//! tick        = TICK, whatever the model: the series is evaluated when a temperature arrives
//! ```
//!
//! The basis is evaluated to order 8 whatever is used of it, so that a term costs the same at any order. The figures are counts of
//! an emulated part (`cargo xtask firmware`, `-icount shift=0`), which holds this form against images of several models to within
//! [`WITHIN`]. Instructions are not cycles.

use sagnac_core::{Image, Shape};

use crate::model::shape::image_price;
use crate::model::spec::ModelSpec;

/// A slow update without any term.
const BASE: f64 = 670.0;
/// More with any term.
const SERIES: f64 = 8.0;
/// More with each thermometer, difference or column after the first.
const INPUT: f64 = 400.0;
/// More with each lag filter and its rate.
const LAG: f64 = 154.0;
/// More with each term, of whatever shape.
const TERM: f64 = 80.0;
/// A tick of compensation between slews.
pub const TICK_INSTRUCTIONS: u32 = 46;
/// The form is this close to what is counted, as a part.
pub const WITHIN: f64 = 0.02;

/// What a slow update has to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Thermometers, differences and columns.
    pub inputs: usize,
    /// Lag filters.
    pub lags: usize,
    /// Terms of any shape.
    pub terms: usize,
    /// Instructions that their shapes add.
    pub shapes: u32,
}

impl Work {
    /// Of a model that reads so many inputs.
    pub fn of_model(model: &ModelSpec, inputs: usize) -> Self {
        let [bias, rated, scale] = model.image_terms();
        // What is not multiplied has, together, a term of order 0 that makes it zero at its references.
        let with_zero = |terms: usize| if terms > 0 { terms + 1 } else { 0 };
        let zones = u32::from(model.thermometer().zones.saturating_sub(1));
        let harmonics = model.inputs().iter().map(|of| of.harmonics.len() as u32).sum::<u32>();
        let turn = [Shape::Cosine { turns_q18: 0 }, Shape::Sine { turns_q18: 0 }].map(image_price);
        let shapes = zones * image_price(Shape::Zone { knot_q15: 0 }) + harmonics * turn.iter().sum::<u32>();
        Self { inputs, lags: model.lags(), terms: with_zero(bias) + rated + with_zero(scale), shapes }
    }

    /// With a warm-up beside it: an input, its lag, its term.
    pub(crate) fn with_warm_up(self) -> Self {
        Self { inputs: self.inputs + 1, lags: self.lags + 1, terms: self.terms + 1, ..self }
    }

    /// Of an image.
    pub fn of_image(image: &Image) -> Self {
        Self {
            inputs: image.inputs().len(),
            lags: image.inputs().iter().filter(|t| t.lag.is_used()).count(),
            terms: image.terms().len(),
            shapes: image.terms().iter().map(|term| image_price(term.shape)).sum(),
        }
    }

    /// Instructions of a slow update.
    pub fn instructions(self) -> u32 {
        let series = if self.terms > 0 { SERIES } else { 0.0 };
        let others = INPUT * self.inputs.saturating_sub(1) as f64;
        let terms = TERM * self.terms as f64 + f64::from(self.shapes);
        (BASE + series + others + LAG * self.lags as f64 + terms).round() as u32
    }
}
