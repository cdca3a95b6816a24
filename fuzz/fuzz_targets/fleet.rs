//! Of a fleet: manifests, tables of Parquet, results of units.
#![no_main]

use sagnac::fleet::{Prior, UnitResult, table_summary, units_of};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    sagnac_fuzz::only_our_own_panics_are_findings();
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("room on the disk");
    if let Ok(units) = units_of(file.path()) {
        assert!(!units.is_empty() && units.iter().all(|unit| !unit.name.is_empty() && !unit.name.contains('/')));
    }
    let _ = table_summary(file.path());
    let _ = serde_json::from_slice::<UnitResult>(bytes);
    if let Ok(prior) =
        std::str::from_utf8(bytes).map_err(|_| ()).and_then(|text| Prior::from_json(text).map_err(|_| ()))
    {
        let text = prior.to_json().expect("a prior that was read can be written");
        assert_eq!(Prior::from_json(&text).expect("and read again").to_json().expect("and again"), text);
    }
});
