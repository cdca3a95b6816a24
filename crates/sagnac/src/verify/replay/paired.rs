//! Windows of a retest, as logged and as corrected: the same rows, the same bounds, side by side.
//!
//! ```text
//! batch ─┬───────────────▶ raw windows        what is excluded on request is decided here, for both sides
//!        └─▶ Replay ─▶ corrected windows      + the union of the status bits of each window's rows
//! ```
//!
//! Bounds of windows follow from times and temperatures alone, which both sides share.

use crate::verify::replay::clocks::Clocks;
use crate::verify::replay::correction::Correction;
use crate::verify::replay::flagged::{FlaggedOff, FlaggedWatch};
use crate::verify::replay::options::VerifyOptions;
use crate::verify::replay::tick_by_tick::{Corrected, Replay};
use crate::window::{Run, SeenLogs, WindowBuilder, Windows, mark_outliers};
use sagnac_core::Status;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Batch, LogShape, Logs, Reason, same_shape};
use sagnac_log::setup::{Setup, WindowSize};
use sagnac_units::{ns_from_s, s_from_ns};

use crate::rate_table::input::RateTableInput;

/// Both sides of a retest, window by window.
#[derive(Clone, Debug)]
pub(crate) struct PairedWindows {
    /// As logged.
    pub(crate) raw: Windows,
    /// As corrected; axes, bounds and exclusions are those of `raw`.
    pub(crate) corrected: Windows,
    /// Per axis and window: every status bit of its rows.
    pub(crate) status: Vec<Vec<Status>>,
    /// Per axis, flagged rows that differ from their neighbours.
    pub(crate) flagged_off: Vec<Option<FlaggedOff>>,
    /// What the times of its files say of one another.
    pub(crate) clocks: Clocks,
}

impl PairedWindows {
    /// Replays whole logs; the replay goes on where a log goes on with the run of the one before.
    ///
    /// # Errors
    /// What reading and replaying report; logs of different columns or units.
    pub(crate) fn replayed(correction: &Correction, logs: Logs<'_>, setup: &Setup) -> Result<Self> {
        let mut pair: Option<PairBuilder> = None;
        let (mut seen, mut replay, mut counter_end) = (SeenLogs::default(), None::<Replay>, None);
        for log in logs {
            let mut log = log?;
            let shape = log.shape().clone();
            let name = log.summary().file;
            let (images, readings) = correction.fit_to(&shape, setup).map_err(|e| e.file(&name))?;
            let pair = match &mut pair {
                Some(pair) => pair,
                None => pair.insert(PairBuilder::new(&shape, setup)?),
            };
            same_shape(&pair.shape, &shape).map_err(|e| e.file(&name))?;
            pair.raw.follow(&mut log, counter_end.as_ref())?;
            let mut is_first = true;
            log.for_each_batch(|batch| {
                if std::mem::take(&mut is_first) && !pair.begin_file(batch, &name)? || batch.begins_run {
                    let new = Replay::new(&images, &shape, readings.clone(), &name).map_err(|e| e.file(&name))?;
                    replay = Some(new);
                }
                let Some(replay) = &mut replay else { return Ok(()) };
                let corrected = replay.correct(batch)?;
                pair.push(batch, corrected).map_err(|e| e.file(&name))
            })?;
            let summary = log.summary();
            seen.take(&summary)?;
            pair.raw.end_file(summary.clone());
            pair.corrected.end_file(summary);
            counter_end = log.counter_end();
        }
        let pair =
            pair.ok_or_else(|| Error::input("no retest log is given", "give one or more logs after the calibration"))?;
        Ok(pair.finish(setup))
    }

    /// Leaves out windows whose table rate is not known, on both sides.
    ///
    /// # Errors
    /// As [`RateTableInput::of`].
    pub(crate) fn leave_out_unknown(&mut self, setup: &Setup) -> Result<()> {
        RateTableInput::leave_out_unknown(&mut self.raw, setup)?;
        self.corrected.exclude_as(&self.raw);
        Ok(())
    }

    /// The same without what looks like an outlier, or lies at the start of a run.
    pub(crate) fn excluding(&self, options: VerifyOptions, discard_initial_s: f64) -> Self {
        let mut kept = self.clone();
        let until = |run: u32| kept.raw.runs[run as usize].start_ns + ns_from_s(discard_initial_s).unwrap_or(0);
        let early = |i: &usize| kept.raw.rows.start_ns[*i] < until(kept.raw.rows.run[*i]);
        let start: Vec<usize> = (0..kept.raw.len()).filter(early).collect();
        if options.exclude_start {
            start.into_iter().for_each(|i| kept.raw.exclude(i, Reason::Settling));
        }
        if options.exclude_outliers {
            mark_outliers(&mut kept.raw);
        }
        kept.corrected.exclude_as(&kept.raw);
        kept
    }

