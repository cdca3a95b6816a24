//! `compare --limits`: is a gyro that did not change accepted, and one that changed by twice a limit refused? Records are made from
//! logs of a generator that shares no code with the program: three months of one gyro, two runs each.

use crate::hostile::{Bench, Dice, Now, fraction};
use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use crate::support::rows::{Rows, to_decimals};
use sagnac::compare::{Comparison, compare};
use sagnac::{Calibration, Limits};
use sagnac_log::setup::TurnOnCount;

/// The drift of the gyro in its first months.
pub(crate) fn usual(now: Now) -> f64 {
    0.02 * now.u() - 0.008 * now.u().powi(2) + 0.01 * now.u().powi(3) + 0.05 * now.cpm
}

/// One record of two runs, each a turn-on of its own, of so many cycles of 6.7 h.
fn month(
    seed: u64,
    drift: &(dyn Fn(Now) -> f64 + Sync),
    bias_dph: f64,
    turn_on_dph: f64,
    cycles: usize,
    model: &str,
) -> Calibration {
    let mut dice = Dice::new(seed ^ 0x70_6f6e);
    let run = |k: u64, off: f64| {
        let mut bench = Bench::new(10 * seed + k, drift);
        (bench.bias_dph, bench.cycles) = (bias_dph + off, cycles);
        bench.log()
    };
    let logs = (0..2).map(|k| run(k, turn_on_dph * dice.normal())).collect();
    let setup = sagnac::Setup { turn_ons: Some(TurnOnCount::FILES), ..Bench::setup() };
    fit(logs, &setup, model).unwrap()
}

fn named(records: Vec<Calibration>) -> Vec<(String, Calibration)> {
    records.into_iter().enumerate().map(|(k, record)| (format!("month-{k}.cal.json"), record)).collect()
}

pub(crate) fn judged(records: Vec<Calibration>, limits: &Limits) -> Comparison {
    compare(&named(records), Some(limits)).unwrap()
}

/// Names of the limits that are not met or not decided.
pub(crate) fn missed(found: &Comparison) -> Vec<&str> {
    let limits = found.axes.iter().flat_map(|axis| &axis.limits);
    limits.filter(|limit| limit.pass == Some(false)).map(|limit| limit.name.as_str()).collect()
}

pub(crate) fn navigation() -> Limits {
    Limits::named_or_read("navigation-grade").unwrap()
}

/// Operating characteristic of `navigation-grade` over three records.
#[test]
fn an_unchanged_gyro_is_accepted_and_twice_a_limit_is_refused() {
    let limits = navigation();
    let unchanged = |model: &str, first: u64, records: u64| {
        fraction(records, |seed| {
            let of = |k: u64| month(first + 3 * seed + k, &usual, 0.0, 0.002, 2, model);
            let found = judged((0..3).map(of).collect(), &limits);
            if !found.passed() {
                println!("{model} {seed}: {:?}", found.axes[0].limits);
            }
            found.passed()
        })
    };
    let fixed = unchanged("bias 3, rate 0", 1000, 100);
    evidence(
        "`compare` accepts an unchanged gyro by `navigation-grade`, three records of two runs of 13 h, one model",
        fixed,
        "≥ 0.97",
        100,
    );
    let auto = unchanged("auto", 2000, 16);
    evidence(
        "`compare` accepts an unchanged gyro by `navigation-grade`, three records of two runs of 13 h, `auto`",
        auto,
        "≥ 0.97",
        16,
    );

    type Case = (&'static str, f64, fn(Now) -> f64, &'static str);
    let twice: [Case; 4] = [
        ("bias_repeatability_dph_max", 0.07, |_| 0.0, "`compare` refuses a change of fixed bias of twice its limit"),
        (
            "temperature_residual_dph_max",
            0.0,
            // Over −1 … 1 the root mean square of u² about its mean is √(4/45).
            |now| 0.024 / 0.298 * now.u().powi(2),
            "`compare` refuses a change of the curve of twice its limit",
        ),
        (
            "drift_dph_per_c_max",
            0.0,
            |now| 0.0008 * now.celsius,
            "`compare` refuses a change of the slope of twice its limit",
        ),
        (
            "drift_dph_per_cpm_max",
            0.0,
            |now| 0.04 * now.cpm,
            "`compare` refuses a change of the rate effect of twice its limit",
        ),
    ];
    for (key, bias_dph, more, claim) in twice {
        let refused = fraction(60, |seed| {
            let changed = move |now: Now| usual(now) + more(now);
            let of = |k: u64| month(3000 + 3 * seed + k, &usual, 0.0, 0.002, 1, "bias 3, rate 0");
            // The month that changed is any of them.
            let mut records: Vec<Calibration> = (0..2).map(of).collect();
            let other = month(3002 + 3 * seed, &changed, bias_dph, 0.002, 1, "bias 3, rate 0");
            records.insert(seed as usize % 3, other);
            let found = judged(records, &limits);
            let of_key = found.axes[0].limits.iter().find(|limit| limit.name == key).unwrap();
            assert!(of_key.why.as_ref().unwrap().contains(&format!("month-{}", seed % 3)), "{of_key:?}");
            !found.passed() && missed(&found).contains(&key)
        });
        evidence(claim, refused, "≥ 0.95", 60);
    }
}

