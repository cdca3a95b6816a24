//! Calibrations out to the target, and old coefficients in.

mod image;
mod polynomial;

pub use image::{encode, image_bytes};
pub use polynomial::{Polynomial, import};
