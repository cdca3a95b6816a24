//! Bare Allan curves, and the terms that are fitted to them.
#![no_main]

use sagnac::allan::{budget_of_curves, parse_curve};
use sagnac::calibration::LogFile;

libfuzzer_sys::fuzz_target!(|text: &[u8]| {
    if let Ok(curves) = parse_curve(text) {
        let (file, sha256, rows_sketch) = (String::new(), String::new(), String::new());
        let input = LogFile { file, sha256, rows: 0, rows_sketch };
        let budget = budget_of_curves(&curves, None, input).expect("no length that could be wrong");
        serde_json::to_string(&budget).expect("a budget is JSON");
    }
});
