//! Which readings of a thermometer are valid.
//!
//! Invalid for a fit: a reading outside the valid range; a jump that does not persist; a value that stays constant
//! while another thermometer moves. A replay takes such readings ([`crate::ingest::AsRead`]), for the target has its own rules. An empty field is not a reading: the newest one is kept, as in a
//! register, for 1.5 times the thermometer's own interval and at most its hold time.

use crate::ingest::checks::reason::Reason;
use crate::setup::ThermometerSetup;
use sagnac_units::{ns_from_s, s_from_ns};

/// Readings farther apart than this, and faster than [`JUMP_C_PER_S`], are a jump …
const JUMP_C: f64 = 5.0;
/// Largest temperature rate of a gyro (10 °C/min).
const JUMP_C_PER_S: f64 = 10.0 / 60.0;
/// … unless the new level stays for this many rows.
const JUMP_STAYS_ROWS: u32 = 10;
/// A thermometer is frozen if another moved by this much …
const FROZEN_OTHER_MOVED_C: f64 = 3.0;
/// … while this one gave the same value for this long.
const FROZEN_NS: i64 = 300_000_000_000;

/// A reading as it came.
#[derive(Clone, Copy)]
struct Reading {
    celsius: f64,
    time_ns: i64,
    /// Since the reading before it.
    interval_ns: Option<i64>,
}

/// State of one thermometer.
pub(crate) struct ThermometerCheck {
    spec: ThermometerSetup,
    valid_c: f64,
    valid_ns: i64,
    interval_ns: Option<i64>,
    /// The newest reading, whatever it is: what a processor's register holds.
    register: Option<Reading>,
    jump_c: f64,
    jump_rows: u32,
    value_c: f64,
    pub(crate) changed_ns: i64,
    /// Sparse history of (time, value), a new entry per 0.5 °C, for the change since a time.
    trail: Vec<(i64, f64)>,
}

impl ThermometerCheck {
    pub(crate) fn new(spec: ThermometerSetup) -> Self {
        let nan = f64::NAN;
        Self {
            spec,
            valid_c: nan,
            valid_ns: 0,
            interval_ns: None,
            register: None,
            jump_c: nan,
            jump_rows: 0,
            value_c: nan,
            changed_ns: i64::MIN,
            trail: Vec::new(),
        }
    }

    /// The newest valid reading; NaN before the first.
    pub(crate) fn valid_c(&self) -> f64 {
        self.valid_c
    }

    /// True if [`Self::check`] would accept each of these readings, which follow `before_c` row by row. For a log's only
    /// thermometer, which cannot be found frozen.
    pub(crate) fn are_plain(&self, readings_c: &[f64], before_c: f64) -> bool {
        let [lo, hi] = self.spec.valid_range_c;
        let (mut all, mut before) = (true, before_c);
        for &t_c in readings_c {
            all &= (t_c >= lo) & (t_c <= hi) & ((t_c - before).abs() <= JUMP_C);
            before = t_c;
        }
        all
    }

    /// Stores the last of such readings; `before_ns` is the time of the one before it, if it is among them.
    pub(crate) fn accept(&mut self, t_c: f64, t_ns: i64, before_ns: Option<i64>) {
        self.interval_ns = Some(t_ns - before_ns.unwrap_or(self.valid_ns));
        let before_ns = before_ns.or(self.register.map(|reading| reading.time_ns));
        let interval_ns = before_ns.map(|before_ns| t_ns.saturating_sub(before_ns));
        self.register = Some(Reading { celsius: t_c, time_ns: t_ns, interval_ns });
        (self.valid_c, self.valid_ns) = (t_c, t_ns);
        self.jump_rows = 0;
    }

    /// True once it has been constant for long.
    pub(crate) fn may_be_frozen(&self, now_ns: i64) -> bool {
        now_ns.saturating_sub(self.changed_ns) > FROZEN_NS
    }

    /// The reading, if it is valid. `joins`: the row before it is adjacent.
    pub(crate) fn check(&mut self, t_c: f64, t_ns: i64, joins: bool, others_moved_c: f64) -> Result<f64, Reason> {
        if !(self.spec.valid_range_c[0]..=self.spec.valid_range_c[1]).contains(&t_c) {
            return Err(Reason::TemperatureInvalid);
        }
        // Since its own last reading: a thermometer may be slower than the log.
        let since_s = s_from_ns(t_ns.saturating_sub(self.valid_ns));
        if joins && self.jumped(t_c, since_s) {
            return Err(Reason::ThermometerJump);
        }
        if self.valid_c.is_finite() {
            self.interval_ns = Some(t_ns.saturating_sub(self.valid_ns));
        }
        (self.valid_c, self.valid_ns) = (t_c, t_ns);
        self.remember(t_c, t_ns);
        let frozen = self.may_be_frozen(t_ns) && others_moved_c > FROZEN_OTHER_MOVED_C;
        if frozen { Err(Reason::ThermometerFrozen) } else { Ok(t_c) }
    }

    /// Value of an empty field: the newest reading within its hold time, otherwise NaN.
    pub(crate) fn held(&self, t_ns: i64) -> f64 {
        let hold_ns = ns_from_s(self.spec.stale_after_s).unwrap_or(i64::MAX);
        let limit = self.interval_ns.map_or(hold_ns, |interval| interval.saturating_add(interval / 2).min(hold_ns));
        if t_ns.saturating_sub(self.valid_ns) <= limit { self.valid_c } else { f64::NAN }
    }

    /// A reading of any kind comes.
    pub(crate) fn read(&mut self, celsius: f64, time_ns: i64) {
        let interval_ns = self.register.map(|before| time_ns.saturating_sub(before.time_ns));
        self.register = Some(Reading { celsius, time_ns, interval_ns });
    }

    /// What a processor's register has in a row without a reading: nothing, or of a thermometer slower than the rows the newest reading
    /// for one and a half of its intervals.
    pub(crate) fn in_register(&self, t_ns: i64, nominal_ns: i64) -> f64 {
        let newest = self.register.and_then(|reading| Some((reading, reading.interval_ns?)));
        let held = newest.filter(|(reading, interval_ns)| {
            *interval_ns > nominal_ns.saturating_add(nominal_ns / 2)
                && t_ns.saturating_sub(reading.time_ns) <= interval_ns.saturating_add(interval_ns / 2)
        });
        held.map_or(f64::NAN, |(reading, _)| reading.celsius)
    }

    /// True while a jump has not persisted long enough to be a new level.
    fn jumped(&mut self, t_c: f64, dt_s: f64) -> bool {
        let limit = JUMP_C + JUMP_C_PER_S * dt_s;
        if (t_c - self.valid_c).abs() <= limit || self.valid_c.is_nan() {
            self.jump_rows = 0;
            return false;
        }
        self.jump_rows = if (t_c - self.jump_c).abs() <= limit { self.jump_rows + 1 } else { 1 };
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

    /// How far it has moved since a time.
    pub(crate) fn moved_since(&self, since_ns: i64) -> f64 {
        let later = self.trail.iter().rev().take_while(|(t, _)| *t >= since_ns).map(|(_, value)| *value);
        let (lo, hi) = later.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (hi - lo).max(0.0)
    }
}
