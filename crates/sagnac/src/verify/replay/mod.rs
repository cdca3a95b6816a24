//! A retest log through the images of a correction, row by row on the target's own code, next to the log as it is.

pub(crate) mod clocks;
pub(crate) mod column_of_input;
pub(crate) mod compensate;
pub(crate) mod correction;
pub(crate) mod flagged;
pub(crate) mod options;
pub(crate) mod paired;
pub(crate) mod tick_by_tick;
