//! From batches to windows and tracks, in one pass.

use crate::allan::ShortTau;
use crate::error::{Error, Result};
use crate::ingest::{Batch, LogReader, LogShape, LogSummary, Reason, Tallies};
use crate::setup::{Setup, WindowSize};
use crate::units::{ns_from_s, s_from_ns};
use crate::window::{Run, WindowRows, WindowShape, Windows, outliers};

/// A window ends when a temperature has moved by this much within it, °C.
const SPLIT_C: f64 = 2.0;
/// Longest track, in temperature periods: 48 days at 1 s.
const MAX_TRACK: usize = 1 << 22;

/// Collects windows; push batches run by run, then finish.
pub struct WindowBuilder {
    shape: WindowShape,
    settle_ns: i64,
    tick_ns: i64,
    rows: WindowRows,
    runs: Vec<Run>,
    short_tau: Vec<ShortTau>,
    run: Option<OpenRun>,
    judged_axes: usize,
}

/// The run being read.
struct OpenRun {
    start_ns: i64,
    end_ns: i64,
    open: Option<Sums>,
    tracks: Vec<Track>,
}

/// Sums of the window being filled.
struct Sums {
    index: i64,
    start_ns: i64,
    end_ns: i64,
    duration_ns: i64,
    samples: u32,
    first_line: u64,
    angle: Vec<f64>,
    temperatures: Vec<Moments>,
    aux: Vec<Moments>,
    reference: Moments,
}

/// Weighted mean and second moment about it (West 1979), with extremes.
#[derive(Clone, Copy)]
struct Moments {
    weight: f64,
    mean: f64,
    m2: f64,
    min: f64,
    max: f64,
}

impl Moments {
    const EMPTY: Self = Self { weight: 0.0, mean: 0.0, m2: 0.0, min: f64::INFINITY, max: f64::NEG_INFINITY };

    fn push(&mut self, value: f64, weight: f64) {
        if value.is_nan() {
            return;
        }
        self.weight += weight;
        let delta = value - self.mean;
        self.mean += delta * weight / self.weight;
        self.m2 += weight * delta * (value - self.mean);
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }

    fn spread_with(&self, value: f64) -> f64 {
        if value.is_nan() { 0.0 } else { self.max.max(value) - self.min.min(value) }
    }
}

/// Zero-order hold of one thermometer on the grid of the temperature period.
struct Track {
    newest_c: f64,
    values: Vec<f64>,
}

impl Track {
    /// Everything on the grid strictly before the sample's time still has the sample before it.
    fn sample(&mut self, grid_points_before: usize, value_c: f64) {
        self.extend(grid_points_before);
        if !value_c.is_nan() {
            if self.newest_c.is_nan() {
                // Nothing is known before the first sample: it stands for the time before.
                self.values.fill(value_c);
            }
            self.newest_c = value_c;
        }
    }

    fn extend(&mut self, len: usize) {
        if self.values.len() < len {
            self.values.resize(len, self.newest_c);
        }
    }
}

impl WindowBuilder {
    /// For logs of this shape.
    ///
    /// # Errors
    /// A temperature period that is no whole number of ticks.
    pub fn new(log: &LogShape, setup: &Setup) -> Result<Self> {
        let (tick_ns, period_ns) = (setup.tick_ns(), setup.period_ns()?);
        let sample_interval_s = s_from_ns(log.nominal_ns);
        if let Some(seconds) = setup.window().seconds()
            && log.timed
            && seconds < 0.999 * sample_interval_s
        {
            return Err(Error::input(format!("a window of {seconds} s is shorter than a row ({sample_interval_s} s)"))
                .column("window")
                .help("give a longer window, or `row` for one window per row"));
        }
        let window = if log.timed { setup.window() } else { WindowSize::ROW };
        let nominal_s = window.seconds().unwrap_or(sample_interval_s);
        let longest = if window == WindowSize::ROW { 0.0 } else { nominal_s / 4.0 };
        let shape = WindowShape {
            axes: log.axes.clone(),
            thermometers: log.thermometers.clone(),
            aux: log.aux.clone(),
            unit: log.unit,
            timed: log.timed,
            window,
            nominal_s,
            period_ns,
            sample_interval_s,
        };
        let columns = |n: usize| vec![Vec::new(); n];
        let rows = WindowRows {
            angle: columns(log.axes.len()),
            short_tau: vec![Vec::new(); log.axes.len()],
            mean_c: columns(log.thermometers.len()),
            variance_c2: columns(log.thermometers.len()),
            min_c: columns(log.thermometers.len()),
            max_c: columns(log.thermometers.len()),
            aux: columns(log.aux.len()),
            ..WindowRows::default()
        };
        Ok(Self {
            short_tau: vec![ShortTau::new(sample_interval_s, longest); log.axes.len()],
            shape,
            settle_ns: ns_from_s(setup.settle_s).unwrap_or(0),
            tick_ns,
            rows,
            runs: Vec::new(),
            run: None,
            judged_axes: log.axes.len(),
        })
    }

