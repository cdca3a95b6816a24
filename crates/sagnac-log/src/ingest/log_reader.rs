//! One log from its opening to its summary, batch by batch.
//!
//! ```text
//! open ─▶ nominal interval from the first rows ─▶ next_batch / for_each_batch ─▶ summary, state of the counter
//! ```
//!
//! The whole log is never held. A file whose clock restarts while its running total goes on can follow another one
//! ([`LogReader::follow`]).

use std::collections::VecDeque;
use std::path::Path;
use std::sync::mpsc::{channel, sync_channel};
use std::thread::Scope;

use crate::error::{Error, Result};
use crate::ingest::bytes::source::{HashHandle, Source, Watch};
use crate::ingest::checks::align::Aligner;
use crate::ingest::checks::batch::Batch;
use crate::ingest::checks::full_scale::{Clipped, FullScale};
use crate::ingest::checks::reason::Tallies;
use crate::ingest::checks::rows::{self, CounterEnd, RowValidator};
use crate::ingest::checks::running_total::RunningTotal;
use crate::ingest::checks::sketch::Sketch;
use crate::ingest::checks::turntable::TableRates;
use crate::ingest::clock::even::EvenClock;
use crate::ingest::clock::interval::row_clock;
use crate::ingest::clock::unbroken::UnbrokenClock;
use crate::ingest::columns::feed::{Opened, Purpose, ReadMode};
use crate::ingest::columns::header::{Content, Layout, TableColumn};
use crate::ingest::columns::log_shape::{AngleUnit, LogShape};
use crate::ingest::columns::raw::{MAX_TIME, RawRows};
use crate::ingest::formats::Format;
use crate::ingest::pieces::Pieces;
use crate::setup::{Counter, Setup};
use crate::threads::{helpers, spawn_in};
use sagnac_units::ns_from_s;

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
    /// Hashes of its rows, by which a copy in other bytes is recognised ([`share_rows`](crate::ingest::share_rows)); empty where it says too little.
    pub rows_sketch: String,
    /// Its clock restarts and its running total goes on: its times go on from the file before.
    pub follows_by_counter: bool,
    /// Wraps and restarts of its clock, a sentence each.
    pub clock: Vec<String>,
    /// Rates that many rows have as the largest or the smallest one.
    pub clipped: Vec<Clipped>,
}

/// Batches that are passed on before a thread is started for them.
const BATCHES_ALONE: usize = 2;

/// A log being read.
pub struct LogReader {
    pieces: Pieces,
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
    sketch: Option<Sketch>,
    /// Of counts that should be of each row.
    running_total: Option<RunningTotal>,
    full_scale: FullScale,
    /// Read line by line.
    is_stream: bool,
    name: String,
    /// Added to every time: not zero where it follows another file by its counter.
    offset_ns: Option<i64>,
    /// Of a log with times.
    unbroken: Option<UnbrokenClock>,
    /// Of stamps that are not the times of their rows.
    even: Option<EvenClock>,
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
    pub fn from_table(table: crate::ingest::MemoryTable, setup: &Setup, mode: ReadMode) -> Result<Self> {
        let (name, hash) = (table.name.clone(), HashHandle::default());
        let opened = crate::ingest::arrow::open_table(table, hash.clone(), setup, mode);
        opened.and_then(|opened| Self::start(opened, &name, hash, setup, mode)).map_err(|e| e.file(name))
    }

    fn from_source(source: Source, setup: &Setup, mode: ReadMode) -> Result<Self> {
        let (name, hash) = (source.name.clone(), source.hash.clone());
        let opened = Format::of(&source.start).open(source, setup, Purpose::Rows(mode));
        opened.and_then(|opened| Self::start(opened, &name, hash, setup, mode)).map_err(|e| e.file(name))
    }

