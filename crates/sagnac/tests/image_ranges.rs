//! What an image cannot hold is never selected: tables of sensors far from a ring laser gyro, of drifts from 10 to 30,000 °/h and
//! scale factors that move by up to 20,000 ppm, and very small ones. The generator shares no code with the fit.

use std::fmt::Write as _;

use crate::hostile::{Bench, Dice, Now, fraction};
use crate::support::evidence::evidence;
use crate::support::{fit, retest};
use sagnac::calibration::{AxisCalibration, LogUnit};
use sagnac::export::encode;
use sagnac::{Calibration, ErrorKind};
use sagnac_core::{Compensator, State};
use sagnac_log::setup::Setup;

/// One sensor of microelectromechanics: what its rate log reads.
struct Mems {
    /// Coefficients over u = (T − 22.5)/62.5: bias °/h, scale factor ppm, °/h per °C/min.
    bias_dph: [f64; 4],
    wiggle_dph: f64,
    scale_ppm: [f64; 3],
    rate_dph_per_cpm: f64,
    on_table: bool,
    n_deg_rt_h: f64,
}

impl Mems {
    /// By chance: sizes over decades, signs either way.
    fn of(dice: &mut Dice) -> Self {
        let mut sized = |least: f64, most: f64| {
            let size = least * (most / least).powf(dice.uniform());
            if dice.uniform() < 0.5 { -size } else { size }
        };
        let bias = sized(10.0, 30_000.0);
        let scale = sized(100.0, 20_000.0);
        let mut part = |of: f64| sized(0.05, 1.0) * of;
        let bias_dph = [bias, part(bias), part(bias), part(bias)];
        let (wiggle_dph, rate_dph_per_cpm) = (part(bias), part(bias));
        let scale_ppm = [scale, part(scale), part(scale)];
        let on_table = dice.uniform() < 0.5;
        Self { bias_dph, wiggle_dph, scale_ppm, rate_dph_per_cpm, on_table, n_deg_rt_h: 0.2 }
    }

    /// Rows of 10 s over two cycles −40 … 85 °C at 1.5 °C/min; on a table four rates of either sign, 200 s each.
    fn log(&self, seed: u64) -> Vec<u8> {
        let mut dice = Dice::new(seed);
        let table = if self.on_table { ",reference_rate_dps" } else { "" };
        let mut text = format!("time_s,temperature_c,rate_dps{table}\n");
        let (mut block, row_s) = (-40.0, 10.0);
        for i in 0..2400 {
            let minutes = (i as f64 + 0.5) * row_s / 60.0;
            let in_cycle = minutes % 200.0;
            let chamber = if in_cycle < 100.0 { -40.0 + 1.25 * in_cycle } else { 85.0 - 1.25 * (in_cycle - 100.0) };
            let step = (chamber - block) * (1.0 - (-row_s / 300.0_f64).exp());
            block += step;
            let (u, cpm) = ((block - 22.5) / 62.5, step / row_s * 60.0);
            let powers = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| (sum + c) * u);
            let table_dps = if self.on_table { [-100.0, -20.0, 20.0, 100.0][i / 20 % 4] } else { 0.0 };
            let bias = powers(&self.bias_dph) + self.wiggle_dph * (7.0 * u).sin() + self.rate_dph_per_cpm * cpm;
            let noise = self.n_deg_rt_h / (row_s / 3600.0_f64).sqrt() * dice.normal();
            // ε > 0: fewer counts for the same angle.
            let turned = table_dps * 3600.0 / (1.0 + powers(&self.scale_ppm) * 1e-6);
            let dps = (turned + bias + noise) / 3600.0;
            let seen = if self.on_table { format!(",{table_dps}") } else { String::new() };
            writeln!(text, "{},{block:.4},{dps:.9}{seen}", (i + 1) as f64 * row_s).unwrap();
        }
        text.into_bytes()
    }
}

fn setup() -> Setup {
    Setup { scale_factor_deviation_max_ppm: Some(1e6), input_rate_dph: Some(0.0.into()), ..Setup::default() }
}

