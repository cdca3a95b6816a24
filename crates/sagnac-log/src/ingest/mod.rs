//! Reads logs: from bytes to checked rows.
//!
//! ```text
//! Source (hash, gunzip, format) ─▶ ChunkReader (parsed in parallel: text, Parquet, Arrow, ULog) ─▶ Aligner
//!        (temperatures to the time of counts) ─▶ RowValidator (checked rows) ─▶ Batch
//! ```
//!
//! [`LogReader`] reads one file, batch by batch, and never holds the whole log. A file whose clock restarts while its running total
//! goes on can follow another one ([`LogReader::follow`]).

mod align;
#[cfg(feature = "parquet")]
mod arrow_file;
mod cells;
mod chunks;
#[cfg(feature = "parquet")]
mod column_values;
#[cfg(feature = "parquet")]
mod columnar;
mod counter;
mod expected;
mod foreign;
mod formats;
pub mod header;
mod interval;
mod iso;
mod live;
mod logs;
mod number;
#[cfg(feature = "parquet")]
mod parquet_file;
#[cfg(feature = "parquet")]
mod parquet_footer;
#[cfg(feature = "parquet")]
mod parquet_pages;
mod raw;
mod reason;
#[cfg(feature = "parquet")]
mod row_hash;
mod rows;
mod sample;

mod sketch;
mod source;
mod table;
mod text;
mod text_head;
mod thermometer;
#[cfg(feature = "parquet")]
mod thrift;
#[cfg(feature = "ulog")]
mod ulog;

use std::collections::VecDeque;
use std::path::Path;
use std::sync::mpsc::{channel, sync_channel};
use std::thread::Scope;

use crate::error::{Error, Result};
use crate::ingest::align::Aligner;
use crate::ingest::chunks::{ChunkReader, Feed};
#[cfg(feature = "parquet")]
pub use crate::ingest::column_values::{column_numbers, column_times, time_text};
#[cfg(feature = "parquet")]
pub use crate::ingest::columnar::MemoryTable;
pub use crate::ingest::formats::{FORMATS, Format};
use crate::ingest::header::Layout;
pub use crate::ingest::header::already_compensated;
use crate::ingest::interval::nominal_interval;
pub use crate::ingest::live::LiveHeader;
pub use crate::ingest::logs::Logs;
pub use crate::ingest::number::{parse_time_ns, parse_value};
#[cfg(feature = "parquet")]
pub use crate::ingest::parquet_file::{ParquetRead, parquet_batches, parquet_schema};
use crate::ingest::raw::{Faults, RawRows};
pub use crate::ingest::reason::{Reason, Tallies, Tally};
pub use crate::ingest::rows::CounterEnd;
use crate::ingest::rows::RowValidator;
pub use crate::ingest::sample::{Sample, SampleColumn, sample, sample_reader};
use crate::ingest::sketch::Sketch;
pub use crate::ingest::sketch::share_rows;
use crate::ingest::source::{HashHandle, Source};
pub use crate::ingest::source::{Watch, hex, sha256, sha256_of_file};
pub use crate::ingest::table::TableColumn;
use crate::ingest::table::TableRates;
pub use crate::ingest::text::COMPENSATED_STAMP;
pub use crate::ingest::text::{fields_of, unquoted};
use crate::setup::{Counter, ReadConfig, Setup};
use crate::threads::{helpers, spawn_in};
use sagnac_units::ns_from_s;

/// What one unit of an angle column is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AngleUnit {
    /// A count log: whole quanta of `arcsec_per_count · quantum` arcsec.
    Quanta {
        /// Nominal scale factor S0, arcsec per count.
        arcsec_per_count: f64,
        /// Counts per quantum.
        quantum: f64,
    },
    /// A rate log: arcsec (rate × interval).
    Arcsec,
}

impl AngleUnit {
    /// arcsec per unit of an angle column.
    pub fn arcsec(self) -> f64 {
        match self {
            Self::Quanta { arcsec_per_count, quantum } => arcsec_per_count * quantum,
            Self::Arcsec => 1.0,
        }
    }
}

