//! A short test with what the fleet knows: do its intervals hold, what does it save, and is a unit that is not of the fleet refused?
//! By fleets of lots with heavy tails, from a generator that shares no code with the program.

use crate::hostile;
use crate::support;

use crate::hostile::lots::{Fleet, Gyro, MODEL, OF_UNITS, gyro, lot};
use crate::hostile::{Bench, Dice, Now};
use crate::support::evidence::evidence;
use rayon::prelude::*;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Loss, Model, UnitPrior};

/// From +20 °C down, half an hour there, up to +70 °C, half an hour there.
fn short_c(minutes: f64) -> f64 {
    match minutes {
        m if m < 60.0 => 20.0 - m,
        m if m < 90.0 => -40.0,
        m if m < 200.0 => -40.0 + (m - 90.0),
        _ => 70.0,
    }
}

/// The short test: 3.8 of the 13.3 hours.
fn short(bench: &mut Bench<'_>) {
    (bench.hours, bench.chamber_c) = (Some(230.0 / 60.0), short_c);
}

/// The full test: two cycles, 13.3 hours.
fn full(_: &mut Bench<'_>) {}

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

fn calibrated(log: Vec<u8>, prior: Option<&UnitPrior>) -> sagnac::Result<Calibration> {
    let options = match prior {
        Some(prior) => FitOptions::new(Model::Auto).prior(Some(prior.clone())),
        None => FitOptions::new(support::model(MODEL)),
    };
    support::fit_with(vec![log], &Bench::setup(), &options)
}

const TEMPERATURES_C: [f64; 6] = [-38.0, -20.0, 0.0, 40.0, 55.0, 68.0];

/// Of many units: how often the 95 % intervals of curve and rate effect hold, mean square error of the curve, how many were refused.
#[derive(Default, Debug)]
struct Score {
    held: f64,
    rate_held: f64,
    error_dph: f64,
    refused: f64,
}

impl Score {
    fn of(found: &[Option<[f64; 3]>]) -> Self {
        let n = found.iter().flatten().count() as f64;
        let mean = |at: usize| found.iter().flatten().map(|one| one[at]).sum::<f64>() / n;
        let refused = 1.0 - n / found.len() as f64;
        Self { held: mean(0), rate_held: mean(1), error_dph: mean(2).sqrt(), refused }
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

/// Next units of several fleets, with and without the prior. With three lots they are of the second; with twelve of a new one.
fn next_units(fleets: u64, lots: usize, noise: fn(&mut Bench<'_>), test: fn(&mut Bench<'_>)) -> [Score; 2] {
    const UNITS: u64 = 80;
    let mut found = [Vec::new(), Vec::new()];
    for number in 0..fleets {
        let fleet = Fleet::new(number + 1, lots, noise);
        let prior = if lots < 10 { fleet.of_lot() } else { fleet.prior.of_unit(None).unwrap() };
        let one = |unit: u64| {
            let seed = 1_000_000 * (number + 1) + unit;
            let mut dice = Dice::new(seed);
            let gyro = gyro(if lots < 10 { fleet.lots[1] } else { lot(&mut dice) }, &mut dice);
            let log = || gyro.log(seed, chain(noise, test));
            [Some(&prior), None].map(|prior| calibrated(log(), prior).ok().map(|made| scored(&made, gyro)))
        };
        let both: Vec<_> = (0..UNITS).into_par_iter().map(one).collect();
        for (all, at) in found.iter_mut().zip(0..) {
            all.extend(both.iter().map(|both: &[Option<[f64; 3]>; 2]| both[at]));
        }
    }
    let scores = found.map(|found| Score::of(&found));
    println!("{lots} lots: {scores:?}");
    scores
}

/// The intervals of a short test with a prior hold, and its curve is better than that of least squares by the true model.
#[test]
fn a_short_test_is_as_sure_as_it_says() {
    let [with, without] = next_units(5, 3, full, short);
    evidence("prior of a lot, short test: 95 % interval of the curve covers", with.held, "0.93 … 0.97", 400);
    evidence("prior of a lot, short test: 95 % interval of the rate effect covers", with.rate_held, "0.92 … 0.97", 400);
    let gain = with.error_dph / without.error_dph;
    evidence("prior of a lot, short test: rms error of the curve over that without the prior", gain, "≤ 0.45", 400);
    evidence(
        "prior of a lot: units of the fleet refused, with tails of Student's t of five",
        with.refused,
        "≤ 0.06",
        400,
    );
}

/// A lot that the fleet has not seen, where lots are many.
#[test]
fn a_new_lot_is_within_many() {
    let [with, without] = next_units(4, 12, full, short);
    evidence("prior of twelve lots, unit of another: 95 % interval of the curve covers", with.held, "0.93 … 0.98", 320);
    evidence(
        "prior of twelve lots, unit of another: 95 % interval of the rate effect covers",
        with.rate_held,
        "0.93 … 0.98",
        320,
    );
    assert!(with.error_dph < 0.5 * without.error_dph);
    let fleet = Fleet::new(9, 3, full);
    for lot in [None, Some("lot 7")] {
        let error = fleet.prior.of_unit(lot).unwrap_err();
        assert_eq!(error.kind, sagnac::ErrorKind::Refused);
        assert!(error.help.unwrap().contains("lot 0, lot 1, lot 2"));
    }
}

/// Flicker and random walk: the fleet's full tests say what a short one cannot.
#[test]
fn slow_noise_is_the_fleets() {
    let [with, _] = next_units(4, 3, slow_noise, short);
    evidence(
        "prior of a lot, short test, slow noise: 95 % interval of the curve covers",
        with.held,
        "0.93 … 0.98",
        320,
    );
    evidence(
        "prior of a lot, short test, slow noise: 95 % interval of the rate effect covers",
        with.rate_held,
        "0.92 … 0.97",
        320,
    );
}

/// A full test with a prior is no worse for it.
#[test]
fn a_full_test_gains_a_little() {
    let [with, without] = next_units(2, 3, full, full);
    evidence("prior of a lot, full test: 95 % interval of the curve covers", with.held, "0.92 … 0.98", 160);
    assert!(with.error_dph < without.error_dph, "{with:?} {without:?}");
}

/// Units that are not of the fleet: one parameter is six σ of its lot away. Where the test's own noise is as large as that scatter, or the
/// test does not show a parameter at all (the lag), an odd unit passes: what the record says of the test is then the fleet's.
#[test]
fn odd_units_are_refused_by_name() {
    let fleets = [Fleet::new(1, 3, full), Fleet::new(2, 3, full)];
    let caught = |parameter: usize| {
        hostile::fraction(100, |unit| {
            let fleet = &fleets[unit as usize % 2];
            let mut dice = Dice::new(7000 * (parameter as u64 + 1) + unit);
            let mut of = fleet.lots[1];
            of[parameter] += if unit % 4 < 2 { 6.0 } else { -6.0 } * OF_UNITS[parameter];
            let odd = gyro(of, &mut dice);
            match calibrated(odd.log(unit + 31, short), Some(&fleet.of_lot())) {
                Ok(_) => false,
                Err(e) => e.what.contains("not of this fleet") && e.help.unwrap().contains("full test"),
            }
        })
    };
    evidence("short test, unit six σ odd in the slope over temperature: refused", caught(0), "≥ 0.95", 100);
    evidence("short test, unit six σ odd in the second order: refused", caught(1), "≥ 0.95", 100);
    evidence(
        "short test, unit six σ odd in the third order, which it shows no better than the fleet: refused",
        caught(2),
        "≥ 0.6",
        100,
    );
    evidence("short test, unit six σ odd in the rate effect: refused", caught(3), "≥ 0.95", 100);
}

/// A fleet whose units are alike in the third order, ten times as much as their short test could tell: a unit that is odd there has the
/// fleet's narrow interval unless the test contradicts it.
#[test]
fn oddness_where_all_are_alike_is_seen() {
    const ALIKE: f64 = 0.002;
    let fleet = Fleet::alike_in_third(11, ALIKE);
    let prior = fleet.of_lot();
    let found = |by: f64, seed: u64| {
        let one = |unit: u64| {
            let mut dice = Dice::new(seed + unit);
            let mut odd = gyro(fleet.lots[1], &mut dice);
            odd.curve[2] = fleet.lots[1][2] + ALIKE * (hostile::lots::heavy(&mut dice) + by);
            calibrated(odd.log(seed + unit, short), Some(&prior)).ok().map(|made| scored(&made, odd))
        };
        Score::of(&(0..160).into_par_iter().map(one).collect::<Vec<_>>())
    };
    let [of_fleet, odd, very_odd] = [(0.0, 4000), (20.0, 5000), (40.0, 6000)].map(|(by, seed)| found(by, seed));
    println!("alike: {of_fleet:?} {odd:?} {very_odd:?}");
    evidence(
        "fleet alike in the third order, short test: 95 % interval of the curve covers",
        of_fleet.held,
        "0.92 … 0.98",
        160,
    );
    evidence("the same: units of the fleet that are refused", of_fleet.refused, "≤ 0.06", 160);
    evidence("the same, unit 20 σ odd in the third order: refused", odd.refused, "≥ 0.2", 160);
    evidence("the same, unit 40 σ odd in the third order: refused", very_odd.refused, "≥ 0.95", 160);
    // What the record says of it: with such an error one test of ten finds nothing.
    let made = calibrated(gyro(fleet.lots[1], &mut Dice::new(3)).log(3, short), Some(&prior)).unwrap();
    let stated = made.axes[0].fit.as_ref().unwrap().prior.as_ref().unwrap().unnoticed_dph.unwrap();
    let passed = 1.0 - found(stated / error_of_third(ALIKE), 8000).refused;
    println!("stated {stated}: {} σ, passed {passed}", stated / error_of_third(ALIKE));
    evidence("the same, unit odd by what the record states as unnoticed: passes", passed, "≤ 0.3", 160);
}

/// Largest |u³| about its mean over the fleet's span, for a coefficient.
fn error_of_third(coefficient: f64) -> f64 {
    let curve: Vec<f64> = (-100..=100).map(|at| coefficient * (f64::from(at) / 100.0).powi(3)).collect();
    curve.iter().copied().fold(0.0, f64::max)
}

/// Units that are odd in what the model of the fleet does not have: a fourth order, a bump, a second and longer lag. Either their residual is
/// larger than the fleet's, or the terms that there are take most of it.
#[test]
fn what_the_model_does_not_have_is_seen() {
    let fleet = Fleet::new(12, 3, full);
    let prior = fleet.of_lot();
    // Refused, and how often the intervals of the others hold.
    let found = |extra: &(dyn Fn(f64) -> f64 + Sync), seed: u64| {
        let one = |unit: u64| {
            let gyro = gyro(fleet.lots[1], &mut Dice::new(seed + unit));
            let drift = move |now: Now| gyro.drift(now) + extra(now.celsius);
            let mut bench = Bench::new(seed + unit, &drift);
            (bench.rate_lag_s, bench.row_s) = (gyro.lag_s, 20.0);
            short(&mut bench);
            let made = calibrated(bench.log(), Some(&prior)).ok()?;
            let axis = &made.axes[0];
            let truth = |celsius: f64| gyro.curve(celsius) + extra(celsius);
            let holds = |celsius: &f64| {
                let found = axis.evaluate(*celsius, 0.0);
                let truth = truth(*celsius) - truth(axis.reference_c());
                (found.lower_dph.unwrap()..=found.upper_dph.unwrap()).contains(&truth)
            };
            Some(TEMPERATURES_C.iter().filter(|celsius| holds(celsius)).count() as f64 / TEMPERATURES_C.len() as f64)
        };
        let all: Vec<Option<f64>> = (0..120).into_par_iter().map(one).collect();
        let passed = all.iter().flatten().count() as f64;
        [1.0 - passed / 120.0, all.iter().flatten().sum::<f64>() / passed]
    };
    let fourth = |celsius: f64| ((celsius - 15.0) / 55.0).powi(4);
    let none = found(&|_| 0.0, 20_000);
    let [small, large, larger] = [0.05, 0.1, 0.2].map(|size| found(&move |c| size * fourth(c), 30_000));
    let bump = found(&|c| 0.08 * (-((c - 45.0) / 8.0).powi(2) / 2.0).exp(), 50_000);
    println!("outside the model: {none:?} {small:?} {large:?} {larger:?} {bump:?}");
    evidence("short test with the prior of a lot, units of the fleet: refused", none[0], "≤ 0.06", 120);
    evidence("the same with 0.2 °/h·u⁴, which the fleet does not have: refused", larger[0], "≥ 0.9", 120);
    evidence("the same with a bump of 0.08 °/h, σ 8 °C: refused", bump[0], "≥ 0.9", 120);
}

/// A prior that says nothing is the fit without one, and one that knows everything is its own mean.
#[test]
fn between_no_prior_and_nothing_else() {
    let fleet = Fleet::new(3, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(5));
    let log = || gyro.log(77, full);
    let with = |factor: f64| {
        let mut prior = fleet.of_lot();
        prior.covariance.iter_mut().for_each(|value| *value *= factor);
        calibrated(log(), Some(&prior)).unwrap()
    };
    let (without, vague) = (calibrated(log(), None).unwrap(), with(1e6));
    let used = |made: &Calibration| made.axes[0].fit.as_ref().unwrap().prior.clone().unwrap();
    for celsius in TEMPERATURES_C {
        for cpm in [0.0, 1.0] {
            let [a, b] = [&without, &vague].map(|made| made.axes[0].evaluate(celsius, cpm));
            let half = (a.upper_dph.unwrap() - a.drift_dph).abs();
            // Rows are weighted by their noise here and by their lengths there: a tenth of the uncertainty between them.
            assert!((a.drift_dph - b.drift_dph).abs() < 0.25 * half, "{celsius}: {a:?} {b:?}");
        }
    }
    assert!((used(&vague).determined - 6.0).abs() < 0.01 && used(&vague).directions == 6, "{:?}", used(&vague));
    let mut certain = fleet.of_lot();
    certain.covariance.iter_mut().for_each(|value| *value *= 1e-12);
    let refusal = calibrated(log(), Some(&certain)).unwrap_err();
    assert!(refusal.what.contains("shows nothing in which the units of the fleet differ"), "{refusal}");
}

/// What is in the record, and that it is read again; the image has the hash of the record, so that of the prior is bound to it.
#[test]
fn the_record_says_what_it_rests_on() {
    let fleet = Fleet::new(4, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(8));
    let mut made = calibrated(gyro.log(78, short), Some(&fleet.of_lot())).unwrap();
    made.serial = "RLG-9".to_owned();
    let used = made.axes[0].fit.as_ref().unwrap().prior.clone().unwrap();
    assert_eq!(
        (used.sha256.as_str(), used.lot.as_deref(), used.parameters),
        (fleet.prior.sha256.as_str(), Some("lot 1"), 6)
    );
    assert!(
        used.distance <= used.distance_max && used.directions > 2 && (2.0..6.0).contains(&used.determined),
        "{used:?}"
    );
    let text = made.to_json().unwrap();
    let again = Calibration::parse(&text).unwrap();
    assert_eq!(again, made);
    // The span and the rates are those of the fleet's tests, which the short one does not reach.
    let [lo, hi] = made.axes[0].span_c();
    let of_fleet = fleet.of_lot();
    assert!(lo <= of_fleet.span_c[0] && hi >= of_fleet.span_c[1], "{lo} {hi} {:?}", of_fleet.span_c);
    let rates = made.axes[0].thermometer().rate_span_per_min.unwrap();
    assert!(rates[0] <= of_fleet.rate_spans_cpm[0][0] && rates[1] >= of_fleet.rate_spans_cpm[0][1]);
    let image = made.image('x').unwrap();
    // docs/reference/image-format.md: the parent's SHA-256 is at 92.
    assert_eq!(image[92..124], sagnac_log::ingest::sha256(text.as_bytes()));
}

/// What a prior cannot be used on is refused, and says why.
#[test]
fn a_prior_is_no_calibration() {
    let fleet = Fleet::new(5, 3, full);
    let gyro = gyro(fleet.lots[1], &mut Dice::new(9));
    // A chamber that stands still.
    let level = gyro.log(1, |bench| (bench.hours, bench.chamber_c) = (Some(4.0), |_| 20.0));
    let refusal = calibrated(level, Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("shows nothing in which the units of the fleet differ"), "{refusal}");
    // Ten minutes.
    let brief = gyro.log(2, |bench| (bench.hours, bench.chamber_c) = (Some(0.15), short_c));
    let refusal = calibrated(brief, Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("too few to tell how noisy"), "{refusal}");
    // Another product.
    let other = Gyro { curve: [-0.6, 0.1, 0.0], ..gyro };
    let refusal = calibrated(other.log(3, short), Some(&fleet.of_lot())).unwrap_err();
    assert!(refusal.what.contains("not of this fleet") && refusal.what.contains("bias 1 is -1"), "{refusal}");
    for options in [
        FitOptions::new(support::model(MODEL)),
        FitOptions::new(Model::Auto).bootstrap(Some(100)),
        FitOptions::new(Model::Auto).loss(Loss::Huber),
        FitOptions::new(Model::Auto).correct_warm_up(true),
    ] {
        let options = options.prior(Some(fleet.of_lot()));
        let refusal = support::fit_with(vec![gyro.log(4, short)], &Bench::setup(), &options).unwrap_err();
        assert!(refusal.what.contains("does not go with a prior"), "{refusal}");
    }
}
