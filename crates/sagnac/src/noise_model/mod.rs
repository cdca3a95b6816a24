//! Noise of rows that is not white; it knows no model of a gyro.
//!
//! ```text
//! rows ─▶ likelihood of a noise ─▶ estimate (which noise they show) ─▶ processes (its covariance), whitening (rows made independent)
//! ```

pub(crate) mod blocks;
pub(crate) mod estimate;
pub(crate) mod factor;
pub(crate) mod likelihood;
pub(crate) mod minimum;
pub(crate) mod processes;
pub(crate) mod stated;
pub(crate) mod whitening;