    fn start(opened: Opened, name: &str, hash: HashHandle, setup: &Setup, mode: ReadMode) -> Result<Self> {
        let Opened { feed, layout, delimiter, lines_before, assumed } = opened;
        let mut pieces = Pieces::new(feed, lines_before, mode != ReadMode::LineByLine);
        let unit = angle_unit(&layout, setup)?;
        let mut ahead = VecDeque::new();
        let row_clock = row_clock(&mut pieces, &layout, setup, mode, &mut ahead)?;
        let nominal_ns = row_clock.nominal_ns;
        let shape = LogShape {
            axes: layout.axes.iter().map(|(_, axis, _)| *axis).collect(),
            thermometers: layout.temperatures.iter().map(|(_, name, _)| name.clone()).collect(),
            aux: layout.aux.iter().map(|(_, name)| name.clone()).collect(),
            unit,
            timed: layout.time.is_some() || setup.has_even_rows(),
            nominal_ns,
            has_reference: layout.reference.is_some(),
            ignored: layout.ignored.clone(),
        };
        let check = RowValidator::new(name.to_owned(), &layout, setup, nominal_ns);
        // For a pipe, no row was known when the interval was given.
        let watched = mode == ReadMode::LineByLine && setup.sample_interval_s.is_some();
        let check = if watched { check.watching_interval() } else { check };
        let batch = Batch::for_shape(&shape);
        let align = Aligner::new(ns_from_s(setup.temperature_offset_s).unwrap_or(0));
        let rows = RawRows::default();
        let layout_places = layout.time.map(|(_, places)| places);
        let column = layout.reference.map_or(TableColumn::Rate, |(_, column)| column);
        // Output that is written row by row must not wait for table marks; only fits and verifications need them.
        let column = if mode != ReadMode::Bulk && column == TableColumn::Mark { TableColumn::Rate } else { column };
        let table = TableRates::new(column);
        let sketch = Some(Sketch::new(shape.axes.clone()));
        let counts_of_rows =
            layout.is_count_log() && setup.counter() == Counter::Incremental && setup.counter.is_none();
        let running_total = (counts_of_rows && !shape.has_reference).then(|| RunningTotal::new(shape.axes.len()));
        let full_scale = FullScale::new(&layout.axes);
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
            running_total,
            full_scale,
            is_stream: mode == ReadMode::LineByLine,
            name: name.to_owned(),
            offset_ns: None,
            unbroken: layout_places.map(|places| UnbrokenClock::new(row_clock.stamp_step_ns(), places)),
            even: row_clock.even.map(EvenClock::new),
            assumed: assumed.into_iter().chain(row_clock.words()).collect(),
        })
    }

    /// Where a cumulative counter stands once the log was read to its end; `None` for other logs.
    pub fn counter_end(&self) -> Option<CounterEnd> {
        self.check.counter_end()
    }

    /// Goes on from the end of another file, before the first batch is read: true where the clock restarts and the running total of
    /// the first row goes on within what one interval can bring. A total near zero is no evidence, for a counter that began again stands
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

    /// Leaves the sketch of the rows out of the summary: for results that no other log is compared with.
    pub fn without_sketch(mut self) -> Self {
        self.sketch = None;
        self
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
            let totals = self.running_total.as_ref().map_or(Ok(()), |watch| watch.check(&self.shape.axes));
            let range = totals.and_then(|()| self.full_scale.check(self.delimiter));
            return range.map(|()| false).map_err(|e| e.file(&self.name));
        }
        if self.rows.begins_run {
            self.check.begin_run();
            self.batch.begins_run = true;
        }
        self.full_scale.push(&self.rows.axes);
        self.check.push(&mut self.rows, &mut self.batch)?;
        if let Some(sketch) = &mut self.sketch {
            sketch.push(&self.batch, self.shape.unit != AngleUnit::Arcsec);
        }
        if let Some(watch) = &mut self.running_total {
            watch.push(&self.batch);
            // A stream may have no end, and its first rows are out by then.
            if self.is_stream {
                watch.check(&self.shape.axes).map_err(|e| e.file(&self.name))?;
            }
        }
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
            let known = self.rows.time_ns.iter_mut().filter(|t| t.unsigned_abs() < MAX_TIME);
            known.for_each(|t| *t = t.saturating_add(offset_ns));
        }
        if let Some(clock) = self.unbroken.as_mut().filter(|_| more) {
            if let (true, Some(even)) = (self.rows.begins_run, &mut self.even) {
                even.restart();
            }
            if let Some(rest) = clock.mend(&mut self.rows) {
                self.ahead.push_front(rest);
            }
            self.even.iter_mut().for_each(|even| even.replace(&mut self.rows));
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
            rows_sketch: self.sketch.as_ref().map_or_else(String::new, Sketch::hex),
            follows_by_counter: self.offset_ns.is_some(),
            clock: self.unbroken.as_ref().map_or_else(Vec::new, UnbrokenClock::words),
            clipped: self.full_scale.clipped(),
        }
    }
}

/// A rate of the table that is none is missing.
fn forget_impossible(reference_dps: &mut [f64]) {
    reference_dps.iter_mut().filter(|rate| rate.abs() > rows::MAX_RATE_DPS).for_each(|rate| *rate = f64::NAN);
}

fn angle_unit(layout: &Layout, setup: &Setup) -> Result<AngleUnit> {
    if !layout.is_count_log() {
        if setup.counter() == Counter::Cumulative {
            return Err(Error::input(
                "counter = \"cumulative\" is set, but the log contains rates",
                "remove counter from the setup",
            )
            .column("counter"));
        }
        return Ok(AngleUnit::Arcsec);
    }
    let arcsec_per_count = setup.arcsec_per_count.ok_or_else(|| {
        Error::input(
            "the log contains counts, and their size in arcsec is not given",
            "give --arcsec-per-count, or set arcsec_per_count in the setup",
        )
        .column("arcsec_per_count")
    })?;
    Ok(AngleUnit::Quanta { arcsec_per_count, quantum: setup.quantum.unwrap_or(1.0) })
}
