//! What a log consists of, and how long its rows are.

use crate::error::{Error, Result};

/// Shortest time without rows over which temperatures are interpolated, ns.
const GAP_NS: i64 = 60_000_000_000;
/// What one unit of an angle column is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AngleUnit {
    /// A count log: whole quanta of `arcsec_per_count · quantum` arcsec.
    Quanta {
        /// Nominal scale factor S0, arcsec per count.
        arcsec_per_count: f64,
        /// Counts per quantum.
        quantum: f64,
    },
    /// A rate log: arcsec (rate × interval).
    Arcsec,
}

impl AngleUnit {
    /// arcsec per unit of an angle column.
    pub fn arcsec(self) -> f64 {
        match self {
            Self::Quanta { arcsec_per_count, quantum } => arcsec_per_count * quantum,
            Self::Arcsec => 1.0,
        }
    }
}

/// What a log consists of; the same for every batch of it.
#[derive(Clone, Debug, PartialEq)]
pub struct LogShape {
    /// Axis letters, in the order of `Batch::angle`.
    pub axes: Vec<char>,
    /// Thermometer names, in the order of `Batch::temperature_c`.
    pub thermometers: Vec<String>,
    /// Names of auxiliary columns.
    pub aux: Vec<String>,
    /// Unit of `Batch::angle`.
    pub unit: AngleUnit,
    /// False for a table without times whose rows are no record at even intervals: each may be of any time.
    pub timed: bool,
    /// Nominal interval of a row, ns.
    pub nominal_ns: i64,
    /// There is a reference-rate column.
    pub has_reference: bool,
    /// Headers that are not read.
    pub ignored: Vec<String>,
}

impl LogShape {
    /// Intervals that a row covers: more than one for a cumulative counter with missing rows in between.
    pub fn intervals(&self, start_ns: i64, end_ns: i64) -> u64 {
        intervals_of(end_ns - start_ns, self.nominal_ns).unsigned_abs()
    }

    /// Rows between two times; any number where they overlap.
    pub fn lost_rows(&self, from_ns: i64, to_ns: i64) -> u64 {
        if to_ns < from_ns { u64::MAX } else { self.intervals(from_ns, to_ns) * u64::from(to_ns > from_ns) }
    }

    /// The same for the usual row: true where [`LogShape::intervals`] is 1.
    #[inline]
    pub fn is_one_interval(&self, start_ns: i64, end_ns: i64) -> bool {
        let nominal_ns = self.nominal_ns.max(1);
        end_ns - start_ns <= nominal_ns + nominal_ns / 2
    }

    /// Between the stamps of two rows temperatures were not read for so long that the older ones say little of it: more than three intervals, and a minute.
    pub fn is_gap(&self, from_ns: i64, to_ns: i64) -> bool {
        let length_ns = to_ns.saturating_sub(from_ns);
        length_ns >= GAP_NS && length_ns > self.nominal_ns.saturating_mul(3)
    }
}

/// Logs that can be analysed together: the same axes, thermometers, units and row interval.
///
/// # Errors
/// What differs.
pub fn same_shape(first: &LogShape, other: &LogShape) -> Result<()> {
    let differs = |what: &str| {
        Err(Error::input(
            format!("{what} differ from those of the first log"),
            "analyse logs of one layout at a time: remove this one, or map its columns under [columns]",
        ))
    };
    if first.axes != other.axes {
        return differs("axes");
    }
    if first.thermometers != other.thermometers || first.aux != other.aux {
        return differs("thermometers or auxiliary columns");
    }
    if first.unit != other.unit || first.timed != other.timed {
        return differs("units (counts or rates, with or without time)");
    }
    let ratio = first.nominal_ns as f64 / other.nominal_ns as f64;
    if !(0.9..1.1).contains(&ratio) {
        return differs("row intervals");
    }
    Ok(())
}

/// Nominal intervals in a length of time: up to one and a half count as one, since they are no gap.
pub(crate) fn intervals_of(length_ns: i64, nominal_ns: i64) -> i64 {
    let nominal_ns = nominal_ns.max(1);
    (length_ns - nominal_ns / 2 + nominal_ns - 1).div_euclid(nominal_ns).max(1)
}