/// Scatter from turn-on to turn-on: one-sided bound over the runs of all records.
#[test]
fn turn_ons_of_all_records_count() {
    let limits: Limits = "turn_on_sigma_dph_max = 0.03".parse().unwrap();
    let refused = |scatter: f64, first: u64| {
        fraction(60, |seed| {
            let of = |k: u64| month(first + 4 * seed + k, &usual, 0.0, scatter, 1, "bias 3, rate 0");
            !judged((0..4).map(of).collect(), &limits).passed()
        })
    };
    let steady = 1.0 - refused(0.008, 4000);
    evidence("`compare` accepts a scatter of turn-ons of a quarter of its limit, eight turn-ons", steady, "≥ 0.97", 60);
    let twice = refused(0.06, 5000);
    evidence("`compare` refuses a scatter of turn-ons of twice its limit, eight turn-ons", twice, "≥ 0.95", 60);
}

/// A gyro on a rate table: rows of 5 s at ±10 and ±40 °/s over a ramp of the block.
fn table_log(seed: u64, epsilon_ppm: &dyn Fn(f64) -> f64) -> Rows<4> {
    let mut dice = Dice::new(seed);
    let quantum = 0.5;
    let mut log = Rows::new(["time_s", "temperature_c", "counts", "reference_rate_dps"]);
    let (mut angle, mut counted) = (0.0, 0.0);
    for i in 0..8640 {
        let celsius = 15.0 - 55.0 * (std::f64::consts::TAU * f64::from(i) / 8640.0).cos();
        let table_dps = [-40.0, -10.0, 10.0, 40.0][i as usize / 60 % 4];
        let white = 0.003 / (5.0_f64 / 3600.0).sqrt() * dice.normal();
        let dph = table_dps * 3600.0 + 4.5 + 0.02 * celsius / 55.0 + white;
        // ε > 0: fewer counts for the same angle.
        angle += dph * 5.0 / (1.0 + epsilon_ppm(celsius) * 1e-6);
        let total = (angle / quantum).floor();
        log.push([f64::from((i + 1) * 5), to_decimals(celsius, 4), total - counted, table_dps]);
        counted = total;
    }
    log
}

/// The scale factor changes as a whole, or in the cold alone: both are twice the limit there.
#[test]
fn a_scale_factor_that_changed_is_refused() {
    let setup = Bench::setup_of(0.5);
    let limits = navigation();
    let usual = |celsius: f64| 100.0 + 0.2 * celsius;
    let whole = |celsius: f64| usual(celsius) + 20.0;
    let cold = |celsius: f64| usual(celsius) + 20.0 * (70.0 - celsius) / 110.0;
    let refused = |changed: &(dyn Fn(f64) -> f64 + Sync), first: u64| {
        fraction(60, |seed| {
            let of = |k: u64, epsilon: &dyn Fn(f64) -> f64| {
                fit(vec![table_log(first + 2 * seed + k, epsilon)], &setup, "bias 1, scale 1").unwrap()
            };
            let found = judged(vec![of(0, &usual), of(1, changed)], &limits);
            let missed = missed(&found);
            assert!(missed.iter().all(|key| *key == "scale_factor_repeatability_ppm_max"), "{missed:?}");
            assert_eq!(missed.is_empty(), found.passed());
            !found.passed()
        })
    };
    let sound = 1.0 - refused(&usual, 6000);
    evidence("`compare` accepts an unchanged scale factor by `navigation-grade`", sound, "≥ 0.97", 60);
    evidence("`compare` refuses a change of the scale factor of twice its limit", refused(&whole, 7000), "≥ 0.95", 60);
    evidence("`compare` refuses the same in the cold alone", refused(&cold, 8000), "≥ 0.95", 60);
}

