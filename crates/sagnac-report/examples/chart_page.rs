//! A page of plain charts: a curve with its band, as the noise report uses it.
//!
//! `cargo run --example chart_page -- chart.html` (without a name it writes nothing)

use sagnac::Result;
use sagnac_log::write::write_bytes;
use sagnac_report::noise_report;

fn main() -> Result<()> {
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/chamber/cycle-1.csv.gz");
    let bench = sagnac::Setup::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/chamber/bench.toml"))?;
    let budget = sagnac::allan(&bench, log)?;
    // A thermal cycle is not a record at rest; the budget carries a warning.
    assert!(budget.warnings.iter().any(|warning| warning.contains("temperature")), "{:?}", budget.warnings);
    let page = noise_report(&budget, Default::default())?;
    println!("{} bytes of HTML", page.html().len());
    match std::env::args().nth(1) {
        Some(path) => write_bytes(path.as_ref(), page.html().as_bytes()),
        None => Ok(()),
    }
}
