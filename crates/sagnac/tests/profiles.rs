//! Profiles of benches without a cycle: heating alone with a coarse thermometer, and short soaks.

use crate::support::records::Random;
use crate::support::rows::Rows;
use crate::support::{fit, windows};
use sagnac_log::ingest::Reason;
use sagnac_log::setup::Setup;

const SEEDS: std::ops::Range<u64> = 0..60;
const REFERENCE_C: f64 = 25.0;

fn setup() -> Setup {
    Setup { reference_c: Some(REFERENCE_C), ..Setup::default() }
}

/// Drift of a flight controller, °/h, less that at 25 °C.
fn drift_dph(celsius: f64) -> f64 {
    let d = celsius - REFERENCE_C;
    40.0 * d - 0.4 * d * d + 0.004 * d * d * d
}

/// A board that warms up from a cold soak: 2 Hz for 45 min, a thermometer in steps of half a degree to a degree.
fn heating(random: &mut Random) -> Rows<3> {
    let (from_c, to_c) = (-8.0 + 4.0 * random.uniform(), 48.0 + 6.0 * random.uniform());
    let (tau_s, step_c) = (700.0 + 400.0 * random.uniform(), if random.below(3) == 0 { 0.5 } else { 1.0 });
    let mut rows = Rows::new(["time_s", "temperature_c", "rate_dph"]);
    for row in 1..=5400 {
        let time_s = 0.5 * f64::from(row);
        let celsius = to_c - (to_c - from_c) * (-time_s / tau_s).exp();
        rows.push([time_s, (celsius / step_c).floor() * step_c, drift_dph(celsius) + 10.0 * random.normal()]);
    }
    rows
}

/// Temperature explains its own rate: no rate term is selected, and the curve is that of the gyro to half a step of the thermometer.
#[test]
fn a_coarse_thermometer_that_only_warms_makes_no_rate_term() {
    let (mut right, mut covered, mut rated) = (0, 0, 0);
    for seed in SEEDS {
        let found = fit(vec![heating(&mut Random::new(seed))], &setup(), "auto").unwrap();
        let axis = &found.axes[0];
        rated += usize::from(axis.correction.model.contains("rate"));
        let at = [-3.0, 10.0, 30.0, 42.0].map(|celsius| (axis.evaluate(celsius, 0.0), drift_dph(celsius)));
        // Half a degree, at 72 °/h per °C less the 40 of the reference: 16 °/h; measured: up to 19.
        right += usize::from(at.iter().all(|(found, truth)| (found.drift_dph - truth).abs() < 25.0));
        let inside =
            |lower: Option<f64>, upper: Option<f64>, truth: f64| lower.unwrap() <= truth && truth <= upper.unwrap();
        covered += usize::from(at.iter().all(|(found, truth)| inside(found.lower_dph, found.upper_dph, *truth)));
    }
    println!("right {right}, covered {covered}, with a rate term {rated} of 60");
    assert!(rated == 0 && right >= 57 && covered >= 57, "right {right}, covered {covered}, rated {rated}");
}

const LONG_SOAK_S: f64 = 3000.0;

/// A long soak, in which the bench may be bumped, then soaks of 150 to 300 s between ramps of 2 °C/min, 20 °/h per °C, up and down.
fn short_soaks(random: &mut Random, bump_dph: f64) -> Rows<3> {
    let (soak_s, step_c) = (150.0 + 150.0 * random.uniform(), 10.0);
    let leg_s = soak_s + 60.0 * step_c / 2.0;
    let mut rows = Rows::new(["time_s", "temperature_c", "rate_dph"]);
    for row in 1..=(LONG_SOAK_S + 14.0 * leg_s) as u32 {
        let time_s = f64::from(row) - LONG_SOAK_S;
        let (leg, within_s) = ((time_s / leg_s).floor(), time_s % leg_s);
        let moved_c = ((within_s - soak_s).max(0.0) / 30.0).min(step_c);
        let height_c = if leg < 0.0 {
            0.0
        } else if leg < 7.0 {
            leg * step_c + moved_c
        } else {
            (14.0 - leg) * step_c - moved_c
        };
        let celsius = -10.0 + height_c;
        let bump = if (-2000.0..-1850.0).contains(&time_s) { bump_dph } else { 0.0 };
        rows.push([time_s + LONG_SOAK_S, celsius, 20.0 * (celsius - REFERENCE_C) + 10.0 * random.normal() + bump]);
    }
    rows
}

/// The end of a soak is a bend, not a bump: no window is left out, and the slope is that of the gyro. A bump is still found.
#[test]
fn short_soaks_are_no_bumps() {
    let out = |rows: Rows<3>| {
        let made = windows(vec![rows], &setup());
        let is_bump = |reason: &&Option<Reason>| matches!(reason, Some(Reason::Motion | Reason::StartUp));
        made.rows.excluded.iter().filter(is_bump).count()
    };
    let (mut clean, mut found) = (0, 0);
    for seed in SEEDS {
        let rows = short_soaks(&mut Random::new(seed), 0.0);
        let slope = fit(vec![rows.clone()], &setup(), "bias 1").map(|made| {
            let [cold, warm] = [0.0, 50.0].map(|celsius| made.axes[0].evaluate(celsius, 0.0).drift_dph);
            (warm - cold) / 50.0
        });
        clean += usize::from(out(rows) == 0 && slope.is_ok_and(|slope| (slope / 20.0 - 1.0).abs() < 0.01));
        found += usize::from(out(short_soaks(&mut Random::new(seed), 400.0)) > 0);
    }
    println!("clean {clean}, bump found {found} of 60");
    assert!(clean >= 57 && found >= 57, "clean {clean}, bump found {found}");
}
