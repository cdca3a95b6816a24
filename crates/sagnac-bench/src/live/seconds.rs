//! Rows summed to seconds: what is shown, and what warnings are made of.
//!
//! ```text
//! rate of a second = Σ angle / Σ intervals, °/h        Δ² = mean of (nᵢ − nᵢ₋₁)²/2, the scatter from row to row
//! ```
//!
//! The rows are those that came, before any of them is judged: a warning is about the bench, not about what a fit can use.

use std::collections::BTreeMap;

use arrow_array::{Array, RecordBatch, StringArray};
use sagnac_log::Result;
use sagnac_log::ingest::header::Layout;
use sagnac_log::ingest::names;
use sagnac_log::ingest::{column_numbers, column_times};
use sagnac_log::setup::{Counter, Setup};
use sagnac_units::{NS_PER_S, s_from_ns};

/// Length of a second, ns.
const SECOND_NS: i64 = 1_000_000_000;
/// A row that is longer than this is behind a gap, in intervals.
const GAP: f64 = 1.5;

/// What is in a column besides time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Columns {
    /// Axes: place, letter, arcsec per count, or `None` for a rate in °/h per unit.
    pub(crate) axes: Vec<AxisColumn>,
    /// Thermometers: place, name, zero; and whether an instrument has it.
    pub(crate) thermometers: Vec<ThermometerColumn>,
    /// Other numbers: place, name.
    pub(crate) numbers: Vec<(usize, String)>,
    /// Words: place, name.
    pub(crate) words: Vec<(usize, String)>,
    time: Option<(usize, u32)>,
    interval_ns: Option<i64>,
    is_total: bool,
    modulus: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AxisColumn {
    place: usize,
    /// Its letter.
    pub(crate) letter: char,
    /// °/h per unit of a rate; arcsec per count.
    scale: f64,
    is_count: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ThermometerColumn {
    place: usize,
    /// Its name.
    pub(crate) name: String,
    zero: f64,
    /// An instrument's, not the gyro's.
    pub(crate) is_of_instrument: bool,
}

impl Columns {
    /// Columns of a log by its setup.
    ///
    /// # Errors
    /// Headers that contradict the setup.
    pub(crate) fn new(batch: &RecordBatch, setup: &Setup) -> Result<Self> {
        let schema = batch.schema();
        let headers: Vec<String> = schema.fields().iter().map(|field| field.name().clone()).collect();
        // As the reader of a log does: columns of other names that state what they are.
        let recognised = names::recognised(&headers, &[], &[], &setup.columns);
        let recognised = headers.iter().cloned().zip(recognised).filter_map(|(own, known)| Some((own, known?)));
        let names = setup.columns.clone().into_iter().chain(recognised).collect();
        let layout = Layout::new(headers.clone(), &names, setup.axis)?;
        let polled: Vec<&str> =
            setup.bench.polls.iter().flat_map(|poll| poll.columns.iter().map(|column| column.name.as_str())).collect();
        let read = layout.columns_read();
        let aux = layout.aux.iter().map(|(place, name)| (*place, name.clone()));
        let is_text = |place: usize| matches!(schema.field(place).data_type(), arrow_schema::DataType::Utf8);
        let rest = || (0..headers.len()).filter(|place| !read.contains(place));
        let named = |place: usize| (place, headers[place].clone());
        let axis = |(place, letter, unit): &(usize, char, Option<f64>)| AxisColumn {
            place: *place,
            letter: *letter,
            scale: unit.unwrap_or(setup.arcsec_per_count.unwrap_or(1.0)),
            is_count: unit.is_none(),
        };
        let thermometer = |(place, name, zero): &(usize, String, f64)| ThermometerColumn {
            place: *place,
            name: if name.is_empty() { "temperature".to_owned() } else { name.clone() },
            zero: *zero,
            is_of_instrument: polled.contains(&headers[*place].as_str()),
        };
        Ok(Self {
            axes: layout.axes.iter().map(axis).collect(),
            thermometers: layout.temperatures.iter().map(thermometer).collect(),
            numbers: aux.chain(rest().filter(|place| !is_text(*place)).map(named)).collect(),
            words: rest().filter(|place| is_text(*place)).map(named).collect(),
            time: layout.time,
            interval_ns: setup.sample_interval_s.and_then(sagnac_units::ns_from_s),
            is_total: setup.counter() == Counter::Cumulative,
            modulus: setup.counter_bits.map(|bits| 2_f64.powi(i32::from(bits))),
        })
    }
}

/// How the rows of an axis follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Steps {
    /// Σ (difference)²/2 of rows that follow each other, (°/h)² at their interval, and their number.
    pub(crate) squares: f64,
    pub(crate) pairs: u32,
    /// Rows whose value is that of the row before.
    pub(crate) repeats: u32,
    /// Rows without a value.
    pub(crate) missing: u32,
    /// Rows whose value differs from that of the row before by nearly the same as that one.
    pub(crate) rises: u32,
    /// Largest difference of two values, counts.
    pub(crate) largest: f64,
}

