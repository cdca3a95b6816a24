//! A counter that nothing turns: a gyro in lock-in or without its wire, on the standard retest. By a generator that shares no code with
//! the program. 40 of 80 such retests were accepted while a value that cannot be had was left to chance.

use crate::hostile::curves::calibrated;
use crate::hostile::{Bench, Dice, fraction, none, usual};
use crate::support::evidence::{Records, evidence};
use crate::support::rows::Rows;
use crate::support::{reader, windows};
use sagnac::survey::{GoodFor, survey};
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac_log::setup::Setup;

/// What is said of a still counter.
const JITTER: &str = "nothing but the jitter";

/// Counts of a total that jitters by σ of `jitter` counts about one place from so many hours on; 0 for a total that stands.
fn jittering(seed: u64, jitter: f64, from_h: f64) -> Rows<3> {
    let mut log = Bench { input_dph: 0.0, ..Bench::retest(seed, &usual) }.log();
    let mut dice = Dice::new(seed ^ 0x57111);
    let (place, mut counted) = (dice.uniform(), 0.0);
    for [.., counts] in log.rows.iter_mut().filter(|row| row[0] > from_h * 3600.0) {
        let total = (place + jitter * dice.normal()).floor();
        (*counts, counted) = (total - counted, total);
    }
    log
}

#[test]
fn a_counter_that_nothing_turns_has_no_verdict() {
    const RECORDS: Records = Records::new(80).few(8);
    let (unit, setup) = (calibrated(), Setup { input_rate_dph: Some(0.0.into()), ..Bench::setup() });
    let correction = Correction::from_calibration(unit).unwrap();
    for (jitter, from_h, claim) in [
        (0.0, 0.0, "a retest whose counter stands still has no verdict"),
        (0.5, 0.0, "a retest whose counter jitters by 0.5 counts has no verdict"),
        (1.0, 0.0, "a retest whose counter jitters by 1 count has no verdict"),
        (3.0, 0.0, "a retest whose counter jitters by 3 counts has no verdict"),
        (1.0, 7.4, "a retest whose counter jitters by 1 count from its middle on has no verdict"),
        (0.0, 10.0, "a retest whose counter stands still for its last third has no verdict"),
    ] {
        let refused = fraction(RECORDS, |seed| {
            let log = || jittering(7_300 + seed, jitter, from_h);
            let found = survey(&windows(vec![log()], &setup), &setup).unwrap();
            let is_named = found.good_for == GoodFor::Nothing && found.reason.unwrap().contains(JITTER);
            let proof = verify(&correction, vec![reader(log(), &setup)], &setup, VerifyOptions::default());
            is_named && proof.is_err_and(|error| error.what.contains(JITTER))
        });
        evidence(claim, refused, "≥ 1", RECORDS);
    }
}

/// A quiet gyro in coarse counts: N of 0.0005 °/√h makes 0.3 arcsec in a window, a count is 2; no drift and no slow noise.
#[test]
fn a_quiet_gyro_is_not_still() {
    const RECORDS: Records = Records::new(80).few(20);
    let setup = Bench::setup_of(2.0);
    let moving = fraction(RECORDS, |seed| {
        let bench = Bench {
            n_deg_rt_h: 0.0005,
            quantum_arcsec: 2.0,
            is_dithered: seed % 2 == 0,
            ..Bench::retest(7_500 + seed, &none)
        };
        let found = survey(&windows(vec![bench.log()], &setup), &setup).unwrap();
        !found.reason.is_some_and(|reason| reason.contains(JITTER))
    });
    evidence("a gyro of N = 0.0005 °/√h in counts of 2 arcsec is no still counter", moving, "≥ 0.99", RECORDS);
}
