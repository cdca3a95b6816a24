//! Logs in, noise budget out.

use std::ops::Range;

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, Batch, Bridge, LogShape, Logs, Tallies, Tally, same_shape};
use sagnac_log::setup::Setup;
use sagnac_noise::{
    AxisBudget, HELD_PHASES, MOST_DISTURBED_PART, MOST_ROWS, MOST_TAUS, Period, RecordUnit, RowPlace, Screen, Screened,
    TauError, Taus, budget_of_screened, differences, served,
};
use sagnac_units::format::significant;
use sagnac_units::s_from_ns;
use serde::Serialize;

use crate::allan::ramp::{RampDrift, RampWatch};
use crate::calibration::{LogFile, program};
use crate::rate_table::input::SAME_RATE;
use crate::window::{Rest, RestSpan, RestWatch, WindowBuilder, Windows};

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// τ to show.
    pub taus: Taus,
    /// Hold every phase (8 bytes each), so that every τ overlaps fully however long the record is.
    pub exact: bool,
    /// Remove the drift over temperature first; the logs are read twice.
    pub detrend: bool,
    /// Use the longest rest alone; the logs are read twice.
    pub at_rest: bool,
}

impl Request {
    /// These τ, of the record as it is.
    pub fn new(taus: Taus) -> Self {
        Self { taus, exact: false, detrend: false, at_rest: false }
    }
}

/// The noise of a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NoiseBudget {
    /// Axis by axis.
    pub axes: Vec<AxisBudget>,
    /// Warnings about the values.
    pub warnings: Vec<String>,
    /// The drift over temperature was removed first.
    pub detrended: bool,
    /// The part of the record that was used, where the longest rest was asked for.
    pub at_rest: Option<RestSpan>,
    /// What was not used.
    pub excluded: Vec<Tally>,
    /// The logs.
    pub inputs: Vec<LogFile>,
    /// Program and version.
    pub program: String,
}

/// Bytes of a row of an axis with full overlap: up to four variants of the record, each with its phase.
const EXACT_ROW_BYTES: usize = 32;

/// Reads logs, each as one or more unbroken stretches, into a noise budget.
///
/// A request to detrend, or for the longest rest, needs `again`: the same logs, opened again.
///
/// # Errors
/// Errors of reading; logs of different shape; `all` τ of a long record; a temperature whose drift cannot be removed.
pub fn noise_budget<'a>(
    logs: impl Into<Logs<'a>>,
    again: Option<Logs<'a>>,
    setup: &Setup,
    request: &Request,
) -> Result<NoiseBudget> {
    let mut logs = logs.into();
    let shape = logs.shape()?;
    if !shape.timed && setup.sample_interval_s.is_none() {
        let file = logs.first()?.summary().file;
        return Err(Error::input(
            "the log has no time column, and the row interval is not given",
            "give --sample-interval, set sample_interval_s in the setup, or map the time column under [columns]",
        )
        .file(file));
    }
    let tau0_s = s_from_ns(shape.nominal_ns);
    let first = match again {
        Some(again) => Some(WindowBuilder::read_all(again, setup)?.finish()),
        None if request.detrend || request.at_rest => {
            return Err(Error::defect("the logs were not opened a second time"));
        }
        None => None,
    };
    let at_rest = first.as_ref().filter(|_| request.at_rest).map(longest_rest).transpose()?;
    let drifts = first.filter(|_| request.detrend).map(|windows| RampDrift::of(windows, setup)).transpose()?;
    let shown = request.taus.multiples(tau0_s).map_err(bad_tau)?;
    let mut reading = Reading::new(&shape, &shown, request.exact);
    if at_rest.is_some() {
        (reading.at_rest, reading.rest) = (at_rest, None);
    }
    let share = setup.memory.tracks() + setup.memory.windows();
    let most_exact_rows = usize::try_from(share).unwrap_or(usize::MAX) / (EXACT_ROW_BYTES * shape.axes.len().max(1));
    let mut rows = 0;
    for (number, log) in logs.enumerate() {
        let mut log = log?.without_sketch();
        same_shape(&shape, log.shape()).map_err(|e| e.file(log.summary().file))?;
        let name = log.summary().file;
        let drift = drifts.as_ref().and_then(|drifts| drifts.get(number));
        log.for_each_batch(|batch| {
            rows += batch.len();
            if request.exact && rows > most_exact_rows {
                let what = format!("--exact over {rows} rows takes");
                let error = setup.memory.exceeded(&what, share, "remove --exact");
                return Err(error.line(batch.line.first().copied().unwrap_or(0)).file(&name));
            }
            reading.push(batch, drift);
            Ok(())
        })?;
        reading.end_run();
        let summary = log.summary();
        reading.tallies.merge(&summary.tallies);
        reading.warnings.extend(summary.clock.iter().map(|what| format!("{name}: {what}")));
        reading.inputs.push(LogFile::of(&summary));
    }
    reading.finish(&shape, &shown, request)
}

