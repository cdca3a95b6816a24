//! A warm-up since power-on as a part of the correction, where it is asked for. By a generator that shares no code with the program.

use crate::hostile::{Bench, Now, WHITE_100_S_DPH, fraction};
use crate::support;
use crate::support::evidence::evidence;
use crate::support::retest;
use rayon::prelude::*;
use sagnac::FitOptions;
use sagnac::calibration::Calibration;
use sagnac::export::{encode, image_bytes};
use sagnac::fit::calibrate;
use sagnac_core::{Image, ValueSource};

const TAU_S: f64 = 2520.0;
const RECORDS: u64 = 100;

/// A warm-up of so many °/h beside a slope.
fn warming(dph: f64) -> impl Fn(Now) -> f64 {
    move |now| 0.05 * now.u() + dph * (-3600.0 * now.hours / TAU_S).exp()
}

fn log(seed: u64, dph: f64, change: fn(&mut Bench<'_>)) -> Vec<u8> {
    let truth = warming(dph);
    let mut bench = Bench::new(seed, &truth);
    (bench.cycles, bench.row_s) = (1, 20.0);
    change(&mut bench);
    bench.log()
}

/// A calibration that may correct a warm-up.
fn calibrated(seed: u64, runs: u64, dph: f64, model: &str, change: fn(&mut Bench<'_>)) -> Calibration {
    let logs = (0..runs).map(|run| log(57_000_000 + 1000 * seed + run, dph, change)).collect();
    let options = FitOptions::new(support::model(model)).correct_warm_up(true);
    calibrate(support::windows(logs, &Bench::setup()), &Bench::setup(), &options).unwrap()
}

/// Size and time constant are held by ± 2 σ, under white and under slow noise; τ was not on the grid.
#[test]
fn size_and_time_constant_are_known_as_stated() {
    for (name, runs, change) in [
        ("one run", 1, (|_| ()) as fn(&mut Bench<'_>)),
        ("two runs", 2, |_| ()),
        ("two runs, B = 0.01 °/h", 2, |bench| bench.b_dph = 0.01),
    ] {
        let found: Vec<_> = (0..RECORDS)
            .into_par_iter()
            .map(|seed| calibrated(seed, runs, 0.2, "bias 1", change).axes.remove(0).correction.warm_up)
            .collect();
        let all: Vec<_> = found.iter().flatten().collect();
        let part = |holds: &dyn Fn(&&&sagnac::calibration::WarmUp) -> bool| {
            all.iter().filter(holds).count() as f64 / RECORDS as f64
        };
        let size = part(&|w| (w.value_dph - 0.2).abs() < 2.0 * w.sigma_dph.unwrap());
        let tau = part(&|w| (w.tau_s.value - TAU_S).abs() < 2.0 * w.tau_s.sigma.unwrap());
        evidence(
            &format!("a warm-up of 0.2 °/h and 42 min is found and corrected, {name}"),
            part(&|_| true),
            "≥ 0.95",
            RECORDS,
        );
        evidence(&format!("± 2 σ of the corrected warm-up hold its size, {name}"), size, "≥ 0.88", RECORDS);
        evidence(&format!("± 2 σ of the corrected warm-up hold its time constant, {name}"), tau, "≥ 0.88", RECORDS);
    }
}

/// Where there is none, none is corrected, by `auto` and beside a given model.
#[test]
fn none_is_corrected_where_there_is_none() {
    for model in ["auto", "bias 1"] {
        let found =
            fraction(RECORDS, |seed| calibrated(seed, 2, 0.0, model, |_| ()).axes[0].correction.warm_up.is_some());
        evidence(&format!("a warm-up is corrected where there is none, `{model}`"), found, "≤ 0.05", RECORDS);
    }
}

/// The record as JSON and its image hold it, the target's own code leaves on the log of the fit what the host's fit left, and on a
/// second test from power-on the noise. Without it a third of the drift stays.
#[test]
fn the_target_corrects_it_from_power_on() {
    let made = calibrated(1, 2, 1.0, "auto", |_| ());
    let axis = &made.axes[0];
    assert_eq!(Calibration::parse(&made.to_json().unwrap()).unwrap(), made);
    assert!(axis.fit.as_ref().unwrap().time_effects.is_empty(), "{:?}", axis.fit.as_ref().unwrap().time_effects);
    let image = encode(&made, axis, [0; 32], 1).unwrap();
    assert_eq!((image.format_minor(), image.inputs().last().unwrap().source), (4, ValueSource::WarmUp));
    assert_eq!(Image::decode(&image_bytes(&image)), Ok(image));
    let priced = axis.candidates().iter().find(|candidate| candidate.chosen).unwrap().slow_update_instructions;
    assert_eq!(priced, Some(image.work().instructions()));

    let after =
        |made: &Calibration, seed: u64| retest(made, log(seed, 1.0, |_| ()), &Bench::setup()).axes[0].after.sigma_dph;
    let mut without = made.clone();
    without.axes[0].correction.warm_up = None;
    let floor = WHITE_100_S_DPH;
    let (with, without) = (after(&made, 9), after(&without, 9));
    println!("second test: {with:.5} with, {without:.5} °/h without; noise floor {floor:.5}");
    assert!(with < 1.05 * floor, "{with} {floor}");
    assert!(without > 5.0 * with, "{with} {without}");
}

/// A record that holds no such thing is refused.
#[test]
fn a_record_with_a_warm_up_out_of_range_is_refused() {
    let made = calibrated(1, 1, 1.0, "bias 1", |_| ());
    let text = made.to_json().unwrap();
    let tau = made.axes[0].correction.warm_up.as_ref().unwrap().tau_s.value;
    for wrong in ["-1.0", "0.0", "1e999"] {
        let changed = text.replacen(&format!("\"value\": {tau}"), &format!("\"value\": {wrong}"), 1);
        assert_ne!(changed, text);
        let refusal = Calibration::parse(&changed).unwrap_err().to_string();
        assert!(wrong == "1e999" || refusal.contains("warm_up"), "{refusal}");
    }
}
