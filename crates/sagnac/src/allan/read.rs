//! Logs in, noise budget out.

use serde::Serialize;

use crate::allan::budget::{AxisBudget, LONGEST_PART, budget, differences};
use crate::allan::pyramid::served;
use crate::allan::ramp::{Drift, RampWatch};
use crate::allan::recorder::{Recorded, Recorder};
use crate::calibration::Input;
use crate::digits::significant;
use crate::error::{Error, Result};
use crate::fit::{SAME_RATE, program};
use crate::ingest::{Batch, LogReader, LogShape, Tallies, Tally};
use crate::setup::Setup;
use crate::units::s_from_ns;
use crate::window::same_shape;

/// Points per decade of τ unless told.
const PER_DECADE: usize = 10;
/// Phases that are held, all axes together, before the pyramid takes them: 24 MiB.
pub const HELD_PHASES: usize = 3 << 20;
/// `all` shows no more τ than this.
const MOST_TAUS: usize = 20_000;
/// Distances that are prepared: no record is longer.
const HIGHEST: usize = 1 << 40;

/// The τ to show.
#[derive(Clone, Debug, PartialEq)]
pub enum Taus {
    /// Ten per decade.
    LogSpaced,
    /// Powers of two of the row's interval.
    Octaves,
    /// Every multiple of the row's interval.
    All,
    /// These, s; each to the nearest multiple.
    Given(Vec<f64>),
}

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
pub struct NoiseBudget {
    /// Axis by axis.
    pub axes: Vec<AxisBudget>,
    /// What makes the figures doubtful.
    pub warnings: Vec<String>,
    /// The drift over temperature was taken out first.
    pub detrended: bool,
    /// What was not used.
    pub excluded: Vec<Tally>,
    /// The logs.
    pub inputs: Vec<Input>,
    /// Program and version.
    pub program: String,
}

impl Taus {
    /// Distances in rows, rising; for `All` those of a record of so many rows.
    fn multiples(&self, tau0_s: f64) -> Result<Vec<usize>> {
        let mut out: Vec<usize> = match self {
            Self::LogSpaced => {
                let exponents = 0..=12 * PER_DECADE;
                exponents.map(|i| 10.0_f64.powf(i as f64 / PER_DECADE as f64).round() as usize).collect()
            }
            Self::Octaves => (0..40).map(|octave| 1 << octave).collect(),
            Self::All => (1..=MOST_TAUS).collect(),
            Self::Given(seconds) => {
                let one = |tau_s: &f64| {
                    let m = (tau_s / tau0_s).round();
                    if (1.0..HIGHEST as f64).contains(&m) {
                        return Ok(m as usize);
                    }
                    Err(Error::input(format!(
                        "τ must be a multiple of the row's interval, {tau0_s} s, and at least it"
                    ))
                    .column("--taus")
                    .value(tau_s.to_string()))
                };
                seconds.iter().map(one).collect::<Result<_>>()?
            }
        };
        out.sort_unstable();
        out.dedup();
        out.retain(|m| *m <= HIGHEST);
        Ok(out)
    }
}

/// Reads logs, each as one or more unbroken stretches, into a noise budget.
///
/// With `again` (the same logs, opened anew) the drift over temperature is taken out first.
///
/// # Errors
/// What reading says; logs of different shape; `all` τ of a long record; a temperature that cannot be taken out.
pub fn noise_budget(
    logs: Vec<LogReader>,
    again: Option<Vec<LogReader>>,
    setup: &Setup,
    request: &Request,
) -> Result<NoiseBudget> {
    let shape = logs.first().ok_or_else(|| Error::input("no log given"))?.shape().clone();
    let tau0_s = s_from_ns(shape.nominal_ns);
    let drifts = again.map(|again| Drift::of(again, setup)).transpose()?;
    let shown = request.taus.multiples(tau0_s)?;
    let mut reading = Reading::new(&shape, &shown, request.exact);
    for (number, mut log) in logs.into_iter().enumerate() {
        same_shape(&shape, log.shape()).map_err(|e| e.file(log.summary().file))?;
        while let Some(batch) = log.next_batch()? {
            reading.push(batch, drifts.as_ref().and_then(|drifts| drifts.get(number)));
        }
        reading.end_run();
        let summary = log.summary();
        reading.tallies.merge(&summary.tallies);
        reading.inputs.push(Input::of(&summary));
    }
    reading.finish(&shape, &shown, request)
}

/// The budget of one unbroken stretch that is at hand: angles of `tau0_s` seconds each, arcsec.
///
/// # Errors
/// As [`noise_budget`].
pub fn budget_of_angles(angles: &[f64], tau0_s: f64, taus: &Taus) -> Result<AxisBudget> {
    let shown = taus.multiples(tau0_s)?;
    let mut recorder = Recorder::new(differences(&shown, angles.len().max(1)), usize::MAX);
    recorder.push(angles);
    let recorded = recorder.finish();
    let limit = shown_limit(taus, recorded.stretches.longest());
    Ok(budget('x', &recorded, tau0_s, 1.0, |m| m <= limit && shown.contains(&m)))
}

/// What is being read.
struct Reading {
    recorders: Vec<Recorder>,
    watches: Vec<RampWatch>,
    warnings: Vec<String>,
    tallies: Tallies,
    inputs: Vec<Input>,
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
        let wanted = differences(shown, HIGHEST);
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
            return Err(Error::input("no row of this log can be used").help("`sagnac inspect` tells why"));
        }
        let limit = shown_limit(&request.taus, longest);
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
        warnings.extend(axes.iter().filter_map(AxisBudget::misfit_text));
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

/// What was asked for by name is shown while there is a difference; else up to a third of the longest stretch.
fn shown_limit(taus: &Taus, longest_phases: u64) -> usize {
    let part = match taus {
        Taus::Given(_) => 2,
        _ => LONGEST_PART,
    };
    usize::try_from(longest_phases / part).unwrap_or(usize::MAX)
}
