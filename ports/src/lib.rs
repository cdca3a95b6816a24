//! The target's program in C99 and Verilog: an image, and the table of the loops if there is one, become files of source text.
//!
//! ```text
//! Image, LoopTable ─┬─▶ c_files        c/*.h, c/*.c, constants of the unit, vectors and their check
//!                   └─▶ verilog_files  verilog/*.v, words for $readmemh
//! ```
//!
//! It knows the target (`sagnac-core`, `sagnac-loops`) and no fit. `cargo xtask c` and `cargo xtask fpga` check what it writes.

mod c;
mod unit_check;
mod verilog;

use std::path::Path;

pub use c::{FixedBias, Part, c_files};
pub use verilog::{hex_words, verilog_files};

/// One file of source text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextFile {
    /// Its name, below the folder of the export, with `/` between folders.
    pub name: String,
    /// Its text.
    pub text: String,
}

impl TextFile {
    fn new(name: &str, text: String) -> Self {
        Self { name: name.to_owned(), text }
    }

    /// False where `path` is a file with a name that any project has, a Makefile or a README, and no export made it: the first line of
    /// an export's own file is the same.
    pub fn may_replace(&self, path: &Path) -> bool {
        if self.name.contains('/') || self.name.starts_with("sagnac_") || self.name.starts_with("tb_") || !path.exists()
        {
            return true;
        }
        let there = std::fs::read_to_string(path).unwrap_or_default();
        there.lines().next() == self.text.lines().next()
    }
}
