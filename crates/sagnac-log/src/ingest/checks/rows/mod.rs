//! Checks rows: order of times, steps of counters, validity of temperatures.
//!
//! A row at t holds the counts (or the mean rate) of (t − dt, t]; the first row and the first after
//! a gap have the nominal interval. Unusable values are counted by reason, never guessed.
//!
//! Stretches of rows without any fault are copied column by column; every other row passes through the state machine. A
//! property test asserts that both give the same.

mod plain;

use crate::error::{Error, Result};
use crate::ingest::checks::batch::{Batch, Bridge};
use crate::ingest::checks::counter::{CounterStep, StepStatistics};
use crate::ingest::checks::reason::{Reason, Tallies};
use crate::ingest::checks::thermometer::ThermometerCheck;
use crate::ingest::clock::interval::PipeWatch;
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::log_shape::intervals_of;
use crate::ingest::columns::raw::{BAD_TEMPERATURE, Faults, MAX_TIME, RawRows};
use crate::setup::{Counter, Setup};
use sagnac_units::s_from_ns;

/// Valid range of an auxiliary column without a setting.
const MOST_OF_AUX: [f64; 2] = [-1e12, 1e12];
/// The row after a gap of a cumulative counter covers the whole gap, up to this many intervals or this long.
const BRIDGED_INTERVALS: i64 = 3;
/// Longest gap that the row after it covers, ns.
const BRIDGED_NS: i64 = 30_000_000_000;
/// Longest gap of a log: 30 days.
const LEAP_NS: i64 = 30 * 86_400 * 1_000_000_000;
/// Tolerance within which a quotient counts / quantum is a whole number, beyond the rounding of the division.
const WHOLE_TO: f64 = 1e-6;
/// Largest total that is held exactly.
const MAX_TOTAL_QUANTA: f64 = 9e15;
const MAX_QUANTA: f64 = (1_u64 << 40) as f64;
/// No gyro turns faster than 1e5 °/s.
pub(crate) const MAX_RATE_DPS: f64 = 1e5;
const MAX_RATE_DPH: f64 = 3600.0 * MAX_RATE_DPS;
/// A row may last longer than the nominal interval.
const LONGEST_ROW: f64 = 1.5;

/// Rows checked together.
const PLAIN_CHUNK: usize = 256;
/// Rows checked one by one before the next attempt at a stretch.
const ONE_BY_ONE: usize = 32;

/// One row of a piece.
struct Row<'a> {
    rows: &'a RawRows,
    at: usize,
}

impl Row<'_> {
    fn line(&self) -> u64 {
        self.rows.line_of(self.at)
    }

    fn time_ns(&self) -> Option<i64> {
        self.rows.time(self.at)
    }

    fn is_flagged(&self) -> bool {
        self.rows.faults[self.at].has(Faults::FLAGGED)
    }

    fn axes(&self) -> impl Iterator<Item = f64> {
        self.rows.axes.iter().map(|column| column[self.at])
    }

    fn temperatures_c(&self) -> impl Iterator<Item = f64> {
        self.rows.temperatures_c.iter().map(|column| column[self.at])
    }
}

/// The interval that a row covers.
struct Interval {
    start_ns: i64,
    end_ns: i64,
    after_gap: bool,
}

/// Where a cumulative counter stands at the end of a file.
#[derive(Clone, Debug)]
pub struct CounterEnd {
    time_ns: i64,
    totals: Vec<i64>,
    steps_by_axis: Vec<StepStatistics>,
}

/// The state machine that turns raw rows into usable ones.
pub(crate) struct RowValidator {
    file: String,
    timed: bool,
    /// Stretches of rows without faults may be copied whole.
    whole_rows: bool,
    nominal_ns: i64,
    counter: Counter,
    counter_bits: Option<u8>,
    /// Counts per quantum, or `None` for a rate log.
    quantum: Option<f64>,
    /// Most quanta of a row.
    most_quanta: f64,
    clock_ns: Option<i64>,
    last_counter: Option<(i64, Vec<i64>)>,
    /// Steps of each axis so far.
    steps_by_axis: Vec<StepStatistics>,
    thermometers: Vec<ThermometerCheck>,
    /// Per auxiliary column: its valid range.
    aux_valid_range: Vec<Option<[f64; 2]>>,
    pub(crate) tallies: Tallies,
    pub(crate) rows_read: u64,
    /// For a pipe whose interval was given.
    watch: Option<PipeWatch>,
}