    /// Part of the rows in usable windows of `whole` that is not used here, 0 to 1.
    pub(crate) fn excluded_fraction(&self, whole: &Self) -> f64 {
        let rows = |pair: &Self| pair.used().iter().map(|i| f64::from(pair.raw.rows.samples[*i])).sum::<f64>();
        1.0 - rows(self) / rows(whole)
    }

    /// The windows of one run alone.
    pub(crate) fn of_run(&self, run: usize) -> Self {
        let of_run = |i: &usize| self.raw.rows.run[*i] as usize == run;
        let members: Vec<usize> = (0..self.raw.len()).filter(of_run).collect();
        Self {
            raw: self.raw.only(&members),
            corrected: self.corrected.only(&members),
            status: self.status.iter().map(|column| members.iter().map(|i| column[*i]).collect()).collect(),
            flagged_off: Vec::new(),
            clocks: Clocks::default(),
        }
    }

    /// Part of the time between the first and the last row of the runs, or of one run, of which nothing is judged, 0 to 1: no row is usable,
    /// the rate of the table is not known, or it lies between files of one clock.
    pub(crate) fn missing_fraction(&self, of_run: Option<usize>) -> f64 {
        let counts = |run: usize| of_run.is_none_or(|of_run| of_run == run);
        let runs: f64 =
            (0..self.raw.runs.len()).filter(|run| counts(*run)).map(|run| self.raw.runs[run].length_s()).sum();
        let whole = runs + if of_run.is_none() { s_from_ns(self.clocks.unseen_ns) } else { 0.0 };
        let is_known = |i: &usize| {
            counts(self.raw.rows.run[*i] as usize) && self.raw.rows.excluded[*i] != Some(Reason::NoReference)
        };
        let known: f64 = (0..self.raw.len()).filter(is_known).map(|i| self.raw.duration_s(i)).sum();
        // Sums of windows and of runs differ by their rounding.
        Some((whole - known) / whole).filter(|part| *part > 1e-9).map_or(0.0, |part| part.min(1.0))
    }

    /// Windows that are used, in their order.
    pub(crate) fn used(&self) -> Vec<usize> {
        (0..self.raw.len()).filter(|i| self.raw.rows.excluded[*i].is_none()).collect()
    }
}

struct PairBuilder {
    shape: LogShape,
    raw: WindowBuilder,
    corrected: WindowBuilder,
    /// None on a table.
    flagged: Option<FlaggedWatch>,
}

impl PairBuilder {
    fn new(shape: &LogShape, setup: &Setup) -> Result<Self> {
        let without_aux = LogShape { aux: Vec::new(), ..shape.clone() };
        let window_s = setup.window.unwrap_or(WindowSize::DEFAULT).seconds();
        let window_ns = window_s.and_then(ns_from_s).unwrap_or(shape.nominal_ns);
        Ok(Self {
            flagged: (shape.timed && !shape.has_reference).then(|| FlaggedWatch::new(shape.axes.len(), window_ns)),
            shape: shape.clone(),
            raw: WindowBuilder::new(shape, setup)?.without_tracks(),
            corrected: WindowBuilder::new(&without_aux, setup)?.without_tracks(),
        })
    }

    fn begin_file(&mut self, batch: &Batch, name: &str) -> Result<bool> {
        self.raw.begin_file(batch, name)?;
        let goes_on = self.corrected.begin_file(batch, name)?;
        self.flagged.iter_mut().filter(|_| !goes_on).for_each(FlaggedWatch::end_run);
        Ok(goes_on)
    }

    fn push(&mut self, batch: &Batch, corrected: Corrected) -> Result<()> {
        self.raw.push(batch)?;
        let Corrected { angle, unrounded, status } = corrected;
        let mut side = batch.clone();
        side.angle = angle;
        side.aux.clear();
        if let Some(flagged) = &mut self.flagged {
            if batch.begins_run {
                flagged.end_run();
            }
            flagged.push(batch, &unrounded);
        }
        // Random walk is estimated before rounding to whole counts: at rest the rounding is a slow saw, which a fit of
        // short τ reads as a walk.
        self.corrected.push_corrected(&side, &unrounded, &status)
    }

    fn finish(self, setup: &Setup) -> PairedWindows {
        let raw = self.raw.finish_whole();
        let (mut corrected, status) = self.corrected.keep_outliers().finish_with_status();
        corrected.exclude_as(&raw);
        let nominal_ns = self.shape.nominal_ns;
        let clocks = if raw.shape.timed { Clocks::of(&raw.runs, nominal_ns, setup) } else { Clocks::default() };
        let length_s = raw.runs.iter().map(Run::length_s).sum();
        let finish = |flagged: FlaggedWatch| flagged.finish(length_s, raw.shape.unit.arcsec());
        let flagged_off = self.flagged.map_or_else(Vec::new, finish);
        PairedWindows { raw, corrected, status, flagged_off, clocks }
    }
}
