//! What a model costs on the target, instructions of a Cortex-M4F.
//!
//! ```text
//! slow update = BASE + SERIES·[any term] + INPUT·(inputs − 1) + LAG·(lags) + TERM·(terms) + ZONE·(zones) + HARMONIC·(harmonics)
//! tick        = TICK, whatever the model: the series is evaluated when a temperature arrives
//! ```
//!
//! The basis is evaluated to order 8 whatever is used of it, so that a term costs the same at any order. The figures are counts of
//! an emulated part (`cargo xtask firmware`, `-icount shift=0`), which holds this form against images of several models to within
//! [`WITHIN`]. Instructions are not cycles.

use sagnac_core::{Image, Shape};

use crate::model::spec::ModelSpec;

/// A slow update without any term.
const BASE: f64 = 670.0;
/// More with any term.
const SERIES: f64 = 20.0;
/// More with each thermometer, difference or column after the first.
const INPUT: f64 = 400.0;
/// More with each lag filter and its rate.
const LAG: f64 = 154.0;
/// More with each term, of whatever shape.
const TERM: f64 = 80.0;
/// More with each zone.
pub(crate) const ZONE: f64 = 8.0;
/// More with each harmonic: a cosine or a sine.
pub(crate) const HARMONIC: f64 = 126.0;
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
    /// Those of them that are zones.
    pub zones: usize,
    /// Those of them that are cosines or sines.
    pub harmonics: usize,
}

impl Work {
    /// Of a model that reads so many inputs.
    pub fn of_model(model: &ModelSpec, inputs: usize) -> Self {
        let [bias, rated, scale] = model.image_terms();
        // What is not multiplied has, together, a term of order 0 that makes it zero at its references.
        let with_zero = |terms: usize| if terms > 0 { terms + 1 } else { 0 };
        let zones = usize::from(model.thermometer().zones.saturating_sub(1));
        let harmonics = 2 * model.inputs().iter().map(|of| of.harmonics.len()).sum::<usize>();
        Self { inputs, lags: model.lags(), terms: with_zero(bias) + rated + with_zero(scale), zones, harmonics }
    }

    /// Of an image.
    pub fn of_image(image: &Image) -> Self {
        Self {
            inputs: image.inputs().len(),
            lags: image.inputs().iter().filter(|t| t.lag.is_used()).count(),
            terms: image.terms().len(),
            zones: image.terms().iter().filter(|term| matches!(term.shape, Shape::Zone { .. })).count(),
            harmonics: image.terms().iter().filter(|term| term.shape.turns_q18().is_some()).count(),
        }
    }

    /// Instructions of a slow update.
    pub fn instructions(self) -> u32 {
        let series = if self.terms > 0 { SERIES } else { 0.0 };
        let others = INPUT * self.inputs.saturating_sub(1) as f64;
        let shapes = TERM * self.terms as f64 + ZONE * self.zones as f64 + HARMONIC * self.harmonics as f64;
        (BASE + series + others + LAG * self.lags as f64 + shapes).round() as u32
    }
}
