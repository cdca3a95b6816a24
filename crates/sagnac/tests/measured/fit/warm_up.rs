//! A warm-up since power-on as a part of the correction, where it is asked for. By a generator that shares no code with the program.

use crate::hostile::{Bench, Now, fraction};
use crate::support;
use crate::support::evidence::{Records, evidence};
use crate::support::rows::Rows;
use rayon::prelude::*;
use sagnac::FitOptions;
use sagnac::calibration::Calibration;
use sagnac::fit::calibrate;

const TAU_S: f64 = 2520.0;
const RECORDS: Records = Records::new(100).few(30);

/// A warm-up of so many °/h next to a slope.
fn warming(dph: f64) -> impl Fn(Now) -> f64 {
    move |now| 0.05 * now.u() + dph * (-3600.0 * now.hours / TAU_S).exp()
}

pub(crate) fn log(seed: u64, dph: f64, change: fn(&mut Bench<'_>)) -> Rows<3> {
    let truth = warming(dph);
    let mut bench = Bench::new(seed, &truth);
    (bench.cycles, bench.row_s) = (1, 20.0);
    change(&mut bench);
    bench.log()
}

/// A calibration that may correct a warm-up.
pub(crate) fn calibrated(seed: u64, runs: u64, dph: f64, model: &str, change: fn(&mut Bench<'_>)) -> Calibration {
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
        let found: Vec<_> = RECORDS
            .each()
            .into_par_iter()
            .map(|seed| calibrated(seed, runs, 0.2, "bias 1", change).axes.remove(0).correction.warm_up)
            .collect();
        let all: Vec<_> = found.iter().flatten().collect();
        let part = |holds: &dyn Fn(&&&sagnac::calibration::WarmUp) -> bool| {
            all.iter().filter(holds).count() as f64 / RECORDS.count() as f64
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

/// Where there is none, none is corrected, by `auto` and next to a given model.
#[test]
fn none_is_corrected_where_there_is_none() {
    for model in ["auto", "bias 1"] {
        let found =
            fraction(RECORDS, |seed| calibrated(seed, 2, 0.0, model, |_| ()).axes[0].correction.warm_up.is_some());
        evidence(&format!("a warm-up is corrected where there is none, `{model}`"), found, "≤ 0.05", RECORDS);
    }
}
