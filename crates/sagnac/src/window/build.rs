//! From batches to windows and tracks, in one pass.

use std::ops::Range;

use crate::window::outliers;
use crate::window::rest::RestWatch;
use crate::window::row_trace::RowTrace;
use crate::window::sums::{Moments, WindowSums, until_split};
use crate::window::tracks::{Grid, Tracks};
use crate::window::windows::{Run, RunFile, WindowRows, WindowShape, Windows};
use sagnac_core::Status;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{
    AngleUnit, Batch, CounterEnd, LogReader, LogShape, LogSummary, Logs, Reason, Sketches, Tallies, same_shape,
};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::setup::{RunDivision, Setup, TableRun, WindowSize};
use sagnac_noise::{FILLED, WindowedDifferences};
use sagnac_units::{ns_from_s, s_from_ns};

/// Bytes of a window apart from its columns: times, samples, line, reference, reason.
const WINDOW_BYTES: usize = 64;
/// Bytes of an axis in a window: angle, status, and the list of squares.
const AXIS_BYTES: usize = 48;
/// Bytes of an octave of the squares.
const OCTAVE_BYTES: usize = 16;
/// Bytes of a thermometer or auxiliary column in a window: mean, variance, least, largest.
const COLUMN_BYTES: usize = 32;
/// Windows of a log whose rows have neither time nor interval, one for each row.
const MOST_UNTIMED_WINDOWS: usize = 20_000;
/// A column that grows has up to this many times the length that it needs.
const GROWTH: usize = 2;

/// Collects windows; push batches run by run, then finish.
#[derive(Clone)]
pub struct WindowBuilder {
    log: LogShape,
    shape: WindowShape,
    division: RunDivision,
    tables: Vec<TableRun>,
    discard_initial_ns: i64,
    /// Length of a window by time.
    window_ns: Option<i64>,
    tick_ns: i64,
    rows: WindowRows,
    runs: Vec<Run>,
    differences: Vec<WindowedDifferences>,
    /// Of a log with a clock.
    rest: Option<RestWatch>,
    /// Where the stretch of those differences ends, ns.
    stretch_end_ns: Option<i64>,
    trace: RowTrace,
    run: Option<OpenRun>,
    /// Name of the file that is being read.
    file: String,
    /// Length of each row of the batch at hand, ns.
    weights: Vec<f64>,
    /// Columns whose track is kept: thermometers, then auxiliary columns.
    tracks: usize,
    /// Per window: σ of the reference rate within it, °/s.
    table_spread_dps: Vec<f64>,
    keep_outliers: bool,
    /// Per axis and window: union of the status bits of corrected rows.
    status: Vec<Vec<Status>>,
    memory: MemoryBudget,
}

/// The run being read.
#[derive(Clone)]
struct OpenRun {
    start_ns: i64,
    end_ns: i64,
    open: Option<WindowSums>,
    tracks: Tracks,
    /// Files that were read to their end.
    files: Vec<RunFile>,
    /// The file that is being read: its start, ns, its name, and usable rows of it.
    file_start_ns: i64,
    file: String,
    file_rows: u64,
}

/// Logs that were read: one whose bytes or rows came before would count twice.
#[derive(Default)]
pub(crate) struct SeenLogs {
    /// SHA-256 and file of each.
    logs: Vec<(String, String)>,
    rows: Sketches,
}

impl SeenLogs {
    /// # Errors
    /// The same bytes again, or rows of a log that came before: a copy with other line ends or with rows lost is no other run.
    pub(crate) fn take(&mut self, log: &LogSummary) -> Result<()> {
        let of_bytes = self.logs.iter().find(|(sha256, _)| *sha256 == log.sha256).map(|(_, file)| ("bytes", file));
        let of_rows = || self.rows.twin_of(&log.rows_sketch).and_then(|at| self.logs.get(at as usize));
        if let Some((what, twin)) = of_bytes.or_else(|| of_rows().map(|(_, file)| ("rows", file))) {
            let what = format!("the file contains the same {what} as {twin}");
            return Err(Error::input(what, "give each log once").file(&log.file));
        }
        self.rows.add(self.logs.len() as u32, &log.rows_sketch);
        self.logs.push((log.sha256.clone(), log.file.clone()));
        Ok(())
    }
}

