//! Rows as read: parsed, by column, not checked.

use csv::ByteRecord;

/// In [`RawRows::time_ns`]: the field holds no time.
pub(crate) const NO_TIME: i64 = i64::MIN;
/// In [`RawRows::temperatures_c`]: the field holds something other than a number. (NaN: it is empty.)
pub(crate) const BAD_TEMPERATURE: f64 = f64::INFINITY;

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
}

impl RawRows {
    /// Empty columns of the right number.
    pub(crate) fn reset(&mut self, axes: usize, thermometers: usize, aux: usize) {
        self.axes.resize_with(axes, Vec::new);
        self.temperatures_c.resize_with(thermometers, Vec::new);
        self.aux.resize_with(aux, Vec::new);
        self.line.clear();
        self.time_ns.clear();
        self.faults.clear();
        self.reference_dps.clear();
        self.fields.clear();
        for column in self.axes.iter_mut().chain(&mut self.temperatures_c).chain(&mut self.aux) {
            column.clear();
        }
        (self.lines_before, self.lines) = (0, 0);
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
