//! A stated flight: the position error that the drift after correction makes.

pub(crate) mod position;
pub(crate) mod strapdown;