impl RowValidator {
    pub(crate) fn new(file: String, layout: &Layout, setup: &Setup, nominal_ns: i64) -> Self {
        let thermometers =
            layout.temperatures.iter().map(|(_, name, _)| ThermometerCheck::new(setup.thermometer(name)));
        Self {
            file,
            timed: layout.time.is_some(),
            whole_rows: layout.temperatures.len() <= usize::from(layout.time.is_some())
                && (setup.counter() == Counter::Incremental || !layout.is_count_log()),
            nominal_ns,
            counter: setup.counter(),
            counter_bits: setup.counter_bits,
            quantum: layout.is_count_log().then(|| setup.quantum.unwrap_or(1.0)),
            most_quanta: most_quanta(setup, nominal_ns),
            clock_ns: None,
            last_counter: None,
            steps_by_axis: vec![StepStatistics::default(); layout.axes.len()],
            thermometers: thermometers.collect(),
            aux_valid_range: layout.aux.iter().map(|(_, name)| setup.aux(name).valid_range).collect(),
            tallies: Tallies::default(),
            rows_read: 0,
            watch: None,
        }
    }

    /// Where the counter stands; `None` for a log without running totals, or where its last row has none.
    pub(crate) fn counter_end(&self) -> Option<CounterEnd> {
        let (time_ns, totals) = self.last_counter.clone().filter(|(time_ns, _)| Some(*time_ns) == self.clock_ns)?;
        Some(CounterEnd { time_ns, totals, steps_by_axis: self.steps_by_axis.clone() })
    }

    /// Goes on from the end of another file where the first row says that its counter goes on and its clock starts again. Returns
    /// what is to be added to its times, ns; `None` where it does not go on. `sure`: both are one run, if the totals allow it.
    pub(crate) fn follow(&mut self, end: &CounterEnd, rows: &RawRows, sure: bool) -> Option<i64> {
        let sound = rows.faults.first().is_some_and(|faults| *faults == Faults::NONE);
        let first_ns = rows.time(0).filter(|t| t.unsigned_abs() < MAX_TIME && sound && self.timed)?;
        let restarts = first_ns - self.nominal_ns / 2 < end.time_ns;
        let quantum = self.quantum.filter(|_| restarts && self.counter == Counter::Cumulative)?;
        let total = |column: &Vec<f64>| {
            let exact = column.first()? / quantum;
            let usable = exact.abs() <= MAX_TOTAL_QUANTA && is_whole_total(exact) && !self.beyond_width(exact);
            usable.then(|| exact.round() as i64)
        };
        let totals: Vec<i64> = rows.axes.iter().map(total).collect::<Option<_>>()?;
        let pairs = || end.steps_by_axis.iter().zip(end.totals.iter().zip(&totals));
        let next = pairs().all(|(statistics, (before, now))| statistics.is_next(*before, *now, self.counter_bits));
        // The last row of a file once more as the first of the next.
        let again = !next && totals == end.totals;
        let is_evidence = |total: &i64, statistics: &StepStatistics| !statistics.stands_near_zero(*total);
        let evidence =
            pairs().any(|(statistics, (before, now))| is_evidence(before, statistics) && is_evidence(now, statistics));
        if !(next || again) || !(sure || evidence) || totals.len() != end.totals.len() {
            return None;
        }
        self.clock_ns = Some(end.time_ns);
        self.last_counter = Some((end.time_ns, end.totals.clone()));
        self.steps_by_axis.clone_from(&end.steps_by_axis);
        let elapsed_ns = if again { 0 } else { self.nominal_ns };
        Some(end.time_ns + elapsed_ns - first_ns)
    }

    /// The clock starts again: the next row has none before it.
    pub(crate) fn begin_run(&mut self) {
        (self.clock_ns, self.last_counter) = (None, None);
    }

    /// Checks the interval against the first rows.
    pub(crate) fn watching_interval(self) -> Self {
        Self { watch: self.timed.then(|| PipeWatch::new(self.nominal_ns)), whole_rows: false, ..self }
    }

