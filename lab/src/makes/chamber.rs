//! The logs in testdata/: three cycles of the domain notes' chamber, a row every 5 s.

use std::io::Write;

use anyhow::Result;
use flate2::{Compression, GzBuilder};
use sagnac_sim::{LaggedChamber, csv_bytes};

use crate::made::Made;
use crate::places::CHAMBER;

pub(crate) fn make() -> Result<Vec<Made>> {
    let cycle = |n: u64| {
        // No name and no time in the gzip header: the same rows give the same bytes.
        let mut gz = GzBuilder::new().write(Vec::new(), Compression::best());
        gz.write_all(&csv_bytes(LaggedChamber { row_s: 5, ..LaggedChamber::domain_notes() }.run(n)))?;
        Ok(Made::new(format!("{CHAMBER}/cycle-{n}.csv.gz"), gz.finish()?))
    };
    (1..=3).map(cycle).collect()
}
