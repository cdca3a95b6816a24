//! Do intervals hold the truth after `auto` has selected, and under noise that is not white? By generators that share no code
//! with the program.

mod hostile;
mod support;

use hostile::{Bench, Now};
use rayon::prelude::*;
use sagnac::calibration::Calibration;
use support::fit;

type Truth = fn(Now) -> f64;

/// Temperatures at which the at-rest curve is compared, °C.
const AT_C: [f64; 9] = [-38.0, -25.0, -12.0, 0.0, 12.0, 36.0, 48.0, 58.0, 67.0];

/// What some records show.
#[derive(Debug, Default, Clone)]
struct Shown {
    /// Part of the intervals of the at-rest curve that hold the truth.
    coverage: f64,
    /// Root mean square error of the curve, °/h.
    error_dph: f64,
    /// Models that were selected, with how often.
    models: std::collections::BTreeMap<String, usize>,
}

fn shown(records: u64, runs: u64, truth: Truth, model: &str, change: fn(&mut Bench<'_>)) -> Shown {
    let one = |record: u64| -> Calibration {
        let logs = (0..runs).map(|run| {
            let mut bench = Bench::new(1000 * record + run, &truth);
            (bench.cycles, bench.row_s) = (1, 20.0);
            change(&mut bench);
            bench.log()
        });
        fit(logs.collect(), &Bench::setup(), model).unwrap()
    };
    let rest = |celsius: f64| truth(Now { celsius, cpm: 0.0, lagged_cpm: 0.0, hours: 0.0 });
    let each = |record: u64| {
        let made = one(record);
        let axis = &made.axes[0];
        let errors = AT_C.map(|celsius| {
            let found = axis.evaluate(celsius, 0.0);
            let true_dph = rest(celsius) - rest(25.0);
            let (lower, upper) = (found.lower_dph.unwrap(), found.upper_dph.unwrap());
            (found.drift_dph - true_dph, lower <= true_dph && true_dph <= upper)
        });
        (axis.correction.model.clone(), errors)
    };
    let all: Vec<_> = (0..records).into_par_iter().map(each).collect();
    let mut out = Shown::default();
    let n = (all.len() * AT_C.len()) as f64;
    for (model, errors) in all {
        *out.models.entry(model).or_default() += 1;
        for (error, holds) in errors {
            out.error_dph += error * error / n;
            out.coverage += f64::from(u8::from(holds)) / n;
        }
    }
    out.error_dph = out.error_dph.sqrt();
    out
}

fn weak_cubic(now: Now) -> f64 {
    let u = now.u();
    0.02 * u - 0.008 * u * u + 0.01 * u * u * u
}

#[test]
fn measure() {
    let plain: fn(&mut Bench<'_>) = |_| ();
    for runs in [1, 2, 4] {
        for model in ["bias 3", "auto"] {
            let start = std::time::Instant::now();
            let s = shown(60, runs, weak_cubic, model, plain);
            println!("{runs} {model}: {s:?} {:?}", start.elapsed());
        }
    }
    let noises: [(&str, fn(&mut Bench<'_>)); 4] = [
        ("white", |_| ()),
        ("B 0.01", |b| b.b_dph = 0.01),
        ("K 0.01", |b| b.k_dph_rt_h = 0.01),
        ("markov 2000 s", |b| b.markov = Some((2000.0, 0.01))),
    ];
    for (name, change) in noises {
        let s = shown(100, 2, weak_cubic, "bias 3", change);
        println!("{name}: {s:?}");
    }
}
