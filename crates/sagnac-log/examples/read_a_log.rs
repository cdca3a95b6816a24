//! Rows of a log, batch by batch, with what was rejected and why.
//!
//! `cargo run --example read_a_log`

use std::path::Path;

use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::{Result, Setup};

fn main() -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber");
    let setup = Setup::read(folder.join("bench.toml"))?;
    let mut log = LogReader::open(folder.join("cycle-1.csv.gz"), &setup, ReadMode::Bulk)?;
    println!("axes {:?}, thermometers {:?}", log.shape().axes, log.shape().thermometers);

    let (mut rows, mut coldest, mut warmest) = (0, f64::INFINITY, f64::NEG_INFINITY);
    while let Some(batch) = log.next_batch()? {
        rows += batch.len();
        for celsius in batch.temperature_c.iter().flatten() {
            (coldest, warmest) = (celsius.min(coldest), celsius.max(warmest));
        }
    }
    let summary = log.summary();
    println!("{rows} rows, {coldest:.1} … {warmest:.1} °C, SHA-256 {}", summary.sha256);
    for tally in summary.tallies.list() {
        println!("rejected: {} rows, {} (first at {})", tally.rows, tally.reason.name(), tally.first);
    }
    assert!(rows as u64 == summary.rows && (coldest, warmest) == (-40.0, 70.0));
    Ok(())
}
