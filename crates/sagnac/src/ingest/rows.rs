//! Judging rows: time in order, counters unrolled, temperatures believed or not.
//!
//! A row at t holds the counts (or the mean rate) of (t − dt, t]; the first row and the first after
//! a gap take the nominal interval. What cannot be used is counted by reason, never guessed.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::ingest::Batch;
use crate::ingest::csv::RawRow;
use crate::ingest::header::Layout;
use crate::setup::{Counter, Setup, ThermometerSetup};
use crate::units::s_from_ns;

/// Why a row, a temperature or a window is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Not as many fields as the header has.
    Ragged,
    /// A time or count that is not a finite number.
    NotANumber,
    /// More than 2^40 quanta or 1e8 °/h in a row.
    ValueOutOfRange,
    /// Time before the row above.
    TimeBackwards,
    /// Time of the row above.
    DuplicateTime,
    /// More than 1.5 intervals since the row above; the row itself is used unless its counter is cumulative.
    Gap,
    /// The log's own flag.
    FlaggedInvalid,
    /// A temperature field that holds no number.
    TemperatureNotANumber,
    /// A temperature outside the plausible limits.
    TemperatureImplausible,
    /// A temperature that jumped by more than 5 °C between rows and did not stay.
    ThermometerJump,
    /// A thermometer that stood still while another moved.
    ThermometerFrozen,
    /// Window within `settle_s` of the start of its run.
    Settling,
    /// Window of less than a tenth of the nominal length.
    ShortWindow,
    /// Window with fewer than half of its temperatures.
    NoTemperature,
    /// First window of a run, far from what follows.
    StartUp,
    /// Window far from its neighbours (a bump, a motion).
    Motion,
    /// Window on the shorter side of a lasting step.
    Step,
}

impl Reason {
    /// The name scripts rely on.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ragged => "ragged",
            Self::NotANumber => "not_a_number",
            Self::ValueOutOfRange => "value_out_of_range",
            Self::TimeBackwards => "time_backwards",
            Self::DuplicateTime => "duplicate_time",
            Self::Gap => "gap",
            Self::FlaggedInvalid => "flagged_invalid",
            Self::TemperatureNotANumber => "temperature_not_a_number",
            Self::TemperatureImplausible => "temperature_implausible",
            Self::ThermometerJump => "thermometer_jump",
            Self::ThermometerFrozen => "thermometer_frozen",
            Self::Settling => "settling",
            Self::ShortWindow => "short_window",
            Self::NoTemperature => "no_temperature",
            Self::StartUp => "start_up",
            Self::Motion => "motion",
            Self::Step => "step",
        }
    }
}

/// How often a reason occurred, and where first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Tally {
    /// The reason.
    pub reason: Reason,
    /// Rows of the log it concerns.
    pub rows: u64,
    /// `file:line` of the first.
    pub first: String,
}

/// Tallies of one or several logs, in the order of [`Reason`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tallies(BTreeMap<Reason, (u64, String)>);

impl Tallies {
    /// Counts `rows` more for a reason.
    pub fn add(&mut self, reason: Reason, rows: u64, first: impl FnOnce() -> String) {
        self.0.entry(reason).or_insert_with(|| (0, first())).0 += rows;
    }

    /// Adds another log's tallies; first places stay.
    pub fn merge(&mut self, other: &Self) {
        for (reason, (rows, first)) in &other.0 {
            self.add(*reason, *rows, || first.clone());
        }
    }

    /// From a list.
    pub fn from_list(list: Vec<Tally>) -> Self {
        Self(list.into_iter().map(|tally| (tally.reason, (tally.rows, tally.first))).collect())
    }

    /// As a list.
    pub fn list(&self) -> Vec<Tally> {
        self.0
            .iter()
            .map(|(reason, (rows, first))| Tally { reason: *reason, rows: *rows, first: first.clone() })
            .collect()
    }
}

/// Rows of this many °C apart are a jump …
const JUMP_C: f64 = 5.0;
/// … unless the new level stays for this many rows.
const JUMP_STAYS_ROWS: u32 = 10;
/// A thermometer is frozen if another moved by this much …
const FROZEN_OTHER_MOVED_C: f64 = 3.0;
/// … while it gave one and the same value for this long.
const FROZEN_NS: i64 = 300_000_000_000;
/// A cumulative counter may bridge rows that could not be read, up to this many intervals.
const BRIDGED_INTERVALS: i64 = 3;
/// No log has a gap of 30 days.
const LEAP_NS: i64 = 30 * 86_400 * 1_000_000_000;
const MAX_QUANTA: f64 = (1_u64 << 40) as f64;
const MAX_RATE_DPH: f64 = 1e8;

/// The state machine that turns raw rows into usable ones.
pub(crate) struct RowCheck {
    file: String,
    timed: bool,
    nominal_ns: i64,
    counter: Counter,
    counter_bits: Option<u8>,
    /// Counts per quantum, or `None` for a rate log.
    quantum: Option<f64>,
    clock_ns: Option<i64>,
    last_counter: Option<(i64, Vec<i64>)>,
    largest_step: i64,
    thermometers: Vec<ThermometerCheck>,
    pub(crate) tallies: Tallies,
    pub(crate) rows_read: u64,
}

