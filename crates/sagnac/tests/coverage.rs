//! Do intervals hold the truth after `auto` has selected, and under noise that is not white? By generators that share no code
//! with the program.

use crate::hostile;
use crate::support;

use crate::hostile::curves::{Truth, shown, shown_by, useless};
use crate::hostile::{Bench, Now};
use crate::support::evidence::evidence;
use crate::support::fit;
use sagnac::fit::{FitOptions, calibrate};
use sagnac_log::setup::{Noise, Setup, WindowSize};

fn weak_cubic(now: Now) -> f64 {
    let u = now.u();
    0.02 * u - 0.008 * u * u + 0.01 * u * u * u
}

/// A cubic so weak that `auto` often leaves its highest order out: the interval knows. With a fixed "2 %" the intervals held the
/// truth in 0.39, 0.47 and 0.32 of the cases.
#[test]
fn intervals_hold_after_selection() {
    let coverage = |runs: u64, records: u64| {
        let found = shown(records, runs, weak_cubic, "auto", |_| ());
        let best = shown(records, runs, weak_cubic, "bias 3", |_| ());
        println!("weak cubic, {runs} runs: {found:?}; bias 3: {}", best.error_dph);
        evidence(
            &format!("rms error of the curve by `auto` over that by `bias 3`, weak cubic, runs: {runs}"),
            found.error_dph / best.error_dph,
            "≤ 1.6",
            records,
        );
        found.coverage
    };
    evidence(
        "95 % interval of the curve covers after `auto`, weak cubic, one run",
        coverage(1, 120),
        "0.90 … 0.98",
        120,
    );
    evidence(
        "95 % interval of the curve covers after `auto`, weak cubic, two runs",
        coverage(2, 60),
        "0.90 … 0.98",
        60,
    );
    evidence(
        "95 % interval of the curve covers after `auto`, weak cubic, four runs",
        coverage(4, 40),
        "0.90 … 0.985",
        40,
    );
}

