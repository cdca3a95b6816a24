//! From entries of the journal to rows: a function of the journal alone.
//!
//! ```text
//! bytes of source 0 ─text: lines ─┐
//!                   ─frames ──────┴▶ cells of a row ─▶ + newest answers of the instruments ─▶ typed columns
//! answers of instruments, each with its arrival ───────┘
//! ```
//!
//! A row has the newest answer of each instrument that had arrived when the row's bytes arrived, as long as it is not older than three questions. Rows
//! keep the times that the gyro gives them; where it gives none, or its clock begins again, the time of arrival carries on ([`ClockReport`]).

mod clock;
mod frames;
mod rows_made;
mod text;

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;
use sagnac_log::setup::LiveFormat;
use sagnac_log::write::CellColumns;
use sagnac_log::{Error, Result};

pub use clock::ClockReport;
pub use rows_made::{Counts, Event};

use crate::decode::frames::Frames;
use crate::decode::rows_made::{Polled, Rows};
use crate::decode::text::Text;
use crate::journal::{Entry, EntryKind};
use crate::source::{BytePlace, Connection};
use crate::start::Start;

enum Format {
    Text(Box<Text>),
    Frames(Box<Frames>),
}

/// Entries to rows.
pub struct Decoder {
    format: Format,
    rows: Rows,
    names: Vec<String>,
    place: BytePlace,
    /// A replay has the clock of its log, which is none next to the computer's.
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
        let mut rows = Rows::new(metadata, polled);
        let format = match setup.bench.format {
            LiveFormat::Text => Format::Text(Box::new(Text::new(setup, start.started_ns, &mut rows)?)),
            LiveFormat::Frames => Format::Frames(Box::new(Frames::new(setup, &mut rows)?)),
        };
        let has_clock = setup.bench.source.as_deref().is_none_or(|source| !source.starts_with("replay:"));
        Ok(Self { format, rows, has_clock, names: start.sources.clone(), place: BytePlace::default() })
    }

    /// The next entry.
    pub fn push(&mut self, entry: &Entry) {
        let at_ns = entry.arrival_ns;
        let text = || String::from_utf8_lossy(&entry.payload).into_owned();
        match (entry.kind, entry.source) {
            (EntryKind::Bytes, 0) => {
                self.rows.counts.bytes += entry.payload.len() as u64;
                self.place.follow(entry);
                match &mut self.format {
                    Format::Text(text) => text.push(&entry.payload, at_ns, &mut self.rows),
                    Format::Frames(frames) => frames.push(&entry.payload, at_ns, &mut self.rows),
                }
            }
            (EntryKind::Bytes, source) => {
                self.rows.answer(usize::from(source) - 1, &entry.payload, at_ns);
            }
            (EntryKind::Connected, source) => {
                if source == 0 {
                    self.connected(entry);
                }
                self.rows.say(at_ns, format!("connected: {}", Connection::of(entry).to));
            }
            (EntryKind::Lost, source) => {
                let name = self.names.get(usize::from(source)).map_or("", String::as_str);
                self.rows.say(at_ns, format!("{name} lost: {}", text()));
            }
            (EntryKind::Ended, source) => {
                self.flush();
                if let (Format::Text(text), 0) = (&mut self.format, source) {
                    text.ended(at_ns, &mut self.rows);
                }
                let name = self.names.get(usize::from(source)).cloned().unwrap_or_default();
                self.rows.say(at_ns, format!("{name} has ended"));
            }
            (EntryKind::Resumed, _) => {
                self.flush();
                self.rows.say(at_ns, "the recording goes on");
            }
            (EntryKind::Stopped, _) => {
                self.flush();
                self.rows.say(at_ns, "the recording was ended");
            }
            (EntryKind::Note, _) => self.rows.say(at_ns, text()),
            (EntryKind::Start, _) => {}
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
        self.rows.columns().map(CellColumns::schema)
    }

    /// Rows that wait.
    pub fn waiting(&self) -> usize {
        self.rows.columns().map_or(0, CellColumns::len)
    }

    /// The rows that wait; `None` before the headers.
    ///
    /// # Errors
    /// None that is known.
    pub fn take(&mut self) -> Result<Option<RecordBatch>> {
        self.rows.take()
    }

    /// What was recorded.
    pub fn counts(&self) -> Counts {
        self.rows.counts
    }

    /// What happened.
    pub fn events(&self) -> &[Event] {
        &self.rows.events
    }

    /// The gyro's clock next to that of arrival.
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
