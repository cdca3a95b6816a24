//! Calibrations out to the target, and old coefficients in.

mod c;
mod data_sheet;
mod polynomial;
mod verilog;

use std::path::Path;

use sagnac_log::error::{Error, Result};

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

    /// Refuses to replace a file with a name that any project has, a Makefile or a README, unless an export made it: then its first line
    /// is the same.
    ///
    /// # Errors
    /// There is such a file of another.
    pub fn check_place(&self, path: &Path) -> Result<()> {
        if self.name.contains('/') || self.name.starts_with("sagnac_") || self.name.starts_with("tb_") || !path.exists()
        {
            return Ok(());
        }
        let there = std::fs::read_to_string(path).unwrap_or_default();
        if there.lines().next() == self.text.lines().next() {
            return Ok(());
        }
        Err(Error::input("this file is not of an export, and would be replaced")
            .file(path.display().to_string())
            .help("export into a folder of its own"))
    }
}
