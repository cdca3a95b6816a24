//! What a model costs on the target: the slow update of the image that it becomes ([`sagnac_core::Work`]).

use sagnac_core::{Shape, Work};

use crate::model::spec::ModelSpec;

/// A tick of compensation between slews, instructions of a Cortex-M4F.
pub const TICK_INSTRUCTIONS: u32 = 46;
/// The form of [`Work::instructions`] is this close to what is counted, as a part.
pub const WITHIN: f64 = 0.02;

/// What the slow update has to do for a model that reads so many inputs.
pub fn work_of(model: &ModelSpec, inputs: usize) -> Work {
    let [bias, rated, scale] = model.image_terms();
    // What is not multiplied has, together, a term of order 0 that makes it zero at its references.
    let with_zero = |terms: usize| if terms > 0 { terms + 1 } else { 0 };
    let zones = u32::from(model.thermometer().zones.saturating_sub(1));
    let harmonics = model.inputs().iter().map(|terms| terms.harmonics.len() as u32).sum::<u32>();
    let turn = [Shape::Cosine { turns_q18: 0 }, Shape::Sine { turns_q18: 0 }].map(Shape::instructions);
    let shapes = zones * Shape::Zone { knot_q15: 0 }.instructions() + harmonics * turn.iter().sum::<u32>();
    let terms = with_zero(bias) + rated + with_zero(scale);
    Work { inputs: inputs as u32, lags: model.lags() as u32, terms: terms as u32, shapes }
}

/// With a warm-up next to it: an input, its lag, its term.
pub(crate) fn with_warm_up(work: Work) -> Work {
    Work { inputs: work.inputs + 1, lags: work.lags + 1, terms: work.terms + 1, ..work }
}