/// What a log consists of; the same for every batch of it.
#[derive(Clone, Debug, PartialEq)]
pub struct LogShape {
    /// Axis letters, in the order of `Batch::angle`.
    pub axes: Vec<char>,
    /// Thermometer names, in the order of `Batch::temperature_c`.
    pub thermometers: Vec<String>,
    /// Names of auxiliary columns.
    pub aux: Vec<String>,
    /// Unit of `Batch::angle`.
    pub unit: AngleUnit,
    /// False for a table without time: intervals are then nominal.
    pub timed: bool,
    /// Nominal interval of a row, ns.
    pub nominal_ns: i64,
    /// There is a reference-rate column.
    pub has_reference: bool,
    /// Headers that are not read.
    pub ignored: Vec<String>,
}

/// Shortest time without rows over which temperatures are interpolated, ns.
const GAP_NS: i64 = 60_000_000_000;
/// Batches that are passed on before a thread is started for them.
const BATCHES_ALONE: usize = 2;

/// Logs that can be analysed together: the same axes, thermometers, units and row interval.
///
/// # Errors
/// What differs.
pub fn same_shape(first: &LogShape, other: &LogShape) -> Result<()> {
    let differs = |what: &str| Err(Error::input(format!("{what} differ from those of the first log")));
    if first.axes != other.axes {
        return differs("axes");
    }
    if first.thermometers != other.thermometers || first.aux != other.aux {
        return differs("thermometers or auxiliary columns");
    }
    if first.unit != other.unit || first.timed != other.timed {
        return differs("units (counts or rates, with or without time)");
    }
    let ratio = first.nominal_ns as f64 / other.nominal_ns as f64;
    if !(0.9..1.1).contains(&ratio) {
        return differs("row intervals");
    }
    Ok(())
}

impl LogShape {
    /// Intervals that a row covers: more than one for a cumulative counter with missing rows in between.
    pub fn intervals(&self, start_ns: i64, end_ns: i64) -> u64 {
        intervals_of(end_ns - start_ns, self.nominal_ns).unsigned_abs()
    }

    /// The same for the usual row: true where [`LogShape::intervals`] is 1.
    #[inline]
    pub fn is_one_interval(&self, start_ns: i64, end_ns: i64) -> bool {
        let nominal_ns = self.nominal_ns.max(1);
        end_ns - start_ns <= nominal_ns + nominal_ns / 2
    }

    /// Between the stamps of two rows temperatures were not read for so long that the older ones say little of it: more than three intervals, and a minute.
    pub fn is_gap(&self, from_ns: i64, to_ns: i64) -> bool {
        let length_ns = to_ns.saturating_sub(from_ns);
        length_ns >= GAP_NS && length_ns > self.nominal_ns.saturating_mul(3)
    }
}

/// Nominal intervals in a length of time: up to one and a half count as one, since they are no gap.
pub(crate) fn intervals_of(length_ns: i64, nominal_ns: i64) -> i64 {
    let nominal_ns = nominal_ns.max(1);
    (length_ns - nominal_ns / 2 + nominal_ns - 1).div_euclid(nominal_ns).max(1)
}

/// Counts of a cumulative counter over a gap (start, end] between two rows of a batch. The gap is too long for a row, because the
/// temperature within it is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Bridge {
    /// Rows of the batch before it.
    pub before_row: usize,
    /// Start, ns.
    pub start_ns: i64,
    /// End, ns.
    pub end_ns: i64,
    /// Line of the total at its end.
    pub line: u64,
    /// Per axis, in `LogShape::unit`.
    pub angle: Vec<f64>,
}