impl RowCheck {
    pub(crate) fn new(file: String, layout: &Layout, setup: &Setup, nominal_ns: i64) -> Self {
        let thermometers =
            layout.temperatures.iter().map(|(_, name, _)| ThermometerCheck::new(setup.thermometer(name)));
        Self {
            file,
            timed: layout.time.is_some(),
            nominal_ns,
            counter: setup.counter,
            counter_bits: setup.counter_bits,
            quantum: layout.is_count_log().then(|| setup.quantum.unwrap_or(1.0)),
            clock_ns: None,
            last_counter: None,
            largest_step: 0,
            thermometers: thermometers.collect(),
            tallies: Tallies::default(),
            rows_read: 0,
        }
    }

    /// Judges one row; appends it to `batch` if it is usable.
    pub(crate) fn push(&mut self, row: &RawRow, batch: &mut Batch) -> Result<()> {
        self.rows_read += 1;
        self.refuse_leap(row)?;
        let Some((start_ns, end_ns)) = self.interval(row) else {
            return Ok(());
        };
        let moved_clock = self.clock_ns.replace(end_ns).is_some();
        if row.axes.iter().any(|v| v.is_nan()) {
            self.reject(Reason::NotANumber, row);
            return Ok(());
        }
        let units = match self.quantum {
            Some(quantum) => self.counts(row, quantum, start_ns, end_ns)?,
            None => self.rates(row, s_from_ns(end_ns - start_ns)).map(|angles| (start_ns, angles)),
        };
        let Some((start_ns, angles)) = units else {
            return Ok(());
        };
        self.check_temperatures(row, end_ns, moved_clock && self.timed, batch);
        if !row.valid {
            self.reject(Reason::FlaggedInvalid, row);
        }
        batch.push(start_ns, end_ns, &angles, row);
        Ok(())
    }

    /// A clock that was set in the middle of a log makes one log into two.
    fn refuse_leap(&self, row: &RawRow) -> Result<()> {
        match (row.time_ns, self.clock_ns) {
            (Some(now), Some(before)) if now.saturating_sub(before) > LEAP_NS => {
                Err(Error::input(format!("time leaps by {:.0} days", s_from_ns(now.saturating_sub(before)) / 86_400.0))
                    .file(&self.file)
                    .line(row.line)
                    .help("cut the log there and give both parts; each file is a run of its own"))
            }
            _ => Ok(()),
        }
    }

    fn reject(&mut self, reason: Reason, row: &RawRow) {
        let file = &self.file;
        self.tallies.add(reason, 1, || format!("{file}:{}", row.line));
    }

    /// The interval (start, end] the row speaks of, or `None` if its time cannot be used.
    fn interval(&mut self, row: &RawRow) -> Option<(i64, i64)> {
        if row.ragged {
            self.reject(Reason::Ragged, row);
            return None;
        }
        if !self.timed {
            let start = self.clock_ns.unwrap_or(0);
            return Some((start, start.saturating_add(self.nominal_ns)));
        }
        let Some(t) = row.time_ns.filter(|t| t.unsigned_abs() < 1 << 62) else {
            self.reject(Reason::NotANumber, row);
            return None;
        };
        let Some(before) = self.clock_ns else {
            return Some((t - self.nominal_ns, t));
        };
        if t <= before {
            self.reject(if t == before { Reason::DuplicateTime } else { Reason::TimeBackwards }, row);
            return None;
        }
        if (t - before) > self.nominal_ns + self.nominal_ns / 2 {
            self.reject(Reason::Gap, row);
            return Some((t - self.nominal_ns, t));
        }
        Some((before, t))
    }

    /// Quanta of each axis, with the start of the interval they belong to.
    fn counts(&mut self, row: &RawRow, quantum: f64, start_ns: i64, end_ns: i64) -> Result<Option<(i64, Vec<f64>)>> {
        let mut quanta = Vec::with_capacity(row.axes.len());
        for counts in &row.axes {
            let exact = counts / quantum;
            if exact.abs() > MAX_QUANTA && self.counter == Counter::Incremental || exact.abs() > 9e15 {
                self.reject(Reason::ValueOutOfRange, row);
                return Ok(None);
            }
            if (exact - exact.round()).abs() > 1e-6 * exact.abs().max(1.0) {
                return Err(Error::input(format!("not a whole number of quanta (quantum {quantum} counts)"))
                    .file(&self.file)
                    .line(row.line)
                    .value(counts.to_string())
                    .help("give the smallest step of the counts column with --quantum or in the setup"));
            }
            quanta.push(exact.round() as i64);
        }
        if self.counter == Counter::Incremental {
            return Ok(Some((start_ns, quanta.iter().map(|q| *q as f64).collect())));
        }
        let Some((before_ns, before)) = self.last_counter.replace((end_ns, quanta.clone())) else {
            return Ok(None);
        };
        if end_ns - before_ns > BRIDGED_INTERVALS * self.nominal_ns {
            return Ok(None);
        }
        let mut steps = Vec::with_capacity(quanta.len());
        for (now, before) in quanta.iter().zip(&before) {
            steps.push(self.unroll(now - before, row)? as f64);
        }
        Ok(Some((before_ns, steps)))
    }

