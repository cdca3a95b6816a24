//! The headers of a source that is read while it runs.
//!
//! A file begins with its headers; a serial port may be opened in the middle of a row. So each line is asked whether it is a line of headers,
//! by the rule of text logs ([`crate::ingest::text::head`]), until one is.

use crate::error::Result;
use crate::ingest::columns::header::Layout;
use crate::ingest::text::head::{layout_of, text_of};
use crate::setup::Setup;

/// The columns of a live source.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveHeader {
    /// Its columns by role.
    pub layout: Layout,
    /// What separates its fields.
    pub delimiter: u8,
}

impl LiveHeader {
    /// Reads a line of headers, which is UTF-8 or Windows-1252; `None` for a line that names no counts and no rates. `more` are columns behind those of
    /// the line.
    ///
    /// # Errors
    /// Headers that contradict each other or the setup.
    pub fn of_line(line: &[u8], more: &[String], setup: &Setup) -> Result<Option<Self>> {
        let text = text_of(line);
        let line = text.trim_start_matches('\u{feff}').trim();
        let layout = layout_of(line, more, setup)?;
        Ok(layout.map(|(layout, delimiter)| Self { layout, delimiter }))
    }

    /// Decimal commas are understood where no comma separates fields.
    pub fn has_decimal_comma(&self) -> bool {
        self.delimiter != b','
    }
}
