//! The formats of a log: its first bytes, its name, and how it is opened. A new format is a row of [`FORMATS`].

use crate::error::{Error, Result};
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Open, Opened, Purpose};
use crate::ingest::{arrow, text, ulog};
use crate::setup::Setup;

/// A format of a log, without gzip.
pub(crate) struct Format {
    /// First bytes of a file; none for text.
    pub(crate) magic: &'static [u8],
    name: &'static str,
    /// None in a program that was built without it.
    open: Option<Open>,
}

/// Every format; text has no magic bytes and is therefore the last.
static FORMATS: [Format; 5] = [
    Format { magic: b"PAR1", name: "Apache Parquet", open: arrow::OPEN },
    Format { magic: b"ARROW1", name: "Arrow IPC file (Feather 2)", open: arrow::OPEN },
    // The stream form begins with a continuation mark.
    Format { magic: &[0xff; 4], name: "Arrow IPC stream", open: arrow::OPEN },
    Format { magic: b"ULog\x01\x12\x35", name: "PX4 ULog", open: ulog::OPEN },
    Format { magic: b"", name: "delimited text", open: text::OPEN },
];

impl Format {
    /// The format by its first bytes; anything unknown is text, whose reader refuses binary files.
    pub(crate) fn of(start: &[u8]) -> &'static Self {
        FORMATS.iter().find(|format| start.starts_with(format.magic)).unwrap_or(&FORMATS[FORMATS.len() - 1])
    }

    /// Reads the header of a log of this format.
    pub(crate) fn open(&self, source: Source, setup: &Setup, purpose: Purpose) -> Result<Opened> {
        let open = self.open.ok_or_else(|| Error::without(self.name))?;
        open(source, setup, purpose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_first_bytes() {
        for format in &FORMATS {
            let start = [format.magic, b"more"].concat();
            assert_eq!(Format::of(&start).name, format.name);
        }
        assert_eq!(Format::of(b"time_s,counts").name, "delimited text");
    }
}