/// The image at rest against the record over the span: largest distance in °/h and ppm, as parts of what is allowed: 1e-6 of
/// all terms together, and 1e-5 °/h and 0.001 ppm.
fn away_from_record(found: &Calibration, axis: &AxisCalibration) -> f64 {
    let image = encode(found, axis, [0; 32], 1).unwrap();
    let gyro = Compensator::new(image);
    let input = axis.thermometer();
    let [lo, hi] = axis.span_c();
    let dph_per_count = found.unit.arcsec_per_lsb() / found.target.tick_s();
    let sum: f64 = axis.correction.terms.iter().map(|term| term.value.abs()).sum();
    let at = |k: i32| {
        let code = ((lo + (hi - lo) * f64::from(k) / 50.0 - input.offset) / input.gain_per_code).round();
        let celsius = (input.offset + code * input.gain_per_code).clamp(lo, hi);
        let mut state = State::new();
        gyro.update(&mut state, &[Some(code as i32)]).unwrap();
        let drift = state.target_increment() as f64 / 2.0_f64.powi(32) * dph_per_count;
        let wanted = axis.drift(celsius, axis.reference_c());
        let scale = (state.k_q32() as f64 / 2.0_f64.powi(32) - 1.0) * 1e6;
        let [of_t, of_reference] = [celsius, axis.reference_c()].map(|t| axis.scale_deviation(t)[0]);
        let drift = (drift - wanted).abs() / (1e-5 + 1e-6 * sum);
        let scale = (scale - (of_t - of_reference)).abs() / (1e-3 + 1e-6 * sum);
        drift.max(scale)
    };
    (0..=50).map(at).fold(0.0, f64::max)
}

/// Every model that `auto` selects is exported, and its image says what the record says. Of the tables of 98 real units 34 % once
/// were not.
#[test]
fn whatever_auto_selects_an_image_holds() {
    let sound = fraction(100, |seed| {
        let mut dice = Dice::new(7_000 + seed);
        let sensor = Mems::of(&mut dice);
        // A fifth of them with counts of a stated size, too fine for most.
        let stated = if seed % 5 == 0 { Some(1e-4) } else { None };
        let setup = Setup { rate_lsb_arcsec: stated, ..setup() };
        let found = fit(vec![sensor.log(seed)], &setup, "auto").unwrap();
        let axis = &found.axes[0];
        let rejected = &axis.fit.as_ref().unwrap().rejected_models;
        let away = away_from_record(&found, axis);
        println!(
            "{seed}: bias {:.0}, scale {:.0}, table {}: `{}` {:?} away {away:.4} rejected {rejected:?}",
            sensor.bias_dph[0], sensor.scale_ppm[0], sensor.on_table, axis.correction.model, found.unit
        );
        if stated.is_none() {
            let of_bias = rejected.iter().find(|model| model.reason.contains("°/h, and an image holds"));
            assert!(of_bias.is_none(), "the counts follow the bias: {of_bias:?}");
        }
        // The retest runs at the table's rates through the same image.
        let axis = &retest(&found, sensor.log(seed + 500), &setup).axes[0];
        away < 1.0 && axis.after.sigma_dph.is_finite()
    });
    evidence("a model that `auto` selects for a MEMS rate log of 10 to 30,000 °/h is exported", sound, "≥ 1", 100);
}

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
        let text = format!("{error} {}", error.help.clone().unwrap_or_default());
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
        &["`bias 2`", "axis x", "the term `bias 1` reaches", "8192 °/h", "of 0.001 holds it"],
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
        vec![bench.log()],
        &slow,
        "bias 1",
        &["axis x", "the term `bias 1` reaches", "819.2 °/h", "a tick_s of 0.4"],
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
    // 605 + 10 + 4·80 and no rate.
    let needs = 935;
    let free = fit(logs(), &Bench::setup(), "bias 3").unwrap();
    let instructions = |found: &Calibration| encode(found, &found.axes[0], [0; 32], 1).unwrap().work().instructions();
    assert_eq!(instructions(&free), needs);
    assert_eq!(instructions(&fit(logs(), &limited(needs), "bias 3").unwrap()), needs);
    let refusal = fit(logs(), &limited(needs - 1), "bias 3").unwrap_err();
    let text = format!("{refusal} {}", refusal.help.clone().unwrap_or_default());
    assert_eq!(refusal.kind, ErrorKind::Refused, "{text}");
    for word in ["axis x", "935 instructions", "time for 934", "smaller --model"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let found = fit(logs(), &limited(needs - 1), "auto").unwrap();
    assert!(instructions(&found) < needs, "{}", found.axes[0].correction.model);
    let rejected = &found.axes[0].fit.as_ref().unwrap().rejected_models;
    assert!(rejected.iter().any(|model| model.reason.contains("time for 934")), "{rejected:?}");
    let mut moved = free;
    moved.setup.slow_update_instructions_max = Some(needs - 1);
    let refusal = encode(&moved, &moved.axes[0], [0; 32], 1).unwrap_err().to_string();
    assert!(refusal.contains("time for 934"), "{refusal}");
}
