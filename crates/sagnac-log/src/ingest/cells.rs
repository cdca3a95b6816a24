//! Transposes rows into columns, block by block.

use crate::ingest::header::Layout;
use crate::ingest::raw::{Faults, RawRows};

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

/// Pending rows, transposed together.
#[derive(Clone)]
pub(crate) struct Cells {
    /// One per column of the log.
    pub(crate) slots: Vec<Slot>,
    has_time: bool,
    /// Values row by row, as wide as `slots`.
    pub(crate) values: Vec<f64>,
    times_ns: Vec<i64>,
    faults: Vec<Faults>,
}

impl Cells {
    pub(crate) fn new(layout: &Layout) -> Self {
        let mut slots = vec![Slot::Skipped; layout.headers.len()];
        let mut set = |index: usize, slot: Slot| slots[index] = slot;
        layout.time.iter().for_each(|(index, places)| set(*index, Slot::Time(*places)));
        let axes = layout.axes.iter().enumerate();
        axes.for_each(|(n, (index, _, unit))| set(*index, Slot::Axis(n, unit.unwrap_or(1.0))));
        layout.temperatures.iter().enumerate().for_each(|(n, (i, _, zero))| set(*i, Slot::Temperature(n, *zero)));
        layout.reference.iter().for_each(|(index, _)| set(*index, Slot::Reference));
        layout.valid.iter().for_each(|index| set(*index, Slot::Valid));
        layout.aux.iter().enumerate().for_each(|(n, (index, _))| set(*index, Slot::Aux(n)));
        let has_time = layout.time.is_some();
        Self { slots, has_time, values: Vec::new(), times_ns: Vec::new(), faults: Vec::new() }
    }

    /// Pending rows.
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

    /// A broken row: all its values are missing.
    #[cfg(feature = "ulog")]
    pub(crate) fn push_broken_row(&mut self) {
        self.values.resize(self.values.len() + self.slots.len(), f64::NAN);
        self.finish_row(crate::ingest::raw::NO_TIME, Faults::RAGGED);
    }

    /// Moves the pending rows into the columns.
    pub(crate) fn hand_over(&mut self, rows: &mut RawRows) {
        rows.faults.append(&mut self.faults);
        for (index, slot) in self.slots.iter().enumerate() {
            let values = self.values.chunks_exact(self.slots.len()).map(|row| row[index]);
            match slot {
                Slot::Time(_) => rows.time_ns.append(&mut self.times_ns),
                Slot::Axis(n, unit) => rows.axes[*n].extend(values.map(|value| value * unit)),
                Slot::Temperature(n, zero) => rows.temperatures_c[*n].extend(values.map(|value| value - zero)),
                Slot::Reference => rows.reference_dps.extend(values),
                Slot::Aux(n) => rows.aux[*n].extend(values),
                Slot::Valid | Slot::Skipped => {}
            }
        }
        self.values.clear();
    }
}