    /// Lets only the first `axes` axes decide which windows are outliers.
    #[must_use]
    pub fn judging(self, axes: usize) -> Self {
        Self { judged_axes: axes, ..self }
    }

    /// Reads whole logs, each as one run.
    ///
    /// # Errors
    /// What reading says; logs of different columns or units.
    pub fn read_all(logs: Vec<LogReader>, setup: &Setup) -> Result<Self> {
        let first = logs.first().ok_or_else(|| Error::input("no log given"))?.shape().clone();
        let mut builder = Self::new(&first, setup)?;
        let mut seen: Vec<(String, String)> = Vec::new();
        for mut log in logs {
            same_shape(&first, log.shape()).map_err(|e| e.file(log.summary().file))?;
            while let Some(batch) = log.next_batch()? {
                builder.push(batch)?;
            }
            let summary = log.summary();
            if let Some((_, twin)) = seen.iter().find(|(sha256, _)| *sha256 == summary.sha256) {
                let what = format!("holds the same bytes as {twin}; one run counts once");
                return Err(Error::input(what).file(summary.file).help("give each log once"));
            }
            seen.push((summary.sha256.clone(), summary.file.clone()));
            builder.end_run(summary);
        }
        Ok(builder)
    }

    /// The next rows of the run.
    ///
    /// # Errors
    /// A run of more temperature periods than a track may have.
    pub fn push(&mut self, batch: &Batch) -> Result<()> {
        (0..batch.len()).try_for_each(|i| self.push_row(batch, i))
    }

    fn push_row(&mut self, batch: &Batch, i: usize) -> Result<()> {
        let (start_ns, end_ns) = (batch.start_ns[i], batch.end_ns[i]);
        let run = self.run.get_or_insert_with(|| OpenRun::new(start_ns, self.shape.thermometers.len()));
        run.end_ns = end_ns;
        if self.shape.timed {
            // As in replay: a stamp counts from the tick it falls into.
            let elapsed_ns = (end_ns - run.start_ns) / self.tick_ns * self.tick_ns;
            let before = elapsed_ns / self.shape.period_ns + i64::from(elapsed_ns % self.shape.period_ns != 0);
            let before = usize::try_from(before).unwrap_or(usize::MAX);
            if before > MAX_TRACK {
                return Err(too_many_periods(self.shape.period_ns).line(batch.line[i]));
            }
            for (track, column) in run.tracks.iter_mut().zip(&batch.temperature_c) {
                track.sample(before, column[i]);
            }
        }
        if !batch.valid[i] {
            return Ok(());
        }
        let index = match self.shape.window.seconds() {
            Some(seconds) => {
                let length_ns = ns_from_s(seconds).unwrap_or(i64::MAX).max(1);
                (end_ns - 1 - run.start_ns).div_euclid(length_ns)
            }
            None => i64::try_from(self.rows.run.len()).unwrap_or(i64::MAX),
        };
        let must_close = run.open.as_ref().is_some_and(|sums| {
            sums.index != index
                || sums.end_ns != start_ns
                || self.shape.window == WindowSize::ROW
                || sums.would_split(batch, i)
        });
        if must_close {
            self.close_window();
        }
        for (short_tau, column) in self.short_tau.iter_mut().zip(&batch.angle) {
            short_tau.push(column[i] * self.shape.unit.arcsec());
        }
        if let Some(run) = self.run.as_mut() {
            run.open.get_or_insert_with(|| Sums::new(index, start_ns, batch, i)).add(batch, i);
        }
        Ok(())
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
        rows.reference_dps.push(if sums.reference.weight > 0.0 { sums.reference.mean } else { f64::NAN });
        let push = |columns: &mut Vec<Vec<f64>>, values: &mut dyn Iterator<Item = f64>| {
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        };
        for (column, short_tau) in rows.short_tau.iter_mut().zip(&mut self.short_tau) {
            column.push(short_tau.take());
        }
        push(&mut rows.angle, &mut sums.angle.iter().copied());
        let half = s_from_ns(sums.duration_ns) / 2.0;
        let known = |m: &Moments, value: f64| if m.weight >= half { value } else { f64::NAN };
        push(&mut rows.mean_c, &mut sums.temperatures.iter().map(|m| known(m, m.mean)));
        push(&mut rows.variance_c2, &mut sums.temperatures.iter().map(|m| known(m, m.m2 / m.weight)));
        push(&mut rows.min_c, &mut sums.temperatures.iter().map(|m| known(m, m.min)));
        push(&mut rows.max_c, &mut sums.temperatures.iter().map(|m| known(m, m.max)));
        push(&mut rows.aux, &mut sums.aux.iter().map(|m| known(m, m.mean)));
    }

