//! From entries of the journal to rows: a function of the journal alone.
//!
//! ```text
//! bytes of source 0 ─text: lines ─┐
//!                   ─frames ──────┴▶ cells of a row ─▶ + newest answers of the instruments ─▶ typed columns
//! answers of instruments, each with its arrival ───────┘
//! ```
//!
//! A row has the newest answer of each instrument that had arrived when the row's bytes arrived, as long as it is not older than three questions. Rows
//! keep the times that the gyro gives them; where it gives none, or its clock begins anew, the time of arrival carries on ([`ClockReport`]).

mod clock;
mod frames;
mod text;

use std::collections::HashMap;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use sagnac_log::ingest::{Content, parse_value};
use sagnac_log::setup::{LiveFormat, PollColumn, PollSetup};
use sagnac_log::write::CellColumns;
use sagnac_log::{Error, Result};
use sagnac_units::NS_PER_S;
use serde::Serialize;

pub use clock::ClockReport;

use crate::decode::frames::Frames;
use crate::decode::text::Text;
use crate::journal::{Entry, Kind};
use crate::source::{Connection, Place};
use crate::start::Start;

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
struct Polled {
    column: PollColumn,
    is_scpi: bool,
    fresh_ns: i64,
    /// The newest value as text, and its arrival.
    newest: Option<(String, i64)>,
}

impl Polled {
    fn new(poll: &PollSetup, column: &PollColumn) -> Self {
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
    polled: Vec<Polled>,
    pub(crate) counts: Counts,
    pub(crate) events: Vec<Event>,
}

impl Rows {
    /// Names of the polled columns.
    fn polled_names(&self) -> Vec<String> {
        self.polled.iter().map(|polled| polled.column.name.clone()).collect()
    }

    /// The columns of the source's own are known; those of the instruments, which are numbers, come behind them.
    fn begin(&mut self, own: Vec<(String, Content)>, decimal_comma: bool) {
        let polled = self.polled.iter().map(|polled| (polled.column.name.clone(), Content::Number));
        let columns = own.into_iter().chain(polled).collect();
        self.columns = Some(CellColumns::new(columns, std::mem::take(&mut self.metadata), decimal_comma));
    }

    /// A row of the source's own cells.
    fn row<C: AsRef<[u8]>>(&mut self, own: impl IntoIterator<Item = C>, at_ns: i64) {
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

enum Format {
    Text(Box<Text>),
    Frames(Box<Frames>),
}

/// Entries to rows.
pub struct Decoder {
    format: Format,
    rows: Rows,
    names: Vec<String>,
    place: Place,
    /// A replay has the clock of its log, which is none beside the computer's.
    has_clock: bool,
}

impl Decoder {
    /// Of a recording.
    ///
    /// # Errors
    /// Headers of the setup that are none.
    pub fn new(start: &Start) -> Result<Self> {
        let setup = &start.setup();
        let columns = setup.bench.polls.iter().flat_map(|poll| poll.columns.iter().map(move |column| (poll, column)));
        let polled: Vec<Polled> = columns.map(|(poll, column)| Polled::new(poll, column)).collect();
        let metadata = start.metadata();
        let mut rows = Rows { columns: None, metadata, polled, counts: Counts::default(), events: Vec::new() };
        let format = match setup.bench.format {
            LiveFormat::Text => Format::Text(Box::new(Text::new(setup, start.started_ns, &mut rows)?)),
            LiveFormat::Frames => Format::Frames(Box::new(Frames::new(setup, &mut rows)?)),
        };
        let has_clock = setup.bench.source.as_deref().is_none_or(|source| !source.starts_with("replay:"));
        Ok(Self { format, rows, has_clock, names: start.sources.clone(), place: Place::default() })
    }

    /// The next entry.
    pub fn push(&mut self, entry: &Entry) {
        let at_ns = entry.arrival_ns;
        let text = || String::from_utf8_lossy(&entry.payload).into_owned();
        match (entry.kind, entry.source) {
            (Kind::Bytes, 0) => {
                self.rows.counts.bytes += entry.payload.len() as u64;
                self.place.follow(entry);
                match &mut self.format {
                    Format::Text(text) => text.push(&entry.payload, at_ns, &mut self.rows),
                    Format::Frames(frames) => frames.push(&entry.payload, at_ns, &mut self.rows),
                }
            }
            (Kind::Bytes, source) => {
                let polled = self.rows.polled.get_mut(usize::from(source) - 1);
                polled.into_iter().for_each(|polled| polled.answer(&entry.payload, at_ns));
            }
            (Kind::Connected, source) => {
                if source == 0 {
                    self.connected(entry);
                }
                self.rows.say(at_ns, format!("connected: {}", Connection::of(entry).to));
            }
            (Kind::Lost, source) => {
                let name = self.names.get(usize::from(source)).map_or("", String::as_str);
                self.rows.say(at_ns, format!("{name} lost: {}", text()));
            }
            (Kind::Ended, source) => {
                self.flush();
                if let (Format::Text(text), 0) = (&mut self.format, source) {
                    text.ended(at_ns, &mut self.rows);
                }
                let name = self.names.get(usize::from(source)).cloned().unwrap_or_default();
                self.rows.say(at_ns, format!("{name} has ended"));
            }
            (Kind::Resumed, _) => {
                self.flush();
                self.rows.say(at_ns, "the recording goes on");
            }
            (Kind::Stopped, _) => {
                self.flush();
                self.rows.say(at_ns, "the recording was ended");
            }
            (Kind::Note, _) => self.rows.say(at_ns, text()),
            (Kind::Start, _) => {}
        }
    }

    /// Why there are no columns, where a line of headers could not be read.
    pub fn problem(&self) -> Option<&Error> {
        match &self.format {
            Format::Text(text) => text.problem(),
            Format::Frames(_) => None,
        }
    }

    /// A new connection: half a line of the old one is lost, unless the source goes on where it was.
    fn connected(&mut self, entry: &Entry) {
        let before = self.place.0;
        self.place.follow(entry);
        if self.place.0.is_some() && self.place.0 == before {
            return;
        }
        match &mut self.format {
            Format::Text(text) => text.connected(Connection::of(entry).may_be_cut, &mut self.rows),
            Format::Frames(frames) => frames.connected(&mut self.rows),
        }
    }

    /// A row that waits for more of its source gets none.
    fn flush(&mut self) {
        if let Format::Frames(frames) = &mut self.format {
            frames.flush(&mut self.rows);
        }
    }

    /// The columns, once the headers came.
    pub fn schema(&self) -> Option<SchemaRef> {
        self.rows.columns.as_ref().map(CellColumns::schema)
    }

    /// Rows that wait.
    pub fn waiting(&self) -> usize {
        self.rows.columns.as_ref().map_or(0, CellColumns::len)
    }

    /// The rows that wait; `None` before the headers.
    ///
    /// # Errors
    /// None that is known.
    pub fn take(&mut self) -> Result<Option<RecordBatch>> {
        self.rows.columns.as_mut().map(CellColumns::take).transpose()
    }

    /// What was recorded.
    pub fn counts(&self) -> Counts {
        self.rows.counts
    }

    /// What happened.
    pub fn events(&self) -> &[Event] {
        &self.rows.events
    }

    /// The gyro's clock beside that of arrival.
    pub fn clock(&self) -> ClockReport {
        if !self.has_clock {
            return ClockReport::default();
        }
        match &self.format {
            Format::Text(text) => text.clock(),
            Format::Frames(frames) => frames.clock(),
        }
    }
}
