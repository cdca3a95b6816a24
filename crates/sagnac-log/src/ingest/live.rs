//! The headers of a source that is read while it runs.
//!
//! A file begins with its headers; a serial port may be opened in the middle of a row. So each line is asked whether it is a line of headers,
//! by the rule of text logs ([`crate::ingest::text_head`]), until one is.

use crate::error::Result;
use crate::ingest::header::Layout;
use crate::ingest::text_head::headers_of;
use crate::setup::ReadConfig;

/// The columns of a live source.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveHeader {
    /// Its columns by role.
    pub layout: Layout,
    /// What separates its fields.
    pub delimiter: u8,
}

impl LiveHeader {
    /// Reads a line of headers; `None` for a line that names no counts and no rates. A polled column may have its name in `[columns]`, too.
    ///
    /// # Errors
    /// Headers that contradict each other or the setup.
    pub fn of_line(line: &str, more: &[String], config: &ReadConfig) -> Result<Option<Self>> {
        let line = line.trim_start_matches('\u{feff}').trim();
        let Some((mut headers, delimiter)) = headers_of(line, config)? else { return Ok(None) };
        headers.extend(more.iter().cloned());
        Self::of_headers(headers, delimiter, config).map(Some)
    }

    /// Of known headers.
    ///
    /// # Errors
    /// As [`LiveHeader::of_line`].
    pub fn of_headers(headers: Vec<String>, delimiter: u8, config: &ReadConfig) -> Result<Self> {
        Ok(Self { layout: Layout::new(headers, &config.columns, config.axis)?, delimiter })
    }

    /// Decimal commas are understood where no comma separates fields.
    pub fn has_decimal_comma(&self) -> bool {
        self.delimiter != b','
    }
}
