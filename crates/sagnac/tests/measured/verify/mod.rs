//! Can a bad unit be accepted, or a good one refused?

pub(crate) mod acceptance;
pub(crate) mod compare_limits;
pub(crate) mod copies;
pub(crate) mod counts;
pub(crate) mod faults;
mod hidden;
pub(crate) mod many_files;
mod memory;
mod reservations;
mod retest_intervals;
mod slow_bias;
mod sound;
mod still;
mod turn_ons;
pub(crate) mod turned;
