//! Truth to test against: a seeded gyro on a thermal test.
//!
//! For now two rigs: the source paper's ([`PaperRig`]) and a block that follows a chamber with a lag
//! ([`LaggedChamber`]). The fitter never sees what is in here; it gets rows, as from a log.
//!
//! Random numbers: ChaCha8 (rand_chacha) seeded with `seed_from_u64`, normal values by rand_distr's
//! ziggurat on `libm`, so the same seed gives the same bytes on every machine.
//!
//! Both rigs count like a real one: the true angle plus a random walk accumulates, and what the
//! counter has passed since the last row is the row's count, so quantization errors never add up.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod chamber;
mod counter;
mod paper;

use std::io::Write;

pub use chamber::{LaggedChamber, Leg};
pub use paper::PaperRig;

/// One row of a simulated log: counts of the interval that ends at `time_s`.
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
