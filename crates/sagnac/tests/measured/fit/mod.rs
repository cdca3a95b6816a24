//! Are intervals, selection and forecasts of a calibration right?

mod at_rate;
pub(crate) mod coverage;
mod enough;
pub(crate) mod entanglement;
pub(crate) mod harmonics;
pub(crate) mod how_sure;
pub(crate) mod image_ranges;
mod irrelevant_inputs;
mod paper;
pub(crate) mod plan;
pub(crate) mod prior;
pub(crate) mod rate_table;
pub(crate) mod two_lags;
pub(crate) mod warm_up;
mod whole_noise;
