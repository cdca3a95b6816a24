//! PX4 ULog: the gyro's topic as a table.
//!
//! ```text
//! messages ─▶ one row per message of sensor_gyro (else sensor_combined) of the chosen instance:
//!             time_us, rate_radps_x, _y, _z, temperature_c (its own), temperature_c_baro … (of other sensors)
//! ```
//!
//! The thermometer of another sensor fills its field in the first row logged after its message; other rows
//! leave it empty, as a slower thermometer does in text. Values are the log's 32-bit floats exactly.
//! A topic that is announced and has no message is passed over: the file is then read a second time for the next one.
//! A file that ends within a message, as after a power loss, gives one ragged row for it.
//!
//! `messages` splits the file. Only messages of topics that are read, all of them flat, go through
//! `px4-ulog`: it panics on some malformed records and follows nested formats without a limit.

mod messages;
mod topics;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{BufRead, BufReader};

use csv::ByteRecord;
use px4_ulog::stream_parser::file_reader::LogParser;
use px4_ulog::stream_parser::model::{DataMessage, UlogParseError};

use crate::error::{Error, Result};
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Feed, Open, Opened, Purpose, ReadMode};
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::raw::{BAD_TEMPERATURE, Faults, NO_TIME, RawRows, Slot};
use crate::ingest::ulog::messages::{Message, Messages, Next, appended_offsets};
use crate::ingest::ulog::topics::{Known, TEMPERATURE, TopicUse};
use crate::read::open_input;
use crate::setup::Setup;

/// Rows per piece.
const BATCH_ROWS: usize = 4096;
/// Longest message of a thermometer that is kept for the first row.
const MAX_READING_BYTES: usize = 4096;
const FILE_HEADER_BYTES: usize = 16;
pub(crate) const OPEN: Option<Open> = Some(open);

/// Reads up to the gyro's first message, which makes the layout known. Its columns have Sagnac's names, whatever the purpose.
///
/// # Errors
/// No ULog file, no message of a gyro, columns that the setup contradicts.
fn open(source: Source, setup: &Setup, purpose: Purpose) -> Result<Opened> {
    let instance = setup.instance.unwrap_or(0);
    let mut start = Start::read(source.reader, instance, &BTreeSet::new())?;
    if start.first.is_none() {
        let silent = start.known.silent(instance, &start.heard);
        let other = start.known.gyro(instance, &silent).filter(|(id, _)| start.heard.contains(id));
        let Some((id, _)) = other else { return Err(no_gyro(&start.known, instance)) };
        let Some(path) = source.plain_file else { return Err(silent_gyro(&start.known, id)) };
        let file = open_input(&path).map_err(|e| Error::io_path(&path, "open", &e))?;
        start = Start::read(Box::new(BufReader::new(file)), instance, &silent)?;
    }
    let Start { messages, header, known, early, first, .. } = start;
    let Some((first, gyro)) = first else { return Err(no_gyro(&known, instance)) };
    let (headers, topics) = columns(&known, gyro);
    let layout = Layout::new(headers, &setup.columns, setup.axis)?;
    let table = Table {
        slots: Slot::of_columns(&layout),
        layout: layout.clone(),
        topics,
        rows: RawRows::default(),
        waiting: Vec::new(),
        keep_fields: purpose.mode() != ReadMode::Bulk,
    };
    // A thermometer's message before the gyro's first one belongs to the first row.
    let waiting = early.into_values().chain([first]).collect();
    Ok(Opened::new(Box::new(ULogFeed { messages, header, known, table, waiting }), layout))
}

/// Rows of a file, piece by piece.
struct ULogFeed {
    messages: Messages,
    header: [u8; FILE_HEADER_BYTES],
    known: Known,
    table: Table,
    /// Messages that were read to learn the layout.
    waiting: VecDeque<Message>,
}