impl Steps {
    /// Of further rows.
    pub(crate) fn add(&mut self, more: &Self) {
        self.squares += more.squares;
        self.pairs += more.pairs;
        self.repeats += more.repeats;
        self.missing += more.missing;
        self.rises += more.rises;
        self.widen(more.largest);
    }

    fn widen(&mut self, step: f64) {
        if step.abs() > self.largest.abs() {
            self.largest = step;
        }
    }
}

/// One axis in a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AxisSecond {
    /// Σ rate · interval, °/h·s.
    angle: f64,
    seconds: f64,
    pub(crate) steps: Steps,
}

impl AxisSecond {
    /// Mean rate, °/h; NaN without a row.
    pub(crate) fn rate_dph(&self) -> f64 {
        if self.seconds > 0.0 { self.angle / self.seconds } else { f64::NAN }
    }
}

/// A second of rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Second {
    /// Time of its last row, s since the first row.
    pub(crate) t_s: f64,
    /// Rows in it, and rows that are missing before them.
    pub(crate) rows: u32,
    pub(crate) lost: u32,
    pub(crate) axes: Vec<AxisSecond>,
    /// Newest values; NaN where there is none.
    pub(crate) temperatures_c: Vec<f64>,
    pub(crate) numbers: Vec<f64>,
    /// Words that are not `OK`, by column.
    pub(crate) words: BTreeMap<usize, String>,
}

/// Sums rows to seconds.
pub(crate) struct Seconds {
    pub(crate) columns: Columns,
    first_ns: Option<i64>,
    last_ns: i64,
    /// Interval of a row, ns: as stated, else the median of the first steps.
    interval_ns: Option<i64>,
    steps: Vec<i64>,
    last: Vec<f64>,
    last_step: Vec<f64>,
    open: Option<(i64, Second)>,
}

/// Steps from which the interval is known.
const STEPS: usize = 9;
/// Steps of a running total differ by less than this part of them.
const ALIKE: f64 = 0.2;

impl Seconds {
    pub(crate) fn new(columns: Columns) -> Self {
        let axes = columns.axes.len();
        Self {
            interval_ns: columns.interval_ns,
            columns,
            first_ns: None,
            last_ns: i64::MIN,
            steps: Vec::new(),
            last: vec![f64::NAN; axes],
            last_step: vec![f64::NAN; axes],
            open: None,
        }
    }

    /// The seconds that end within a batch.
    pub(crate) fn push(&mut self, batch: &RecordBatch) -> Vec<Second> {
        let numbers = |place: usize| column_numbers(batch.column(place)).unwrap_or_default();
        let times = self.columns.time.and_then(|(place, places)| column_times(batch.column(place), places));
        let axes: Vec<Vec<f64>> = self.columns.axes.iter().map(|axis| numbers(axis.place)).collect();
        let thermometers: Vec<Vec<f64>> = self.columns.thermometers.iter().map(|t| numbers(t.place)).collect();
        let others: Vec<Vec<f64>> = self.columns.numbers.iter().map(|(place, _)| numbers(*place)).collect();
        let words: Vec<Option<StringArray>> = self
            .columns
            .words
            .iter()
            .map(|(place, _)| batch.column(*place).as_any().downcast_ref::<StringArray>().cloned())
            .collect();
        let mut done = Vec::new();
        for row in 0..batch.num_rows() {
            let time_ns = match &times {
                Some(times) => times.get(row).copied().flatten(),
                None => Some(self.last_ns.max(0).saturating_add(self.interval_ns.unwrap_or(SECOND_NS))),
            };
            let Some(time_ns) = time_ns else { continue };
            // A time out of order is a damaged row.
            if time_ns <= self.last_ns {
                continue;
            }
            done.extend(self.second_of(time_ns));
            let (interval_s, lost) = self.step(time_ns);
            let follows = lost == 0 && self.open.as_ref().is_some();
            let Some((_, second)) = &mut self.open else { continue };
            second.rows += 1;
            second.lost += lost;
            for (axis, column) in axes.iter().enumerate() {
                let value = column.get(row).copied().unwrap_or(f64::NAN);
                let known =
                    Known { interval_s, follows, modulus: self.columns.modulus, is_total: self.columns.is_total };
                let at = (&mut self.last[axis], &mut self.last_step[axis]);
                add(&mut second.axes[axis], &self.columns.axes[axis], value, known, at);
            }
            for (newest, (column, t)) in
                second.temperatures_c.iter_mut().zip(thermometers.iter().zip(&self.columns.thermometers))
            {
                *newest = column.get(row).map_or(f64::NAN, |value| value - t.zero);
            }
            for (newest, column) in second.numbers.iter_mut().zip(&others) {
                *newest = column.get(row).copied().unwrap_or(f64::NAN);
            }
            for (at, column) in words.iter().enumerate() {
                let said = column.as_ref().filter(|column| column.is_valid(row)).map(|column| column.value(row));
                if let Some(said) = said.filter(|said| !said.is_empty() && *said != "OK") {
                    second.words.insert(at, said.to_owned());
                }
            }
        }
        done
    }

