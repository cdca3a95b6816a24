//! Rows as the decoders make them: cells of the source, with the newest answer of each instrument, in typed columns.

use std::collections::HashMap;

use arrow_array::RecordBatch;
use sagnac_log::Result;
use sagnac_log::ingest::{Content, parse_value};
use sagnac_log::setup::{PollColumn, PollSetup};
use sagnac_log::write::CellColumns;
use sagnac_units::NS_PER_S;
use serde::Serialize;

/// An answer is no older than so many questions.
const FRESH_QUESTIONS: f64 = 3.0;
/// Events that are kept for those who show them.
const MOST_EVENTS: usize = 1000;

/// What a person should know, with its time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Event {
    /// Time of arrival, ns since 1970.
    pub at_ns: i64,
    /// What happened.
    pub what: String,
}

/// What was recorded, so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Rows.
    pub rows: u64,
    /// Bytes of the first source.
    pub bytes: u64,
    /// Bytes of it that are in no row: cut lines, damaged frames.
    pub lost_bytes: u64,
    /// Lines that have another number of fields than the headers.
    pub cut_lines: u64,
    /// Frames that are missing between those that came.
    pub missing_frames: u64,
}

/// An instrument's column.
pub(super) struct Polled {
    column: PollColumn,
    is_scpi: bool,
    fresh_ns: i64,
    /// The newest value as text, and its arrival.
    newest: Option<(String, i64)>,
}

impl Polled {
    pub(super) fn new(poll: &PollSetup, column: &PollColumn) -> Self {
        let fresh_ns = (FRESH_QUESTIONS * poll.every_s * NS_PER_S) as i64 + NS_PER_S as i64;
        Self { column: column.clone(), is_scpi: column.query.is_some(), fresh_ns, newest: None }
    }

    fn answer(&mut self, bytes: &[u8], at_ns: i64) {
        let value = if self.is_scpi { parse_value(bytes, false) } else { self.column.kind.value(bytes) };
        let value = value.map(|value| value * self.column.scale.unwrap_or(1.0)).filter(|value| value.is_finite());
        self.newest = value.map(|value| (value.to_string(), at_ns));
    }

    fn at(&self, at_ns: i64) -> &str {
        let fresh = self.newest.as_ref().filter(|(_, then)| at_ns.saturating_sub(*then) <= self.fresh_ns);
        fresh.map_or("", |(value, _)| value.as_str())
    }
}

/// Where rows go: the columns, once they are known.
pub(crate) struct Rows {
    /// `None` until the headers came.
    columns: Option<CellColumns>,
    metadata: HashMap<String, String>,
    pub(super) polled: Vec<Polled>,
    pub(crate) counts: Counts,
    pub(crate) events: Vec<Event>,
}

impl Rows {
    pub(super) fn new(metadata: HashMap<String, String>, polled: Vec<Polled>) -> Self {
        Self { columns: None, metadata, polled, counts: Counts::default(), events: Vec::new() }
    }

    /// An instrument has answered.
    pub(super) fn answer(&mut self, instrument: usize, bytes: &[u8], at_ns: i64) {
        self.polled.get_mut(instrument).into_iter().for_each(|polled| polled.answer(bytes, at_ns));
    }

    pub(super) fn columns(&self) -> Option<&CellColumns> {
        self.columns.as_ref()
    }

    /// The rows that wait; `None` before the headers.
    pub(super) fn take(&mut self) -> Result<Option<RecordBatch>> {
        self.columns.as_mut().map(CellColumns::take).transpose()
    }

    /// Names of the polled columns.
    pub(super) fn polled_names(&self) -> Vec<String> {
        self.polled.iter().map(|polled| polled.column.name.clone()).collect()
    }

    /// The columns of the source's own are known; those of the instruments, which are numbers, come behind them.
    pub(super) fn begin(&mut self, own: Vec<(String, Content)>, decimal_comma: bool) {
        let polled = self.polled.iter().map(|polled| (polled.column.name.clone(), Content::Number));
        let columns = own.into_iter().chain(polled).collect();
        self.columns = Some(CellColumns::new(columns, std::mem::take(&mut self.metadata), decimal_comma));
    }

    /// A row of the source's own cells.
    pub(super) fn row<C: AsRef<[u8]>>(&mut self, own: impl IntoIterator<Item = C>, at_ns: i64) {
        let Some(columns) = &mut self.columns else { return };
        let own = own.into_iter().map(OneOf::Own);
        let polled = self.polled.iter().map(|polled| OneOf::Polled(polled.at(at_ns)));
        columns.row(own.chain(polled));
        self.counts.rows += 1;
    }

    pub(crate) fn say(&mut self, at_ns: i64, what: impl Into<String>) {
        if self.events.len() == MOST_EVENTS {
            self.events.remove(0);
        }
        self.events.push(Event { at_ns, what: what.into() });
    }
}

/// A cell of the source, or of an instrument.
enum OneOf<'a, C> {
    Own(C),
    Polled(&'a str),
}

impl<C: AsRef<[u8]>> AsRef<[u8]> for OneOf<'_, C> {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Own(cell) => cell.as_ref(),
            Self::Polled(cell) => cell.as_bytes(),
        }
    }
}
