//! Small rigs with a known truth, for tests of the fitter.
//!
//! | rig | truth |
//! |---|---|
//! | [`PaperRig`] | the source paper's quadratic in temperature |
//! | [`LaggedChamber`] | cubic drift and rate effect of a block that lags the chamber |
//! | [`RateTable`] | drift and scale factor over temperature, on a rate table |
//! | [`ManyInputs`] | drift and scale factor that depend on several inputs |
//! | [`Resting`] | the five noise terms at one temperature |
//!
//! Each is a few lines of equations, without the loops, faults and readout of the simulated gyro. The logs in `testdata/`
//! and the figures of the README were made with them. Except for [`Resting`] they draw normal values from
//! `rand_distr`, whose last bits depend on the platform's `exp` and `ln`.

mod chamber;
mod counter;
mod factory;
mod many_inputs;
mod paper;
mod rate_table;
mod resting;

use std::io::Write;

pub use chamber::LaggedChamber;
pub use factory::Factory;
pub use many_inputs::ManyInputs;
pub use paper::PaperRig;
pub use rate_table::RateTable;
pub use resting::Resting;

/// One row of a rig's log: counts of the interval that ends at `time_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// End of the interval, s.
    pub time_s: f64,
    /// Reading of the thermometer at that time, °C.
    pub temperature_c: f64,
    /// Counts of the interval, a multiple of the counter's step.
    pub counts: f64,
}

/// Writes rows as CSV under `time_s,temperature_c,counts`.
///
/// # Errors
/// Those of the writer.
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
    // Writing to a Vec cannot fail.
    let _ = write_csv(rows, &mut bytes);
    bytes
}
