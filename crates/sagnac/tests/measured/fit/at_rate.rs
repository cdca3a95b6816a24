//! What `evaluate` says where no rate term was selected, and where memory of temperature passes for one. By a generator that shares no
//! code with the program. At 1 °C/min its interval held in 0, 0 and 0.17 of 120; at rest next to a memory of ± 0.1 °/h it said ± 0.004.

use crate::hostile::{Bench, Now, fraction, none};
use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use crate::support::rows::Rows;
use sagnac::calibration::AxisCalibration;

fn calibrated(logs: Vec<Rows<3>>, model: &str) -> AxisCalibration {
    fit(logs, &Bench::setup(), model).unwrap().axes.remove(0)
}

/// An effect of the temperature rate too small to be selected, in a model that is a curve alone.
#[test]
fn a_rate_effect_that_was_not_selected_is_in_the_interval() {
    const RECORDS: Records = Records::new(120).few(40);
    for (dph_per_cpm, claim) in [
        (0.001, "interval of `evaluate` at 1 °C/min holds, an effect of 0.001 °/h per °C/min and no rate term"),
        (0.002, "interval of `evaluate` at 1 °C/min holds, an effect of 0.002 °/h per °C/min and no rate term"),
        (0.003, "interval of `evaluate` at 1 °C/min holds, an effect of 0.003 °/h per °C/min and no rate term"),
    ] {
        let drift = move |now: Now| 0.02 * now.u() + dph_per_cpm * now.cpm;
        let held = fraction(RECORDS, |seed| {
            let logs =
                (0..2).map(|k| Bench { cycles: 1, row_s: 20.0, ..Bench::new(61_000 + 2 * seed + k, &drift) }.log());
            let axis = calibrated(logs.collect(), "bias 3");
            let found = axis.evaluate(25.0, 1.0);
            // Three times as fast as any ramp of the test.
            let beyond = axis.evaluate(25.0, 3.0);
            assert!(found.in_span && !beyond.in_span);
            let holds =
                |lower: Option<f64>, upper: Option<f64>, truth: f64| (lower.unwrap()..=upper.unwrap()).contains(&truth);
            holds(found.lower_dph, found.upper_dph, dph_per_cpm)
                && holds(beyond.lower_dph, beyond.upper_dph, 3.0 * dph_per_cpm)
        });
        evidence(claim, held, "≥ 0.90", RECORDS);
    }
}

/// The bias follows the temperature with friction: its own temperature stays up to 4 °C behind, whatever the rate.
fn with_friction(bench: Bench<'_>, size_dph: f64) -> Rows<3> {
    const PLAY_C: f64 = 4.0;
    let (arcsec, mut held_c, mut total, mut counted) = (crate::hostile::QUANTUM_ARCSEC, f64::NAN, 0.0_f64, 0.0);
    let row_s = bench.row_s;
    let mut log = bench.log();
    for [_, celsius, counts] in &mut log.rows {
        held_c = if held_c.is_nan() { *celsius } else { held_c.clamp(*celsius - PLAY_C, *celsius + PLAY_C) };
        total += *counts + size_dph * (*celsius - held_c) / PLAY_C * row_s / arcsec;
        (*counts, counted) = (total.floor() - counted, total.floor());
    }
    log
}

/// At rest after heating the truth is `size_dph` above the curve of the correction, after cooling as far below.
#[test]
fn memory_is_in_the_interval_at_rest() {
    const RECORDS: Records = Records::new(60).few(60);
    for (size_dph, claim) in [
        (0.03, "interval of `evaluate` at rest holds a memory of ± 0.03 °/h, no soak from both sides"),
        (0.1, "interval of `evaluate` at rest holds a memory of ± 0.1 °/h, no soak from both sides"),
    ] {
        let held = fraction(RECORDS, |seed| {
            let logs = (0..2)
                .map(|k| with_friction(Bench { cycles: 1, ..Bench::new(63_000 + 2 * seed + k, &none) }, size_dph));
            let axis = calibrated(logs.collect(), "bias 3, rate 0");
            let memory = axis.fit.as_ref().unwrap().memory.unwrap();
            assert!(memory.difference_dph.is_none());
            let found = axis.evaluate(25.0, 0.0);
            // The fit puts its curve between the two.
            found.lower_dph.unwrap() <= -size_dph && found.upper_dph.unwrap() >= size_dph
        });
        evidence(claim, held, "≥ 0.95", RECORDS);
    }
    let logs = |seed: u64, size_dph: f64| {
        (0..2).map(|k| with_friction(Bench::retest(65_000 + 2 * seed + k, &none), size_dph)).collect::<Vec<_>>()
    };
    // With soaks from both sides it is an estimate, and a sound unit has none.
    let shown = fraction(RECORDS, |seed| {
        let memory = calibrated(logs(seed, 0.06), "bias 3, rate 0").fit.unwrap().memory.unwrap();
        (memory.difference_dph.unwrap() - 0.12).abs() < 3.0 * memory.sigma_dph.unwrap() + 0.012
            && memory.half_dph > 0.05
    });
    evidence("a memory of ± 0.06 °/h is found by soaks from both sides", shown, "≥ 0.95", RECORDS);
    let sound = fraction(RECORDS, |seed| {
        let memory = calibrated(logs(seed, 0.0), "bias 3, rate 0").fit.unwrap().memory.unwrap();
        memory.half_dph == 0.0
    });
    evidence("a unit without memory has none by soaks from both sides", sound, "≥ 0.90", RECORDS);
}
