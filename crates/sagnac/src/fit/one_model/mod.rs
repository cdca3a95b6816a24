//! One model on one problem: its lags, coefficients and covariance, and what the fit makes of each input.

pub(crate) mod curve;
pub(crate) mod design;
pub(crate) mod effects;
pub(crate) mod input_noise;
mod movement;
pub(crate) mod prepared;
pub(crate) mod recorded;
pub(crate) mod reduce;
pub(crate) mod residual_noise;
pub(crate) mod solution;
pub(crate) mod two_lags;
pub(crate) mod warm_up;
