//! Defects that cancel in a window, come and go, or look like slow noise: does a verdict see them? By a generator that shares no code with
//! the program. Every one of them was accepted by an earlier rule, in 20 records of 20 or nearly.

use crate::hostile::curves::calibrated;
use crate::hostile::{Bench, Dice, Now, fraction, usual};
use crate::support::evidence::evidence;
use crate::support::rows::Rows;
use crate::support::{fit, reader};
use sagnac::Limits;
use sagnac::calibration::Calibration;
use sagnac::verify::{Correction, VerifyOptions, verify};

fn accepts(unit: &Calibration, limits: &Limits, log: Rows<3>) -> bool {
    let correction = Correction::from_calibration(unit.clone()).unwrap();
    let logs = vec![reader(log, &Bench::setup())];
    verify(&correction, logs, &Bench::setup(), VerifyOptions::default()).unwrap().limits(limits).unwrap().passed()
}

fn navigation() -> Limits {
    Limits::named_or_read("navigation-grade").unwrap()
}

/// Number of the row at these hours of test.
fn row_at(hours: f64) -> u64 {
    (hours * 720.0) as u64
}

/// Two rows in each twenty minutes are 300 arcsec off, one up, the next down: they cancel in a window of 100 s.
#[test]
fn pairs_of_wrong_rows_are_noise() {
    let (unit, limits) = (calibrated(), navigation());
    let pairs = |hours: f64| match row_at(hours) % 240 {
        100 => 60.0,
        101 => -60.0,
        _ => 0.0,
    };
    let accepted = fraction(40, |seed| accepts(&unit, &limits, Bench::retest(3_000 + seed, &usual).log_with(&pairs)));
    evidence(
        "a unit with two rows of 300 arcsec in each 20 min, which cancel, is accepted by `navigation-grade`",
        accepted,
        "≤ 0.05",
        40,
    );
}

/// Three times the angle random walk for 20 minutes of each 100.
#[test]
fn a_walk_that_comes_and_goes_counts() {
    let (unit, limits) = (calibrated(), navigation());
    let accepted = fraction(40, |seed| {
        let bursts = |hours: f64| {
            let row = row_at(hours);
            let in_burst = row % 1200 < 240;
            if in_burst { 0.2277 * Dice::new(row ^ (seed << 32)).normal() } else { 0.0 }
        };
        accepts(&unit, &limits, Bench::retest(3_100 + seed, &usual).log_with(&bursts))
    });
    evidence(
        "a unit with N = 0.009 °/√h for 20 of each 100 min is accepted by `navigation-grade`",
        accepted,
        "≤ 0.05",
        40,
    );
}

/// A ripple over temperature with a period of 24 °C, rms twice the limit.
#[test]
fn a_ripple_over_temperature_is_seen() {
    let (unit, limits) = (calibrated(), navigation());
    let rippled = |now: Now| usual(now) + 0.034 * (std::f64::consts::TAU * now.celsius / 24.0).sin();
    let accepted = fraction(40, |seed| accepts(&unit, &limits, Bench::retest(3_200 + seed, &rippled).log()));
    evidence(
        "a unit at twice `temperature_residual_dph_max`, a ripple each 24 °C, is accepted by `navigation-grade`",
        accepted,
        "≤ 0.05",
        40,
    );
}

/// An effect of |Ṫ|: neither a slope over Ṫ nor a hysteresis.
#[test]
fn a_rate_effect_of_one_sign_is_seen() {
    let (unit, limits) = (calibrated(), navigation());
    for (dph_per_cpm, claim) in [
        (0.04, "a unit with 0.04 °/h for each °C/min of either sign is accepted by `navigation-grade`"),
        (-0.04, "a unit with −0.04 °/h for each °C/min of either sign is accepted by `navigation-grade`"),
    ] {
        let drift = move |now: Now| usual(now) + dph_per_cpm * now.cpm.abs();
        let accepted = fraction(60, |seed| accepts(&unit, &limits, Bench::retest(3_400 + seed, &drift).log()));
        evidence(claim, accepted, "≤ 0.05", 60);
    }
}

/// The log with its temperature blank for three minutes: a window without one must not hide the others.
fn without_a_temperature(mut log: Rows<3>) -> Rows<3> {
    log.rows[1999..2035].iter_mut().for_each(|row| row[1] = f64::NAN);
    log
}

/// One slow ramp, on which a curve of fifth to eighth order is as slow as noise, and a rule without a guard band.
#[test]
fn no_curve_is_slow_noise() {
    fn ramp_c(minutes: f64) -> f64 {
        (-40.0 + 0.2 * minutes).min(70.0)
    }
    let at_rest = |now: Now| usual(Now { cpm: 0.0, ..now });
    let logs = (1..=4).map(|seed| Bench::new(seed, &at_rest).log()).collect();
    let unit = fit(logs, &Bench::setup(), "bias 3").unwrap();
    let limits = Limits::parse("decision = \"simple\"\ntemperature_residual_dph_max = 0.012").unwrap();
    for (order, claim) in [
        (
            5,
            "a unit with a residual of order 5 at twice `temperature_residual_dph_max` is accepted on one ramp of 0.2 °C/min, `simple`",
        ),
        (
            7,
            "a unit with a residual of order 7 at twice `temperature_residual_dph_max` is accepted on one ramp of 0.2 °C/min, `simple`",
        ),
    ] {
        let drift = move |now: Now| at_rest(now) + 0.034 * (f64::from(order) * now.u().clamp(-1.0, 1.0).acos()).cos();
        let accepted = fraction(40, |seed| {
            let bench = Bench {
                chamber_c: ramp_c,
                hours: Some(9.4),
                block_lag_s: 60.0,
                b_dph: 0.003,
                ..Bench::new(3_300 + seed, &drift)
            };
            accepts(&unit, &limits, without_a_temperature(bench.log()))
        });
        evidence(claim, accepted, "≤ 0.05", 40);
    }
}
