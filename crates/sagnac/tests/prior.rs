//! Single calibrations with a prior; those of many units are in `measured/fit/prior.rs`.

use crate::hostile::lots::{Fleet, Gyro, MODEL, gyro};
use crate::hostile::{Bench, Dice};
use crate::measured::fit::prior::{TEMPERATURES_C, calibrated, full, short, short_c};
use crate::support;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Model};

/// A prior that says nothing is the fit without one, and one that knows everything is its own mean.
#[test]
fn between_no_prior_and_nothing_else() {
    let fleet = Fleet::new(3, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(5));
    let log = || gyro.log(77, full);
    let with = |factor: f64| {
        let mut prior = fleet.of_lot();
        prior.covariance.iter_mut().for_each(|value| *value *= factor);
        calibrated(log(), Some(&prior)).unwrap()
    };
    let (without, vague) = (calibrated(log(), None).unwrap(), with(1e6));
    let used = |made: &Calibration| made.axes[0].fit.as_ref().unwrap().prior.clone().unwrap();
    for celsius in TEMPERATURES_C {
        for cpm in [0.0, 1.0] {
            let [a, b] = [&without, &vague].map(|made| made.axes[0].evaluate(celsius, cpm));
            let half = (a.upper_dph.unwrap() - a.drift_dph).abs();
            // Rows are weighted by their noise here and by their lengths there: a tenth of the uncertainty between them.
            assert!((a.drift_dph - b.drift_dph).abs() < 0.25 * half, "{celsius}: {a:?} {b:?}");
        }
    }
    assert!((used(&vague).determined - 6.0).abs() < 0.01 && used(&vague).directions == 6, "{:?}", used(&vague));
    let mut certain = fleet.of_lot();
    certain.covariance.iter_mut().for_each(|value| *value *= 1e-12);
    let refusal = calibrated(log(), Some(&certain)).unwrap_err();
    assert!(refusal.what.contains("does not separate the units of the fleet"), "{refusal}");
}

/// What is in the record, and that it is read again; the image has the hash of the record, so that of the prior is bound to it.
#[test]
fn the_record_says_what_it_rests_on() {
    let fleet = Fleet::new(4, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(8));
    let mut made = calibrated(gyro.log(78, short), Some(&fleet.of_lot())).unwrap();
    made.serial = "RLG-9".to_owned();
    let used = made.axes[0].fit.as_ref().unwrap().prior.clone().unwrap();
    assert_eq!(
        (used.sha256.as_str(), used.lot.as_deref(), used.parameters),
        (fleet.prior.sha256.as_str(), Some("lot 1"), 6)
    );
    assert!(
        used.distance <= used.distance_max && used.directions > 2 && (2.0..6.0).contains(&used.determined),
        "{used:?}"
    );
    let text = made.to_json().unwrap();
    let again = Calibration::parse(&text).unwrap();
    assert_eq!(again, made);
    // The span and the rates are those of the fleet's tests, which the short one does not reach.
    let [lo, hi] = made.axes[0].span_c();
    let of_fleet = fleet.of_lot();
    assert!(lo <= of_fleet.span_c[0] && hi >= of_fleet.span_c[1], "{lo} {hi} {:?}", of_fleet.span_c);
    let rates = made.axes[0].thermometer().rate_span_per_min.unwrap();
    assert!(rates[0] <= of_fleet.rate_spans_cpm[0][0] && rates[1] >= of_fleet.rate_spans_cpm[0][1]);
    let image = made.image('x').unwrap();
    // docs/reference/image-format.md: the parent's SHA-256 is at 92.
    assert_eq!(image[92..124], sagnac_log::ingest::sha256(text.as_bytes()));
}

/// What a prior cannot be used on is refused, and says why.
#[test]
fn a_prior_is_no_calibration() {
    let fleet = Fleet::new(5, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(9));
    // A chamber that stands still.
    let level = gyro.log(1, |bench| (bench.hours, bench.chamber_c) = (Some(4.0), |_| 20.0));
    let refusal = calibrated(level, Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("does not separate the units of the fleet"), "{refusal}");
    // Ten minutes.
    let brief = gyro.log(2, |bench| (bench.hours, bench.chamber_c) = (Some(0.15), short_c));
    let refusal = calibrated(brief, Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("too few for the noise of the test"), "{refusal}");
    // Another product.
    let other = Gyro { curve: [-0.6, 0.1, 0.0], ..gyro };
    let refusal = calibrated(other.log(3, short), Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("not of this fleet") && refusal.what.contains("bias 1 is -1"), "{refusal}");
    for options in [FitOptions::new(support::model(MODEL)), FitOptions::new(Model::Auto).correct_warm_up(true)] {
        let options = options.prior(Some(fleet.of_lot()));
        let refusal = support::fit_with(vec![gyro.log(4, short)], &Bench::setup(), &options).unwrap_err();
        assert!(refusal.what.contains("cannot be combined with a prior"), "{refusal}");
    }
}
