//! What moves together with temperature: drift in time and warm-up are no rate terms, and a test that only heats says so. By a
//! generator that shares no code with the program.

use crate::hostile::{Bench, Now};
use crate::support::at_rest;
use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use rayon::prelude::*;
use sagnac::calibration::{AxisCalibration, MovedTogether, TimeEffectKind};

/// Of each kind.
const RECORDS: Records = Records::new(60).few(30);

/// Temperatures at which the at-rest curve is compared, °C.
const AT_C: [f64; 9] = [-36.0, -25.0, -12.0, 0.0, 12.0, 36.0, 48.0, 58.0, 65.0];

/// Calibrations by `auto` of a truth, a run or more of one cycle each.
fn calibrated(runs: u64, truth: fn(Now) -> f64, change: fn(&mut Bench<'_>)) -> Vec<AxisCalibration> {
    let one = |record: u64| {
        let logs = (0..runs).map(|run| {
            let mut bench = Bench::new(31_000_000 + 1000 * record + run, &truth);
            (bench.cycles, bench.row_s) = (1, 20.0);
            change(&mut bench);
            bench.log()
        });
        fit(logs.collect(), &Bench::setup(), "auto").unwrap().axes.remove(0)
    };
    RECORDS.each().into_par_iter().map(one).collect()
}

fn part(of: &[AxisCalibration], holds: impl Fn(&AxisCalibration) -> bool) -> f64 {
    of.iter().filter(|axis| holds(axis)).count() as f64 / of.len() as f64
}

/// Part of the intervals of the at-rest curve that hold the truth.
fn coverage(of: &[AxisCalibration], truth: fn(Now) -> f64) -> f64 {
    let rest = |celsius: f64| truth(Now { celsius, cpm: 0.0, lagged_cpm: 0.0, slow_cpm: 0.0, hours: 0.0 });
    let holds = |axis: &AxisCalibration, celsius: f64| {
        let (drift_dph, half_dph) = at_rest(axis, celsius);
        (drift_dph - (rest(celsius) - rest(25.0))).abs() <= half_dph
    };
    let held: usize = of.iter().map(|axis| AT_C.iter().filter(|celsius| holds(axis, **celsius)).count()).sum();
    held as f64 / (of.len() * AT_C.len()) as f64
}

fn models(of: &[AxisCalibration]) -> std::collections::BTreeMap<String, usize> {
    let mut models = std::collections::BTreeMap::new();
    for axis in of {
        let effects = axis.fit.as_ref().unwrap().time_effects.iter().map(|e| format!(" +{:?}", e.kind));
        *models.entry(format!("{}{}", axis.correction.model, effects.collect::<String>())).or_default() += 1;
    }
    models
}

fn has_rate(axis: &AxisCalibration) -> bool {
    axis.correction.terms.iter().any(|term| term.times_rate)
}

/// A cycle heats first and cools then, so a drift in time looks like a rate term of a slow lag.
#[test]
fn a_drift_in_time_is_no_rate_term() {
    let truth = |now: Now| 0.05 * now.u() + 0.01 * now.hours;
    for (name, runs) in [("one run", 1), ("two runs", 2)] {
        let all = calibrated(runs, truth, |_| ());
        println!("{name}: {:?}", models(&all));
        evidence(
            &format!("`auto` takes a drift of 0.01 °/h per hour for a rate term, {name}"),
            part(&all, has_rate),
            "≤ 0.05",
            RECORDS,
        );
        let covers = part(&all, |axis| {
            let effects = &axis.fit.as_ref().unwrap().time_effects;
            effects.iter().filter(|e| e.kind == TimeEffectKind::Drift).all(|e| (e.value - 0.01).abs() < 2.0 * e.sigma)
        });
        evidence(&format!("± 2 σ of the fitted drift in time hold the truth, {name}"), covers, "≥ 0.88", RECORDS);
        evidence(
            &format!("95 % interval of the curve covers beside a drift in time, {name}"),
            coverage(&all, truth),
            "≥ 0.9",
            RECORDS,
        );
    }
}

#[test]
fn a_warm_up_is_no_rate_term() {
    let truth = |now: Now| 0.05 * now.u() + 0.1 * (-now.hours / 0.7).exp();
    let rest = |now: Now| 0.05 * now.u();
    for (name, runs) in [("one run", 1), ("two runs", 2)] {
        let all = calibrated(runs, truth, |_| ());
        println!("{name}: {:?}", models(&all));
        evidence(
            &format!("`auto` takes a warm-up of 0.1 °/h and 42 min for a rate term, {name}"),
            part(&all, has_rate),
            "≤ 0.05",
            RECORDS,
        );
        evidence(
            &format!("95 % interval of the curve covers beside a warm-up, {name}"),
            coverage(&all, rest),
            "≥ 0.9",
            RECORDS,
        );
    }
}

/// A strong warm-up whose time constant lies between those of the grid: no drift in time makes up for the difference.
#[test]
fn a_strong_warm_up_leaves_the_curve_alone() {
    let truth = |now: Now| 0.05 * now.u() + 0.3 * (-now.hours * 3600.0 / 1500.0).exp();
    let all = calibrated(2, truth, |_| ());
    println!("{:?}", models(&all));
    let drifts = part(&all, |axis| {
        axis.fit.as_ref().unwrap().time_effects.iter().any(|effect| effect.kind == TimeEffectKind::Drift)
    });
    evidence("a drift in time is fitted beside a warm-up of 0.3 °/h and 25 min", drifts, "≤ 0.05", RECORDS);
    let covers = coverage(&all, |now| 0.05 * now.u());
    evidence("95 % interval of the curve covers beside a warm-up of 0.3 °/h and 25 min", covers, "≥ 0.9", RECORDS);
}

/// Where nothing goes with time, nothing is fitted with the terms.
#[test]
fn no_effect_of_time_is_found_where_there_is_none() {
    let all = calibrated(2, |now| 0.05 * now.u() + 0.05 * now.lagged_cpm, |bench| bench.rate_lag_s = 300.0);
    println!("{:?}", models(&all));
    let found = part(&all, |axis| !axis.fit.as_ref().unwrap().time_effects.is_empty());
    evidence(
        "a drift in time or a warm-up is fitted where there is none, beside a rate term",
        found,
        "≤ 0.05",
        RECORDS,
    );
    evidence("a rate term of 0.05 °/h per °C/min is selected", part(&all, has_rate), "≥ 0.95", RECORDS);
}

/// Only heating: a rate term is also a curve, and the curve at rest must know it.
#[test]
fn heating_alone_is_said_and_widens_the_curve() {
    let truth = |now: Now| 0.05 * now.u() + 0.03 * now.lagged_cpm;
    for (name, lag_s) in [("1 s", 1.0), ("300 s", 300.0)] {
        let change: fn(&mut Bench<'_>) = if lag_s > 1.0 {
            |bench| (bench.hours, bench.rate_lag_s) = (Some(290.0 / 60.0), 300.0)
        } else {
            |bench| bench.hours = Some(290.0 / 60.0)
        };
        let all = calibrated(2, truth, change);
        println!("{name}: {:?}", models(&all));
        for axis in all.iter().take(3) {
            println!(
                "{:?} {:?}",
                axis.fit.as_ref().unwrap().entanglement,
                AT_C.map(|c| axis.evaluate(c, 0.0)).map(|e| (e.drift_dph, e.upper_dph))
            );
        }
        let said = part(&all, |axis| {
            axis.fit.as_ref().unwrap().entanglement.iter().any(|e| e.with == MovedTogether::TemperatureRate)
        });
        evidence(&format!("a test that only heats is recorded as such, rate lag {name}"), said, "≥ 1", RECORDS);
        evidence(
            &format!("95 % interval of the curve covers after heating alone, rate lag {name}"),
            coverage(&all, truth),
            "≥ 0.9",
            RECORDS,
        );
    }
}
