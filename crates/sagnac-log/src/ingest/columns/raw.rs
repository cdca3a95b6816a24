//! Rows as read: parsed, by column, not checked.

use csv::ByteRecord;

use crate::ingest::columns::header::Layout;

/// In [`RawRows::time_ns`]: the field holds no time.
pub(crate) const NO_TIME: i64 = i64::MIN;
/// In [`RawRows::temperatures_c`]: the field holds something other than a number. (NaN: it is empty.)
pub(crate) const BAD_TEMPERATURE: f64 = f64::INFINITY;

/// Times beyond this many ns (146 years) are invalid.
pub(crate) const MAX_TIME: u64 = 1 << 62;

/// Faults in the text of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Faults(u8);

impl Faults {
    pub(crate) const NONE: Self = Self(0);
    /// Not as many fields as the header has.
    pub(crate) const RAGGED: Self = Self(1);
    /// The log's own flag.
    pub(crate) const FLAGGED: Self = Self(2);

    pub(crate) fn with(self, other: Self, set: bool) -> Self {
        if set { Self(self.0 | other.0) } else { self }
    }

    pub(crate) fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

/// Where the values of a column go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Slot {
    /// Places from the column's unit to ns.
    Time(u32),
    /// Axis, and °/h per unit; 1 for counts.
    Axis(usize, f64),
    /// Thermometer and zero.
    Temperature(usize, f64),
    Reference,
    Valid,
    Aux(usize),
    Skipped,
}

impl Slot {
    /// One per column of a log.
    pub(crate) fn of_columns(layout: &Layout) -> Vec<Self> {
        let mut slots = vec![Self::Skipped; layout.headers.len()];
        layout.time.iter().for_each(|(index, places)| slots[*index] = Self::Time(*places));
        let axes = layout.axes.iter().enumerate();
        axes.for_each(|(n, (index, _, unit))| slots[*index] = Self::Axis(n, unit.unwrap_or(1.0)));
        let temperatures = layout.temperatures.iter().enumerate();
        temperatures.for_each(|(n, (index, _, zero))| slots[*index] = Self::Temperature(n, *zero));
        layout.reference.iter().for_each(|(index, _)| slots[*index] = Self::Reference);
        layout.valid.iter().for_each(|index| slots[*index] = Self::Valid);
        layout.aux.iter().enumerate().for_each(|(n, (index, _))| slots[*index] = Self::Aux(n));
        slots
    }

    /// Stands for something other than a number.
    pub(crate) fn bad(self) -> f64 {
        if matches!(self, Self::Temperature(..)) { BAD_TEMPERATURE } else { f64::NAN }
    }
}

/// One piece of a log, by column. NaN: missing or not a number.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawRows {
    /// Line before the piece's first.
    pub(crate) lines_before: u64,
    /// Lines of the piece, rows or not.
    pub(crate) lines: u64,
    /// Line of each row, from 1 within the piece.
    pub(crate) line: Vec<u32>,
    /// [`NO_TIME`] where the field is not a time; empty without a time column.
    pub(crate) time_ns: Vec<i64>,
    pub(crate) faults: Vec<Faults>,
    pub(crate) axes: Vec<Vec<f64>>,
    pub(crate) temperatures_c: Vec<Vec<f64>>,
    pub(crate) aux: Vec<Vec<f64>>,
    /// Empty without such a column.
    pub(crate) reference_dps: Vec<f64>,
    /// The fields as text, kept only where the log is written out again.
    pub(crate) fields: Vec<ByteRecord>,
    /// The clock starts again with the first row: a run of its own.
    pub(crate) begins_run: bool,
    has_time: bool,
    has_reference: bool,
}

