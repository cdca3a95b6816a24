//! From simulated rows to calibrations and verifications, through the readers a user's log goes through.

pub(crate) mod evidence;
pub(crate) mod records;
pub(crate) mod rows;

use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::fit::{FitOptions, Model, calibrate};
use sagnac::verify::{Correction, Verification, VerifyOptions, verify};
use sagnac::window::{WindowBuilder, Windows};
use sagnac_log::ingest::LogReader;
use sagnac_log::setup::Setup;

use self::rows::Log;

pub(crate) fn reader(log: impl Log, setup: &Setup) -> LogReader {
    log.reader("simulated.csv", setup)
}

pub(crate) fn windows(logs: Vec<impl Log>, setup: &Setup) -> Windows {
    let logs = logs.into_iter().map(|log| reader(log, setup)).collect::<Vec<_>>();
    WindowBuilder::read_all(logs, setup).unwrap().finish()
}

pub(crate) fn model(text: &str) -> Model {
    text.parse().unwrap()
}

pub(crate) fn fit(logs: Vec<impl Log>, setup: &Setup, text: &str) -> sagnac::Result<Calibration> {
    fit_with(logs, setup, &FitOptions::new(model(text)))
}

pub(crate) fn fit_with(logs: Vec<impl Log>, setup: &Setup, options: &FitOptions) -> sagnac::Result<Calibration> {
    calibrate(windows(logs, setup), setup, options)
}

pub(crate) fn retest(calibration: &Calibration, log: impl Log, setup: &Setup) -> Verification {
    let correction = Correction::from_calibration(calibration.clone()).unwrap();
    verify(&correction, vec![reader(log, setup)], setup, VerifyOptions::default()).unwrap().verification
}

/// The setup of the paper's rig.
pub(crate) fn paper_setup() -> Setup {
    Setup { arcsec_per_count: Some(1.059), quantum: Some(0.25), ..Setup::default() }
}

/// The value of several that is farthest from a wanted one.
pub(crate) fn farthest(values: impl IntoIterator<Item = f64>, wanted: f64) -> f64 {
    let values = values.into_iter();
    values.max_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs())).unwrap()
}

/// The curve at rest and the half width of its interval, °/h, without what memory of temperature may add; at the border outside the span.
pub(crate) fn at_rest(axis: &AxisCalibration, celsius: f64) -> (f64, f64) {
    let [lo, hi] = axis.span_c();
    let found = axis.predict(celsius.clamp(lo, hi)).unwrap();
    (found.drift_dph, found.curve_dph)
}
