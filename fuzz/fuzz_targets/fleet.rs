//! Of a fleet: manifests, listings, tables of Parquet, results of units, priors, recipes and answers.
#![no_main]

use std::path::PathBuf;

use sagnac::fleet::{Answer, Prior, Recipe, UnitResult, table_summary, units_among, units_of};

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
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let _ = serde_json::from_str::<Answer>(text);
    if let Ok(recipe) = Recipe::from_json(text) {
        let text = recipe.to_json().expect("a recipe that was read can be sent on");
        assert_eq!(Recipe::from_json(&text).expect("and read again").to_json().expect("and again"), text);
    }
    let mut lines = text.lines();
    if let Ok(units) = units_among(lines.next().unwrap_or_default(), lines.map(PathBuf::from).collect()) {
        assert!(units.iter().all(|unit| !unit.name.is_empty() && !unit.name.contains('/')));
    }
});
