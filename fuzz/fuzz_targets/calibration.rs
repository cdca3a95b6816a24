//! Calibration records: one that is read can be written, read again as the same, and encoded or refused.
#![no_main]

use sagnac::calibration::Calibration;
use sagnac::verify::Correction;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let Ok(calibration) = Calibration::parse(text) else { return };
    if let Ok(written) = calibration.to_json() {
        assert_eq!(Calibration::parse(&written).as_ref(), Ok(&calibration));
    }
    let _ = Correction::from_calibration(calibration);
});