/// A curve that no order describes: whatever `auto` selects is wrong somewhere, and the interval knows. By the spread among series alone the
/// intervals held it in 0.82 and 0.49 of the cases.
#[test]
fn intervals_hold_where_no_order_describes_the_curve() {
    let covered = |claim: &str, runs: u64, truth: Truth, bound: &str| {
        let found = shown(60, runs, truth, "auto", |_| ());
        println!("{claim}: {found:?}");
        evidence(
            &format!("95 % interval of the curve covers after `auto`, {claim}, runs: {runs}"),
            found.coverage,
            bound,
            60,
        );
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
    let by = |truth: Truth, change: Change| shown(60, 4, truth, "bias 3", change);
    let named = |claim: &str, truth: Truth, bounds: [&str; 2]| {
        let found = by(truth, |_| ());
        println!("{claim}: {found:?}");
        evidence(
            &format!("a record names its lack of fit, `bias 3` for {claim}, four runs"),
            found.lacks,
            bounds[0],
            60,
        );
        let covers = format!("95 % interval of the curve covers, `bias 3` for {claim}, four runs");
        evidence(&covers, found.coverage, bounds[1], 60);
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
            60,
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
    evidence("a record of these three names a lack of fit that it does not have", lacks, "≤ 0.03", 180);
}

/// A cubic with a rate term of a slow lag: nothing else is selected, and the interval at rest holds.
#[test]
fn a_rate_term_of_a_slow_lag_leaves_the_curve_in_its_interval() {
    let truth = |now: Now| 0.1 * now.u().powi(3) + 0.05 * now.lagged_cpm;
    for runs in [1, 2] {
        let found = shown(60, runs, truth, "auto", |bench| bench.rate_lag_s = 300.0);
        let best = shown(60, runs, truth, "bias 3, rate 0", |bench| bench.rate_lag_s = 300.0);
        println!("{runs} runs: {found:?}, {best:?}");
        evidence(
            &format!("95 % interval of the curve covers after `auto`, strong cubic with a rate of 300 s, runs: {runs}"),
            found.coverage,
            "0.90 … 0.99",
            60,
        );
        evidence(
            &format!(
                "rms error by `auto` over that by the true model, strong cubic with a rate of 300 s, runs: {runs}"
            ),
            found.error_dph / best.error_dph,
            "≤ 1.5",
            60,
        );
        let more = |of: fn(&str) -> bool| useless(&found, of);
        let most = more(|model| model.starts_with("bias 4") || model.starts_with("bias 5"))
            .max(more(|model| !model.contains("rate 0")))
            .max(more(|model| model.contains("zones")));
        evidence(
            &format!("a useless term is selected beside them, the most frequent of three kinds, runs: {runs}"),
            most,
            "≤ 0.05",
            60,
        );
    }
}

/// A stated noise model is that of the intervals: with what the gyro has they hold, and with ten times of it they are wider.
#[test]
fn a_stated_noise_model_wins() {
    let mut bench = Bench::new(5, &weak_cubic);
    (bench.cycles, bench.row_s, bench.k_dph_rt_h) = (1, 20.0, 0.01);
    let half = |noise: Option<Noise>| {
        let setup = Setup { noise, ..Bench::setup() };
        let made = fit(vec![bench.log()], &setup, "bias 3").unwrap();
        let found = made.axes[0].evaluate(60.0, 0.0);
        found.upper_dph.unwrap() - found.lower_dph.unwrap()
    };
    let [white, own, more] =
        [(0.0, 0.0), (0.0, 0.01), (0.0, 0.1)].map(|(b, k)| half(Some(Noise::walk(0.003).slow(b, k))));
    assert!(white < 0.8 * own && 5.0 * own < more, "{white} {own} {more}");
    // Without a statement it is measured: within a factor of two and a half of the truth on one record.
    let measured = half(None);
    assert!(measured > own / 2.5 && measured < 2.5 * own, "{measured} {own}");
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
        let found = shown(150, 2, weak_cubic, "bias 3", change);
        println!("{noise}: {found:?}");
        let claim = format!("95 % interval of the curve covers, `bias 3`, {noise}");
        evidence(&claim, found.coverage, "0.92 … 0.98", 150);
    }
}

/// Short windows are many, and noise is estimated from 4,000 rows at most. The first 4,000 windows told nothing of what is slower than
/// they are together, and no slow noise at all where they held none of the second run: half an interval was 0.0033 °/h for 0.009.
#[test]
fn intervals_hold_in_short_windows() {
    let found = |window_s: f64, change: Change| {
        let setup = Setup { window: Some(WindowSize::Seconds(window_s)), ..Bench::setup() };
        shown_by(&setup, 60, 2, weak_cubic, "bias 3", change).coverage
    };
    let of_flicker = found(5.0, |bench| (bench.row_s, bench.b_dph) = (5.0, 0.03));
    evidence("95 % interval of the curve covers, B = 0.03 °/h, windows of 5 s", of_flicker, "0.90 … 0.99", 60);
    let of_walk = found(2.0, |bench| (bench.row_s, bench.k_dph_rt_h) = (2.0, 0.01));
    evidence("95 % interval of the curve covers, K = 0.01 °/h/√h, windows of 2 s", of_walk, "0.90 … 0.99", 60);
}

/// A setup that states a third of the bias instability is not believed, one that states the true one is.
#[test]
fn noise_stated_too_low_makes_no_interval_narrow() {
    let by = |b_dph: f64| {
        let noise = Some(Noise::walk(hostile::N_DEG_RT_H).slow(b_dph, 0.0));
        let setup = Setup { noise, ..Bench::setup() };
        shown_by(&setup, 150, 2, weak_cubic, "bias 3", |bench| bench.b_dph = 0.01)
    };
    let (low, true_one) = (by(0.003), by(0.01));
    println!("stated 0.003: {low:?}; stated 0.01: {true_one:?}");
    evidence(
        "95 % interval of the curve covers, B = 0.01 °/h where the setup states 0.003",
        low.coverage,
        "0.91 … 0.98",
        150,
    );
    evidence(
        "95 % interval of the curve covers, B = 0.01 °/h as the setup states",
        true_one.coverage,
        "0.91 … 0.98",
        150,
    );
    evidence(
        "a log shows more noise than the setup states, where it states the true one",
        true_one.louder,
        "≤ 0.03",
        150,
    );
}

/// The bootstrap's interval of the cubic coefficient under slow noise of each kind, two runs.
#[test]
fn bootstrap_intervals_hold_under_slow_noise() {
    let coverage = |change: Change| {
        let covers = |record: u64| {
            let logs = (0..2).map(|run| {
                let mut bench = Bench::new(91_000_000 + 1000 * record + run, &weak_cubic);
                (bench.cycles, bench.row_s) = (1, 20.0);
                change(&mut bench);
                bench.log()
            });
            let options = FitOptions::new(support::model("bias 3")).bootstrap(Some(400));
            let made = calibrate(support::windows(logs.collect(), &Bench::setup()), &Bench::setup(), &options).unwrap();
            let axis = &made.axes[0];
            let [lo_c, hi_c] = axis.span_c();
            // 0.01·u³ over the span of the fit: a quarter of its leading power is the Chebyshev coefficient.
            let cubic = 0.01 * ((hi_c - lo_c) / 110.0_f64).powi(3) / 4.0;
            let [lower, upper] = axis.correction.terms[2].bootstrap.unwrap();
            lower <= cubic && cubic <= upper
        };
        hostile::fraction(300, covers)
    };
    for (noise, change) in NOISES {
        evidence(&format!("95 % interval by the bootstrap covers, {noise}"), coverage(change), "0.92 … 0.98", 300);
    }
}
