//! Seconds summed to minutes, for warnings.

use std::collections::BTreeMap;

use crate::live::seconds::{Second, Steps};

/// Length of a minute, s.
pub(crate) const MINUTE_S: f64 = 60.0;

/// A value over a minute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Value {
    sum: f64,
    pub(crate) number: u32,
    pub(crate) least: f64,
    pub(crate) most: f64,
    /// The newest.
    pub(crate) last: f64,
    /// How often it changed.
    pub(crate) changes: u32,
}

impl Default for Value {
    fn default() -> Self {
        Self { sum: 0.0, number: 0, least: f64::INFINITY, most: f64::NEG_INFINITY, last: f64::NAN, changes: 0 }
    }
}

impl Value {
    fn add(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        self.changes += u32::from(self.number > 0 && value.to_bits() != self.last.to_bits());
        self.sum += value;
        self.number += 1;
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        self.last = value;
    }

    /// NaN without a value.
    pub(crate) fn mean(&self) -> f64 {
        self.sum / f64::from(self.number)
    }
}

/// One axis over a minute.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AxisMinute {
    pub(crate) rate: Value,
    /// Variance from row to row, (°/h)² at the interval of a row; NaN without two rows.
    pub(crate) variance: f64,
    pub(crate) steps: Steps,
}

/// A minute.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Minute {
    /// Its start, s since the first row.
    pub(crate) t_s: f64,
    pub(crate) rows: u32,
    pub(crate) lost: u32,
    pub(crate) axes: Vec<AxisMinute>,
    pub(crate) temperatures: Vec<Value>,
    pub(crate) numbers: Vec<Value>,
    /// Words that are not `OK` by column, and in how many seconds.
    pub(crate) words: BTreeMap<usize, (String, u32)>,
    pub(crate) seconds: u32,
}

/// Sums seconds to minutes.
#[derive(Default)]
pub(crate) struct Minutes {
    open: Option<Minute>,
}

impl Minutes {
    /// The minute that is over with a second.
    pub(crate) fn push(&mut self, second: &Second) -> Option<Minute> {
        let number = (second.t_s / MINUTE_S).floor();
        let over = self.open.take_if(|open| (open.t_s / MINUTE_S).floor() < number).map(closed);
        let open = self.open.get_or_insert_with(|| Minute {
            t_s: number * MINUTE_S,
            axes: vec![AxisMinute::default(); second.axes.len()],
            temperatures: vec![Value::default(); second.temperatures_c.len()],
            numbers: vec![Value::default(); second.numbers.len()],
            ..Minute::default()
        });
        open.rows += second.rows;
        open.lost += second.lost;
        open.seconds += 1;
        for (minute, axis) in open.axes.iter_mut().zip(&second.axes) {
            minute.rate.add(axis.rate_dph());
            minute.steps.add(&axis.steps);
        }
        open.temperatures.iter_mut().zip(&second.temperatures_c).for_each(|(value, c)| value.add(*c));
        open.numbers.iter_mut().zip(&second.numbers).for_each(|(value, number)| value.add(*number));
        for (column, words) in &second.words {
            let said = open.words.entry(*column).or_insert_with(|| (words.clone(), 0));
            said.1 += 1;
        }
        over
    }
}

fn closed(mut minute: Minute) -> Minute {
    for axis in &mut minute.axes {
        axis.variance = axis.steps.squares / f64::from(axis.steps.pairs);
    }
    minute
}
