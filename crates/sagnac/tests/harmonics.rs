//! A harmonic of a stated period; fitted periods are in `measured/fit/harmonics.rs`.

use crate::measured::fit::harmonics::{Prism, amplitude, made, setup};
use crate::support::retest;
use sagnac::calibration::Calibration;
use sagnac::model::ActsOn;

/// A stated period through fit, record, bytes of the image and the target's own code, on another run.
#[test]
fn a_stated_period_is_corrected_on_another_run() {
    let gyro = Prism { amplitude_dph: 0.1, period_v: 14.0, phase: 1.0, seed: 7 };
    let found = made(gyro, "bias 1, harmonic(stab_v) 14").unwrap();
    let text = found.to_json().unwrap();
    assert_eq!(Calibration::parse(&text).unwrap(), found);
    let axis = &found.axes[0];
    assert!((amplitude(axis) - 0.1).abs() < 0.01, "{}", amplitude(axis));
    assert!(axis.correction.terms.iter().all(|term| term.acts_on == ActsOn::Bias));
    assert!(axis.nonlinear().is_empty(), "a stated period has no uncertainty");
    let proof = retest(&found, Prism { seed: 8, ..gyro }.log(), &setup());
    let (before, after) = (proof.axes[0].before.sigma_dph, proof.axes[0].after.sigma_dph);
    let alone = retest(&made(gyro, "bias 3, bias(stab_v) 3").unwrap(), Prism { seed: 8, ..gyro }.log(), &setup());
    println!("σ {before:.4} → {after:.4} °/h; polynomials of the voltage: {:.4}", alone.axes[0].after.sigma_dph);
    // The floor of a window is 0.02 °/h.
    assert!(before > 0.06 && after < 0.022 && alone.axes[0].after.sigma_dph > 2.0 * after);
}