impl RawRows {
    /// Empty columns of a log.
    pub(crate) fn reset(&mut self, layout: &Layout) {
        self.axes.resize_with(layout.axes.len(), Vec::new);
        self.temperatures_c.resize_with(layout.temperatures.len(), Vec::new);
        self.aux.resize_with(layout.aux.len(), Vec::new);
        (self.has_time, self.has_reference) = (layout.time.is_some(), layout.reference.is_some());
        self.line.clear();
        self.time_ns.clear();
        self.faults.clear();
        self.reference_dps.clear();
        self.fields.clear();
        for column in self.axes.iter_mut().chain(&mut self.temperatures_c).chain(&mut self.aux) {
            column.clear();
        }
        (self.lines_before, self.lines, self.begins_run) = (0, 0, false);
    }

    /// The numbers of a column; none of a time, a flag, or what is not read.
    #[inline]
    pub(crate) fn numbers(&mut self, slot: Slot) -> Option<&mut Vec<f64>> {
        match slot {
            Slot::Axis(n, _) => self.axes.get_mut(n),
            Slot::Temperature(n, _) => self.temperatures_c.get_mut(n),
            Slot::Aux(n) => self.aux.get_mut(n),
            Slot::Reference => Some(&mut self.reference_dps),
            Slot::Time(_) | Slot::Valid | Slot::Skipped => None,
        }
    }

    /// Completes a row whose numbers were pushed.
    #[inline]
    pub(crate) fn finish_row(&mut self, time_ns: i64, faults: Faults) {
        if self.has_time {
            self.time_ns.push(time_ns);
        }
        self.faults.push(faults);
    }

    /// So many rows: the first of those that are there, or with further ones to be filled; not their lines.
    pub(crate) fn resize(&mut self, rows: usize) {
        let reference = self.has_reference.then_some(&mut self.reference_dps);
        let columns = self.axes.iter_mut().chain(&mut self.temperatures_c).chain(&mut self.aux).chain(reference);
        columns.for_each(|column| column.resize(rows, 0.0));
        self.time_ns.resize(if self.has_time { rows } else { 0 }, NO_TIME);
        self.faults.resize(rows, Faults::NONE);
    }

    /// Completes a piece of so many lines: values as in the log become °/h and °C.
    pub(crate) fn finish(&mut self, slots: &[Slot], lines: u64) {
        self.lines = lines;
        for slot in slots {
            match *slot {
                Slot::Axis(n, unit) if unit != 1.0 => self.axes[n].iter_mut().for_each(|value| *value *= unit),
                Slot::Temperature(n, zero) if zero != 0.0 => {
                    self.temperatures_c[n].iter_mut().for_each(|value| *value -= zero);
                }
                _ => {}
            }
        }
    }

    /// The rows from `at` on, which leave this piece.
    pub(crate) fn split_off(&mut self, at: usize) -> Self {
        let columns = |columns: &mut Vec<Vec<f64>>| columns.iter_mut().map(|column| column.split_off(at)).collect();
        let optional = |column: &mut Vec<f64>| column.split_off(at.min(column.len()));
        Self {
            lines_before: self.lines_before,
            lines: self.lines,
            line: self.line.split_off(at),
            time_ns: self.time_ns.split_off(at.min(self.time_ns.len())),
            faults: self.faults.split_off(at),
            axes: columns(&mut self.axes),
            temperatures_c: columns(&mut self.temperatures_c),
            aux: columns(&mut self.aux),
            reference_dps: optional(&mut self.reference_dps),
            fields: self.fields.split_off(at.min(self.fields.len())),
            begins_run: true,
            has_time: self.has_time,
            has_reference: self.has_reference,
        }
    }

    /// The time of a usable row; a broken row may have any time.
    pub(crate) fn sound_time(&self, row: usize) -> Option<i64> {
        self.time(row).filter(|t| t.unsigned_abs() < MAX_TIME && !self.faults[row].has(Faults::RAGGED))
    }

    pub(crate) fn len(&self) -> usize {
        self.line.len()
    }

    /// Line of a row in its file, from 1.
    pub(crate) fn line_of(&self, row: usize) -> u64 {
        self.lines_before + u64::from(self.line[row])
    }

    /// Time of a row, if its field is one.
    pub(crate) fn time(&self, row: usize) -> Option<i64> {
        self.time_ns.get(row).copied().filter(|t| *t != NO_TIME)
    }
}
