//! Two small rigs with a known truth, for tests of the fitter: the source paper's and a lagged block.
//!
//! They came before the gyro and draw their normal values from `rand_distr`; the logs in testdata/ and the figures of
//! the README were made with them.

mod chamber;
mod counter;
mod many_inputs;
mod paper;
mod rate_table;
mod resting;

use std::io::Write;

pub use chamber::LaggedChamber;
pub use many_inputs::ManyInputs;
pub use paper::PaperRig;
pub use rate_table::RateTable;
pub use resting::Resting;

/// One row of a rig's log: counts of the interval that ends at `time_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// End of the interval, s.
    pub time_s: f64,
    /// Thermometer reading at that time, °C.
    pub temperature_c: f64,
    /// Counts of the interval, a multiple of the quantum.
    pub counts: f64,
}

/// Writes rows as CSV under `time_s,temperature_c,counts`.
///
/// # Errors
/// What the writer says.
pub fn write_csv(rows: impl Iterator<Item = Row>, mut out: impl Write) -> std::io::Result<()> {
    writeln!(out, "time_s,temperature_c,counts")?;
    for row in rows {
        writeln!(out, "{},{},{}", row.time_s, row.temperature_c, row.counts)?;
    }
    out.flush()
}

/// Rows as the bytes of a CSV file.
pub fn csv_bytes(rows: impl Iterator<Item = Row>) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A Vec takes every byte it is given.
    let _ = write_csv(rows, &mut bytes);
    bytes
}