impl WindowBuilder {
    /// For logs of this shape.
    ///
    /// # Errors
    /// A temperature period that is no whole number of ticks.
    pub fn new(log: &LogShape, setup: &Setup) -> Result<Self> {
        let window = setup.window();
        let (tick_ns, period_ns) = (setup.clock().tick_ns(), setup.clock().period_ns()?);
        let sample_interval_s = s_from_ns(log.nominal_ns);
        if let Some(seconds) = window.seconds()
            && log.timed
            && seconds < 0.999 * sample_interval_s
        {
            return Err(Error::input(
                format!("a window of {seconds} s is shorter than a row ({sample_interval_s} s)"),
                "give a longer --window, or --window row for one window per row",
            )
            .column("window"));
        }
        let window = if log.timed { window } else { WindowSize::ROW };
        let nominal_s = window.seconds().unwrap_or(sample_interval_s);
        // A row alone has no noise next to the others.
        let noise_s = if window == WindowSize::ROW { 0.0 } else { nominal_s };
        let shape = WindowShape {
            axes: log.axes.clone(),
            thermometers: log.thermometers.clone(),
            aux: log.aux.clone(),
            unit: log.unit,
            is_turned: log.has_reference || !setup.tables.is_empty(),
            timed: log.timed,
            window,
            nominal_s,
            period_ns,
            sample_interval_s,
        };
        let columns = |n: usize| vec![Vec::new(); n];
        let rows = WindowRows {
            angle: columns(log.axes.len()),
            squares: vec![Vec::new(); log.axes.len()],
            mean_c: columns(log.thermometers.len()),
            variance_c2: columns(log.thermometers.len()),
            min_c: columns(log.thermometers.len()),
            max_c: columns(log.thermometers.len()),
            aux: columns(log.aux.len()),
            aux_variance: columns(log.aux.len()),
            aux_min: columns(log.aux.len()),
            aux_max: columns(log.aux.len()),
            ..WindowRows::default()
        };
        Ok(Self {
            log: log.clone(),
            differences: vec![WindowedDifferences::new(sample_interval_s, noise_s); log.axes.len()],
            rest: (log.timed && !shape.is_turned).then(|| RestWatch::new(log)),
            stretch_end_ns: None,
            trace: RowTrace::new(sample_interval_s),
            window_ns: shape.window.seconds().map(window_ns),
            shape,
            division: setup.runs,
            tables: setup.tables.clone(),
            discard_initial_ns: ns_from_s(setup.discard_initial_s).unwrap_or(0),
            tick_ns,
            rows,
            runs: Vec::new(),
            run: None,
            file: String::new(),
            weights: Vec::new(),
            tracks: log.thermometers.len() + log.aux.len(),
            table_spread_dps: Vec::new(),
            keep_outliers: false,
            status: vec![Vec::new(); log.axes.len()],
            memory: setup.memory,
        })
    }

    /// Keeps no tracks, which only a fit needs, and looks for no rest.
    #[must_use]
    pub(crate) fn without_tracks(self) -> Self {
        Self { tracks: 0, rest: None, ..self }
    }

