//! A gyro on a turntable: the rates of the table per window, and scale factor and bias plateau by plateau.

pub(crate) mod input;
mod plateau_noise;
pub(crate) mod plateaus;
mod turned_window;
