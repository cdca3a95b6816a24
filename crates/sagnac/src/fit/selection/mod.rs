//! Which model: a given one checked, or `auto` from the grid over one thermometer and the search over all inputs.
//!
//! ```text
//! allowed inputs ─▶ nuisance (drift in time, warm-up) ─▶ grid (folds, grades) ─▶ search ─▶ what an image holds, and quiet thermometers
//! ```

pub(crate) mod allowed_inputs;
pub(crate) mod auto;
pub(crate) mod criterion;
pub(crate) mod folds;
pub(crate) mod given;
pub(crate) mod grades;
pub(crate) mod grid;
pub(crate) mod held_by_image;
pub(crate) mod nuisance;
pub(crate) mod period;
pub(crate) mod prices;
pub(crate) mod search;
pub(crate) mod selected;
pub(crate) mod warm_up;