    /// Reads whole logs, each opened when the one before is read. A log that goes on where the one before ends goes on with its run ([`RunDivision`]).
    ///
    /// # Errors
    /// What reading reports; logs of different columns or units; files that are to be one run and are not in the order of
    /// their times.
    pub fn read_all<'a>(logs: impl Into<Logs<'a>>, setup: &Setup) -> Result<Self> {
        let mut logs = logs.into();
        let first = logs.shape()?;
        let mut builder = Self::new(&first, setup)?;
        let (mut seen, mut counter_end) = (SeenLogs::default(), None);
        for log in logs {
            let mut log = log?;
            same_shape(&first, log.shape()).map_err(|e| e.file(log.summary().file))?;
            builder.follow(&mut log, counter_end.as_ref())?;
            let (mut is_first, name) = (true, log.summary().file);
            log.for_each_batch(|batch| {
                if std::mem::take(&mut is_first) {
                    builder.begin_file(batch, &name)?;
                }
                builder.push(batch).map_err(|e| e.file(&name))
            })?;
            let summary = log.summary();
            seen.take(&summary)?;
            builder.end_file(summary);
            counter_end = log.counter_end();
        }
        Ok(builder)
    }

    /// The next rows of the run.
    ///
    /// # Errors
    /// A run of more temperature periods than a track may have.
    pub fn push(&mut self, batch: &Batch) -> Result<()> {
        self.push_corrected(batch, &batch.angle, &[])
    }

    /// The same of corrected rows: `unrounded` are the angles before rounding to whole counts, whose Allan
    /// deviations measure the noise; `status` has the bits of each row, per axis.
    pub(crate) fn push_corrected(
        &mut self,
        batch: &Batch,
        unrounded: &[Vec<f64>],
        status: &[Vec<Status>],
    ) -> Result<()> {
        if batch.begins_run {
            self.restart();
        }
        let (Some(first_ns), Some(last_ns)) = (batch.start_ns.first(), batch.end_ns.last()) else { return Ok(()) };
        let (file, tracks) = (&self.file, self.tracks);
        let run = self.run.get_or_insert_with(|| OpenRun::new(*first_ns, tracks, file));
        run.end_ns = *last_ns;
        run.file_rows += batch.len() as u64;
        if self.shape.timed {
            let kept: usize = self.runs.iter().flat_map(|run| &run.tracks).map(Vec::len).sum();
            let grid = Grid::new(self.tick_ns, self.shape.period_ns, self.tracks, kept, self.memory);
            run.tracks.sample(batch, &self.log, grid)?;
        }
        if !self.shape.timed && self.rows.run.len() > MOST_UNTIMED_WINDOWS {
            let what = format!("over {MOST_UNTIMED_WINDOWS} rows have no time, and the row interval is not given");
            return Err(Error::input(what, "give --sample-interval SECONDS: rows are then summed into windows")
                .column("sample_interval_s"));
        }
        let columns = self.log.thermometers.len() + self.log.aux.len();
        let octaves: usize = self.differences.iter().map(WindowedDifferences::octaves).sum();
        let axes = AXIS_BYTES * self.log.axes.len() + OCTAVE_BYTES * octaves;
        let bytes_each = GROWTH * (WINDOW_BYTES + axes + COLUMN_BYTES * columns);
        if (self.rows.run.len() * bytes_each) as u64 > self.memory.windows() {
            let what = format!("{} windows take", self.rows.run.len());
            let or = "give longer windows (--window) or fewer logs at a time";
            let error = self.memory.exceeded(&what, self.memory.windows(), or);
            return Err(error.line(*batch.line.first().unwrap_or(&0)));
        }
        if let Some(rest) = &mut self.rest {
            rest.push(batch);
        }
        self.trace.push(batch, &self.log);
        self.weights.clear();
        let rows = batch.start_ns.iter().zip(&batch.end_ns);
        self.weights.extend(rows.map(|(start, end)| (end - start) as f64));
        let mut at = 0;
        while at < batch.len() {
            let end = self.same_window(batch, at);
            if self.is_usable(batch, at) {
                self.add(batch, unrounded, status, at..end);
            }
            at = end;
        }
        Ok(())
    }

    /// A row that a window can take: of a cumulative counter with rows lost it may outlast a window.
    fn is_usable(&self, batch: &Batch, row: usize) -> bool {
        let length_ns = batch.end_ns[row] - batch.start_ns[row];
        let outlasts = self.window_ns.is_some_and(|window_ns| length_ns > window_ns);
        batch.valid[row] && !(outlasts && self.log.intervals(batch.start_ns[row], batch.end_ns[row]) > 1)
    }

    /// The end of the rows from `at` on that belong together: usable, one after the other, in one window by time.
    fn same_window(&self, batch: &Batch, at: usize) -> usize {
        let Some(run) = self.run.as_ref().filter(|_| self.is_usable(batch, at)) else { return at + 1 };
        let Some(length_ns) = self.window_ns else { return at + 1 };
        let index = (batch.end_ns[at] - 1 - run.start_ns).div_euclid(length_ns);
        let last_ns = run.start_ns.saturating_add(index.saturating_add(1).saturating_mul(length_ns));
        let in_time = at + batch.end_ns[at..].partition_point(|end| *end <= last_ns);
        // Valid, an interval each, one after the other.
        if batch.is_plain() {
            return in_time.max(at + 1);
        }
        let joins = |i: usize| self.is_usable(batch, i) && batch.start_ns[i] == batch.end_ns[i - 1];
        (at + 1..in_time).find(|i| !joins(*i)).unwrap_or(in_time)
    }

    /// Adds rows of one window by time; a temperature that moves far within it divides it.
    fn add(&mut self, batch: &Batch, unrounded: &[Vec<f64>], status: &[Vec<Status>], rows: Range<usize>) {
        let index = match (self.window_ns, &self.run) {
            (Some(length_ns), Some(run)) => (batch.end_ns[rows.start] - 1 - run.start_ns).div_euclid(length_ns),
            _ => i64::try_from(self.rows.run.len()).unwrap_or(i64::MAX),
        };
        let open = self.run.as_ref().and_then(|run| run.open.as_ref());
        // The mean of a rate does not need the rows that are lost.
        let goes_on = |sums: &WindowSums| self.is_of_rates() || sums.end_ns == batch.start_ns[rows.start];
        if open.is_some_and(|sums| sums.index != index || !goes_on(sums)) || self.shape.window == WindowSize::ROW {
            self.close_window();
        }
        let mut at = rows.start;
        while at < rows.end {
            let open = self.run.as_ref().and_then(|run| run.open.as_ref());
            let (end, extremes_c) = until_split(open, batch, at..rows.end);
            if end == at {
                self.close_window();
                continue;
            }
            let is_new = self.run.as_ref().is_none_or(|run| run.open.is_none());
            self.push_differences(batch, unrounded, at..end, is_new);
            if let Some(run) = self.run.as_mut() {
                let sums = run.open.get_or_insert_with(|| WindowSums::new(index, batch.start_ns[at], batch, at));
                sums.add(batch, at..end, &self.weights[at..end]);
                sums.extremes_c = extremes_c;
                sums.add_status(status, at..end);
            }
            at = end;
        }
    }

    /// A row is a sample of its own, whatever was lost before it.
    fn is_of_rates(&self) -> bool {
        self.shape.unit == AngleUnit::Arcsec
    }

    /// Rows to the squared differences, the first of a window or not. Of a cumulative counter with rows lost some cover several intervals.
    fn push_differences(&mut self, batch: &Batch, unrounded: &[Vec<f64>], rows: Range<usize>, is_new: bool) {
        let start_ns = batch.start_ns[rows.start];
        let lost = self.stretch_end_ns.map(|end_ns| self.log.lost_rows(end_ns, start_ns));
        match lost {
            Some(0) if !(is_new && self.shape.is_turned) => {}
            Some(lost) if self.is_of_rates() && (1..=FILLED).contains(&lost) => {
                self.differences.iter_mut().for_each(|differences| differences.fill(lost));
            }
            _ => self.differences.iter_mut().for_each(WindowedDifferences::end_stretch),
        }
        self.stretch_end_ns = batch.end_ns[rows.clone()].last().copied();
        let arcsec = self.shape.unit.arcsec();
        let intervals = |row: usize| self.log.intervals(batch.start_ns[row], batch.end_ns[row]);
        let most_ns = 1.5 * self.log.nominal_ns as f64;
        let mut at = rows.start;
        while at < rows.end {
            let is_wide = |length_ns: &f64| *length_ns > most_ns;
            let wide = (!batch.is_plain()).then(|| self.weights[at..rows.end].iter().position(is_wide)).flatten();
            let end = wide.map_or(rows.end, |wide| at + wide);
            for (differences, column) in self.differences.iter_mut().zip(unrounded) {
                differences.push(&column[at..end], arcsec);
                if end < rows.end {
                    differences.push_wide(intervals(end), column[end], arcsec);
                }
            }
            at = end + 1;
        }
    }

    fn close_window(&mut self) {
        let run_index = self.runs.len() as u32;
        let Some(sums) = self.run.as_mut().and_then(|run| run.open.take()) else {
            return;
        };
        let rows = &mut self.rows;
        rows.run.push(run_index);
        rows.start_ns.push(sums.start_ns);
        rows.end_ns.push(sums.end_ns);
        rows.duration_ns.push(sums.duration_ns);
        rows.samples.push(sums.samples);
        rows.first_line.push(sums.first_line);
        rows.excluded.push(None);
        self.status.iter_mut().zip(&sums.status).for_each(|(column, bits)| column.push(*bits));
        let whole = sums.reference.weight() > 0.999 * sums.duration_ns as f64;
        rows.reference_dps.push(if whole { sums.reference.mean() } else { f64::NAN });
        self.table_spread_dps.push(if sums.reference.weight() > 0.0 { sums.reference.variance().sqrt() } else { 0.0 });
        let push = |columns: &mut Vec<Vec<f64>>, values: &mut dyn Iterator<Item = f64>| {
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        };
        for (column, differences) in rows.squares.iter_mut().zip(&mut self.differences) {
            column.push(differences.end_window());
        }
        push(&mut rows.angle, &mut sums.angle.iter().map(|sum| sum.total()));
        let half = sums.duration_ns as f64 / 2.0;
        let known = |m: &Moments, value: f64| if m.weight() >= half { value } else { f64::NAN };
        push(&mut rows.mean_c, &mut sums.temperatures.iter().map(|m| known(m, m.mean())));
        push(&mut rows.variance_c2, &mut sums.temperatures.iter().map(|m| known(m, m.variance())));
        let extremes = || sums.temperatures.iter().zip(&sums.extremes_c);
        push(&mut rows.min_c, &mut extremes().map(|(m, (min, _))| known(m, *min)));
        push(&mut rows.max_c, &mut extremes().map(|(m, (_, max))| known(m, *max)));
        push(&mut rows.aux, &mut sums.aux.iter().map(|m| known(m, m.mean())));
        push(&mut rows.aux_variance, &mut sums.aux.iter().map(|m| known(m, m.variance())));
        let extremes = || sums.aux.iter().zip(&sums.aux_extremes);
        push(&mut rows.aux_min, &mut extremes().map(|(m, (min, _))| known(m, *min)));
        push(&mut rows.aux_max, &mut extremes().map(|(m, (_, max))| known(m, *max)));
    }

    /// Begins a file with its first rows: true where it goes on with the run, false where it is a new one.
    ///
    /// # Errors
    /// Files that are to be one run and are not in the order of their times.
    pub(crate) fn begin_file(&mut self, batch: &Batch, name: &str) -> Result<bool> {
        let Some(start_ns) = batch.start_ns.first().copied() else { return Ok(false) };
        let goes_on = self.goes_on(start_ns, name)?;
        if !goes_on {
            self.end_run();
        }
        self.file = name.to_owned();
        if let Some(run) = &mut self.run {
            (run.file_start_ns, run.file, run.file_rows) = (start_ns, name.to_owned(), 0);
        }
        Ok(goes_on)
    }

    /// Ends the run within a file whose clock starts again; the file goes on with a run of its own.
    fn restart(&mut self) {
        if let Some(run) = &mut self.run {
            let summary = LogSummary { file: run.file.clone(), rows: run.file_rows, ..LogSummary::default() };
            run.files.push(RunFile { start_ns: run.file_start_ns, summary });
        }
        self.end_run();
    }

    /// Lets a log go on with the run where its clock restarts and its running total goes on from the end of the file before.
    ///
    /// # Errors
    /// A read error.
    pub(crate) fn follow(&self, log: &mut LogReader, end: Option<&CounterEnd>) -> Result<()> {
        let last = self.run.as_ref().and_then(|run| run.files.last());
        if let (Some(end), Some(last), true) = (end, last, self.division != RunDivision::Files) {
            let sure = self.division == RunDivision::One;
            if sure || self.is_on_table_of(&log.summary().file, &last.summary.file) {
                log.follow(end, sure)?;
            }
        }
        Ok(())
    }

    /// Both files have the same entry of the rate table, or none.
    fn is_on_table_of(&self, name: &str, other: &str) -> bool {
        let table_of = |file: &str| {
            let file = sagnac_units::format::file_name(file);
            self.tables.iter().find(|table| table.file.as_deref() == Some(&file))
        };
        table_of(name) == table_of(other)
    }

    fn goes_on(&self, start_ns: i64, name: &str) -> Result<bool> {
        let Some((run, last)) = self.run.as_ref().and_then(|run| Some((run, run.files.last()?))) else {
            return Ok(false);
        };
        let interval_ns = ns_from_s(self.shape.sample_interval_s).unwrap_or(0);
        let gap_ns = start_ns.saturating_sub(run.end_ns);
        match self.division {
            RunDivision::Files => Ok(false),
            _ if !self.shape.timed => Ok(false),
            RunDivision::Auto => {
                let follows = 2 * gap_ns >= -interval_ns && 2 * gap_ns <= 3 * interval_ns;
                Ok(follows && self.is_on_table_of(name, &last.summary.file))
            }
            RunDivision::One if gap_ns < -interval_ns / 2 => Err(Error::input(
                format!(
                    "begins {} s before the end of {}: one run has one time",
                    s_from_ns(-gap_ns),
                    last.summary.file
                ),
                "give the files in the order of their times, or remove --one-run",
            )
            .file(name)),
            RunDivision::One => Ok(true),
        }
    }

    /// Ends a file; its run may go on in the next one.
    pub(crate) fn end_file(&mut self, summary: LogSummary) {
        // Runs of this file that ended within it are known by its bytes, too.
        let last_files = self.runs.iter_mut().rev().map_while(|run| run.files.last_mut());
        let mut rows = summary.rows;
        for part in last_files.take_while(|part| part.summary.sha256.is_empty()) {
            part.summary.sha256.clone_from(&summary.sha256);
            rows = rows.saturating_sub(part.summary.rows);
        }
        if let Some(rest) = &mut self.rest {
            rest.end_file(&summary.file);
        }
        let (file, tracks) = (&self.file, self.tracks);
        let run = self.run.get_or_insert_with(|| OpenRun::new(0, tracks, file));
        run.files.push(RunFile { start_ns: run.file_start_ns, summary: LogSummary { rows, ..summary } });
    }

    fn end_run(&mut self) {
        self.close_window();
        let Some(run) = self.run.take() else { return };
        if let Some(rest) = &mut self.rest {
            rest.end_run();
        }
        self.stretch_end_ns = None;
        self.trace.end_run();
        let tracks = run.tracks.into_values();
        self.runs.push(Run { files: run.files, start_ns: run.start_ns, end_ns: run.end_ns, tracks });
    }

    /// Keeps every window that has numbers; only `discard_initial_s` still applies.
    #[must_use]
    pub fn keep_outliers(self) -> Self {
        Self { keep_outliers: true, ..self }
    }

    /// The windows of a log so far, of which `summary` is known: what [`WindowBuilder::finish`] would give if it ended here.
    #[must_use]
    pub fn so_far(&self, summary: LogSummary) -> Windows {
        let mut ended = self.clone();
        ended.end_file(summary);
        ended.finish()
    }

    /// The windows, and per axis and window the union of the status bits of its corrected rows.
    pub(crate) fn finish_with_status(mut self) -> (Windows, Vec<Vec<Status>>) {
        self.end_run();
        let status = std::mem::take(&mut self.status);
        (self.finish(), status)
    }

    /// Every window that has counts. Only those in which a table changed its rate, and fragments too short for values of their
    /// own, are marked.
    pub(crate) fn finish_whole(mut self) -> Windows {
        self.keep_outliers = true;
        self.discard_initial_ns = 0;
        let mut windows = self.finish();
        windows.mark_fragments();
        windows
    }

    /// The windows, with the excluded ones marked.
    pub fn finish(mut self) -> Windows {
        self.end_run();
        let keep_all = self.keep_outliers;
        let mut tallies = Tallies::default();
        self.runs.iter().flat_map(|run| &run.files).for_each(|file| tallies.merge(&file.summary.tallies));
        let rest = self.rest.and_then(RestWatch::finish);
        let trace = self.trace.finish();
        let mut windows = Windows { shape: self.shape, runs: self.runs, rows: self.rows, tallies, rest, trace };
        for i in 0..windows.len() {
            let run = &windows.runs[windows.rows.run[i] as usize];
            if windows.rows.start_ns[i] - run.start_ns < self.discard_initial_ns {
                windows.exclude(i, Reason::Settling);
            }
        }
        if !keep_all {
            windows.mark_fragments();
        }
        outliers::mark_table_changes(&mut windows, &self.table_spread_dps);
        if !keep_all {
            outliers::mark(&mut windows);
        }
        windows
    }
}

impl OpenRun {
    fn new(start_ns: i64, columns: usize, file: &str) -> Self {
        let (tracks, file) = (Tracks::new(start_ns, columns), file.to_owned());
        let files = Vec::new();
        Self { start_ns, end_ns: start_ns, open: None, tracks, files, file_start_ns: start_ns, file, file_rows: 0 }
    }
}

/// A window in ns.
fn window_ns(seconds: f64) -> i64 {
    ns_from_s(seconds).unwrap_or(i64::MAX).max(1)
}
