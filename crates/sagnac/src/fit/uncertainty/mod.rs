//! What selection and the design of the test add to the uncertainty of the curve.

pub(crate) mod curve_spread;
pub(crate) mod entanglement;
pub(crate) mod memory;
pub(crate) mod other_curves;
pub(crate) mod rate_left;
pub(crate) mod rivals;
pub(crate) mod soak;
pub(crate) mod whole_noise;
