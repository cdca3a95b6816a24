//! The fixed bias as a part of the correction: the retest's mean is its input rate, and a bias is not removed twice.

use crate::hostile::{Bench, usual};
use crate::support::fit_with;
use crate::support::rows::Log as _;
use sagnac::calibration::Calibration;
use sagnac::export::{data_sheet, encode};
use sagnac::fit::FitOptions;
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac_log::setup::Setup;

const BIAS_DPH: f64 = 3.0;

fn bench(seed: u64) -> Bench<'static> {
    Bench { bias_dph: BIAS_DPH, cycles: 1, row_s: 10.0, ..Bench::new(seed, &usual) }
}

fn made(setup: &Setup, removes: bool) -> sagnac::Result<Calibration> {
    let options = FitOptions::new("bias 3, rate 0".parse().unwrap()).remove_bias(removes);
    fit_with(vec![bench(1).log()], setup, &options)
}

/// Mean after, °/h, and bias against the calibration with its σ.
fn retested(calibration: Calibration, setup: &Setup) -> (f64, f64, f64) {
    let correction = Correction::from_calibration(calibration).unwrap();
    let log = bench(2).log().reader("retest.csv", setup);
    let proof = verify(&correction, vec![log], setup, VerifyOptions::default()).unwrap();
    let bias = proof.verification.axes[0].bias_repeatability.clone().unwrap();
    (bias.runs[0].bias_dph.value, bias.runs[0].difference_dph.value, bias.runs[0].difference_dph.sigma)
}

#[test]
fn a_removed_bias_is_gone_from_the_retest_and_a_kept_one_is_not() {
    let setup = Bench::setup();
    let (kept, removed) = (made(&setup, false).unwrap(), made(&setup, true).unwrap());
    assert_eq!(kept.axes[0].correction.fixed_bias, None);
    let bias = removed.axes[0].correction.fixed_bias.unwrap();
    assert!((bias.value_dph - BIAS_DPH).abs() < 4.0 * bias.sigma_dph && bias.runs == 1, "{bias:?}");
    // Nothing else of the record changes.
    assert_eq!(kept.axes[0].correction.terms, removed.axes[0].correction.terms);
    let text = removed.to_json().unwrap();
    assert_eq!(Calibration::parse(&text).unwrap(), removed);
    let (after, difference, sigma) = retested(kept, &setup);
    assert!((after - BIAS_DPH).abs() < 0.02 && difference.abs() < 4.0 * sigma, "{after} {difference} ± {sigma}");
    let (after, difference, sigma) = retested(removed, &setup);
    assert!(after.abs() < 0.02 && difference.abs() < 4.0 * sigma, "{after} {difference} ± {sigma}");
}

#[test]
fn a_bias_of_unknown_input_is_not_removed() {
    let setup = Setup { input_rate_dph: None, ..Bench::setup() };
    let error = made(&setup, true).unwrap_err();
    assert!(error.what.contains("fixed bias of axis x is unknown") && error.help.contains("input_rate_dph"), "{error}");
    assert!(made(&setup, false).is_ok());
}

/// The data sheet states the correction that the image computes, a removed bias included: the difference is of integers alone.
#[test]
fn the_data_sheet_has_a_removed_bias_in_it() {
    let sheet = |removes: bool| {
        let calibration = made(&Setup { serial: Some("G-1".to_owned()), ..Bench::setup() }, removes).unwrap();
        let image = encode(&calibration, &calibration.axes[0], [0; 32], 1).unwrap();
        data_sheet(&calibration, &calibration.axes[0], &image)
    };
    let (kept, removed) = (sheet(false), sheet(true));
    let rows = |sheet: &str| -> Vec<[f64; 3]> {
        let budget = sheet.split_once("image − record, °/h |").unwrap().1;
        let cells = |line: &str| line.split('|').filter_map(|cell| cell.trim().parse().ok()).collect::<Vec<f64>>();
        let lines = budget.lines().skip(2).take_while(|line| line.starts_with('|'));
        lines.map(cells).map(|cells| [cells[0], cells[1], cells[3]]).collect()
    };
    assert!(rows(&kept).len() > 5 && rows(&kept).len() == rows(&removed).len());
    for ([celsius, with, _], [_, without, difference]) in rows(&kept).into_iter().zip(rows(&removed)) {
        assert!((without - with - BIAS_DPH).abs() < 0.02, "{celsius} °C: {with} and {without}");
        assert!(difference.abs() < 1e-4, "{celsius} °C: {difference}");
    }
    assert!(removed.contains("The correction has the fixed bias in it: ") && !kept.contains("fixed bias in it"));
}