/// The longest rest of the first reading.
fn longest_rest(windows: &Windows) -> Result<RestSpan> {
    let longest = windows.rest.as_ref().and_then(|rest| rest.longest.clone());
    longest.ok_or_else(|| {
        Error::refused("no part of the record is known to be at rest", "remove --at-rest, or give a longer record")
    })
}

/// The noise of a log that grows, in memory that does not.
#[derive(Clone)]
pub struct NoiseSoFar {
    reading: Reading,
    shape: LogShape,
    shown: Vec<usize>,
}

/// Phases that are held of each axis of a log that grows: differences of longer τ overlap less.
const HELD_SO_FAR: usize = 1 << 14;

impl NoiseSoFar {
    /// Of a log of this shape, in ten τ per decade.
    ///
    /// # Errors
    /// None that is known: the τ are our own.
    pub fn new(shape: &LogShape) -> Result<Self> {
        let shown = Taus::LogSpaced.multiples(s_from_ns(shape.nominal_ns)).map_err(bad_tau)?;
        Ok(Self { reading: Reading::holding(shape, &shown, HELD_SO_FAR), shape: shape.clone(), shown })
    }

    /// The next rows.
    pub fn push(&mut self, batch: &Batch) {
        self.reading.push(batch, None);
    }

    /// The noise so far, drift over temperature included.
    ///
    /// # Errors
    /// No usable row yet.
    pub fn so_far(&self) -> Result<NoiseBudget> {
        let mut reading = self.reading.clone();
        reading.end_run();
        reading.finish(&self.shape, &self.shown, &Request::new(Taus::LogSpaced))
    }
}

/// Scatter beyond chance, as a part of σ, from which on it is said. Less is in the intervals all the same. Curves of other programs, whose
/// differences do not overlap, scatter by about 5 % more than ours: a warning for each of them would say nothing. Of 200 records of the five
/// terms alone, half of them as such curves, fewer than 5 % are warned of.
const SCATTER_SAID: f64 = 0.1;

/// Periods that are named in a warning.
const PERIODS_SAID: usize = 3;

/// What a misfit of the curve means, in words; `None` for one that is small.
pub(crate) fn misfit_text(axis: &AxisBudget) -> Option<String> {
    let part = axis.misfit.filter(|part| *part >= SCATTER_SAID)?;
    Some(format!(
        "axis {}: the curve scatters about the five terms by {} % more than chance explains (motion, steps or a wandering period); \
         the intervals of its terms include that",
        axis.axis,
        significant(100.0 * part, 2)
    ))
}

/// What to do with a record that moves.
const NO_NOISE: &str = "so that its curve is no noise: `--at-rest` uses the longest rest";

/// Claims no term of the curve of a motion.
fn withhold(axis: &mut AxisBudget) {
    axis.terms = axis.terms.withheld("the record is not at rest");
    axis.fitted = None;
}

/// Where the five laws begin, in words; `None` where they hold at all τ.
fn law_range_text(axis: &AxisBudget) -> Option<String> {
    let range = axis.law_range?;
    let letter = axis.axis;
    let from = significant(range.from_s, 2);
    Some(match range.filter_hz {
        Some(hz) => format!(
            "axis {letter}: filtered at about {} Hz, so that N and the slower terms are fitted from τ = {from} s on",
            significant(hz, 2)
        ),
        None => format!(
            "axis {letter}: below τ = {from} s a dither, a beat or a disturbance shapes the curve, and the terms are fitted from there on"
        ),
    })
}

