//! The values of a retest, axis by axis: before and after, residual, noise, bias and scale factor against the calibration.

pub(crate) mod before_after;
pub(crate) mod diagnostics;
pub(crate) mod judged_windows;
pub(crate) mod memory;
pub(crate) mod noise;
pub(crate) mod of_axis;
pub(crate) mod rate_table;
pub(crate) mod repeatability;
pub(crate) mod residual;
pub(crate) mod suspects;
