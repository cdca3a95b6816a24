//! Checked rows in columns.

use crate::ingest::columns::log_shape::LogShape;
use crate::ingest::columns::raw::{Faults, RawRows};

/// Counts of a cumulative counter over a gap (start, end] between two rows of a batch. The gap is too long for a row, because the
/// temperature within it is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Bridge {
    /// Rows of the batch before it.
    pub before_row: usize,
    /// Start, ns.
    pub start_ns: i64,
    /// End, ns.
    pub end_ns: i64,
    /// Line of the total at its end.
    pub line: u64,
    /// Per axis, in `LogShape::unit`.
    pub angle: Vec<f64>,
}

/// A reading of a thermometer where [`Batch::temperature_c`] has another value: one that a check refused although the target takes it, or a cell
/// without a reading that the check filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsRead {
    /// Row of the batch.
    pub row: usize,
    /// Thermometer of the log.
    pub thermometer: usize,
    /// °C; NaN without a reading.
    pub celsius: f64,
}

/// Columns of usable rows. A row covers (start, end].
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Start of each row's interval, ns.
    pub start_ns: Vec<i64>,
    /// End of each row's interval: the row's own time, ns.
    pub end_ns: Vec<i64>,
    /// Per axis: angle of the interval in `LogShape::unit`.
    pub angle: Vec<Vec<f64>>,
    /// Per thermometer: °C, NaN where missing or invalid.
    pub temperature_c: Vec<Vec<f64>>,
    /// Per auxiliary column; NaN where missing.
    pub aux: Vec<Vec<f64>>,
    /// Rate of the table, °/s; NaN where missing, empty without such a column.
    pub reference_dps: Vec<f64>,
    /// The log's own flag; true without one.
    pub valid: Vec<bool>,
    /// Line in the file, from 1.
    pub line: Vec<u64>,
    /// The row's fields as text (empty with [`ReadMode::Bulk`](crate::ingest::ReadMode::Bulk)).
    pub fields: Vec<::csv::ByteRecord>,
    /// Counts of a cumulative counter over gaps that are too long for a row.
    pub bridges: Vec<Bridge>,
    /// The clock of the log starts again with its first row, which begins a run. Its times go on an hour after those before.
    pub begins_run: bool,
    /// Where a replay reads another temperature than a fit: by row.
    pub as_read: Vec<AsRead>,
    /// Of the next row, per thermometer: as checked, and as read.
    pub(crate) next_c: Vec<[f64; 2]>,
    /// All rows came in stretches without any fault, one after the other.
    pub(crate) plain: bool,
}

impl Batch {
    /// Rows in it.
    pub fn len(&self) -> usize {
        self.end_ns.len()
    }

    /// True if all rows are valid, an interval each, and follow on without a gap, as they were read. False where that is not known.
    pub fn is_plain(&self) -> bool {
        self.plain
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.end_ns.is_empty()
    }

    pub(crate) fn for_shape(shape: &LogShape) -> Self {
        Self {
            angle: vec![Vec::new(); shape.axes.len()],
            temperature_c: vec![Vec::new(); shape.thermometers.len()],
            aux: vec![Vec::new(); shape.aux.len()],
            ..Self::default()
        }
    }

    pub(crate) fn clear(&mut self) {
        self.start_ns.clear();
        self.end_ns.clear();
        self.reference_dps.clear();
        self.valid.clear();
        self.line.clear();
        self.fields.clear();
        self.bridges.clear();
        self.as_read.clear();
        self.plain = true;
        self.begins_run = false;
        for column in self.angle.iter_mut().chain(&mut self.temperature_c).chain(&mut self.aux) {
            column.clear();
        }
    }

    pub(crate) fn push(&mut self, start_ns: i64, end_ns: i64, angles: &[f64], rows: &RawRows, at: usize) {
        self.start_ns.push(start_ns);
        self.end_ns.push(end_ns);
        self.valid.push(!rows.faults[at].has(Faults::FLAGGED));
        self.line.push(rows.line_of(at));
        self.angle.iter_mut().zip(angles).for_each(|(column, value)| column.push(*value));
        for (thermometer, (column, [checked, read])) in self.temperature_c.iter_mut().zip(&self.next_c).enumerate() {
            if checked != read && !(checked.is_nan() && read.is_nan()) {
                self.as_read.push(AsRead { row: column.len(), thermometer, celsius: *read });
            }
            column.push(*checked);
        }
        self.aux.iter_mut().zip(&rows.aux).for_each(|(column, values)| column.push(values[at]));
        self.reference_dps.extend(rows.reference_dps.get(at));
        self.fields.extend(rows.fields.get(at).cloned());
    }
}
