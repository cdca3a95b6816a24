//! Do intervals hold the truth after `auto` has selected, and under noise that is not white? By generators that share no code
//! with the program.

use crate::hostile;
use crate::hostile::curves::{Truth, error_ratio, shown, shown_by, useless};
use crate::hostile::{Bench, Now};
use crate::support::evidence::{Records, evidence};
use sagnac_log::setup::{Noise, Setup, WindowSize};

pub(crate) fn weak_cubic(now: Now) -> f64 {
    let u = now.u();
    0.02 * u - 0.008 * u * u + 0.01 * u * u * u
}

/// A cubic so weak that `auto` often leaves its highest order out: the interval knows. With a fixed "2 %" the intervals held the
/// truth in 0.39, 0.47 and 0.32 of the cases.
#[test]
fn intervals_hold_after_selection() {
    for (runs, records, bound) in [(1, 120, "0.90 … 0.98"), (2, 60, "0.90 … 0.98"), (4, 40, "0.90 … 0.985")] {
        let records = Records::new(records).few(30);
        let found = shown(records, runs, weak_cubic, "auto", |_| ());
        let best = shown(records, runs, weak_cubic, "bias 3", |_| ());
        println!("weak cubic, {runs} runs: {found:?}");
        let claim = format!("rms error of the curve by `auto` over that by `bias 3`, weak cubic, runs: {runs}");
        error_ratio(&claim, [&found, &best], ["≤ 1.6", "≤ 2.2"], records);
        let claim = format!("95 % interval of the curve covers after `auto`, weak cubic, runs: {runs}");
        evidence(&claim, found.coverage, bound, records);
    }
}

/// A curve that no order describes: whatever `auto` selects is wrong somewhere, and the interval knows. By the spread among series alone the
/// intervals held it in 0.82 and 0.49 of the cases.
#[test]
fn intervals_hold_where_no_order_describes_the_curve() {
    let covered = |claim: &str, runs: u64, truth: Truth, bound: &str| {
        let records = Records::new(60).few(30);
        let found = shown(records, runs, truth, "auto", |_| ());
        println!("{claim}: {found:?}");
        let claim = format!("95 % interval of the curve covers after `auto`, {claim}, runs: {runs}");
        evidence(&claim, found.coverage, bound, records);
    };
    covered("a curve that saturates (tanh)", 4, saturating, "0.90 … 0.98");
    covered("a kink beside the reference", 4, kinked, "≥ 0.72");
}

fn saturating(now: Now) -> f64 {
    0.05 * (4.0 * now.u()).tanh()
}

fn kinked(now: Now) -> f64 {
    0.1 * (now.u() - 0.2).max(0.0)
}

/// A model that was asked for and does not describe the curve: the record says so, and the intervals are those of what the curve may be.
/// Where it does describe it, also under noise of each kind, nothing is said.
#[test]
fn a_model_that_the_rows_contradict_is_named() {
    const RECORDS: Records = Records::new(60).few(30);
    let by = |truth: Truth, change: Change| shown(RECORDS, 4, truth, "bias 3", change);
    let named = |claim: &str, truth: Truth, bounds: [&str; 2]| {
        let found = by(truth, |_| ());
        println!("{claim}: {found:?}");
        evidence(
            &format!("a record names its lack of fit, `bias 3` for {claim}, four runs"),
            found.lacks,
            bounds[0],
            RECORDS,
        );
        let covers = format!("95 % interval of the curve covers, `bias 3` for {claim}, four runs");
        evidence(&covers, found.coverage, bounds[1], RECORDS);
    };
    named("a curve that saturates (tanh)", saturating, ["≥ 0.95", "≥ 0.90"]);
    named("a kink beside the reference", kinked, ["≥ 0.60", "≥ 0.60"]);
    for (noise, change) in NOISES {
        let found = by(weak_cubic, change);
        println!("{noise}: {found:?}");
        evidence(
            &format!("a record names a lack of fit that it does not have, `bias 3`, {noise}"),
            found.lacks,
            "≤ 0.05",
            RECORDS,
        );
    }
}

/// No term that is not there: constant, linear and strong cubic drifts, two runs.
#[test]
fn no_useless_term_is_selected() {
    let part = |truth: Truth, has: fn(&str) -> bool| {
        let found = shown(60, 2, truth, "auto", |_| ());
        println!("{found:?}");
        (useless(&found, has), found.lacks)
    };
    let none = part(|_| 0.0, |model| model != "bias 0");
    evidence("`auto` selects a term where there is no drift", none.0, "≤ 0.05", 60);
    let linear = part(|now| 0.05 * now.u(), |model| model != "bias 1");
    evidence("`auto` selects more than the slope of a linear drift", linear.0, "≤ 0.05", 60);
    let cubic = part(|now| 0.1 * now.u().powi(3), |model| model != "bias 3");
    evidence("`auto` selects more than a strong cubic", cubic.0, "≤ 0.05", 60);
    let lacks = (none.1 + linear.1 + cubic.1) / 3.0;
    evidence(
        "a record of these three names a lack of fit that it does not have",
        lacks,
        "≤ 0.03",
        Records::new(180).few(60),
    );
}