impl Feed for ULogFeed {
    /// Each piece has a parser of its own, which knows only the topics that are read.
    fn next(&mut self, _: &mut Vec<u8>, rows: &mut RawRows) -> Result<bool> {
        self.table.rows = std::mem::take(rows);
        self.table.rows.reset(&self.table.layout);
        let table = RefCell::new(&mut self.table);
        let mut on_data = |message: &DataMessage<'_>| table.borrow_mut().take(message);
        let mut parser = LogParser::default();
        parser.set_data_message_callback(&mut on_data);
        begin(&mut parser, &self.header, &self.known, &table.borrow().topics)?;
        while table.borrow().rows.len() < BATCH_ROWS {
            let next = match self.waiting.pop_front() {
                Some(message) => Next::Message(message),
                None => self.messages.next()?,
            };
            match next {
                Next::Message(message) if table.borrow().wants(&message) => {
                    if feed(&mut parser, message.kind, &message.payload).is_err() {
                        table.borrow_mut().push_broken_row();
                    }
                }
                Next::Message(_) => {}
                Next::Cut => table.borrow_mut().push_broken_row(),
                Next::End => break,
            }
        }
        *rows = table.borrow_mut().finished();
        Ok(rows.lines > 0)
    }
}

/// A file up to the gyro's first message.
struct Start {
    messages: Messages,
    header: [u8; FILE_HEADER_BYTES],
    known: Known,
    /// The newest message of every thermometer.
    early: BTreeMap<u16, Message>,
    /// The first message of the gyro, and what the gyro is; `None` at the file's end.
    first: Option<(Message, (u16, TopicUse))>,
    /// Message ids that have data.
    heard: BTreeSet<u16>,
}

impl Start {
    /// Reads on to the first message of the preferred gyro that is not `silent`.
    fn read(reader: Box<dyn BufRead + Send>, instance: u8, silent: &BTreeSet<u16>) -> Result<Self> {
        let (header, known, heard) = ([0; FILE_HEADER_BYTES], Known::default(), BTreeSet::new());
        let mut start =
            Self { messages: Messages::of(reader), header, known, early: BTreeMap::new(), first: None, heard };
        if start.messages.fill(&mut start.header)? < FILE_HEADER_BYTES {
            return Err(Error::damaged("ULog file: it ends in its header"));
        }
        loop {
            match start.messages.next()? {
                Next::Message(message) if message.kind == b'D' => {
                    let Some(id) = message.id() else { continue };
                    if let Some(gyro) = start.known.gyro(instance, silent).filter(|(gyro, _)| id == *gyro) {
                        start.first = Some((message, gyro));
                        return Ok(start);
                    }
                    start.heard.insert(id);
                    if message.payload.len() <= MAX_READING_BYTES && start.known.is_thermometer(id) {
                        start.early.insert(id, message);
                    }
                }
                Next::Message(message) if message.kind == b'B' => {
                    start.messages.appended = appended_offsets(&message.payload);
                }
                Next::Message(message) => start.known.learn(&message),
                Next::Cut | Next::End => return Ok(start),
            }
        }
    }
}

/// The table's headers, and the use of each topic that is read.
fn columns(known: &Known, gyro: (u16, TopicUse)) -> (Vec<String>, BTreeMap<u16, TopicUse>) {
    let mut headers: Vec<String> =
        ["time_us", "rate_radps_x", "rate_radps_y", "rate_radps_z"].map(str::to_owned).into();
    if matches!(gyro.1, TopicUse::Gyro(_, true)) {
        headers.push("temperature_c".to_owned());
    }
    let others = known.thermometers(gyro.0);
    let mut topics = BTreeMap::from([gyro]);
    for (id, name) in others {
        topics.insert(id, TopicUse::Thermometer(headers.len()));
        headers.push(format!("temperature_c_{name}"));
    }
    (headers, topics)
}

/// Declares to the parser the topics that are read, and nothing else.
fn begin(
    parser: &mut LogParser<'_>,
    header: &[u8; FILE_HEADER_BYTES],
    known: &Known,
    topics: &BTreeMap<u16, TopicUse>,
) -> Result<()> {
    parser.consume_bytes(header).map_err(|e| damaged(&e))?;
    // The parser needs flags before any subscription; these state that nothing was appended.
    feed(parser, b'B', &[0; 40])?;
    let subscriptions: Vec<_> = topics.keys().filter_map(|id| known.subscribed.get(id)).collect();
    let formats: BTreeSet<&str> = subscriptions.iter().map(|(topic, ..)| topic.as_str()).collect();
    for (format, _) in formats.into_iter().filter_map(|topic| known.formats.get(topic)) {
        feed(parser, b'F', format)?;
    }
    subscriptions.iter().try_for_each(|(.., subscription)| feed(parser, b'A', subscription))
}

fn feed(parser: &mut LogParser<'_>, kind: u8, payload: &[u8]) -> Result<()> {
    let mut whole = (payload.len() as u16).to_le_bytes().to_vec();
    whole.push(kind);
    whole.extend_from_slice(payload);
    parser.consume_bytes(&whole).map_err(|e| damaged(&e))
}