/// What a comparison cannot ask is not asked and says so; what it does not know is not met; one log twice proves nothing.
/// A second record that was only between −20 and 50 °C says nothing of what changed above.
#[test]
fn what_one_record_has_not_visited_is_not_unchanged() {
    let limits = navigation();
    let hot = |now: Now| usual(now) + 0.5 * ((now.celsius - 55.0) / 15.0).clamp(0.0, 1.0);
    let refused = fraction(20, |seed| {
        let whole = Bench { cycles: 2, ..Bench::new(9_000 + seed, &usual) };
        let narrow = Bench {
            chamber_c: |minutes| Bench::triangle_c(minutes).clamp(-20.0, 50.0),
            ..Bench::new(9_100 + seed, &hot)
        };
        let of = |bench: &Bench<'_>| fit(vec![bench.log()], &Bench::setup(), "bias 3, rate 0").unwrap();
        let found = judged(vec![of(&whole), of(&narrow)], &limits);
        missed(&found).contains(&"span_covered_min")
    });
    evidence(
        "`compare` refuses a record of 64 % of the other's temperatures by `navigation-grade`",
        refused,
        "≥ 1",
        20,
    );
}

/// A lag of the rate effect that went from nothing to 900 s, at 0.1 °/h per °C/min, and an N that tripled: neither is in the curves at rest,
/// nor in the size of the rate effect. Both passed 10 and 5 times of as many.
#[test]
fn a_lag_and_a_noise_that_changed_are_refused() {
    const RECORDS: Records = Records::new(60).few(30);
    let limits = navigation();
    let month = |seed: u64, rate_lag_s: f64, n_deg_rt_h: f64| {
        let drift = |now: Now| 0.02 * now.u() + 0.1 * now.lagged_cpm;
        let run = |k: u64| Bench { rate_lag_s, n_deg_rt_h, cycles: 1, ..Bench::new(10 * seed + k, &drift) }.log();
        let setup = sagnac::Setup { turn_ons: Some(TurnOnCount::FILES), ..Bench::setup() };
        fit((0..2).map(run).collect(), &setup, "bias 3, rate 0").unwrap()
    };
    let found = |seed: u64, lag_s: f64, n_deg_rt_h: f64| {
        judged(vec![month(7000 + 2 * seed, 1.0, 0.003), month(7001 + 2 * seed, lag_s, n_deg_rt_h)], &limits)
    };
    let misses = |found: &Comparison, key: &str| !found.passed() && missed(found).contains(&key);
    let lag = fraction(RECORDS, |seed| misses(&found(seed, 900.0, 0.003), "hysteresis_dph_max"));
    evidence("`compare` refuses a lag that went from 0 to 900 s by `hysteresis_dph_max`", lag, "≥ 0.95", RECORDS);
    let noise = fraction(RECORDS, |seed| misses(&found(seed, 1.0, 0.009), "arw_deg_rt_h_max"));
    evidence("`compare` refuses an N that tripled by `arw_deg_rt_h_max`", noise, "≥ 1", RECORDS);
    let same = fraction(RECORDS, |seed| {
        let found = found(seed, 1.0, 0.003);
        if !found.passed() {
            println!("{seed}: {:?}", missed(&found));
        }
        found.passed()
    });
    evidence("`compare` accepts an unchanged gyro with a rate effect of 0.1 °/h per °C/min", same, "≥ 0.95", RECORDS);
}
