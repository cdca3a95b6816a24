//! A fit as the calibration record.

pub(crate) mod axis;
mod drawn;
mod monomial;
mod scale_factor;
pub(crate) mod tradeoff;