    /// Time since the row before, s, and how many rows are missing between.
    fn step(&mut self, time_ns: i64) -> (f64, u32) {
        let first = self.last_ns == i64::MIN;
        let step_ns = if first { self.interval_ns.unwrap_or(0) } else { time_ns.saturating_sub(self.last_ns) };
        self.last_ns = time_ns;
        if self.interval_ns.is_none() && !first {
            self.steps.push(step_ns);
            if self.steps.len() == STEPS {
                self.steps.sort_unstable();
                self.interval_ns = self.steps.get(STEPS / 2).copied();
            }
        }
        let Some(interval_ns) = self.interval_ns.filter(|ns| *ns > 0) else { return (s_from_ns(step_ns), 0) };
        if step_ns as f64 > GAP * interval_ns as f64 {
            let lost = (step_ns as f64 / interval_ns as f64).round() - 1.0;
            return (s_from_ns(interval_ns), lost.clamp(1.0, 1e9) as u32);
        }
        (s_from_ns(step_ns), 0)
    }

    /// The second that is over with a row of this time.
    fn second_of(&mut self, time_ns: i64) -> Option<Second> {
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        let number = (time_ns - first_ns).div_euclid(SECOND_NS);
        let over = self.open.take_if(|(open, _)| *open != number).map(|(_, second)| second);
        let empty = || Second {
            axes: vec![AxisSecond::default(); self.columns.axes.len()],
            temperatures_c: vec![f64::NAN; self.columns.thermometers.len()],
            numbers: vec![f64::NAN; self.columns.numbers.len()],
            ..Second::default()
        };
        if self.open.is_none() {
            self.open = Some((number, empty()));
        }
        if let Some((_, open)) = &mut self.open {
            open.t_s = (time_ns - first_ns) as f64 / NS_PER_S;
        }
        over
    }
}

/// What is known of a row besides its value.
#[derive(Clone, Copy)]
struct Known {
    interval_s: f64,
    follows: bool,
    is_total: bool,
    modulus: Option<f64>,
}

/// Adds a row to an axis. `before` are the value and the step of the row before.
fn add(second: &mut AxisSecond, column: &AxisColumn, value: f64, known: Known, before: (&mut f64, &mut f64)) {
    let (last, last_step) = before;
    if value.is_nan() {
        second.steps.missing += 1;
        *last = f64::NAN;
        return;
    }
    let mut step = value - *last;
    if let Some(modulus) = known.modulus.filter(|modulus| step.abs() > modulus / 2.0) {
        step -= modulus.copysign(step);
    }
    let (own, before) = if known.is_total { (step, *last_step) } else { (value, *last) };
    let rate = if column.is_count { own * column.scale / known.interval_s } else { own * column.scale };
    let rate_before = if column.is_count { before * column.scale / known.interval_s } else { before * column.scale };
    if rate.is_finite() && known.interval_s > 0.0 && (known.follows || !known.is_total) {
        second.angle += rate * known.interval_s;
        second.seconds += known.interval_s;
    }
    if known.follows && !step.is_nan() {
        let difference = rate - rate_before;
        if difference.is_finite() {
            second.steps.squares += difference * difference / 2.0;
            second.steps.pairs += 1;
            second.steps.repeats += u32::from(own.to_bits() == before.to_bits());
        }
        let alike = (step - *last_step).abs() <= ALIKE * step.abs();
        second.steps.rises += u32::from(!known.is_total && step != 0.0 && alike);
        second.steps.widen(step);
    }
    *last_step = step;
    *last = value;
}
