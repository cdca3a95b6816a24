//! The formats of a log: its first bytes, its name, and how it is opened. A new format is a row of [`FORMATS`].

use crate::error::Result;
#[cfg(feature = "parquet")]
use crate::ingest::arrow::columnar::MemoryTable;
#[cfg(feature = "parquet")]
use crate::ingest::bytes::source::HashHandle;
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Opened, ReadMode};
#[cfg(any(feature = "parquet", feature = "ulog"))]
use crate::ingest::columns::header::Layout;
use crate::ingest::text::head::{self, TextHeader};
use crate::ingest::text::lines::TextFeed;
use crate::setup::ReadConfig;

/// A format of a log, without gzip.
#[derive(Clone, Copy)]
pub struct Format {
    /// First bytes of a file; none for text.
    pub magic: &'static [u8],
    /// Its name.
    pub name: &'static str,
    open: fn(Source, &ReadConfig, ReadMode) -> Result<Opened>,
    /// The same with its rows as text, whatever its columns are for.
    unmapped: fn(Source, &ReadConfig) -> Result<Opened>,
}

/// Every format; text has no magic bytes and is therefore the last.
pub static FORMATS: [Format; 5] = [
    Format { magic: b"PAR1", name: "Apache Parquet", open: open_columns, unmapped: unmapped_columns },
    Format { magic: b"ARROW1", name: "Arrow IPC file (Feather 2)", open: open_columns, unmapped: unmapped_columns },
    // The stream form begins with a continuation mark.
    Format { magic: &[0xff; 4], name: "Arrow IPC stream", open: open_columns, unmapped: unmapped_columns },
    Format {
        magic: &[0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35],
        name: "PX4 ULog",
        open: open_ulog,
        unmapped: unmapped_ulog,
    },
    Format { magic: b"", name: "delimited text", open: open_text, unmapped: unmapped_text },
];

impl Format {
    /// The format by its first bytes; anything unknown is text, whose reader refuses binary files.
    pub fn of(start: &[u8]) -> &'static Self {
        FORMATS.iter().find(|format| start.starts_with(format.magic)).unwrap_or(&FORMATS[FORMATS.len() - 1])
    }

    /// Reads the header of a log of this format.
    pub(crate) fn open(&self, source: Source, config: &ReadConfig, mode: ReadMode) -> Result<Opened> {
        (self.open)(source, config, mode)
    }

    /// The same with its rows as text, whatever its columns are for. Of text the headers must be known ones: `sample` searches for others.
    pub(crate) fn open_unmapped(&self, source: Source, config: &ReadConfig) -> Result<Opened> {
        (self.unmapped)(source, config)
    }
}

fn open_text(mut source: Source, config: &ReadConfig, mode: ReadMode) -> Result<Opened> {
    let header = head::read_header(&mut source, config)?;
    let layout = head::layout_of(&header, config)?;
    let feed = Box::new(TextFeed::new(source.reader, &layout, header.delimiter, mode));
    let TextHeader { delimiter, lines, assumed, .. } = header;
    Ok(Opened { feed, layout, delimiter, lines_before: lines, assumed })
}

#[cfg(feature = "parquet")]
fn open_columns(source: Source, config: &ReadConfig, mode: ReadMode) -> Result<Opened> {
    let columnar = crate::ingest::arrow::columnar::open(source, config.memory)?;
    let layout = Layout::new(columnar.headers.clone(), &config.columns, config.axis)?;
    with_layout(columnar, layout, mode)
}

/// A table in memory.
#[cfg(feature = "parquet")]
pub(super) fn open_table(table: MemoryTable, hash: HashHandle, config: &ReadConfig, mode: ReadMode) -> Result<Opened> {
    let columnar = crate::ingest::arrow::columnar::of_table(table, hash, config.memory);
    let layout = Layout::new(columnar.headers.clone(), &config.columns, config.axis)?;
    with_layout(columnar, layout, mode)
}

/// Of the columns only a time of Arrow's own type has a role: so it becomes text as a date, or in seconds.
#[cfg(feature = "parquet")]
fn unmapped_columns(source: Source, config: &ReadConfig) -> Result<Opened> {
    let columnar = crate::ingest::arrow::columnar::open(source, config.memory)?;
    let layout = Layout { headers: columnar.headers.clone(), time: columnar.own_time(), ..Layout::default() };
    with_layout(columnar, layout, ReadMode::BulkWithText)
}

#[cfg(feature = "parquet")]
fn with_layout(columnar: crate::ingest::arrow::columnar::Columnar, layout: Layout, mode: ReadMode) -> Result<Opened> {
    let feed = Box::new(columnar.feed(&layout, mode)?);
    // As if one line of headers preceded the rows.
    Ok(Opened { feed, layout, delimiter: b',', lines_before: 1, assumed: Vec::new() })
}

#[cfg(feature = "ulog")]
fn open_ulog(source: Source, config: &ReadConfig, mode: ReadMode) -> Result<Opened> {
    let (feed, layout): (_, Layout) = crate::ingest::ulog::open(source, config, mode != ReadMode::Bulk)?;
    Ok(Opened { feed: Box::new(feed), layout, delimiter: b',', lines_before: 1, assumed: Vec::new() })
}

fn unmapped_text(source: Source, config: &ReadConfig) -> Result<Opened> {
    open_text(source, config, ReadMode::BulkWithText)
}

/// Its columns have Sagnac's names.
fn unmapped_ulog(source: Source, config: &ReadConfig) -> Result<Opened> {
    open_ulog(source, config, ReadMode::BulkWithText)
}

#[cfg(not(feature = "parquet"))]
fn unmapped_columns(source: Source, _: &ReadConfig) -> Result<Opened> {
    Err(crate::error::Error::without(Format::of(&source.start).name))
}

#[cfg(not(feature = "parquet"))]
fn open_columns(source: Source, _: &ReadConfig, _: ReadMode) -> Result<Opened> {
    Err(crate::error::Error::without(Format::of(&source.start).name))
}

#[cfg(not(feature = "ulog"))]
fn open_ulog(source: Source, _: &ReadConfig, _: ReadMode) -> Result<Opened> {
    Err(crate::error::Error::without(Format::of(&source.start).name))
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