    fn unroll(&mut self, step: i64, row: &RawRow) -> Result<i64> {
        if let Some(bits) = self.counter_bits {
            let half = 1_i64 << (bits - 1);
            return Ok((step + half).rem_euclid(half << 1) - half);
        }
        let size = step.abs();
        let nearest = (size.max(1) as f64).log2().round().exp2();
        if size > 200 && size > 1000 * self.largest_step.max(1) && (size as f64 / nearest - 1.0).abs() < 0.02 {
            return Err(Error::input(format!("the cumulative counter jumps by {step} quanta, as one that wraps does"))
                .file(&self.file)
                .line(row.line)
                .help("give its width with --counter-bits or counter_bits in the setup"));
        }
        self.largest_step = self.largest_step.max(size);
        Ok(step)
    }

    fn rates(&mut self, row: &RawRow, duration_s: f64) -> Option<Vec<f64>> {
        if row.axes.iter().any(|rate| rate.abs() > MAX_RATE_DPH) {
            self.reject(Reason::ValueOutOfRange, row);
            return None;
        }
        Some(row.axes.iter().map(|rate_dph| rate_dph * duration_s).collect())
    }

    /// Believed temperatures into `batch.checked_c`.
    fn check_temperatures(&mut self, row: &RawRow, t_ns: i64, has_past: bool, batch: &mut Batch) {
        if row.bad_temperature {
            self.reject(Reason::TemperatureNotANumber, row);
        }
        batch.checked_c.clear();
        for (index, &t_c) in row.temperatures_c.iter().enumerate() {
            let others_moved = self.others_moved(index);
            let verdict = self.thermometers[index].check(t_c, t_ns, has_past, others_moved);
            if let Some(reason) = verdict {
                self.reject(reason, row);
            }
            batch.checked_c.push(if verdict.is_some() { f64::NAN } else { t_c });
        }
    }

    /// How far any other thermometer has gone since this one last changed.
    fn others_moved(&self, index: usize) -> f64 {
        let since = self.thermometers[index].changed_ns;
        let others = self.thermometers.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, other)| other.moved_since(since)).fold(0.0, f64::max)
    }
}

/// What is remembered of one thermometer.
struct ThermometerCheck {
    spec: ThermometerSetup,
    believed_c: f64,
    jump_c: f64,
    jump_rows: u32,
    value_c: f64,
    changed_ns: i64,
    /// Sparse memory of (time, value), a new entry per 0.5 °C, to tell how far it moved since when.
    trail: Vec<(i64, f64)>,
}

impl ThermometerCheck {
    fn new(spec: ThermometerSetup) -> Self {
        let nan = f64::NAN;
        Self { spec, believed_c: nan, jump_c: nan, jump_rows: 0, value_c: nan, changed_ns: i64::MIN, trail: Vec::new() }
    }

    fn check(&mut self, t_c: f64, t_ns: i64, has_past: bool, others_moved_c: f64) -> Option<Reason> {
        if t_c.is_nan() {
            return None;
        }
        if !(self.spec.plausible_c[0]..=self.spec.plausible_c[1]).contains(&t_c) {
            return Some(Reason::TemperatureImplausible);
        }
        if has_past && self.jumped(t_c) {
            return Some(Reason::ThermometerJump);
        }
        self.believed_c = t_c;
        self.remember(t_c, t_ns);
        let frozen = t_ns.saturating_sub(self.changed_ns) > FROZEN_NS && others_moved_c > FROZEN_OTHER_MOVED_C;
        frozen.then_some(Reason::ThermometerFrozen)
    }

    /// True while a jump has not stayed long enough to be a new level.
    fn jumped(&mut self, t_c: f64) -> bool {
        if (t_c - self.believed_c).abs() <= JUMP_C || self.believed_c.is_nan() {
            self.jump_rows = 0;
            return false;
        }
        self.jump_rows = if (t_c - self.jump_c).abs() <= JUMP_C { self.jump_rows + 1 } else { 1 };
        self.jump_c = t_c;
        self.jump_rows <= JUMP_STAYS_ROWS
    }

    fn remember(&mut self, t_c: f64, t_ns: i64) {
        if t_c != self.value_c {
            (self.value_c, self.changed_ns) = (t_c, t_ns);
        }
        if self.trail.last().is_none_or(|(_, last)| (last - t_c).abs() > 0.5) {
            if self.trail.len() == 256 {
                self.trail.drain(..128);
            }
            self.trail.push((t_ns, t_c));
        }
    }

    fn moved_since(&self, since_ns: i64) -> f64 {
        let later = self.trail.iter().rev().take_while(|(t, _)| *t >= since_ns).map(|(_, value)| *value);
        let (lo, hi) = later.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (hi - lo).max(0.0)
    }
}
