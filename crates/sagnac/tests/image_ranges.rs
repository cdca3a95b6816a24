//! What an image cannot hold is never selected: tables of sensors far from a ring laser gyro, of drifts from 10 to 30,000 °/h and
//! scale factors that move by up to 20,000 ppm, and very small ones. The generator shares no code with the fit.

use crate::measured::fit::image_ranges::{Mems, away_from_record, setup};

use crate::hostile::{Bench, Now};
use crate::support::fit;
use sagnac::calibration::LogUnit;
use sagnac::export::encode;
use sagnac::{Calibration, ErrorKind};
use sagnac_log::setup::Setup;

/// A drift of 1e-4 °/h does not round to nothing in counts of 1 arcsec, nor in those of a rate log.
#[test]
fn small_drifts_do_not_round_to_nothing() {
    let drift = |now: Now| 1e-4 * now.u();
    for seed in 0..5 {
        let mut bench = Bench::new(seed, &drift);
        // Of 4.5 °/h each window would count the same.
        (bench.n_deg_rt_h, bench.quantum_arcsec, bench.input_dph) = (1e-6, 1.0, 4.5037);
        let found = fit(vec![bench.log()], &Bench::setup_of(1.0), "bias 1").unwrap();
        let away = away_from_record(&found, &found.axes[0]);
        assert!(away < 1.0, "{away}");
    }
}

/// A fixed model that does not fit is refused with axis, term, limit and remedy; what the remedy says holds it.
#[test]
fn a_given_model_that_does_not_fit_is_refused_by_name() {
    let refused = |logs: Vec<Vec<u8>>, setup: &Setup, model: &str, words: &[&str]| {
        let error = fit(logs, setup, model).unwrap_err();
        let text = format!("{error} {}", error.help);
        println!("{text}");
        assert_eq!(error.kind, ErrorKind::Refused, "{text}");
        words.iter().for_each(|word| assert!(text.contains(word), "{word}: {text}"));
    };
    let quiet = Mems {
        bias_dph: [20_000.0, 1000.0, 0.0, 0.0],
        wiggle_dph: 0.0,
        scale_ppm: [0.0; 3],
        rate_dph_per_cpm: 0.0,
        on_table: false,
        n_deg_rt_h: 0.2,
    };
    let logs = || vec![quiet.log(1)];
    let fine = Setup { rate_lsb_arcsec: Some(1e-4), ..setup() };
    refused(
        logs(),
        &fine,
        "bias 2",
        &["`bias 2`", "axis x", "the term `bias 1` reaches", "8192 °/h", "rate_lsb_arcsec to 0.001"],
    );
    let coarser = Setup { rate_lsb_arcsec: Some(1e-3), ..setup() };
    fit(logs(), &coarser, "bias 2").unwrap();
    let found = fit(logs(), &setup(), "bias 2").unwrap();
    assert_eq!(found.unit, LogUnit::Rates { lsb_arcsec: 1e-3 });
    // Two terms that fit alone and not together.
    let both = Mems { bias_dph: [7000.0, 14_000.0, 0.0, 0.0], ..quiet };
    refused(vec![both.log(1)], &fine, "bias 2, rate 0", &["axis x", "together reach", "16384 °/h", "rate_lsb_arcsec"]);
    let scaled = Mems { scale_ppm: [18_000.0, 0.0, 0.0], on_table: true, ..both };
    let words = ["axis x", "the scale terms, the largest `scale 1`", "15625 ppm", "fewer scale terms"];
    refused(vec![scaled.log(1)], &setup(), "bias 2, scale 1", &words);
    // Counts have the size that they have: the tick must be shorter.
    let strong = |now: Now| 2000.0 * now.u();
    let counts = Bench::setup_of(0.1);
    let slow = Setup { tick_s: Some(1.0), ..counts.clone() };
    let bench = Bench { quantum_arcsec: 0.1, ..Bench::new(1, &strong) };
    refused(
        vec![bench.log().csv()],
        &slow,
        "bias 1",
        &["axis x", "the term `bias 1` reaches", "819.2 °/h", "tick_s to 0.4"],
    );
    fit(vec![bench.log()], &Setup { tick_s: Some(0.25), ..counts }, "bias 1").unwrap();
    let auto = fit(vec![bench.log()], &slow, "auto").unwrap();
    encode(&auto, &auto.axes[0], [0; 32], 1).unwrap();
    let rejected = &auto.axes[0].fit.as_ref().unwrap().rejected_models;
    assert!(rejected.iter().any(|model| model.reason.contains("819.2 °/h")), "{rejected:?}");
}

/// The same log makes the same counts, and the counts of one gyro's axes are of one size.
#[test]
fn the_counts_of_a_rate_log_follow_its_drift() {
    for (bias, lsb_arcsec) in [(100.0, 1e-4), (5000.0, 1e-3), (60_000.0, 1e-2)] {
        let sensor = Mems {
            bias_dph: [bias, 0.0, 0.0, 0.0],
            wiggle_dph: 0.0,
            scale_ppm: [0.0; 3],
            rate_dph_per_cpm: 0.0,
            on_table: false,
            n_deg_rt_h: 0.2,
        };
        for seed in 0..3 {
            let found = fit(vec![sensor.log(seed)], &setup(), "bias 1").unwrap();
            assert_eq!(found.unit, LogUnit::Rates { lsb_arcsec }, "{bias}");
        }
    }
}

/// The target's time for a slow update bounds the model: a given one beyond it is refused, `auto` passes over such models, and a record
/// from another board is not exported.
#[test]
fn a_slow_update_that_takes_too_long_is_refused() {
    let curve = |now: Now| 0.05 * now.u() + 0.05 * now.u().powi(2) - 0.1 * now.u().powi(3);
    let logs = || vec![Bench::new(1, &curve).log()];
    let limited = |most: u32| Setup { slow_update_instructions_max: Some(most), ..Bench::setup() };
    // 572 + 15 + 4·77 and no rate.
    let needs = 895;
    let free = fit(logs(), &Bench::setup(), "bias 3").unwrap();
    let instructions = |found: &Calibration| encode(found, &found.axes[0], [0; 32], 1).unwrap().work().instructions();
    assert_eq!(instructions(&free), needs);
    assert_eq!(instructions(&fit(logs(), &limited(needs), "bias 3").unwrap()), needs);
    let refusal = fit(logs(), &limited(needs - 1), "bias 3").unwrap_err();
    let text = format!("{refusal} {}", refusal.help);
    assert_eq!(refusal.kind, ErrorKind::Refused, "{text}");
    for word in ["axis x", "895 instructions", "time for 894", "smaller --model"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let found = fit(logs(), &limited(needs - 1), "auto").unwrap();
    assert!(instructions(&found) < needs, "{}", found.axes[0].correction.model);
    let rejected = &found.axes[0].fit.as_ref().unwrap().rejected_models;
    assert!(rejected.iter().any(|model| model.reason.contains("time for 894")), "{rejected:?}");
    let mut moved = free;
    moved.setup.slow_update_instructions_max = Some(needs - 1);
    let refusal = encode(&moved, &moved.axes[0], [0; 32], 1).unwrap_err().to_string();
    assert!(refusal.contains("time for 894"), "{refusal}");
}
