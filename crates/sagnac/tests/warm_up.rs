//! A warm-up in the record and on the target; many records are in `measured/fit/warm_up.rs`.

use crate::hostile::{Bench, WHITE_100_S_DPH};
use crate::measured::fit::warm_up::{calibrated, log};
use crate::support::retest;
use sagnac::calibration::Calibration;
use sagnac::export::{encode, image_bytes};
use sagnac_core::{Image, ValueSource};

/// The record as JSON and its image hold it, the target's own code leaves on the log of the fit what the host's fit left, and on a
/// second test from power-on the noise. Without it a third of the drift stays.
#[test]
fn the_target_corrects_it_from_power_on() {
    let made = calibrated(1, 2, 1.0, "auto", |_| ());
    let axis = &made.axes[0];
    assert_eq!(Calibration::parse(&made.to_json().unwrap()).unwrap(), made);
    assert!(axis.fit.as_ref().unwrap().time_effects.is_empty(), "{:?}", axis.fit.as_ref().unwrap().time_effects);
    let image = encode(&made, axis, [0; 32], 1).unwrap();
    assert_eq!((image.format_minor(), image.inputs().last().unwrap().source), (5, ValueSource::WarmUp));
    assert_eq!(Image::decode(&image_bytes(&image)), Ok(image));
    let priced = axis.candidates().iter().find(|candidate| candidate.chosen).unwrap().slow_update_instructions;
    assert_eq!(priced, Some(image.work().instructions()));

    let after =
        |made: &Calibration, seed: u64| retest(made, log(seed, 1.0, |_| ()), &Bench::setup()).axes[0].after.sigma_dph;
    let mut without = made.clone();
    without.axes[0].correction.warm_up = None;
    let floor = WHITE_100_S_DPH;
    let (with, without) = (after(&made, 9), after(&without, 9));
    println!("second test: {with:.5} with, {without:.5} °/h without; noise floor {floor:.5}");
    assert!(with < 1.05 * floor, "{with} {floor}");
    assert!(without > 5.0 * with, "{with} {without}");
}

/// A record that holds no such thing is refused.
#[test]
fn a_record_with_a_warm_up_out_of_range_is_refused() {
    let made = calibrated(1, 1, 1.0, "bias 1", |_| ());
    let text = made.to_json().unwrap();
    let tau = made.axes[0].correction.warm_up.as_ref().unwrap().tau_s.value;
    for wrong in ["-1.0", "0.0", "1e999"] {
        let changed = text.replacen(&format!("\"value\": {tau}"), &format!("\"value\": {wrong}"), 1);
        assert_ne!(changed, text);
        let refusal = Calibration::parse(&changed).unwrap_err().to_string();
        assert!(wrong == "1e999" || refusal.contains("warm_up"), "{refusal}");
    }
}
