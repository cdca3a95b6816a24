//! Delimited text: its head, and its lines as rows.

mod blanks;
mod expected;
pub(crate) mod head;
pub(crate) mod lines;
pub(crate) mod live_header;
mod plain;

use crate::error::Result;
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Open, Opened, Purpose};
use crate::ingest::columns::header::Layout;
use crate::ingest::text::head::TextHeader;
use crate::ingest::text::lines::TextFeed;
use crate::setup::Setup;

pub(crate) const OPEN: Option<Open> = Some(open);

/// Headers must be known ones, whatever the purpose: a preview searches for others itself.
fn open(mut source: Source, setup: &Setup, purpose: Purpose) -> Result<Opened> {
    let TextHeader { headers, columns, delimiter, lines, line, assumed } = head::read_header(&mut source, setup)?;
    let layout = Layout::new(headers, &columns, setup.axis).map_err(|e| e.line(line))?;
    let feed = Box::new(TextFeed::new(source.reader, &layout, delimiter, purpose.mode()));
    Ok(Opened { delimiter, lines_before: lines, assumed, ..Opened::new(feed, layout) })
}
