//! Rows as they are read, value by value, into columns.

use crate::ingest::columns::header::Layout;
use crate::ingest::columns::raw::{Faults, NO_TIME, RawRows};

/// Use of a column's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Slot {
    /// Places from the column's unit to ns.
    Time(u32),
    /// Axis, and °/h per unit.
    Axis(usize, f64),
    /// Thermometer and zero.
    Temperature(usize, f64),
    Reference,
    Valid,
    Aux(usize),
    Skipped,
}

/// The rows of a piece that is being read.
#[derive(Clone)]
pub(crate) struct Cells {
    /// One per column of the log.
    pub(crate) columns: Vec<Column>,
    has_time: bool,
    pub(crate) times_ns: Vec<i64>,
    pub(crate) faults: Vec<Faults>,
}

/// A column of the log.
#[derive(Clone)]
pub(crate) struct Column {
    pub(crate) slot: Slot,
    /// As in the log; none of a time, a flag, or what is not read.
    pub(crate) values: Vec<f64>,
}

impl Column {
    #[inline(always)]
    pub(crate) fn push(&mut self, value: f64) {
        self.values.push(value);
    }

    fn is_kept(&self) -> bool {
        !matches!(self.slot, Slot::Time(_) | Slot::Valid | Slot::Skipped)
    }
}

impl Cells {
    pub(crate) fn new(layout: &Layout) -> Self {
        let mut columns = vec![Column { slot: Slot::Skipped, values: Vec::new() }; layout.headers.len()];
        let mut set = |index: usize, slot: Slot| columns[index].slot = slot;
        layout.time.iter().for_each(|(index, places)| set(*index, Slot::Time(*places)));
        let axes = layout.axes.iter().enumerate();
        axes.for_each(|(n, (index, _, unit))| set(*index, Slot::Axis(n, unit.unwrap_or(1.0))));
        layout.temperatures.iter().enumerate().for_each(|(n, (i, _, zero))| set(*i, Slot::Temperature(n, *zero)));
        layout.reference.iter().for_each(|(index, _)| set(*index, Slot::Reference));
        layout.valid.iter().for_each(|index| set(*index, Slot::Valid));
        layout.aux.iter().enumerate().for_each(|(n, (index, _))| set(*index, Slot::Aux(n)));
        let has_time = layout.time.is_some();
        Self { columns, has_time, times_ns: Vec::new(), faults: Vec::new() }
    }

    /// Complete rows.
    pub(crate) fn len(&self) -> usize {
        self.faults.len()
    }

    /// Completes a row whose values were pushed.
    #[inline]
    pub(crate) fn finish_row(&mut self, time_ns: i64, faults: Faults) {
        if self.has_time {
            self.times_ns.push(time_ns);
        }
        self.faults.push(faults);
    }

    /// So many rows: the first of those that are there, or with further ones to be filled.
    pub(crate) fn resize(&mut self, rows: usize) {
        self.columns.iter_mut().filter(|column| column.is_kept()).for_each(|column| column.values.resize(rows, 0.0));
        self.times_ns.resize(if self.has_time { rows } else { 0 }, NO_TIME);
        self.faults.resize(rows, Faults::NONE);
    }

    /// A row of one value per column of the log.
    #[cfg(feature = "ulog")]
    pub(crate) fn push_row(&mut self, values: &[f64], time_ns: i64, faults: Faults) {
        let columns = self.columns.iter_mut().zip(values).filter(|(column, _)| column.is_kept());
        columns.for_each(|(column, value)| column.push(*value));
        self.finish_row(time_ns, faults);
    }

    /// A broken row: all its values are missing.
    #[cfg(feature = "ulog")]
    pub(crate) fn push_broken_row(&mut self) {
        self.columns.iter_mut().filter(|column| column.is_kept()).for_each(|column| column.push(f64::NAN));
        self.finish_row(NO_TIME, Faults::RAGGED);
    }

    /// Exchanges the rows for the empty columns of `rows`, in the units of [`RawRows`].
    pub(crate) fn hand_over(&mut self, rows: &mut RawRows) {
        std::mem::swap(&mut rows.faults, &mut self.faults);
        self.faults.clear();
        for Column { slot, values } in &mut self.columns {
            let theirs = match slot {
                Slot::Time(_) => {
                    std::mem::swap(&mut rows.time_ns, &mut self.times_ns);
                    self.times_ns.clear();
                    continue;
                }
                Slot::Axis(n, unit) => {
                    values.iter_mut().filter(|_| *unit != 1.0).for_each(|value| *value *= *unit);
                    &mut rows.axes[*n]
                }
                Slot::Temperature(n, zero) => {
                    values.iter_mut().filter(|_| *zero != 0.0).for_each(|value| *value -= *zero);
                    &mut rows.temperatures_c[*n]
                }
                Slot::Reference => &mut rows.reference_dps,
                Slot::Aux(n) => &mut rows.aux[*n],
                Slot::Valid | Slot::Skipped => continue,
            };
            std::mem::swap(theirs, values);
            values.clear();
        }
    }
}
