//! Setup files.
#![no_main]

use sagnac_log::setup::Setup;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(setup) = Setup::parse(text) {
        setup.check().expect("what was parsed was checked");
    }
});