/// The periods of a rate in words; `None` without one.
fn periods_text(axis: &AxisBudget) -> Option<String> {
    let word = |period: &Period| {
        let period_s = significant(period.frequency_hz.recip(), 3);
        format!(
            "{period_s} s ({} Hz, amplitude {} °/h)",
            significant(period.frequency_hz, 3),
            significant(period.amplitude_dph, 2)
        )
    };
    let words: Vec<String> = axis.periods.iter().take(PERIODS_SAID).map(word).collect();
    let more = axis.periods.len().saturating_sub(PERIODS_SAID);
    let more = if more > 0 { format!(" and {more} weaker") } else { String::new() };
    let period = if axis.periods.len() == 1 { "a period" } else { "periods" };
    (!words.is_empty()).then(|| {
        format!("axis {}: the rate has {period} of {}{more}, taken out of the terms", axis.axis, words.join(", "))
    })
}

/// Disturbed rows that stay in the values, in words.
fn disturbed_text(axis: &AxisBudget) -> Option<String> {
    let disturbed = axis.disturbed.as_ref().filter(|disturbed| !disturbed.excluded)?;
    let first = disturbed.first.first().map_or("", |row| row.at.as_str());
    Some(format!(
        "axis {}: {} rows ({} %, the first at {first}) are far from those around them: too many to exclude, they make N larger",
        axis.axis,
        disturbed.rows,
        significant(100.0 * disturbed.fraction, 2)
    ))
}

fn bad_tau(error: TauError) -> Error {
    Error::input(error.to_string(), "write it like --taus 1,10,100").column("--taus").value(error.tau_s.to_string())
}

/// What is being read.
#[derive(Clone)]
struct Reading {
    screens: Vec<Screen>,
    shape: LogShape,
    watches: Vec<RampWatch>,
    warnings: Vec<String>,
    tallies: Tallies,
    inputs: Vec<LogFile>,
    arcsec: f64,
    last_end_ns: Option<i64>,
    thermometers: usize,
    detrended: bool,
    /// Rows outside of it are not used.
    at_rest: Option<RestSpan>,
    /// Motion of all rows of a log with a clock.
    rest: Option<RestWatch>,
    /// Lowest and highest rate of a table, °/s.
    table_dps: [f64; 2],
    /// Angles without the drift, to be used again.
    angles: Vec<Vec<f64>>,
}

impl Reading {
    fn new(shape: &LogShape, shown: &[usize], exact: bool) -> Self {
        Self::holding(shape, shown, if exact { usize::MAX } else { HELD_PHASES / shape.axes.len().max(1) })
    }

    /// Holds so many phases of each axis.
    fn holding(shape: &LogShape, shown: &[usize], hold: usize) -> Self {
        let wanted = differences(shown, MOST_ROWS);
        Self {
            screens: shape.axes.iter().map(|_| Screen::new(wanted.clone(), hold)).collect(),
            shape: shape.clone(),
            watches: vec![RampWatch::default(); shape.thermometers.len()],
            warnings: Vec::new(),
            tallies: Tallies::default(),
            inputs: Vec::new(),
            arcsec: shape.unit.arcsec(),
            last_end_ns: None,
            thermometers: shape.thermometers.len(),
            detrended: false,
            at_rest: None,
            rest: (shape.timed && !shape.has_reference).then(|| RestWatch::new(shape)),
            table_dps: [f64::INFINITY, f64::NEG_INFINITY],
            angles: Vec::new(),
        }
    }