/// Columns of usable rows. A row covers (start, end].
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Start of each row's interval, ns.
    pub start_ns: Vec<i64>,
    /// End of each row's interval: the row's own time, ns.
    pub end_ns: Vec<i64>,
    /// Per axis: angle of the interval in `LogShape::unit`.
    pub angle: Vec<Vec<f64>>,
    /// Per thermometer: °C, NaN where missing or invalid.
    pub temperature_c: Vec<Vec<f64>>,
    /// Per auxiliary column; NaN where missing.
    pub aux: Vec<Vec<f64>>,
    /// Rate of the table, °/s; NaN where missing, empty without such a column.
    pub reference_dps: Vec<f64>,
    /// The log's own flag; true without one.
    pub valid: Vec<bool>,
    /// Line in the file, from 1.
    pub line: Vec<u64>,
    /// The row's fields as text (empty with [`ReadMode::Bulk`]).
    pub fields: Vec<::csv::ByteRecord>,
    /// Counts of a cumulative counter over gaps that are too long for a row.
    pub bridges: Vec<Bridge>,
    pub(crate) checked_c: Vec<f64>,
}

impl Batch {
    /// Rows in it.
    pub fn len(&self) -> usize {
        self.end_ns.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.end_ns.is_empty()
    }

    fn for_shape(shape: &LogShape) -> Self {
        Self {
            angle: vec![Vec::new(); shape.axes.len()],
            temperature_c: vec![Vec::new(); shape.thermometers.len()],
            aux: vec![Vec::new(); shape.aux.len()],
            ..Self::default()
        }
    }

    fn clear(&mut self) {
        self.start_ns.clear();
        self.end_ns.clear();
        self.reference_dps.clear();
        self.valid.clear();
        self.line.clear();
        self.fields.clear();
        self.bridges.clear();
        for column in self.angle.iter_mut().chain(&mut self.temperature_c).chain(&mut self.aux) {
            column.clear();
        }
    }

    fn push(&mut self, start_ns: i64, end_ns: i64, angles: &[f64], rows: &RawRows, at: usize) {
        self.start_ns.push(start_ns);
        self.end_ns.push(end_ns);
        self.valid.push(!rows.faults[at].has(Faults::FLAGGED));
        self.line.push(rows.line_of(at));
        let columns = self.angle.iter_mut().zip(angles).chain(self.temperature_c.iter_mut().zip(&self.checked_c));
        columns.for_each(|(column, value)| column.push(*value));
        self.aux.iter_mut().zip(&rows.aux).for_each(|(column, values)| column.push(values[at]));
        self.reference_dps.extend(rows.reference_dps.get(at));
        self.fields.extend(rows.fields.get(at).cloned());
    }
}

/// Summary of a log, complete when the log has been read to its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogSummary {
    /// File name as given.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Rows read, usable or not.
    pub rows: u64,
    /// Rejected rows and values, by reason.
    pub tallies: Tallies,
    /// Hashes of its rows, by which a copy in other bytes is recognised ([`share_rows`]); empty where it says too little.
    pub rows_sketch: String,
    /// Its clock restarts and its running total goes on: its times go on from the file before.
    pub follows_by_counter: bool,
}

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

/// Content of a column of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Whole nanoseconds.
    Nanoseconds,
    /// A number.
    Number,
    /// Anything.
    Text,
}

/// A log being read.
pub struct LogReader {
    pieces: ChunkReader,
    layout: Layout,
    delimiter: u8,
    check: RowValidator,
    shape: LogShape,
    batch: Batch,
    rows: RawRows,
    ahead: VecDeque<RawRows>,
    align: Aligner,
    table: TableRates,
    hash: HashHandle,
    sketch: Sketch,
    name: String,
    /// Added to every time: not zero where it follows another file by its counter.
    offset_ns: Option<i64>,
    assumed: Vec<String>,
}

impl LogReader {
    /// What had to be assumed of the text, a sentence each: its encoding, lines above the headers, units.
    pub fn assumed(&self) -> &[String] {
        &self.assumed
    }