    /// Checks rows; appends the usable ones to `batch`. Columns of a piece without faults are not copied and are gone from it.
    pub(crate) fn push(&mut self, rows: &mut RawRows, batch: &mut Batch) -> Result<()> {
        let (mut at, from) = (0, batch.len());
        while at < rows.len() {
            let plain = self.plain_rows(rows, at);
            if plain > at {
                self.push_plain(rows, at..plain, batch);
                at = plain;
            } else {
                let one_by_one = at..(at + ONE_BY_ONE).min(rows.len());
                at = one_by_one.end;
                batch.plain = false;
                for at in one_by_one {
                    self.push_row(&Row { rows, at }, batch)?;
                }
            }
        }
        self.believe_aux(batch, from);
        Ok(())
    }

    /// Auxiliary values outside their valid range become unknown.
    fn believe_aux(&mut self, batch: &mut Batch, from: usize) {
        let (file, tallies) = (&self.file, &mut self.tallies);
        for (column, plausible) in batch.aux.iter_mut().zip(&self.aux_valid_range) {
            let [lo, hi] = plausible.as_ref().unwrap_or(&MOST_OF_AUX);
            for (value, line) in column.iter_mut().zip(&batch.line).skip(from).filter(|(v, _)| **v < *lo || **v > *hi) {
                *value = f64::NAN;
                tallies.add(Reason::AuxInvalid, 1, || format!("{file}:{line}"));
            }
        }
    }

    /// Checks one row. A row that the log itself flags as invalid still advances clock and thermometers; its
    /// counts are used only if they are valid.
    fn push_row(&mut self, row: &Row<'_>, batch: &mut Batch) -> Result<()> {
        self.rows_read += 1;
        self.refuse_leap(row)?;
        let Some(interval) = self.interval(row) else {
            return Ok(());
        };
        if let Some(watch) = &mut self.watch {
            watch.see(interval.end_ns).map_err(|e| e.file(&self.file).line(row.line()))?;
        }
        let joins = self.clock_ns.replace(interval.end_ns).is_some() && !interval.after_gap && self.timed;
        self.check_temperatures(row, &interval, joins, batch);
        let no_number = row.axes().any(f64::is_nan);
        if row.is_flagged() {
            self.reject(Reason::FlaggedInvalid, row);
        } else if no_number {
            self.reject(Reason::NotANumber, row);
        }
        if no_number {
            return Ok(());
        }
        let units = match self.quantum {
            Some(quantum) => self.counts(row, quantum, &interval, batch)?,
            None => self.rates(row, &interval).map(|angles| (interval.start_ns, angles)),
        };
        if let Some((start_ns, angles)) = units {
            batch.push(start_ns, interval.end_ns, &angles, row.rows, row.at);
        }
        Ok(())
    }

    /// Refuses a log whose clock was changed in the middle: such a log is two logs.
    fn refuse_leap(&self, row: &Row<'_>) -> Result<()> {
        let broken = row.rows.faults[row.at].has(Faults::RAGGED);
        match (row.time_ns(), self.clock_ns) {
            (Some(now), Some(before)) if !broken && now.saturating_sub(before) > LEAP_NS => Err(Error::input(
                format!("time leaps by {:.0} days", s_from_ns(now.saturating_sub(before)) / 86_400.0),
                "cut the log there, and give both parts: each file is a separate run",
            )
            .file(&self.file)
            .line(row.line())),
            _ => Ok(()),
        }
    }

    fn reject(&mut self, reason: Reason, row: &Row<'_>) {
        let file = &self.file;
        self.tallies.add(reason, 1, || format!("{file}:{}", row.line()));
    }

