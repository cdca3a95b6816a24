//! The contract between the reader of a format and those who take its rows.
//!
//! ```text
//! bytes ─open▶ Opened: layout, Feed ─next (one at a time)▶ rows, or text ─Parser (any thread)▶ rows
//! ```

use crate::error::Result;
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::raw::RawRows;
use crate::setup::Setup;

/// Longest line of a log, and longest text of a field.
pub(crate) const MAX_LINE_BYTES: usize = 1 << 20;

/// How a log is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadMode {
    /// Large batches; the nominal interval from the first rows.
    Bulk,
    /// The same, and rows kept as text, for a log that is written out again.
    BulkWithText,
    /// A batch per row and rows kept as text: for a pipe that must answer line by line.
    LineByLine,
}

/// Where the rows of a log come from.
pub(crate) trait Feed: Send {
    /// Reads the next piece: its rows, or the text that a parser turns into them; false at the end.
    fn next(&mut self, text: &mut Vec<u8>, rows: &mut RawRows) -> Result<bool>;

    /// A parser for one thread; none where the pieces are rows.
    fn parser(&self) -> Option<Box<dyn Parser>> {
        None
    }
}

/// Turns the text of a piece into rows, whichever pieces came before.
pub(crate) trait Parser: Send {
    fn parse(&mut self, text: &[u8], rows: &mut RawRows);
}

/// Reads the header of a log of one format.
pub(crate) type Open = fn(Source, &Setup, Purpose) -> Result<Opened>;

/// Why a log is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To be read.
    Rows(ReadMode),
    /// To be looked at: its first rows as text, whatever its columns are for.
    Preview,
}

impl Purpose {
    pub(crate) fn mode(self) -> ReadMode {
        match self {
            Self::Rows(mode) => mode,
            Self::Preview => ReadMode::BulkWithText,
        }
    }
}

/// A log whose header has been read.
pub(crate) struct Opened {
    pub(crate) feed: Box<dyn Feed>,
    pub(crate) layout: Layout,
    pub(crate) delimiter: u8,
    pub(crate) lines_before: u64,
    pub(crate) assumed: Vec<String>,
}

impl Opened {
    /// As if one line of headers preceded the rows, and commas separated them.
    pub(crate) fn new(feed: Box<dyn Feed>, layout: Layout) -> Self {
        Self { feed, layout, delimiter: b',', lines_before: 1, assumed: Vec::new() }
    }
}
