//! Hundreds of records of each truth and number of runs: does the curve by `auto` lie in its interval, how far is it from that of
//! the true model, how often does it have a term too many? It takes an hour; CI compiles it, `cargo test -p sagnac --test studies hours::selection -- --ignored` runs it. By a
//! generator that shares no code with the program.
//!
//! Asked of each: coverage 0.90 … 0.98, error at most 1.15 of the true model's, a term too many in at most 0.05. The bound of the
//! error is wider, because no selection keeps it (`docs/explanation/evidence.md`); intervals may be too wide, never too narrow; 0.08 is
//! above 0.05 by what 300 records scatter.

use crate::hostile::curves::{Truth, error_ratio, shown, useless};
use crate::hostile::{Bench, Now};
use crate::support::evidence::evidence;

/// Records by number of runs.
const RECORDS: [(u64, u64); 4] = [(1, 300), (2, 300), (4, 300), (16, 300)];

/// A drift, the model that has its terms and no other, and those that lack none that matters.
struct Drift {
    name: &'static str,
    truth: Truth,
    model: &'static str,
    /// True for a model without a term too many.
    fits: fn(&str) -> bool,
    /// Bounds of the coverage, and of the error over that of the true model.
    bounds: [&'static str; 2],
    change: fn(&mut Bench<'_>),
}

/// Of curves that the series holds.
const USUAL: [&str; 2] = ["≥ 0.90", "≤ 1.6"];

fn measure(drift: &Drift) {
    for (runs, records) in RECORDS {
        let found = shown(records, runs, drift.truth, "auto", drift.change);
        let best = shown(records, runs, drift.truth, drift.model, drift.change);
        println!("{}, {runs} runs: {found:?}; {}: {best:?}", drift.name, drift.model);
        let name = drift.name;
        evidence(
            &format!("95 % interval of the curve covers after `auto`: {name}, runs: {runs}"),
            found.coverage,
            drift.bounds[0],
            records,
        );
        evidence(
            &format!("`auto` selects a term too many: {name}, runs: {runs}"),
            useless(&found, |model| !(drift.fits)(model)),
            "≤ 0.08",
            records,
        );
        if best.squares.iter().any(|square| *square > 0.0) {
            let claim = format!("rms error of the curve by `auto` over that by the true model: {name}, runs: {runs}");
            error_ratio(&claim, [&found, &best], drift.bounds[1], records);
        }
    }
}

fn cubic(now: Now) -> f64 {
    0.1 * now.u().powi(3)
}

fn cubic_and_rate(now: Now) -> f64 {
    cubic(now) + 0.05 * now.lagged_cpm
}

/// No term of the rate: of a curve that the series only comes near, any order is needed.
fn is_curve(model: &str) -> bool {
    model.starts_with("bias ") && !model.contains("rate")
}

fn is_cubic(model: &str) -> bool {
    model == "bias 3"
}

fn is_cubic_and_rate(model: &str) -> bool {
    model == "bias 3, rate 0"
}

#[test]
#[ignore = "takes minutes"]
fn no_drift() {
    measure(&Drift {
        name: "no drift",
        truth: |_| 0.0,
        model: "bias 0",
        fits: |model| model == "bias 0",
        bounds: USUAL,
        change: |_| (),
    });
}

#[test]
#[ignore = "takes minutes"]
fn linear_drift() {
    measure(&Drift {
        name: "linear",
        truth: |now| 0.05 * now.u(),
        model: "bias 1",
        fits: |model| model == "bias 1",
        bounds: USUAL,
        change: |_| (),
    });
}

#[test]
#[ignore = "takes minutes"]
fn weak_cubic() {
    measure(&Drift {
        name: "weak cubic",
        truth: |now| 0.02 * now.u() - 0.008 * now.u().powi(2) + 0.01 * now.u().powi(3),
        model: "bias 3",
        fits: |model| ["bias 0", "bias 1", "bias 2", "bias 3"].contains(&model),
        bounds: USUAL,
        change: |_| (),
    });
}

#[test]
#[ignore = "takes minutes"]
fn strong_cubic() {
    measure(&Drift {
        name: "strong cubic",
        truth: cubic,
        model: "bias 3",
        fits: is_cubic,
        bounds: USUAL,
        change: |_| (),
    });
}

#[test]
#[ignore = "takes minutes"]
fn cubic_with_a_rate_of_1_s() {
    measure(&Drift {
        name: "cubic with a rate term, 1 s",
        truth: cubic_and_rate,
        model: "bias 3, rate 0",
        fits: is_cubic_and_rate,
        bounds: USUAL,
        change: |bench| bench.rate_lag_s = 1.0,
    });
}

#[test]
#[ignore = "takes minutes"]
fn cubic_with_a_rate_of_300_s() {
    measure(&Drift {
        name: "cubic with a rate term, 300 s",
        truth: cubic_and_rate,
        model: "bias 3, rate 0",
        fits: is_cubic_and_rate,
        bounds: USUAL,
        change: |bench| bench.rate_lag_s = 300.0,
    });
}

#[test]
#[ignore = "takes minutes"]
fn cubic_with_a_rate_of_1200_s() {
    measure(&Drift {
        name: "cubic with a rate term, 1200 s",
        truth: cubic_and_rate,
        model: "bias 3, rate 0",
        fits: is_cubic_and_rate,
        bounds: USUAL,
        change: |bench| bench.rate_lag_s = 1200.0,
    });
}

/// `auto` selects a series of second or third order; the true model knows that there is a knot, and where.
#[test]
#[ignore = "takes minutes"]
fn zones() {
    measure(&Drift {
        name: "two zones",
        truth: |now| 0.03 * now.u() + 0.2 * (0.5 * now.u()).max(0.0).powi(2),
        model: "bias 1, zones 2",
        fits: is_curve,
        bounds: ["≥ 0.90", "≤ 2.6"],
        change: |_| (),
    });
}

/// A curve that no order describes: the series of `auto` against the harmonic itself, its period known.
#[test]
#[ignore = "takes minutes"]
fn harmonic() {
    measure(&Drift {
        name: "cosine of 60 °C",
        truth: |now| 0.03 * now.u() + 0.02 * (std::f64::consts::TAU * now.celsius / 60.0).cos(),
        model: "bias 1, harmonic 60",
        fits: is_curve,
        bounds: ["≥ 0.90", "≤ 2.5"],
        change: |_| (),
    });
}

/// Curves that no model of the program describes: is the truth in the interval of what `auto` selects?
#[test]
#[ignore = "takes minutes"]
fn curves_beyond_every_model() {
    // A kink 26 °C below the reference, one next to it, a curve that saturates, a bump.
    let truths: [(&str, Truth, &str); 4] = [
        ("a kink at 0 °C", |now| 0.1 * (now.celsius / 55.0).max(0.0), "≥ 0.88"),
        (
            "a kink at 26 °C, beside the reference of 25 °C",
            |now| 0.1 * ((now.celsius - 26.0) / 55.0).max(0.0),
            "≥ 0.70",
        ),
        ("saturation, tanh", |now| 0.05 * (4.0 * now.u()).tanh(), "≥ 0.90"),
        (
            "a bump of 12 °C",
            |now| 0.03 * now.u() + 0.02 * (-0.5 * ((now.celsius - 30.0) / 12.0).powi(2)).exp(),
            "≥ 0.80",
        ),
    ];
    for (name, truth, bound) in truths {
        for (runs, records) in RECORDS {
            let found = shown(records, runs, truth, "auto", |_| ());
            println!("{name}, {runs} runs: {found:?}");
            let claim = format!("95 % interval of the curve covers after `auto`: {name}, runs: {runs}");
            evidence(&claim, found.coverage, bound, records);
        }
    }
}