    /// Opens a log; `-` is standard input.
    ///
    /// # Errors
    /// Unreadable, binary, no header, headers that say nothing or contradict the setup, no scale
    /// factor for counts, no interval.
    pub fn open(path: impl AsRef<Path>, setup: &Setup, mode: ReadMode) -> Result<Self> {
        Self::open_watched(path.as_ref(), setup, mode, None)
    }

    /// The same; calls `watch` with the number of bytes read from the file.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn open_watched(path: &Path, setup: &Setup, mode: ReadMode, watch: Option<Watch>) -> Result<Self> {
        Self::from_source(Source::open(path, watch)?, setup, mode)
    }

    /// Reads a log from bytes that come from anywhere; `name` is used in messages.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn from_reader(
        name: &str,
        reader: Box<dyn std::io::Read + Send>,
        setup: &Setup,
        mode: ReadMode,
    ) -> Result<Self> {
        Self::from_source(Source::from_reader(name.to_owned(), reader)?, setup, mode)
    }

    /// Reads a table in memory, batch by batch. Its columns have the names and types of a Parquet log's; a line of headers is counted before
    /// its first row. The hash in its summary is that of the rows' values (`row_hash.rs` has the definition), complete at the end.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    #[cfg(feature = "parquet")]
    pub fn from_table(table: MemoryTable, setup: &Setup, mode: ReadMode) -> Result<Self> {
        let (name, hash) = (table.name.clone(), HashHandle::default());
        let config = setup.stages().read;
        let opened = formats::open_table(table, hash.clone(), &config, mode);
        opened.and_then(|opened| Self::start(opened, &name, hash, &config, mode)).map_err(|e| e.file(name))
    }

    fn from_source(source: Source, setup: &Setup, mode: ReadMode) -> Result<Self> {
        let (name, hash) = (source.name.clone(), source.hash.clone());
        let config = setup.stages().read;
        let opened = source.format.open(source, &config, mode);
        opened.and_then(|opened| Self::start(opened, &name, hash, &config, mode)).map_err(|e| e.file(name))
    }

    fn start(opened: Opened, name: &str, hash: HashHandle, config: &ReadConfig, mode: ReadMode) -> Result<Self> {
        let Opened { feed, layout, delimiter, lines_before, assumed } = opened;
        let mut pieces = ChunkReader::new(feed, lines_before, mode != ReadMode::LineByLine);
        let unit = angle_unit(&layout, config)?;
        let mut ahead = VecDeque::new();
        let nominal_ns = nominal_interval(&mut pieces, &layout, config, mode, &mut ahead)?;
        let shape = LogShape {
            axes: layout.axes.iter().map(|(_, axis, _)| *axis).collect(),
            thermometers: layout.temperatures.iter().map(|(_, name, _)| name.clone()).collect(),
            aux: layout.aux.iter().map(|(_, name)| name.clone()).collect(),
            unit,
            timed: layout.time.is_some(),
            nominal_ns,
            has_reference: layout.reference.is_some(),
            ignored: layout.ignored.clone(),
        };
        let check = RowValidator::new(name.to_owned(), &layout, config, nominal_ns);
        // For a pipe, no row was known when the interval was given.
        let watched = mode == ReadMode::LineByLine && config.sample_interval_s.is_some();
        let check = if watched { check.watching_interval() } else { check };
        let batch = Batch::for_shape(&shape);
        let align = Aligner::new(ns_from_s(config.temperature_offset_s).unwrap_or(0));
        let rows = RawRows::default();
        let column = layout.reference.map_or(TableColumn::Rate, |(_, column)| column);
        // Output that is written row by row must not wait for table marks; only fits and verifications need them.
        let column = if mode != ReadMode::Bulk && column == TableColumn::Mark { TableColumn::Rate } else { column };
        let table = TableRates::new(column);
        let sketch = Sketch::new(shape.axes.clone());
        Ok(Self {
            pieces,
            layout,
            delimiter,
            check,
            shape,
            batch,
            rows,
            ahead,
            align,
            table,
            hash,
            sketch,
            name: name.to_owned(),
            offset_ns: None,
            assumed,
        })
    }

    /// Where a cumulative counter stands once the log was read to its end; `None` for other logs.
    pub fn counter_end(&self) -> Option<CounterEnd> {
        self.check.counter_end()
    }

    /// Goes on from the end of another file, before the first batch is read: true where the clock restarts and the running total of
    /// the first row goes on within what one interval can bring. A total near zero is no evidence, for a counter that began anew stands
    /// there as well; `sure` goes on all the same.
    ///
    /// # Errors
    /// A read error.
    pub fn follow(&mut self, end: &CounterEnd, sure: bool) -> Result<bool> {
        if self.ahead.is_empty() {
            let mut rows = RawRows::default();
            if self.pieces.next(&mut rows).map_err(|e| e.file(&self.name))? {
                self.ahead.push_back(rows);
            }
        }
        let first = self.ahead.front().filter(|rows| rows.len() > 0);
        self.offset_ns = first.and_then(|rows| self.check.follow(end, rows, sure));
        Ok(self.offset_ns.is_some())
    }

    /// What the log consists of.
    pub fn shape(&self) -> &LogShape {
        &self.shape
    }

    /// Headers as in the file.
    pub fn headers(&self) -> &[String] {
        &self.layout.headers
    }

    /// The delimiter between fields; a comma for binary formats.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// Column index of each axis.
    pub fn axis_columns(&self) -> Vec<usize> {
        self.layout.axes.iter().map(|(index, ..)| *index).collect()
    }

    /// Indices of the columns that are read.
    pub fn columns_read(&self) -> Vec<usize> {
        self.layout.columns_read()
    }

    /// °/h per unit of each rate column; `None` for counts.
    pub fn rate_units(&self) -> Vec<Option<f64>> {
        self.layout.axes.iter().map(|(.., unit)| *unit).collect()
    }

    /// Content of a column.
    #[cfg(feature = "parquet")]
    pub fn content_of(&self, index: usize) -> Content {
        self.layout.content_of(index)
    }

    /// The next batch, or `None` at the end. A batch may be empty (its rows were all rejected).
    ///
    /// # Errors
    /// A read error, or a line that makes the whole log unusable.
    pub fn next_batch(&mut self) -> Result<Option<&Batch>> {
        if !self.table.waits() {
            let more = self.read_batch()?;
            self.table.convert(&mut self.batch);
            forget_impossible(&mut self.batch.reference_dps);
            return Ok(more.then_some(&self.batch));
        }
        loop {
            if let Some(batch) = self.table.ready() {
                self.batch = batch;
                forget_impossible(&mut self.batch.reference_dps);
                return Ok(Some(&self.batch));
            }
            if self.read_batch()? {
                self.table.push(self.batch.clone());
            } else if !self.table.end() {
                return Ok(None);
            }
        }
    }

    /// Reads to the end. `take` gets every batch, in order; on a thread of its own where one may be had, so that the next rows are
    /// read meanwhile. The result does not depend on it.
    ///
    /// # Errors
    /// As [`LogReader::next_batch`]; the first of `take`.
    pub fn for_each_batch(&mut self, mut take: impl FnMut(&Batch) -> Result<()> + Send) -> Result<()> {
        // A short log needs no thread.
        for _ in 0..BATCHES_ALONE {
            match self.next_batch()? {
                Some(batch) => take(batch)?,
                None => return Ok(()),
            }
        }
        if helpers(1) > 0
            && let Some(done) = std::thread::scope(|scope| self.pass_on(scope, &mut take))
        {
            return done;
        }
        while let Some(batch) = self.next_batch()? {
            take(batch)?;
        }
        Ok(())
    }

    /// Passes the batches to a thread; `None` where the machine allows no further one.
    fn pass_on<'scope>(
        &mut self,
        scope: &'scope Scope<'scope, '_>,
        take: &'scope mut (impl FnMut(&Batch) -> Result<()> + Send),
    ) -> Option<Result<()>> {
        let (full, batches) = sync_channel::<Batch>(1);
        let (back, used) = channel();
        let thread = spawn_in(scope, "take", move || {
            batches.into_iter().try_for_each(|batch| {
                take(&batch)?;
                // Nobody waits for the last ones.
                let _ = back.send(batch);
                Ok(())
            })
        })
        .ok()?;
        let read = loop {
            match self.next_batch() {
                Ok(Some(_)) => {}
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            }
            let empty = used.try_recv().unwrap_or_else(|_| Batch::for_shape(&self.shape));
            // It ends early only with an error of its own.
            if full.send(std::mem::replace(&mut self.batch, empty)).is_err() {
                break Ok(());
            }
        };
        drop(full);
        // Its error is of earlier rows.
        Some(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(read))
    }

    /// The next rows into `self.batch`; false at the end.
    fn read_batch(&mut self) -> Result<bool> {
        self.batch.clear();
        if !self.next_rows()? {
            return Ok(false);
        }
        self.check.push(&self.rows, &mut self.batch)?;
        self.sketch.push(&self.batch, self.shape.unit != AngleUnit::Arcsec);
        Ok(true)
    }

    /// The next piece into `self.rows`, with the temperatures that belong to it; false at the end.
    fn next_rows(&mut self) -> Result<bool> {
        if self.align.is_straight() {
            return self.next_piece();
        }
        loop {
            if let Some(rows) = self.align.ready() {
                self.rows = rows;
                return Ok(true);
            }
            if self.align.ended() {
                return Ok(false);
            }
            if self.next_piece()? {
                self.align.push(std::mem::take(&mut self.rows));
            } else {
                self.align.end();
            }
        }
    }

    /// The next piece of the file into `self.rows`.
    fn next_piece(&mut self) -> Result<bool> {
        let more = match self.ahead.pop_front() {
            Some(rows) => {
                self.rows = rows;
                true
            }
            None => self.pieces.next(&mut self.rows).map_err(|e| e.file(&self.name))?,
        };
        if let Some(offset_ns) = self.offset_ns {
            let known = self.rows.time_ns.iter_mut().filter(|t| t.unsigned_abs() < rows::MAX_TIME);
            known.for_each(|t| *t = t.saturating_add(offset_ns));
        }
        Ok(more)
    }

    /// Summary of what was read so far.
    pub fn summary(&self) -> LogSummary {
        LogSummary {
            file: self.name.clone(),
            sha256: self.hash.hex(),
            rows: self.check.rows_read,
            tallies: self.check.tallies.clone(),
            rows_sketch: self.sketch.hex(),
            follows_by_counter: self.offset_ns.is_some(),
        }
    }
}

/// A rate of the table that is none is missing.
fn forget_impossible(reference_dps: &mut [f64]) {
    reference_dps.iter_mut().filter(|rate| rate.abs() > rows::MAX_RATE_DPS).for_each(|rate| *rate = f64::NAN);
}

/// A log whose header has been read.
pub(crate) struct Opened {
    feed: Feed,
    layout: Layout,
    delimiter: u8,
    lines_before: u64,
    assumed: Vec<String>,
}

fn angle_unit(layout: &Layout, config: &ReadConfig) -> Result<AngleUnit> {
    if !layout.is_count_log() {
        if config.counter == Counter::Cumulative {
            return Err(Error::input("a cumulative counter is set up, but the log holds rates").column("counter"));
        }
        return Ok(AngleUnit::Arcsec);
    }
    let arcsec_per_count = config.arcsec_per_count.ok_or_else(|| {
        Error::input("the log holds counts, but the size of a count in arcsec is not given")
            .column("arcsec_per_count")
            .help("give --arcsec-per-count or arcsec_per_count in the setup; it is never guessed")
    })?;
    Ok(AngleUnit::Quanta { arcsec_per_count, quantum: config.quantum.unwrap_or(1.0) })
}
