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
use crate::ingest::thermometer::ThermometerCheck;
use crate::setup::{Counter, Setup};
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

/// A cumulative counter may bridge rows that could not be read, up to this many intervals.
const BRIDGED_INTERVALS: i64 = 3;
/// No log has a gap of 30 days.
const LEAP_NS: i64 = 30 * 86_400 * 1_000_000_000;
/// A quotient counts / quantum this close to a whole number is one (and the rounding of the division).
const WHOLE_TO: f64 = 1e-6;
/// Totals are held exactly up to here.
const MAX_TOTAL_QUANTA: f64 = 9e15;
const MAX_QUANTA: f64 = (1_u64 << 40) as f64;
const MAX_RATE_DPH: f64 = 1e8;

/// What a row speaks of.
struct Interval {
    start_ns: i64,
    end_ns: i64,
    after_gap: bool,
}

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
    /// The largest step of a total so far, with its sign.
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

    /// Judges one row; appends it to `batch` if it is usable. A row that the log itself flags as invalid
    /// keeps clock and thermometers going; its counts are taken only if they are sound.
    pub(crate) fn push(&mut self, row: &RawRow, batch: &mut Batch) -> Result<()> {
        self.rows_read += 1;
        self.refuse_leap(row)?;
        let Some(interval) = self.interval(row) else {
            return Ok(());
        };
        let joins = self.clock_ns.replace(interval.end_ns).is_some() && !interval.after_gap && self.timed;
        self.check_temperatures(row, &interval, joins, batch);
        if !row.valid {
            self.reject(Reason::FlaggedInvalid, row);
        } else if row.axes.iter().any(|v| v.is_nan()) {
            self.reject(Reason::NotANumber, row);
        }
        if row.axes.iter().any(|v| v.is_nan()) {
            return Ok(());
        }
        let units = match self.quantum {
            Some(quantum) => self.counts(row, quantum, &interval)?,
            None => self.rates(row, &interval).map(|angles| (interval.start_ns, angles)),
        };
        if let Some((start_ns, angles)) = units {
            batch.push(start_ns, interval.end_ns, &angles, row);
        }
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
    fn interval(&mut self, row: &RawRow) -> Option<Interval> {
        if row.ragged {
            self.reject(Reason::Ragged, row);
            return None;
        }
        let nominal = |end_ns: i64, after_gap: bool| Interval { start_ns: end_ns - self.nominal_ns, end_ns, after_gap };
        if !self.timed {
            return Some(nominal(self.clock_ns.unwrap_or(0).saturating_add(self.nominal_ns), false));
        }
        let Some(end_ns) = row.time_ns.filter(|t| t.unsigned_abs() < 1 << 62) else {
            self.reject(Reason::NotANumber, row);
            return None;
        };
        let Some(start_ns) = self.clock_ns else {
            return Some(nominal(end_ns, false));
        };
        if end_ns <= start_ns {
            self.reject(if end_ns == start_ns { Reason::DuplicateTime } else { Reason::TimeBackwards }, row);
            return None;
        }
        if end_ns - start_ns > self.nominal_ns + self.nominal_ns / 2 {
            let interval = nominal(end_ns, true);
            self.reject(Reason::Gap, row);
            return Some(interval);
        }
        Some(Interval { start_ns, end_ns, after_gap: false })
    }

    /// Quanta of each axis, with the start of the interval they belong to.
    fn counts(&mut self, row: &RawRow, quantum: f64, interval: &Interval) -> Result<Option<(i64, Vec<f64>)>> {
        let exact: Vec<f64> = row.axes.iter().map(|counts| counts / quantum).collect();
        let most = if self.counter == Counter::Incremental { MAX_QUANTA } else { MAX_TOTAL_QUANTA };
        if exact.iter().any(|q| q.abs() > most) {
            if row.valid {
                self.reject(Reason::ValueOutOfRange, row);
            }
            return Ok(None);
        }
        let broken = exact.iter().position(|q| (q - q.round()).abs() > WHOLE_TO + 4.0 * f64::EPSILON * q.abs());
        match broken {
            Some(axis) if row.valid => {
                return Err(Error::input(format!("not a whole number of quanta (quantum {quantum} counts)"))
                    .file(&self.file)
                    .line(row.line)
                    .value(row.axes[axis].to_string())
                    .help("give the smallest step of the counts column with --quantum or in the setup"));
            }
            Some(_) => return Ok(None),
            None => {}
        }
        match self.counter {
            Counter::Incremental if row.valid || exact.iter().all(|q| q.abs() <= f64::from(sagnac_core::MAX_RAW)) => {
                Ok(Some((interval.start_ns, exact.iter().map(|q| q.round()).collect())))
            }
            Counter::Incremental => Ok(None),
            // A flagged total is not built upon.
            Counter::Cumulative if !row.valid => Ok(None),
            Counter::Cumulative if exact.iter().any(|q| self.beyond_width(*q)) => {
                Err(Error::input(format!("a total beyond {} bits", self.counter_bits.unwrap_or(0)))
                    .file(&self.file)
                    .line(row.line)
                    .column("counter_bits")
                    .help("give the counter's true width"))
            }
            Counter::Cumulative => self.steps(row, exact.iter().map(|q| q.round() as i64).collect(), interval),
        }
    }

    /// True for a total that a counter of the given width cannot hold, signed or not.
    fn beyond_width(&self, quanta: f64) -> bool {
        self.counter_bits.is_some_and(|bits| quanta.abs() >= 2.0_f64.powi(i32::from(bits)))
    }

    /// Differences to the last usable totals; rows between them that could not be read are bridged.
    fn steps(&mut self, row: &RawRow, totals: Vec<i64>, interval: &Interval) -> Result<Option<(i64, Vec<f64>)>> {
        let Some((before_ns, before)) = self.last_counter.replace((interval.end_ns, totals.clone())) else {
            return Ok(None);
        };
        if interval.end_ns - before_ns > BRIDGED_INTERVALS * self.nominal_ns {
            if !interval.after_gap {
                self.reject(Reason::Gap, row);
            }
            return Ok(None);
        }
        let mut steps = Vec::with_capacity(totals.len());
        for (now, before) in totals.iter().zip(&before) {
            steps.push(self.unroll(now - before, row)? as f64);
        }
        Ok(Some((before_ns, steps)))
    }

    /// The step of a total, past its wrap if its width is known. Without a width, a step back by a power
    /// of two less what a row usually brings is taken for a wrap and refused.
    fn unroll(&mut self, step: i64, row: &RawRow) -> Result<i64> {
        if let Some(bits) = self.counter_bits {
            let half = 1_i64 << (bits - 1);
            return Ok((step + half).rem_euclid(half << 1) - half);
        }
        let size = step.unsigned_abs();
        let usual = self.largest_step.unsigned_abs();
        let turned = self.largest_step != 0 && step.signum() != self.largest_step.signum();
        let wrap = size.max(1).ilog2() + u32::from(!size.is_power_of_two());
        let of_a_wrap = (1_u64 << wrap.min(62)).abs_diff(size) <= usual + usual / 2 + 16;
        if turned && wrap >= 8 && size > 4 * usual && of_a_wrap {
            return Err(Error::input(format!(
                "the cumulative counter steps by {step} quanta, as one of {wrap} bits that wraps does"
            ))
            .file(&self.file)
            .line(row.line)
            .help("give its width with --counter-bits or counter_bits in the setup"));
        }
        if size > usual {
            self.largest_step = step;
        }
        Ok(step)
    }

    fn rates(&mut self, row: &RawRow, interval: &Interval) -> Option<Vec<f64>> {
        if row.axes.iter().any(|rate| rate.abs() > MAX_RATE_DPH) {
            if row.valid {
                self.reject(Reason::ValueOutOfRange, row);
            }
            return None;
        }
        let duration_s = s_from_ns(interval.end_ns - interval.start_ns);
        Some(row.axes.iter().map(|rate_dph| rate_dph * duration_s).collect())
    }

    /// Believed temperatures into `batch.checked_c`.
    fn check_temperatures(&mut self, row: &RawRow, interval: &Interval, joins: bool, batch: &mut Batch) {
        if row.bad_temperature.contains(&true) {
            self.reject(Reason::TemperatureNotANumber, row);
        }
        batch.checked_c.clear();
        for (index, &t_c) in row.temperatures_c.iter().enumerate() {
            let others_moved = self.others_moved(index);
            let thermometer = &mut self.thermometers[index];
            let believed = if row.bad_temperature.get(index) == Some(&true) {
                Ok(f64::NAN)
            } else if t_c.is_nan() {
                Ok(thermometer.held(interval.end_ns))
            } else {
                thermometer.check(t_c, interval.end_ns, joins, others_moved)
            };
            if let Err(reason) = believed {
                self.reject(reason, row);
            }
            batch.checked_c.push(believed.unwrap_or(f64::NAN));
        }
    }

    /// How far any other thermometer has gone since this one last changed.
    fn others_moved(&self, index: usize) -> f64 {
        let since = self.thermometers[index].changed_ns;
        let others = self.thermometers.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, other)| other.moved_since(since)).fold(0.0, f64::max)
    }
}
