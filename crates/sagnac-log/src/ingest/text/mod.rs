//! Delimited text: its head, and its lines as rows.

mod expected;
pub(crate) mod head;
pub(crate) mod lines;
pub(crate) mod live_header;
mod plain;

use crate::error::Result;
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Open, Opened, Purpose};
use crate::ingest::text::head::TextHeader;
use crate::ingest::text::lines::TextFeed;
use crate::setup::ReadConfig;

pub(crate) const OPEN: Option<Open> = Some(open);

/// Headers must be known ones, whatever the purpose: a preview searches for others itself.
fn open(mut source: Source, config: &ReadConfig, purpose: Purpose) -> Result<Opened> {
    let header = head::read_header(&mut source, config)?;
    let layout = head::layout_of(&header, config)?;
    let feed = Box::new(TextFeed::new(source.reader, &layout, header.delimiter, purpose.mode()));
    let TextHeader { delimiter, lines, assumed, .. } = header;
    Ok(Opened { delimiter, lines_before: lines, assumed, ..Opened::new(feed, layout) })
}
