//! The logs in testdata/: two cycles of the domain notes' chamber and the standard retest, a row every 5 s.

use std::io::Write;

use anyhow::Result;
use flate2::{Compression, GzBuilder};
use sagnac_sim::{LaggedChamber, csv_bytes};

use crate::made::Made;
use crate::places::CHAMBER;

pub(crate) fn make() -> Result<Vec<Made>> {
    let gyro = LaggedChamber { row_s: 5, ..LaggedChamber::domain_notes() };
    let logs = [("cycle-1", gyro.clone()), ("cycle-2", gyro.clone()), ("retest", gyro.standard())];
    logs.into_iter().zip(1..).map(log).collect()
}

/// A log by its name, with a seed.
fn log(((name, gyro), seed): ((&str, LaggedChamber), u64)) -> Result<Made> {
    // No name and no time in the gzip header: the same rows give the same bytes.
    let mut gz = GzBuilder::new().write(Vec::new(), Compression::best());
    gz.write_all(&csv_bytes(gyro.run(seed)))?;
    Ok(Made::new(format!("{CHAMBER}/{name}.csv.gz"), gz.finish()?))
}
