//! The report of a calibration: one HTML file that needs nothing else.
//!
//! `cargo run --example calibration_page -- unit.html` (without a name it writes nothing)

use std::path::Path;

use sagnac::fit::{FitOptions, Model, calibrate_with_report_data};
use sagnac::window::WindowBuilder;
use sagnac::{Result, Setup};
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::write::write_bytes;
use sagnac_report::calibration_report;

fn main() -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/chamber");
    let setup = Setup::read(folder.join("bench.toml"))?;
    let log = LogReader::open(folder.join("cycle-1.csv.gz"), &setup, ReadMode::Bulk)?;
    let windows = WindowBuilder::read_all(vec![log], &setup)?.finish();
    let model: Model = "bias 3, rate 0".parse()?;
    let (calibration, drawn) = calibrate_with_report_data(windows, &setup, &FitOptions::new(model))?;
    let page = calibration_report(&calibration, &drawn, Default::default())?;
    println!("{} bytes of HTML", page.html().len());
    assert!(page.html().starts_with("<!DOCTYPE html>") && !page.html().contains("src=\"http"));
    match std::env::args().nth(1) {
        Some(path) => write_bytes(path.as_ref(), page.html().as_bytes()),
        None => Ok(()),
    }
}
