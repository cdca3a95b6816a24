//! Window tables: Parquet from disk, and what a fit makes of one.
#![no_main]

use sagnac::fit::{FitOptions, Model, calibrate};
use sagnac::window::{is_table, read_table};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sagnac_fuzz::only_our_own_panics_are_findings();
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("room on the disk");
    let _ = is_table(file.path());
    if let Ok((windows, setup)) = read_table(file.path(), sagnac_log::MemoryBudget::default()) {
        let options = FitOptions::new(Model::Auto);
        let _ = calibrate(windows, &setup, &options);
    }
});
