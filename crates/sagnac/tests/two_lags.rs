//! Two lags in the record and on the target; many records are in `measured/fit/two_lags.rs`.

use crate::hostile::Bench;
use crate::measured::fit::two_lags::{FAST_S, TWO, calibrated, log, of_two};
use crate::support::retest;
use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::export::{encode, image_bytes};
use sagnac_core::{Image, ValueSource};

/// The record as JSON and its image hold both lags. The target's own code leaves on the log of the fit what the host's fit left, and on
/// a second log less than half of what one lag leaves.
#[test]
fn the_target_applies_both_lags() {
    let made = calibrated(1, of_two, FAST_S, TWO).unwrap();
    let axis = &made.axes[0];
    assert_eq!(Calibration::parse(&made.to_json().unwrap()).unwrap(), made);
    let [main, slow] = axis.correction.inputs.as_slice() else { panic!("{:?}", axis.correction.inputs) };
    assert_eq!((slow.name.as_str(), slow.repeats()), ("slow temperature_c", Some(main.name.as_str())));
    assert!(main.lag_s.unwrap().value * 3.0 <= slow.lag_s.unwrap().value);
    assert_eq!(axis.nonlinear().iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["lag", "slow lag"]);

    let image = encode(&made, axis, [0; 32], 1).unwrap();
    assert_eq!((image.format_minor(), image.inputs()[1].source), (5, ValueSource::Repeat { of: 0 }));
    assert_eq!(Image::decode(&image_bytes(&image)), Ok(image));

    let after = |made: &Calibration, seed: u64| {
        retest(made, log(seed, of_two, FAST_S), &Bench::setup()).axes[0].after.sigma_dph
    };
    let host = axis.residual().unwrap().sigma_dph;
    let one = calibrated(1, of_two, FAST_S, "bias 3, rate 0").unwrap();
    let (own, with, without) = (after(&made, 1), after(&made, 2), after(&one, 2));
    println!("residual σ: host {host:.5}, target {own:.5}; second log, two lags {with:.5}, one {without:.5} °/h");
    assert!((own / host - 1.0).abs() < 0.02, "{own} {host}");
    assert!(with < 0.5 * without, "{with} {without}");
}

/// A record whose slow lag is not the slower one, or that repeats what it does not have, is refused.
#[test]
fn a_record_with_lags_out_of_order_is_refused() {
    let made = calibrated(1, of_two, FAST_S, TWO).unwrap();
    let changed = |change: &dyn Fn(&mut AxisCalibration)| {
        let mut made = made.clone();
        change(&mut made.axes[0]);
        made.to_json().and_then(|text| Calibration::parse(&text)).map_err(|e| e.to_string())
    };
    assert!(changed(&|_| ()).is_ok());
    let swapped = |axis: &mut AxisCalibration| axis.correction.inputs[1].lag_s.as_mut().unwrap().value = 100.0;
    let other = |axis: &mut AxisCalibration| {
        axis.correction.inputs[1].source = sagnac::calibration::InputSource::Repeat("cavity".to_owned());
    };
    let narrow = |axis: &mut AxisCalibration| axis.correction.inputs[1].valid_range[0] += 1.0;
    for change in [&swapped as &dyn Fn(&mut AxisCalibration), &other, &narrow] {
        let refusal = changed(change).unwrap_err();
        assert!(refusal.contains("slow temperature_c"), "{refusal}");
    }
}