    /// The interval (start, end] of the row, or `None` if its time cannot be used.
    fn interval(&mut self, row: &Row<'_>) -> Option<Interval> {
        if row.rows.faults[row.at].has(Faults::RAGGED) {
            self.reject(Reason::Ragged, row);
            return None;
        }
        let nominal = |end_ns: i64, after_gap: bool| Interval { start_ns: end_ns - self.nominal_ns, end_ns, after_gap };
        if !self.timed {
            return Some(nominal(self.clock_ns.unwrap_or(0).saturating_add(self.nominal_ns), false));
        }
        let Some(end_ns) = row.time_ns().filter(|t| t.unsigned_abs() < MAX_TIME) else {
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
    fn counts(
        &mut self,
        row: &Row<'_>,
        quantum: f64,
        interval: &Interval,
        batch: &mut Batch,
    ) -> Result<Option<(i64, Vec<f64>)>> {
        let exact: Vec<f64> = row.axes().map(|counts| counts / quantum).collect();
        let most = if self.counter == Counter::Incremental { self.most_quanta } else { MAX_TOTAL_QUANTA };
        if exact.iter().any(|q| q.abs() > most) {
            if !row.is_flagged() {
                self.reject(Reason::ValueOutOfRange, row);
            }
            return Ok(None);
        }
        let broken = exact.iter().position(|q| !is_whole_total(*q));
        match broken {
            Some(axis) if !row.is_flagged() => {
                return Err(Error::input(
                    format!("not a whole number of quanta (quantum {quantum} counts)"),
                    "give the smallest step of the counts with --quantum or in the setup",
                )
                .file(&self.file)
                .line(row.line())
                .value(row.rows.axes[axis][row.at].to_string()));
            }
            Some(_) => return Ok(None),
            None => {}
        }
        match self.counter {
            Counter::Incremental
                if !row.is_flagged() || exact.iter().all(|q| q.abs() <= f64::from(sagnac_core::MAX_RAW)) =>
            {
                Ok(Some((interval.start_ns, exact.iter().map(|q| q.round()).collect())))
            }
            Counter::Incremental => Ok(None),
            // A flagged total is not a base for the next difference.
            Counter::Cumulative if row.is_flagged() => Ok(None),
            Counter::Cumulative if exact.iter().any(|q| self.beyond_width(*q)) => Err(Error::input(
                format!("the total exceeds {} bits", self.counter_bits.unwrap_or(0)),
                "set counter_bits to the counter's true width",
            )
            .file(&self.file)
            .line(row.line())
            .column("counter_bits")),
            Counter::Cumulative => self.totals(row, exact.iter().map(|q| q.round() as i64).collect(), interval, batch),
        }
    }

    /// True for a total that a counter of the given width cannot hold, signed or not.
    fn beyond_width(&self, quanta: f64) -> bool {
        self.counter_bits.is_some_and(|bits| quanta.abs() >= 2.0_f64.powi(i32::from(bits)))
    }

    /// Differences to the last usable totals, which are known on both sides of missing or unreadable rows. Counts of a long gap
    /// are kept, but not as a row.
    fn totals(
        &mut self,
        row: &Row<'_>,
        totals: Vec<i64>,
        interval: &Interval,
        batch: &mut Batch,
    ) -> Result<Option<(i64, Vec<f64>)>> {
        let Some((before_ns, before)) = self.last_counter.replace((interval.end_ns, totals.clone())) else {
            return Ok(None);
        };
        let length_ns = interval.end_ns - before_ns;
        let is_row = length_ns <= BRIDGED_NS.max(BRIDGED_INTERVALS * self.nominal_ns);
        let intervals = intervals_of(length_ns, self.nominal_ns);
        let Some(steps) = self.steps(row, &before, &totals, intervals)? else {
            return Ok(None);
        };
        if steps.iter().any(|step| step.unsigned_abs() as f64 > self.most_quanta * intervals as f64) {
            self.reject(Reason::ValueOutOfRange, row);
            return Ok(None);
        }
        let angle = steps.into_iter().map(|step| step as f64).collect();
        if is_row {
            return Ok(Some((before_ns, angle)));
        }
        if !interval.after_gap {
            self.reject(Reason::Gap, row);
        }
        batch.bridges.push(Bridge {
            before_row: batch.len(),
            start_ns: before_ns,
            end_ns: interval.end_ns,
            line: row.line(),
            angle,
        });
        Ok(None)
    }

    /// The steps of all axes, or `None` (counted) where one of them is not known.
    fn steps(&mut self, row: &Row<'_>, before: &[i64], totals: &[i64], intervals: i64) -> Result<Option<Vec<i64>>> {
        let mut steps = Vec::with_capacity(totals.len());
        for ((now, before), statistics) in totals.iter().zip(before).zip(&self.steps_by_axis) {
            match statistics.step(*before, *now, intervals, self.counter_bits) {
                CounterStep::Counted(step) => steps.push(step),
                CounterStep::Reset => {
                    self.reject(Reason::CounterReset, row);
                    return Ok(None);
                }
                CounterStep::Unknown => {
                    self.reject(Reason::CounterUnknown, row);
                    return Ok(None);
                }
                CounterStep::Wrap(bits, step) => {
                    return Err(Error::input(
                        format!(
                            "the cumulative counter steps by {step} quanta, like a wrapping counter of {bits} bits"
                        ),
                        "give its width with --counter-bits, or counter_bits in the setup",
                    )
                    .file(&self.file)
                    .line(row.line()));
                }
            }
        }
        self.steps_by_axis.iter_mut().zip(&steps).for_each(|(statistics, step)| statistics.take(*step, intervals));
        Ok(Some(steps))
    }

    fn rates(&mut self, row: &Row<'_>, interval: &Interval) -> Option<Vec<f64>> {
        if row.axes().any(|rate| rate.abs() > MAX_RATE_DPH) {
            if !row.is_flagged() {
                self.reject(Reason::ValueOutOfRange, row);
            }
            return None;
        }
        let duration_s = s_from_ns(interval.end_ns - interval.start_ns);
        Some(row.axes().map(|rate_dph| rate_dph * duration_s).collect())
    }

    /// Writes the temperatures to `batch.next_c`: the valid ones, and what the log has.
    fn check_temperatures(&mut self, row: &Row<'_>, interval: &Interval, joins: bool, batch: &mut Batch) {
        if row.temperatures_c().any(|t_c| t_c == BAD_TEMPERATURE) {
            self.reject(Reason::TemperatureNotANumber, row);
        }
        batch.next_c.clear();
        for (index, t_c) in row.temperatures_c().enumerate() {
            let others_moved = self.others_moved(index, interval.end_ns);
            let thermometer = &mut self.thermometers[index];
            let (accepted, read) = if t_c == BAD_TEMPERATURE {
                (Ok(f64::NAN), f64::NAN)
            } else if t_c.is_nan() {
                let register = thermometer.in_register(interval.end_ns, self.nominal_ns);
                (Ok(thermometer.held(interval.end_ns)), register)
            } else {
                thermometer.read(t_c, interval.end_ns);
                (thermometer.check(t_c, interval.end_ns, joins, others_moved), t_c)
            };
            if let Err(reason) = accepted {
                self.reject(reason, row);
            }
            batch.next_c.push([accepted.unwrap_or(f64::NAN), read]);
        }
    }

    /// How far any other thermometer has moved since this one last changed; 0 where that is irrelevant.
    fn others_moved(&self, index: usize, now_ns: i64) -> f64 {
        if !self.thermometers[index].may_be_frozen(now_ns) {
            return 0.0;
        }
        let since = self.thermometers[index].changed_ns;
        let others = self.thermometers.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, other)| other.moved_since(since)).fold(0.0, f64::max)
    }
}

