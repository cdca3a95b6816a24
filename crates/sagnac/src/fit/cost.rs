//! What a model costs on the target, instructions of a Cortex-M4F.
//!
//! ```text
//! slow update = BASE + SERIES·[any term] + LAG·[any rate term] + TERM·(terms of bias, rate and scale)
//! tick        = TICK, whatever the model: the series is evaluated when a temperature arrives
//! ```
//!
//! The basis is evaluated to order 8 whatever is used of it, so that a term costs the same at any order. The figures are counts of
//! an emulated part (`cargo xtask firmware`, `-icount shift=0`), which holds this form against images of several models to within
//! [`WITHIN`]. Instructions are not cycles.

use crate::fit::model::ModelSpec;

/// A slow update without any term.
const BASE: f64 = 664.0;
/// More with any term.
const SERIES: f64 = 22.0;
/// More with a rate term: the lag filter and its rate.
const LAG: f64 = 163.0;
/// More with each term.
const TERM: f64 = 70.0;
/// A tick of compensation between slews.
pub const TICK_INSTRUCTIONS: u32 = 46;
/// The form is this close to what is counted, as a part.
pub const WITHIN: f64 = 0.02;

/// Instructions of a slow update with so many terms.
pub fn slow_update_instructions(model: ModelSpec) -> u32 {
    // A series that is not multiplied has a term of order 0 that makes it zero at T0.
    let with_zero = |order: u8| if order > 0 { usize::from(order) + 1 } else { 0 };
    let rates = model.rate.map_or(0, |order| usize::from(order) + 1);
    let terms = with_zero(model.bias) + rates + with_zero(model.scale);
    let series = if terms > 0 { SERIES } else { 0.0 };
    let lag = if model.rate.is_some() { LAG } else { 0.0 };
    (BASE + series + lag + TERM * terms as f64).round() as u32
}