/// A cubic with a rate term of a slow lag: nothing else is selected, and the interval at rest holds.
#[test]
fn a_rate_term_of_a_slow_lag_leaves_the_curve_in_its_interval() {
    let truth = |now: Now| 0.1 * now.u().powi(3) + 0.05 * now.lagged_cpm;
    for runs in [1, 2] {
        let records = Records::new(60).few(30);
        let found = shown(records, runs, truth, "auto", |bench| bench.rate_lag_s = 300.0);
        let best = shown(records, runs, truth, "bias 3, rate 0", |bench| bench.rate_lag_s = 300.0);
        println!("{runs} runs: {found:?}, {best:?}");
        let of = "strong cubic with a rate of 300 s, runs:";
        let claim = format!("95 % interval of the curve covers after `auto`, {of} {runs}");
        evidence(&claim, found.coverage, "0.90 … 0.99", records);
        let claim = format!("rms error by `auto` over that by the true model, {of} {runs}");
        error_ratio(&claim, [&found, &best], ["≤ 1.5", "≤ 2"], records);
        let more = |of: fn(&str) -> bool| useless(&found, of);
        let most = more(|model| model.starts_with("bias 4") || model.starts_with("bias 5"))
            .max(more(|model| !model.contains("rate 0")))
            .max(more(|model| model.contains("zones")));
        evidence(
            &format!("a useless term is selected beside them, the most frequent of three kinds, runs: {runs}"),
            most,
            "≤ 0.05",
            records,
        );
    }
}

/// What a kind of noise sets on the bench.
type Change = fn(&mut Bench<'_>);

/// Noise of each kind.
const NOISES: [(&str, Change); 4] = [
    ("white noise", |_| ()),
    ("B = 0.01 °/h", |bench| bench.b_dph = 0.01),
    ("K = 0.01 °/h/√h", |bench| bench.k_dph_rt_h = 0.01),
    ("Markov noise of 2,000 s", |bench| bench.markov = Some((2000.0, 0.01))),
];

/// A fixed model and two runs. With the lag-one rule alone: 0.78, 0.68 and 0.70 under slow noise.
#[test]
fn intervals_hold_under_slow_noise() {
    for (noise, change) in NOISES {
        let records = Records::new(150).few(30);
        let found = shown(records, 2, weak_cubic, "bias 3", change);
        println!("{noise}: {found:?}");
        let claim = format!("95 % interval of the curve covers, `bias 3`, {noise}");
        evidence(&claim, found.coverage, "0.92 … 0.98", records);
    }
}

/// Short windows are many, and noise is estimated from 4,000 rows at most. The first 4,000 windows told nothing of what is slower than
/// they are together, and no slow noise at all where they held none of the second run: half an interval was 0.0033 °/h for 0.009.
#[test]
fn intervals_hold_in_short_windows() {
    const RECORDS: Records = Records::new(60).few(30);
    let found = |window_s: f64, change: Change| {
        let setup = Setup { window: Some(WindowSize::Seconds(window_s)), ..Bench::setup() };
        shown_by(&setup, RECORDS, 2, weak_cubic, "bias 3", change).coverage
    };
    let of_flicker = found(5.0, |bench| (bench.row_s, bench.b_dph) = (5.0, 0.03));
    evidence("95 % interval of the curve covers, B = 0.03 °/h, windows of 5 s", of_flicker, "0.90 … 0.99", RECORDS);
    let of_walk = found(2.0, |bench| (bench.row_s, bench.k_dph_rt_h) = (2.0, 0.01));
    evidence("95 % interval of the curve covers, K = 0.01 °/h/√h, windows of 2 s", of_walk, "0.90 … 0.99", RECORDS);
}

/// A setup that states a third of the bias instability is not believed, one that states the true one is.
#[test]
fn noise_stated_too_low_makes_no_interval_narrow() {
    const RECORDS: Records = Records::new(150).few(30);
    let by = |b_dph: f64| {
        let noise = Some(Noise::walk(hostile::N_DEG_RT_H).slow(b_dph, 0.0));
        let setup = Setup { noise, ..Bench::setup() };
        shown_by(&setup, RECORDS, 2, weak_cubic, "bias 3", |bench| bench.b_dph = 0.01)
    };
    let (low, true_one) = (by(0.003), by(0.01));
    println!("stated 0.003: {low:?}; stated 0.01: {true_one:?}");
    evidence(
        "95 % interval of the curve covers, B = 0.01 °/h where the setup states 0.003",
        low.coverage,
        "0.91 … 0.98",
        RECORDS,
    );
    evidence(
        "95 % interval of the curve covers, B = 0.01 °/h as the setup states",
        true_one.coverage,
        "0.91 … 0.98",
        RECORDS,
    );
    evidence(
        "a log shows more noise than the setup states, where it states the true one",
        true_one.louder,
        "≤ 0.03",
        RECORDS,
    );
}
