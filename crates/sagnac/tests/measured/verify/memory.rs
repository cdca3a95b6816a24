//! Memory that does not depend on the temperature rate: refused after the standard retest, and not decided without a soak from both
//! sides. The generator has friction as a play operator; the fit takes it for curve and rate terms.

use super::acceptance::{missed, navigation};
use crate::hostile::{Bench, Dice, Now, fraction, usual};
use crate::support::evidence::{Records, evidence};
use crate::support::{fit, reader};
use rayon::prelude::*;
use sagnac::verify::{Correction, Memory, Proof, VerifyOptions, verify};
use std::cell::Cell;

/// Half the width of the play, °C.
const PLAY_C: f64 = 4.0;

/// The usual drift and friction that shifts the bias by ± `size_dph` for good.
fn sticking(size_dph: f64) -> impl Fn(Now) -> f64 {
    let held_c = Cell::new(f64::NAN);
    move |now| {
        // `max` takes the number where the play is not held yet.
        let held = held_c.get().max(now.celsius - PLAY_C).min(now.celsius + PLAY_C);
        held_c.set(held);
        usual(now) + size_dph * (now.celsius - held) / PLAY_C
    }
}

/// A unit with friction, calibrated on two cycles, after the standard retest or after two more cycles.
fn proof(size_dph: f64, seed: u64, is_standard: bool) -> Proof {
    let setup = Bench::setup();
    let b_dph = 0.002 + 0.003 * Dice::new(seed ^ 0x0ddb).uniform();
    let log = |number: u64| {
        let drift = sticking(size_dph);
        let bench = Bench { b_dph, hours: Some(490.0 / 60.0), ..Bench::new(seed + number, &drift) };
        match number {
            0 | 1 => bench.log(),
            _ if is_standard => bench.standard().log(),
            _ => Bench { hours: None, ..bench }.log(),
        }
    };
    let unit = fit(vec![log(0), log(1)], &setup, "bias 3, rate 0").unwrap();
    let correction = Correction::from_calibration(unit).unwrap();
    let found = verify(&correction, vec![reader(log(2), &setup)], &setup, VerifyOptions::default()).unwrap();
    found.limits(&navigation()).unwrap()
}

#[test]
fn memory_is_seen_at_rest() {
    for (size_dph, claim) in [
        (0.03, "a unit whose friction shifts its bias by ± 0.03 °/h is accepted by `navigation-grade`"),
        (0.06, "a unit whose friction shifts its bias by ± 0.06 °/h is accepted by `navigation-grade`"),
        (-0.1, "a unit whose friction shifts its bias by ∓ 0.1 °/h is accepted by `navigation-grade`"),
    ] {
        const RECORDS: Records = Records::new(100).few(20);
        let accepted = fraction(RECORDS, |seed| proof(size_dph, 95_000_000 + 10 * seed, true).passed());
        evidence(claim, accepted, "≤ 0.05", RECORDS);
    }
}

/// The interval of sound units, and the units that friction does not touch.
#[test]
fn memory_of_a_sound_unit_is_none() {
    const RECORDS: Records = Records::new(300).few(20);
    let units: Vec<(Memory, bool)> = RECORDS
        .each()
        .into_par_iter()
        .map(|seed| {
            let found = proof(0.0, 96_000_000 + 10 * seed, true);
            (found.verification.axes[0].residual.memory.unwrap(), missed(&found).contains(&"memory_dph_max".to_owned()))
        })
        .collect();
    let fraction =
        |is: &dyn Fn(&(Memory, bool)) -> bool| units.iter().filter(|unit| is(unit)).count() as f64 / units.len() as f64;
    let sigmas = units.iter().map(|(memory, _)| memory.difference_dph.sigma);
    println!("σ up to {:.4} °/h", sigmas.fold(0.0, f64::max));
    assert!(units.iter().all(|(memory, _)| (memory.temperature_c - 25.0).abs() < 1.0), "{:?}", units.first());
    evidence("`navigation-grade` finds no memory in a sound unit", fraction(&|unit| !unit.1), "≥ 0.98", RECORDS);
    let covered = fraction(&|(memory, _)| memory.difference_dph.value.abs() < 1.96 * memory.difference_dph.sigma);
    evidence("the 95 % interval of memory contains the zero of a sound unit", covered, "0.92 … 0.98", RECORDS);
}

/// Cycles between −40 and 70 °C alone reach no temperature from both sides.
#[test]
fn cycles_without_a_soak_in_mid_span_decide_nothing() {
    const RECORDS: Records = Records::new(60).few(30);
    let by_memory_alone = fraction(RECORDS, |seed| {
        let found = proof(0.0, 97_000_000 + 10 * seed, false);
        let limits = &found.verification.axes[0].limits;
        let memory = limits.iter().find(|limit| limit.name == "memory_dph_max").unwrap();
        let help = memory.why.as_deref().unwrap_or_default();
        assert!(memory.is_open() && help.contains("soak at 25 °C from both sides"), "{memory:?}");
        missed(&found) == ["memory_dph_max"]
    });
    evidence(
        "a sound unit on cycles without a soak in mid-span is left open by `navigation-grade` for memory alone",
        by_memory_alone,
        "≥ 0.90",
        RECORDS,
    );
}
