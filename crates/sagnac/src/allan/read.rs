//! Logs in, noise budget out.

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Batch, LogReader, LogShape, Tallies, Tally, same_shape};
use sagnac_log::setup::Setup;
use sagnac_noise::{
    AxisBudget, HELD_PHASES, MOST_ROWS, MOST_TAUS, Recorded, Recorder, TauError, Taus, budget, differences, served,
};
use sagnac_units::format::significant;
use sagnac_units::s_from_ns;
use serde::Serialize;

use crate::allan::ramp::{Drift, RampWatch};
use crate::calibration::{LogFile, program};
use crate::fit::SAME_RATE;

/// What is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// τ to show.
    pub taus: Taus,
    /// Hold every phase (8 bytes each), so that every τ overlaps fully however long the record is.
    pub exact: bool,
}

/// The noise of a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NoiseBudget {
    /// Axis by axis.
    pub axes: Vec<AxisBudget>,
    /// Warnings about the figures.
    pub warnings: Vec<String>,
    /// The drift over temperature was removed first.
    pub detrended: bool,
    /// What was not used.
    pub excluded: Vec<Tally>,
    /// The logs.
    pub inputs: Vec<LogFile>,
    /// Program and version.
    pub program: String,
}

/// Reads logs, each as one or more unbroken stretches, into a noise budget.
///
/// With `again` (the same logs, opened anew) the drift over temperature is removed first.
///
/// # Errors
/// Errors of reading; logs of different shape; `all` τ of a long record; a temperature whose drift cannot be removed.
pub fn noise_budget(
    logs: Vec<LogReader>,
    again: Option<Vec<LogReader>>,
    setup: &Setup,
    request: &Request,
) -> Result<NoiseBudget> {
    let shape = logs.first().ok_or_else(|| Error::input("no log given"))?.shape().clone();
    let tau0_s = s_from_ns(shape.nominal_ns);
    let drifts = again.map(|again| Drift::of(again, setup)).transpose()?;
    let shown = request.taus.multiples(tau0_s).map_err(bad_tau)?;
    let mut reading = Reading::new(&shape, &shown, request.exact);
    for (number, mut log) in logs.into_iter().enumerate() {
        same_shape(&shape, log.shape()).map_err(|e| e.file(log.summary().file))?;
        while let Some(batch) = log.next_batch()? {
            reading.push(batch, drifts.as_ref().and_then(|drifts| drifts.get(number)));
        }
        reading.end_run();
        let summary = log.summary();
        reading.tallies.merge(&summary.tallies);
        reading.inputs.push(LogFile::of(&summary));
    }
    reading.finish(&shape, &shown, request)
}

/// What a misfit of the curve means, in words.
pub(crate) fn misfit_text(axis: &AxisBudget) -> Option<String> {
    let part = axis.misfit?;
    Some(format!(
        "axis {}: the curve scatters about the five terms by {} % more than chance explains (a period, dither or steps); \
         the intervals of its terms include that",
        axis.axis,
        significant(100.0 * part, 2)
    ))
}

fn bad_tau(error: TauError) -> Error {
    Error::input(error.to_string()).column("--taus").value(error.tau_s.to_string())
}

/// What is being read.
struct Reading {
    recorders: Vec<Recorder>,
    watches: Vec<RampWatch>,
    warnings: Vec<String>,
    tallies: Tallies,
    inputs: Vec<LogFile>,
    arcsec: f64,
    last_end_ns: Option<i64>,
    thermometers: usize,
    detrended: bool,
    /// Lowest and highest rate of a table, °/s.
    table_dps: [f64; 2],
    angles: Vec<Vec<f64>>,
}

impl Reading {
    fn new(shape: &LogShape, shown: &[usize], exact: bool) -> Self {
        let wanted = differences(shown, MOST_ROWS);
        let hold = if exact { usize::MAX } else { HELD_PHASES / shape.axes.len().max(1) };
        Self {
            recorders: shape.axes.iter().map(|_| Recorder::new(wanted.clone(), hold)).collect(),
            watches: vec![RampWatch::default(); shape.thermometers.len()],
            warnings: Vec::new(),
            tallies: Tallies::default(),
            inputs: Vec::new(),
            arcsec: shape.unit.arcsec(),
            last_end_ns: None,
            thermometers: shape.thermometers.len(),
            detrended: false,
            table_dps: [f64::INFINITY, f64::NEG_INFINITY],
            angles: Vec::new(),
        }
    }

    fn push(&mut self, batch: &Batch, drift: Option<&Drift>) {
        self.watches.iter_mut().enumerate().for_each(|(sensor, watch)| watch.push(batch, sensor));
        for rate in batch.reference_dps.iter().filter(|rate| rate.is_finite()) {
            self.table_dps = [self.table_dps[0].min(*rate), self.table_dps[1].max(*rate)];
        }
        self.angles.clone_from(&batch.angle);
        if let Some(drift) = drift {
            drift.take_from(batch, &mut self.angles, self.arcsec);
            self.detrended = true;
        }
        let mut at = 0;
        while at < batch.len() {
            if self.last_end_ns != Some(batch.start_ns[at]) {
                self.end_stretch();
            }
            if !batch.valid[at] {
                self.end_stretch();
                at += 1;
                continue;
            }
            let joins = |i: usize| batch.valid[i] && batch.start_ns[i] == batch.end_ns[i - 1];
            let end = (at + 1..batch.len()).find(|i| !joins(*i)).unwrap_or(batch.len());
            for (recorder, column) in self.recorders.iter_mut().zip(&self.angles) {
                recorder.push(&column[at..end]);
            }
            self.last_end_ns = batch.end_ns.get(end - 1).copied();
            at = end;
        }
    }

    fn end_stretch(&mut self) {
        self.recorders.iter_mut().for_each(Recorder::end_stretch);
        self.last_end_ns = None;
    }

    fn end_run(&mut self) {
        self.end_stretch();
        let watches = std::mem::replace(&mut self.watches, vec![RampWatch::default(); self.thermometers]);
        self.warnings.extend(watches.into_iter().find_map(RampWatch::verdict));
    }

    fn finish(self, shape: &LogShape, shown: &[usize], request: &Request) -> Result<NoiseBudget> {
        let tau0_s = s_from_ns(shape.nominal_ns);
        let recorded: Vec<Recorded> = self.recorders.into_iter().map(Recorder::finish).collect();
        let longest = recorded.iter().map(|axis| axis.stretches.longest()).max().unwrap_or(0);
        if recorded.iter().all(|axis| axis.rows == 0) {
            return Err(Error::input("no row of this log can be used").help("`sagnac inspect` says why"));
        }
        let limit = request.taus.longest_shown(longest);
        if request.taus == Taus::All && limit > MOST_TAUS {
            return Err(Error::input(format!("`all` would be {limit} τ; at most {MOST_TAUS} are shown"))
                .column("--taus")
                .help("leave it out for ten τ per decade, or name the τ you want"));
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
        let axes = shape.axes.iter().zip(&recorded).map(|(letter, recorded)| {
            let shown_as = |asked: usize| if recorded.full_overlap { asked } else { served(asked) };
            let asked = |m: usize| m <= limit && shown.iter().any(|asked| shown_as(*asked) == m);
            budget(*letter, recorded, tau0_s, self.arcsec, asked)
        });
        let axes: Vec<AxisBudget> = axes.collect();
        warnings.extend(axes.iter().filter_map(misfit_text));
        Ok(NoiseBudget {
            axes,
            warnings,
            detrended: self.detrended,
            excluded: self.tallies.list(),
            inputs: self.inputs,
            program: program(),
        })
    }
}
