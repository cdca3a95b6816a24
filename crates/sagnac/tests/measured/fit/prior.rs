//! A short test with what the fleet knows: do its intervals hold, what does it save, and is a unit that is not of the fleet refused?
//! By fleets of lots with heavy tails, from a generator that shares no code with the program.

use crate::hostile;
use crate::support;

use crate::hostile::lots::{Fleet, Gyro, MODEL, OF_UNITS, gyro, lot};
use crate::hostile::{Bench, Dice, Now};
use crate::support::evidence::{Records, evidence, ratio};
use crate::support::rows::Rows;
use rayon::prelude::*;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Model, UnitPrior};

/// From +20 °C down, half an hour there, up to +70 °C, half an hour there.
pub(crate) fn short_c(minutes: f64) -> f64 {
    match minutes {
        m if m < 60.0 => 20.0 - m,
        m if m < 90.0 => -40.0,
        m if m < 200.0 => -40.0 + (m - 90.0),
        _ => 70.0,
    }
}

/// The short test: 3.8 of the 13.3 hours.
pub(crate) fn short(bench: &mut Bench<'_>) {
    (bench.hours, bench.chamber_c) = (Some(230.0 / 60.0), short_c);
}

/// The full test: two cycles, 13.3 hours.
pub(crate) fn full(_: &mut Bench<'_>) {}

/// Flicker and a walk as large as the white noise of a quarter of an hour.
fn slow_noise(bench: &mut Bench<'_>) {
    (bench.b_dph, bench.k_dph_rt_h) = (0.005, 0.003);
}

fn chain(one: fn(&mut Bench<'_>), two: fn(&mut Bench<'_>)) -> impl Fn(&mut Bench<'_>) + Sync {
    move |bench| {
        one(bench);
        two(bench);
    }
}

pub(crate) fn calibrated(log: Rows<3>, prior: Option<&UnitPrior>) -> sagnac::Result<Calibration> {
    let options = match prior {
        Some(prior) => FitOptions::new(Model::Auto).prior(Some(prior.clone())),
        None => FitOptions::new(support::model(MODEL)),
    };
    support::fit_with(vec![log], &Bench::setup(), &options)
}

pub(crate) const TEMPERATURES_C: [f64; 6] = [-38.0, -20.0, 0.0, 40.0, 55.0, 68.0];

/// Of many units: how often the 95 % intervals of curve and rate effect hold, how many were refused.
#[derive(Default, Debug)]
struct Score {
    held: f64,
    rate_held: f64,
    refused: f64,
}

impl Score {
    fn of(found: &[Option<[f64; 3]>]) -> Self {
        let n = found.iter().flatten().count() as f64;
        let mean = |at: usize| found.iter().flatten().map(|one| one[at]).sum::<f64>() / n;
        let refused = 1.0 - n / found.len() as f64;
        Self { held: mean(0), rate_held: mean(1), refused }
    }
}

fn scored(made: &Calibration, gyro: Gyro) -> [f64; 3] {
    let axis = &made.axes[0];
    let quantile = axis.fit.as_ref().unwrap().residual.t_quantile_975;
    let from = gyro.curve(axis.reference_c());
    let of = |celsius: f64| {
        let found = axis.evaluate(celsius, 0.0);
        let truth = gyro.curve(celsius) - from;
        let holds = (found.lower_dph.unwrap()..=found.upper_dph.unwrap()).contains(&truth);
        let [rate, sigma] = axis.rate_effect(celsius).unwrap();
        let holds_rate = (rate - gyro.rate[0] - gyro.rate[1] * (celsius - 15.0) / 55.0).abs() < quantile * sigma;
        [f64::from(u8::from(holds)), f64::from(u8::from(holds_rate)), (found.drift_dph - truth).powi(2)]
    };
    let all = TEMPERATURES_C.map(of);
    std::array::from_fn(|k| all.iter().map(|one| one[k]).sum::<f64>() / all.len() as f64)
}

/// Next units of several fleets, with and without the prior, and the square errors of the curves that both made. With three lots they are
/// of the second; with twelve of a new one. A fleet is known by eighty of its next units, in the sibling one by all.
fn next_units(
    units: Records,
    lots: usize,
    noise: fn(&mut Bench<'_>),
    test: fn(&mut Bench<'_>),
) -> ([Score; 2], Vec<[f64; 2]>) {
    let of_fleet = units.count().min(80);
    let mut found = [Vec::new(), Vec::new()];
    for number in 0..units.count() / of_fleet {
        let fleet = Fleet::new(number + 1, lots, noise);
        let prior = if lots < 10 { fleet.of_lot() } else { fleet.prior.of_unit(None).unwrap() };
        let one = |unit: u64| {
            let seed = 1_000_000 * (number + 1) + unit;
            let mut dice = Dice::new(seed);
            let gyro = gyro(if lots < 10 { fleet.lots[1] } else { lot(&mut dice) }, &mut dice);
            let log = || gyro.log(seed, chain(noise, test));
            [Some(&prior), None].map(|prior| calibrated(log(), prior).ok().map(|made| scored(&made, gyro)))
        };
        let both: Vec<_> = (0..of_fleet).into_par_iter().map(one).collect();
        for (all, at) in found.iter_mut().zip(0..) {
            all.extend(both.iter().map(|both: &[Option<[f64; 3]>; 2]| both[at]));
        }
    }
    // A unit that was refused has no error, with or without.
    let square = |one: &Option<[f64; 3]>| one.map_or(0.0, |one| one[2]);
    let both = |(with, without)| if Option::is_some(with) { [square(with), square(without)] } else { [0.0; 2] };
    let squares = found[0].iter().zip(&found[1]).map(both).collect();
    let scores = found.map(|found| Score::of(&found));
    println!("{lots} lots: {scores:?}");
    (scores, squares)
}

/// Root mean square of the first over that of the second.
fn over(squares: &[[f64; 2]]) -> f64 {
    let sum = |at: usize| squares.iter().map(|pair| pair[at]).sum::<f64>();
    (sum(0) / sum(1)).sqrt()
}

/// The intervals of a short test with a prior hold, and its curve is better than that of least squares by the true model.
#[test]
fn a_short_test_is_as_sure_as_it_says() {
    const UNITS: Records = Records::new(400).few(30);
    let ([with, _], squares) = next_units(UNITS, 3, full, short);
    evidence("prior of a lot, short test: 95 % interval of the curve covers", with.held, "0.93 … 0.97", UNITS);
    evidence(
        "prior of a lot, short test: 95 % interval of the rate effect covers",
        with.rate_held,
        "0.92 … 0.97",
        UNITS,
    );
    let claim = "prior of a lot, short test: rms error of the curve over that without the prior";
    ratio(claim, &squares, over, ["≤ 0.45", "≤ 0.7"], UNITS);
    evidence(
        "prior of a lot: units of the fleet refused, with tails of Student's t of five",
        with.refused,
        "≤ 0.06",
        UNITS,
    );
}

/// A lot that the fleet has not seen, where lots are many.
#[test]
fn a_new_lot_is_within_many() {
    const UNITS: Records = Records::new(320).few(30);
    let ([with, _], squares) = next_units(UNITS, 12, full, short);
    let claim = "prior of twelve lots, unit of another: 95 % interval of the curve covers";
    evidence(claim, with.held, "0.93 … 0.98", UNITS);
    evidence(
        "prior of twelve lots, unit of another: 95 % interval of the rate effect covers",
        with.rate_held,
        "0.93 … 0.98",
        UNITS,
    );
    let claim = "prior of twelve lots, unit of another: rms error of the curve over that without the prior";
    ratio(claim, &squares, over, ["≤ 0.5", "≤ 0.8"], UNITS);
    let fleet = Fleet::new(9, 3, full);
    for lot in [None, Some("lot 7")] {
        let error = fleet.prior.of_unit(lot).unwrap_err();
        assert_eq!(error.kind, sagnac::ErrorKind::Refused);
        assert!(error.help.contains("lot 0, lot 1, lot 2"));
    }
}

/// Flicker and random walk: the fleet's full tests say what a short one cannot.
#[test]
fn slow_noise_is_the_fleets() {
    const UNITS: Records = Records::new(320).few(30);
    let ([with, _], _) = next_units(UNITS, 3, slow_noise, short);
    evidence(
        "prior of a lot, short test, slow noise: 95 % interval of the curve covers",
        with.held,
        "0.93 … 0.98",
        UNITS,
    );
    evidence(
        "prior of a lot, short test, slow noise: 95 % interval of the rate effect covers",
        with.rate_held,
        "0.92 … 0.97",
        UNITS,
    );
}

/// A full test with a prior is no worse for it.
#[test]
fn a_full_test_gains_a_little() {
    const UNITS: Records = Records::new(160).few(30);
    let ([with, _], squares) = next_units(UNITS, 3, full, full);
    evidence("prior of a lot, full test: 95 % interval of the curve covers", with.held, "0.92 … 0.98", UNITS);
    let claim = "prior of a lot, full test: rms error of the curve over that without the prior";
    ratio(claim, &squares, over, ["≤ 1", "≤ 1.2"], UNITS);
}

/// Units that are not of the fleet: one parameter is six σ of its lot away. Where the test's own noise is as large as that scatter, or the
/// test does not show a parameter at all (the lag), an outlier passes: what the record says of the test is then the fleet's.
#[test]
fn odd_units_are_refused_by_name() {
    const ODD: Records = Records::new(100);
    let fleets = [Fleet::new(1, 3, full), Fleet::new(2, 3, full)];
    let caught = |parameter: usize| {
        hostile::fraction(ODD, |unit| {
            let fleet = &fleets[unit as usize % 2];
            let mut dice = Dice::new(7000 * (parameter as u64 + 1) + unit);
            let mut of = fleet.lots[1];
            of[parameter] += if unit % 4 < 2 { 6.0 } else { -6.0 } * OF_UNITS[parameter];
            let odd = gyro(of, &mut dice);
            match calibrated(odd.log(unit + 31, short), Some(&fleet.of_lot())) {
                Ok(_) => false,
                Err(e) => e.what.contains("not of this fleet") && e.help.contains("full test"),
            }
        })
    };
    evidence("short test, unit six σ odd in the slope over temperature: refused", caught(0), "≥ 0.95", ODD);
    evidence("short test, unit six σ odd in the second order: refused", caught(1), "≥ 0.95", ODD);
    evidence(
        "short test, unit six σ odd in the third order, which it shows no better than the fleet: refused",
        caught(2),
        "≥ 0.6",
        ODD,
    );
    evidence("short test, unit six σ odd in the rate effect: refused", caught(3), "≥ 0.95", ODD);
}

/// A fleet whose units are alike in the third order, ten times as much as their short test could tell: a unit that is odd there has the
/// fleet's narrow interval unless the test contradicts it.
#[test]
fn oddness_where_all_are_alike_is_seen() {
    const ALIKE: f64 = 0.002;
    const ALIKE_UNITS: Records = Records::new(160).few(30);
    let fleet = Fleet::alike_in_third(11, ALIKE);
    let prior = fleet.of_lot();
    let found = |by: f64, seed: u64| {
        let one = |unit: u64| {
            let mut dice = Dice::new(seed + unit);
            let mut odd = gyro(fleet.lots[1], &mut dice);
            odd.curve[2] = fleet.lots[1][2] + ALIKE * (hostile::lots::heavy(&mut dice) + by);
            calibrated(odd.log(seed + unit, short), Some(&prior)).ok().map(|made| scored(&made, odd))
        };
        Score::of(&ALIKE_UNITS.each().into_par_iter().map(one).collect::<Vec<_>>())
    };
    let [of_fleet, odd, very_odd] = [(0.0, 4000), (20.0, 5000), (40.0, 6000)].map(|(by, seed)| found(by, seed));
    println!("alike: {of_fleet:?} {odd:?} {very_odd:?}");
    evidence(
        "fleet alike in the third order, short test: 95 % interval of the curve covers",
        of_fleet.held,
        "0.92 … 0.98",
        ALIKE_UNITS,
    );
    evidence("the same: units of the fleet that are refused", of_fleet.refused, "≤ 0.06", ALIKE_UNITS);
    evidence("the same, unit 20 σ odd in the third order: refused", odd.refused, "≥ 0.2", ALIKE_UNITS);
    evidence("the same, unit 40 σ odd in the third order: refused", very_odd.refused, "≥ 0.95", ALIKE_UNITS);
    // What the record says of it: with such an error one test of ten finds nothing.
    let made = calibrated(gyro(fleet.lots[1], &mut Dice::new(3)).log(3, short), Some(&prior)).unwrap();
    let stated = made.axes[0].fit.as_ref().unwrap().prior.as_ref().unwrap().unnoticed_dph.unwrap();
    let passed = 1.0 - found(stated / error_of_third(ALIKE), 8000).refused;
    println!("stated {stated}: {} σ, passed {passed}", stated / error_of_third(ALIKE));
    evidence("the same, unit odd by what the record states as unnoticed: passes", passed, "≤ 0.3", ALIKE_UNITS);
}

/// Largest |u³| about its mean over the fleet's span, for a coefficient.
fn error_of_third(coefficient: f64) -> f64 {
    let curve: Vec<f64> = (-100..=100).map(|at| coefficient * (f64::from(at) / 100.0).powi(3)).collect();
    curve.iter().copied().fold(0.0, f64::max)
}

/// Units that are odd in what the model of the fleet does not have: a fourth order, a bump. Either their residual is
/// larger than the fleet's, or the terms that there are take most of it.
#[test]
fn what_the_model_does_not_have_is_seen() {
    const EXTRA: Records = Records::new(120).few(30);
    let fleet = Fleet::new(12, 3, full);
    let prior = fleet.of_lot();
    let refused = |extra: &(dyn Fn(f64) -> f64 + Sync), seed: u64| {
        hostile::fraction(EXTRA, |unit| {
            let gyro = gyro(fleet.lots[1], &mut Dice::new(seed + unit));
            let drift = move |now: Now| gyro.drift(now) + extra(now.celsius);
            let mut bench = Bench::new(seed + unit, &drift);
            (bench.rate_lag_s, bench.row_s) = (gyro.lag_s, 20.0);
            short(&mut bench);
            calibrated(bench.log(), Some(&prior)).is_err()
        })
    };
    let fourth = refused(&|c| 0.2 * ((c - 15.0) / 55.0).powi(4), 30_000);
    let bump = refused(&|c| 0.08 * (-((c - 45.0) / 8.0).powi(2) / 2.0).exp(), 50_000);
    let claim = "short test with the prior of a lot, 0.2 °/h·u⁴ that the fleet does not have: refused";
    evidence(claim, fourth, "≥ 0.9", EXTRA);
    let claim = "short test with the prior of a lot, a bump of 0.08 °/h, σ 8 °C, that the fleet does not have: refused";
    evidence(claim, bump, "≥ 0.9", EXTRA);
}
