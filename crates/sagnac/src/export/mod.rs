//! Calibrations out to the target, and old coefficients in.

mod c;
mod data_sheet;
mod polynomial;
mod verilog;

pub use crate::image::{Code, codes, encode, image_bytes};
pub use c::c_files;
pub use data_sheet::data_sheet;
pub use polynomial::{Polynomial, import};
pub use verilog::{hex_words, verilog_files};

/// One file of source text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextFile {
    /// Its name, below the folder of the export, with `/` between folders.
    pub name: String,
    /// What it holds.
    pub text: String,
}

impl TextFile {
    fn new(name: &str, text: String) -> Self {
        Self { name: name.to_owned(), text }
    }
}