    fn push(&mut self, batch: &Batch, drift: Option<&RampDrift>) {
        self.watches.iter_mut().enumerate().for_each(|(sensor, watch)| watch.push(batch, sensor));
        for rate in batch.reference_dps.iter().filter(|rate| rate.is_finite()) {
            self.table_dps = [self.table_dps[0].min(*rate), self.table_dps[1].max(*rate)];
        }
        if batch.begins_run {
            self.end_run();
        }
        if let Some(rest) = &mut self.rest {
            rest.push(batch);
        }
        let Some(drift) = drift else { return self.pieces(batch, &batch.angle, None) };
        let mut angles = std::mem::take(&mut self.angles);
        angles.clone_from(&batch.angle);
        drift.take_from(batch, &mut angles, self.arcsec);
        self.detrended = true;
        self.pieces(batch, &angles, Some(drift));
        self.angles = angles;
    }

    /// Rows with these angles, in pieces as long as nothing is missing; and what was counted over gaps between them.
    fn pieces(&mut self, batch: &Batch, angles: &[Vec<f64>], drift: Option<&RampDrift>) {
        let mut bridges = batch.bridges.iter().peekable();
        let log = self.inputs.len() as u32;
        let rows = self.at_rest.as_ref().map_or(0..batch.len(), |rest| rest.rows_of(log, batch));
        let mut at = rows.start;
        while bridges.next_if(|bridge| bridge.before_row < at).is_some() {}
        loop {
            while let Some(bridge) = bridges.next_if(|bridge| bridge.before_row <= at && !rows.is_empty()) {
                self.bridge(bridge, drift);
            }
            if at >= rows.end {
                break;
            }
            let next_bridge = bridges.peek().map_or(rows.end, |bridge| bridge.before_row.min(rows.end));
            let end = self.end_of_plain(batch, at, next_bridge);
            if end > at {
                self.plain_rows(batch, angles, at..end);
            } else {
                self.row(batch, angles, at);
            }
            at = end.max(at + 1);
        }
    }

    /// The end of the rows from `at` on that are valid, an interval each, and follow on without a gap.
    fn end_of_plain(&self, batch: &Batch, at: usize, before: usize) -> usize {
        let (mut last_ns, mut end) = (self.last_end_ns.unwrap_or(batch.start_ns[at]), at);
        if batch.is_plain() && batch.start_ns[at] == last_ns {
            return before;
        }
        let rows = batch.start_ns[at..before].iter().zip(&batch.end_ns[at..before]).zip(&batch.valid[at..before]);
        for ((start_ns, end_ns), valid) in rows {
            if !valid || *start_ns != last_ns || !self.shape.is_one_interval(*start_ns, *end_ns) {
                break;
            }
            (last_ns, end) = (*end_ns, end + 1);
        }
        end
    }

    fn plain_rows(&mut self, batch: &Batch, angles: &[Vec<f64>], rows: Range<usize>) {
        let log = self.inputs.len() as u32;
        for (screen, column) in self.screens.iter_mut().zip(angles) {
            screen.rows(&column[rows.clone()], |at| RowPlace { log, line: batch.line[rows.start + at] });
        }
        self.last_end_ns = Some(batch.end_ns[rows.end - 1]);
    }

    /// A row; what is missing before it is lost.
    fn row(&mut self, batch: &Batch, angles: &[Vec<f64>], row: usize) {
        let (start_ns, end_ns) = (batch.start_ns[row], batch.end_ns[row]);
        let place = RowPlace { log: self.inputs.len() as u32, line: batch.line[row] };
        let gap_from_ns = self.last_end_ns.filter(|last_ns| *last_ns != start_ns);
        let lost = gap_from_ns.map_or(0, |last_ns| self.shape.intervals(last_ns, start_ns));
        let here = self.shape.intervals(start_ns, end_ns);
        for (screen, column) in self.screens.iter_mut().zip(angles) {
            if lost > 0 {
                screen.lost(lost);
            }
            match batch.valid[row] {
                true => screen.wide(here, column[row], place),
                false => screen.lost(here),
            }
        }
        self.last_end_ns = Some(end_ns);
    }

