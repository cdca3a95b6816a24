//! Single verdicts; those over many records are in `measured/verify/acceptance.rs`.

use crate::hostile::curves::calibrated;
use crate::hostile::{Bench, usual};
use crate::measured::verify::acceptance::{missed, navigation, proof};
use crate::support::reader;
use sagnac::Limits;
use sagnac::verify::{Correction, VerifyOptions, verify};

/// A sound test and a turn-on of eleven minutes that is 1 °/h off: too short for a bias, so that none of the limits of the bias is met. Left
/// out, it was accepted.
#[test]
fn a_turn_on_too_short_for_its_bias_meets_no_limit_of_it() {
    let unit = calibrated();
    let text = "bias_repeatability_dph_max = 0.035\nturn_on_sigma_dph_max = 0.03\nposition_error_m_max = 1e6
[flight]\nprofile = [{ minutes = 0, temperature_c = -10 }, { minutes = 60, temperature_c = 40 }]\n";
    let limits: Limits = text.parse().unwrap();
    for off in [0.0, 1.0] {
        let mut short = Bench::new(71_001, &usual);
        (short.hours, short.start_s, short.bias_dph) = (Some(690.0 / 3600.0), 200_000.0, off);
        let logs = vec![Bench::retest(71_000, &usual).log(), short.log()];
        let found = proof(&unit, logs, VerifyOptions::default()).limits(&limits).unwrap();
        assert_eq!(
            missed(&found),
            ["position_error_m_max", "bias_repeatability_dph_max", "turn_on_sigma_dph_max"],
            "{off}"
        );
    }
}

/// The setup of a retest that does not state the input rate does not hide the bias: the rate is that of the calibration.
#[test]
fn the_input_rate_is_that_of_the_calibration() {
    let (unit, limits) = (calibrated(), navigation());
    let setup = sagnac::Setup { input_rate_dph: None, ..Bench::setup() };
    let correction = Correction::from_calibration(unit.clone()).unwrap();
    let mut bench = Bench::retest(1, &usual);
    bench.bias_dph = 0.5;
    let log = reader(bench.log(), &setup);
    let found = verify(&correction, vec![log], &setup, VerifyOptions::default()).unwrap().limits(&limits).unwrap();
    assert_eq!(missed(&found), ["bias_repeatability_dph_max"]);
}