    /// Ends the run; `summary` tells where it came from.
    pub fn end_run(&mut self, summary: LogSummary) {
        self.close_window();
        let run = self.run.take().unwrap_or_else(|| OpenRun::new(0, self.shape.thermometers.len()));
        let tracks = run.tracks.into_iter().map(|track| track.values).collect();
        self.runs.push(Run { summary, start_ns: run.start_ns, end_ns: run.end_ns, tracks });
    }

    /// Windows with what must be left out marked. `keep_all` keeps every window that has numbers
    /// (only `settle_s` is still left out).
    pub fn finish(self, keep_all: bool) -> Windows {
        let mut tallies = Tallies::default();
        self.runs.iter().for_each(|run| tallies.merge(&run.summary.tallies));
        let mut windows = Windows { shape: self.shape, runs: self.runs, rows: self.rows, tallies };
        for i in 0..windows.len() {
            let run = &windows.runs[windows.rows.run[i] as usize];
            if windows.rows.start_ns[i] - run.start_ns < self.settle_ns {
                windows.exclude(i, Reason::Settling);
            } else if !keep_all && windows.duration_s(i) < windows.shape.nominal_s / 10.0 {
                windows.exclude(i, Reason::ShortWindow);
            }
        }
        if !keep_all {
            outliers::mark(&mut windows, self.judged_axes);
        }
        windows
    }
}

impl OpenRun {
    fn new(start_ns: i64, thermometers: usize) -> Self {
        let track = || Track { newest_c: f64::NAN, values: Vec::new() };
        Self { start_ns, end_ns: start_ns, open: None, tracks: (0..thermometers).map(|_| track()).collect() }
    }
}

impl Sums {
    fn new(index: i64, start_ns: i64, batch: &Batch, i: usize) -> Self {
        Self {
            index,
            start_ns,
            end_ns: start_ns,
            duration_ns: 0,
            samples: 0,
            first_line: batch.line[i],
            angle: vec![0.0; batch.angle.len()],
            temperatures: vec![Moments::EMPTY; batch.temperature_c.len()],
            aux: vec![Moments::EMPTY; batch.aux.len()],
            reference: Moments::EMPTY,
        }
    }

    fn would_split(&self, batch: &Batch, i: usize) -> bool {
        self.temperatures.iter().zip(&batch.temperature_c).any(|(m, column)| m.spread_with(column[i]) > SPLIT_C)
    }

    fn add(&mut self, batch: &Batch, i: usize) {
        let duration_ns = batch.end_ns[i] - batch.start_ns[i];
        self.end_ns = batch.end_ns[i];
        self.duration_ns += duration_ns;
        self.samples += 1;
        let weight = s_from_ns(duration_ns);
        self.angle.iter_mut().zip(&batch.angle).for_each(|(sum, column)| *sum += column[i]);
        self.temperatures.iter_mut().zip(&batch.temperature_c).for_each(|(m, column)| m.push(column[i], weight));
        self.aux.iter_mut().zip(&batch.aux).for_each(|(m, column)| m.push(column[i], weight));
        self.reference.push(batch.reference_dps[i], weight);
    }
}

fn too_many_periods(period_ns: i64) -> Error {
    Error::input(format!("the run is longer than {MAX_TRACK} temperature periods of {} s", s_from_ns(period_ns)))
        .column("temperature_period_s")
        .help("cut the log into shorter files (each is a run), or give a longer temperature_period_s in the setup")
}

/// Logs that can stand in one set of windows.
pub(crate) fn same_shape(first: &LogShape, other: &LogShape) -> Result<()> {
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