    /// What a running total counted over a gap.
    fn bridge(&mut self, bridge: &Bridge, drift: Option<&RampDrift>) {
        let place = RowPlace { log: self.inputs.len() as u32, line: bridge.line };
        if self.last_end_ns != Some(bridge.start_ns) {
            self.end_stretch();
        }
        let mut angles = bridge.angle.clone();
        if let Some(drift) = drift {
            drift.take_from_one(bridge.start_ns, bridge.end_ns, &mut angles, self.arcsec);
        }
        let here = self.shape.intervals(bridge.start_ns, bridge.end_ns);
        self.screens.iter_mut().zip(angles).for_each(|(screen, angle)| screen.wide(here, angle, place));
        self.last_end_ns = Some(bridge.end_ns);
    }

    fn end_stretch(&mut self) {
        self.screens.iter_mut().for_each(Screen::end_stretch);
        self.last_end_ns = None;
    }

    fn end_run(&mut self) {
        self.screens.iter_mut().for_each(Screen::end_run);
        self.rest.iter_mut().for_each(RestWatch::end_run);
        self.last_end_ns = None;
        let watches = std::mem::replace(&mut self.watches, vec![RampWatch::default(); self.thermometers]);
        self.warnings.extend(watches.into_iter().find_map(RampWatch::verdict));
    }

    fn finish(self, shape: &LogShape, shown: &[usize], request: &Request) -> Result<NoiseBudget> {
        let tau0_s = s_from_ns(shape.nominal_ns);
        let screened: Vec<Screened> = self.screens.into_iter().map(Screen::finish).collect();
        let longest = screened.iter().map(|axis| axis.used.stretches.longest()).max().unwrap_or(0);
        if screened.iter().all(|axis| axis.used.rows == 0) {
            return Err(Error::input(
                "the log has no usable row",
                "run `sagnac inspect LOG` to list the excluded rows",
            ));
        }
        let limit = request.taus.longest_shown(longest);
        if request.taus == Taus::All && limit > MOST_TAUS {
            return Err(Error::input(
                format!("`all` would be {limit} τ, and the limit is {MOST_TAUS}"),
                "remove --taus for ten τ per decade, or list the τ you want",
            )
            .column("--taus"));
        }
        let mut warnings = self.warnings;
        warnings.dedup();
        if self.detrended {
            warnings.clear();
        }
        let [slowest, fastest] = self.table_dps;
        if fastest - slowest > SAME_RATE * fastest.abs().max(slowest.abs()) {
            warnings.push(format!(
                "a table turned in this record, from {} to {} °/s: its turns read as noise",
                significant(slowest, 4),
                significant(fastest, 4)
            ));
        }
        let place = |place: RowPlace| {
            let file = self.inputs.get(place.log as usize).map_or("", |input| input.file.as_str());
            format!("{file}:{}", place.line)
        };
        let unit = match shape.unit {
            AngleUnit::Quanta { .. } => RecordUnit::Count(self.arcsec),
            AngleUnit::Arcsec => RecordUnit::Angle(self.arcsec),
        };
        let axes = shape.axes.iter().zip(&screened).map(|(letter, screened)| {
            let shown_as = |asked: usize| if screened.used.full_overlap { asked } else { served(asked) };
            let asked = |m: usize| m <= limit && shown.iter().any(|asked| shown_as(*asked) == m);
            budget_of_screened(*letter, screened, tau0_s, unit, asked, place)
        });
        let mut axes: Vec<AxisBudget> = axes.collect();
        // Fewer rows are taken out as disturbed ones.
        let moves = |rest: &Rest| rest.moving_s > MOST_DISTURBED_PART * rest.length_s;
        if let Some(rest) = self.rest.and_then(RestWatch::finish).filter(moves) {
            let percent = significant(100.0 * rest.moving_s / rest.length_s, 2);
            warnings.insert(0, format!("not at rest: the rows move in {percent} % of the time, {NO_NOISE}"));
            axes.iter_mut().for_each(withhold);
        }
        warnings.extend(axes.iter().filter_map(law_range_text));
        warnings.extend(axes.iter().filter_map(periods_text));
        warnings.extend(axes.iter().filter_map(misfit_text));
        warnings.extend(axes.iter().filter_map(disturbed_text));
        Ok(NoiseBudget {
            axes,
            warnings,
            detrended: self.detrended,
            at_rest: self.at_rest,
            excluded: self.tallies.list(),
            inputs: self.inputs,
            program: program(),
        })
    }
}