/// Most quanta of a row: those of the fastest rate.
fn most_quanta(setup: &Setup, nominal_ns: i64) -> f64 {
    let quantum_arcsec = setup.arcsec_per_count.unwrap_or(1.0) * setup.quantum.unwrap_or(1.0);
    let fastest = MAX_RATE_DPH * LONGEST_ROW * s_from_ns(nominal_ns) / quantum_arcsec;
    fastest.min(MAX_QUANTA)
}

/// A number of quanta that a row may hold, at most `most`.
fn is_whole(quanta: f64, most: f64) -> bool {
    (quanta.abs() <= most) & is_near(quanta, nearest(quanta))
}

/// The same for a total, which may be larger.
fn is_whole_total(quanta: f64) -> bool {
    is_near(quanta, quanta.round())
}

fn is_near(quanta: f64, whole: f64) -> bool {
    (quanta - whole).abs() <= WHOLE_TO + 4.0 * f64::EPSILON * quanta.abs()
}

/// The nearest whole number of a value within ±2^51 (halves go to even), without a call.
fn nearest(value: f64) -> f64 {
    const SHIFT: f64 = 1.5 * (1_u64 << 52) as f64;
    (value + SHIFT) - SHIFT
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ingest::columns::raw::NO_TIME;

    fn piece(rows: &[(i64, f64, f64, u8)], layout: &Layout) -> RawRows {
        let (mut piece, timed) = (RawRows::default(), layout.time.is_some());
        piece.reset(layout);
        for (i, (time_ns, t_c, counts, faults)) in rows.iter().enumerate() {
            piece.line.push(i as u32 + 1);
            if timed {
                piece.time_ns.push(*time_ns);
                piece.temperatures_c[0].push(*t_c);
            }
            piece.axes[0].push(*counts);
            piece.faults.push(Faults::NONE.with(Faults::RAGGED, *faults == 1).with(Faults::FLAGGED, *faults == 2));
        }
        piece.lines = rows.len() as u64;
        piece
    }

    /// Mostly good rows, with every kind of fault now and then.
    fn any_rows() -> impl Strategy<Value = Vec<(i64, f64, f64, u8)>> {
        let step = prop_oneof![8000 => Just(10_i64), 1 => 0_i64..40, 1 => Just(-5), 1 => Just(i64::MIN), 1 => Just(14)];
        let warming = prop_oneof![8000 => -0.5..0.5, 1 => Just(f64::NAN), 1 => Just(BAD_TEMPERATURE), 1 => -30.0..30.0, 1 => Just(300.0)];
        let counts = prop_oneof![
            8000 => (-50_i32..50).prop_map(f64::from), 1 => Just(f64::NAN), 1 => Just(1e13), 1 => Just(-1e18), 1 => Just(3.000_000_2)
        ];
        let faults = prop_oneof![8000 => Just(0_u8), 1 => Just(1), 1 => Just(2)];
        prop::collection::vec((step, warming, counts, faults), 0..1500).prop_map(|moves| {
            let (mut time_ns, mut t_c) = (0_i64, 20.0_f64);
            let row = |(step, warming, counts, faults): (i64, f64, f64, u8)| {
                let now = if step == i64::MIN { NO_TIME } else { time_ns + step };
                time_ns = if step == i64::MIN { time_ns } else { now };
                let reading = t_c + warming;
                t_c = if warming.abs() < 1.0 { reading.clamp(-60.0, 100.0) } else { t_c };
                (now, reading, counts, faults)
            };
            moves.into_iter().map(row).collect()
        })
    }

    proptest! {
        /// Stretches copied whole and rows checked one by one: the same rows, tallies and state.
        #[test]
        fn whole_stretches_are_what_single_rows_are(rows in any_rows(), rates: bool, timed: bool, cut in 0_usize..1500) {
            let header = if rates { "rate_dph" } else { "counts" };
            let headers: &[&str] = if timed { &["time_ns", "temperature_c", header] } else { &[header] };
            let headers = headers.iter().map(|header| (*header).to_owned()).collect();
            let layout = Layout::new(headers, &Default::default(), None).unwrap();
            let judge = |whole_rows: bool| {
                let mut check = RowValidator::new("log".to_owned(), &layout, &Setup::default(), 10);
                check.whole_rows &= whole_rows;
                let temperature_c = vec![vec![]; usize::from(timed)];
                let mut batch = Batch { angle: vec![vec![]], temperature_c, ..Batch::default() };
                batch.clear();
                let (first, second) = rows.split_at(cut.min(rows.len()));
                let ended = check.push(&mut piece(first, &layout), &mut batch).and_then(|()| check.push(&mut piece(second, &layout), &mut batch));
                batch.next_c.clear();
                if std::mem::take(&mut batch.plain) {
                    let follow = batch.start_ns.iter().skip(1).zip(&batch.end_ns).all(|(start, end)| start == end);
                    let one = batch.end_ns.iter().zip(&batch.start_ns).all(|(end, start)| (1..=15).contains(&(end - start)));
                    assert!(follow && one && batch.valid.iter().all(|valid| *valid));
                }
                (format!("{ended:?} {batch:?}"), check.tallies, check.rows_read, check.clock_ns)
            };
            prop_assert_eq!(judge(true), judge(false));
        }
    }
}