fn damaged(error: &UlogParseError) -> Error {
    Error::damaged(format!("ULog file: {}", error.description))
}

/// The gyro's messages as pending rows.
struct Table {
    layout: Layout,
    topics: BTreeMap<u16, TopicUse>,
    /// One per column.
    slots: Vec<Slot>,
    rows: RawRows,
    /// Readings of other thermometers since the last row, by column.
    waiting: Vec<(usize, f64)>,
    keep_fields: bool,
}

impl Table {
    fn wants(&self, message: &Message) -> bool {
        message.kind == b'D' && message.id().is_some_and(|id| self.topics.contains_key(&id))
    }

    fn take(&mut self, message: &DataMessage<'_>) {
        let float = |name: &str| -> f64 {
            let parser = message.flattened_format.get_field_parser::<f32>(name);
            parser.map_or(f64::NAN, |parser| f64::from(parser.parse(message.data)))
        };
        match self.topics.get(&message.msg_id) {
            Some(TopicUse::Gyro(fields, warm)) => {
                let time = message.flattened_format.timestamp_field.as_ref();
                let time_us = time.map(|field| field.parse_timestamp(message.data));
                let time_ns = time_us.and_then(|us| i64::try_from(us).ok()?.checked_mul(1000)).unwrap_or(NO_TIME);
                let rates = fields.map(float);
                let own = warm.then(|| float(TEMPERATURE));
                self.push_row(time_us.unwrap_or(0), time_ns, rates, own);
            }
            Some(TopicUse::Thermometer(column)) => self.waiting.push((*column, float(TEMPERATURE))),
            None => {}
        }
    }

    fn push_row(&mut self, time_us: u64, time_ns: i64, rates: [f64; 3], own_c: Option<f64>) {
        let mut row = vec![f64::NAN; self.layout.headers.len()];
        // A rate that is not a number is missing.
        row[1..4].copy_from_slice(&rates.map(|rate| if rate.is_finite() { rate } else { f64::NAN }));
        // A reading that is not a number differs from a missing one, as in text.
        let reading = |value: f64| if value.is_finite() { value } else { BAD_TEMPERATURE };
        own_c.into_iter().for_each(|value| row[4] = reading(value));
        self.waiting.drain(..).for_each(|(column, value)| row[column] = reading(value));
        if self.keep_fields {
            let text = |value: &f64| if value.is_nan() { String::new() } else { value.to_string() };
            let texts = std::iter::once(time_us.to_string()).chain(row[1..].iter().map(text));
            self.rows.fields.push(texts.map(String::into_bytes).collect());
        }
        self.push(&row, time_ns, Faults::NONE);
    }

    fn push_broken_row(&mut self) {
        self.push(&vec![f64::NAN; self.slots.len()], NO_TIME, Faults::RAGGED);
        if self.keep_fields {
            self.rows.fields.push(ByteRecord::new());
        }
    }

    /// A row of one value per column.
    fn push(&mut self, values: &[f64], time_ns: i64, faults: Faults) {
        for (slot, value) in self.slots.iter().zip(values) {
            self.rows.numbers(*slot).into_iter().for_each(|column| column.push(*value));
        }
        self.rows.finish_row(time_ns, faults);
        self.rows.line.push(self.rows.faults.len() as u32);
    }

    /// The pending rows.
    fn finished(&mut self) -> RawRows {
        let mut rows = std::mem::take(&mut self.rows);
        let lines = rows.len() as u64;
        rows.finish(&self.slots, lines);
        rows
    }
}

fn no_gyro(known: &Known, instance: u8) -> Error {
    let topics = known.topics();
    Error::input(
        format!("the ULog file has no messages of sensor_gyro or sensor_combined, instance {instance}"),
        if topics.is_empty() {
            "log sensor_gyro or sensor_combined in PX4".to_owned()
        } else {
            format!("log sensor_gyro or sensor_combined in PX4. The file has: {topics}")
        },
    )
}

/// The preferred gyro has no message, and what was read cannot be read again.
fn silent_gyro(known: &Known, id: u16) -> Error {
    let topic = known.subscribed.get(&id).map_or("another topic", |(topic, ..)| topic.as_str());
    Error::input(
        format!("the preferred gyro of the ULog file has no message, and {topic} has some"),
        "give it as an uncompressed file: a pipe is read once",
    )
}
