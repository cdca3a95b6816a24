//! Calibrations out to the target, and old coefficients in. C and Verilog are written by `sagnac-ports`.

mod data_sheet;
mod polynomial;

pub use crate::image::{Code, codes, encode, image_bytes};
pub use data_sheet::data_sheet;
pub use polynomial::{Polynomial, import};
