//! Faults of the inputs of an image: status 0 is never wrong. The true correction is that of the same image without the fault.
//!
//! ```text
//! wrong: |correction − true| > max(0.1 °/h, 0.05·ΣR) with status 0      R the largest effect of each rate term
//! ```
//!
//! In addition to that, a step within four of the thermometer's own, or 1.5 of the log's, makes its effect. Readings within the limits of slope
//! are no fault that one sensor shows: no wrong value follows on missing ones here, and wrong values from power-on on end after five.

use crate::hostile::{Bench, Dice, Now, fraction};
use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use sagnac::calibration::CorrectionTerm;
use sagnac::export::encode;
use sagnac_core::{Compensator, ErrorBound, Image, Kind, Multiplier, State, Status, UNBOUNDED};

/// Images, and runs of each.
const IMAGES: Records = Records::new(200).few(30);
const RUNS: u64 = if crate::IS_STUDY { 50 } else { 4 };
const HOURS: usize = 6;
/// °/h that status 0 may be off by, and a part of the largest rate effect.
const MOST_DPH: f64 = 0.1;
const MOST_PART: f64 = 0.05;

/// The image of a simulated unit, without a lag, with one or with two, each with its own curve, effects and lags; and what the smallest step
/// that its record can tell from a fault makes behind them, °/h.
fn image(seed: u64) -> (Image, f64) {
    let mut dice = Dice::new(71_000 + seed);
    let [linear, square, fast, slow] = [0.5, 0.2, 1.0, 1.0].map(|most| most * dice.normal());
    let drift = |now: Now| {
        linear * now.u()
            + square * now.u().powi(2)
            + match seed % 3 {
                0 => 0.0,
                1 => fast * now.lagged_cpm,
                _ => fast * now.lagged_cpm + slow * now.slow_cpm,
            }
    };
    let bench = Bench {
        cycles: 1,
        block_lag_s: 300.0,
        rate_lag_s: 60.0 * (2.0 * dice.uniform()).exp(),
        slow_lag_s: 1500.0 * (1.5 * dice.uniform()).exp(),
        thermometer_step_c: [0.0, 1.0 / 256.0, 0.0625][seed as usize / 3 % 3],
        ..Bench::new(seed, &drift)
    };
    let model = ["bias 2", "bias 2, rate 0", "bias 2, rate 0, slow rate 0"][seed as usize % 3];
    let fitted = |model: &str| fit(vec![bench.log()], &Bench::setup(), model);
    // Lags too near to each other are refused.
    let unit = fitted(model).or_else(|_| fitted("bias 2, rate 0")).unwrap();
    let axis = &unit.axes[0];
    let inputs = &axis.correction.inputs;
    let after_step = |term: &CorrectionTerm| {
        let tau_s = inputs.iter().find(|input| input.name == term.input)?.lag_s?.value;
        term.times_rate.then(|| term.value.abs() * 60.0 * inputs[0].max_step / tau_s)
    };
    let after_step = axis.correction.terms.iter().filter_map(after_step).sum();
    (encode(&unit, axis, [0; 32], 1).unwrap(), after_step)
}

/// True temperatures of each update, °C: ramps of up to 1 °C/min and soaks within the span.
fn profile(dice: &mut Dice) -> Vec<f64> {
    let (mut celsius, mut all) = (-20.0 + 70.0 * dice.uniform(), Vec::new());
    while all.len() < HOURS * 3600 {
        let goal = -38.0 + 106.0 * dice.uniform();
        let per_s = (0.2 + 0.75 * dice.uniform()) / 60.0;
        while (goal - celsius).abs() > per_s {
            celsius += per_s * (goal - celsius).signum();
            all.push(celsius);
        }
        all.extend(std::iter::repeat_n(celsius, (3600.0 * dice.uniform()) as usize));
    }
    all
}

/// Readings of one run, and when the processor begins again.
struct Run {
    readings: Vec<Option<f64>>,
    restart: Option<usize>,
}

/// One fault: spikes, a step that stays for a while, missing samples, wrong first samples, or a reset; of any size and length.
fn with_fault(celsius: &[f64], kind: u64, dice: &mut Dice) -> Run {
    let mut readings: Vec<Option<f64>> = celsius.iter().copied().map(Some).collect();
    let start = 3600 + (dice.uniform() * (celsius.len() - 7200) as f64) as usize;
    let length = ((9.0 * dice.uniform()).exp() as usize).clamp(1, celsius.len());
    let size = 0.2 * (6.2 * dice.uniform()).exp() * if dice.uniform() < 0.5 { -1.0 } else { 1.0 };
    let off = |readings: &mut Vec<Option<f64>>, from: usize, to: usize, size: f64| {
        let to = to.min(readings.len());
        readings[from..to].iter_mut().flatten().for_each(|reading| *reading += size);
    };
    match kind {
        0 => {
            let spikes = 1 + (4.0 * dice.uniform()) as usize;
            (0..spikes).for_each(|k| off(&mut readings, start + 7 * k, start + 7 * k + 1 + k % 2, size));
        }
        1 => off(&mut readings, start, start + length, size),
        2 => readings[start..(start + length).min(celsius.len())].fill(None),
        3 => off(&mut readings, 0, length.min(5), size),
        4 => {
            off(&mut readings, start, start + length, size);
            let again = start + 2 * length;
            off(&mut readings, again.min(celsius.len()), again + length, -0.7 * size);
        }
        _ => {}
    }
    Run { readings, restart: (kind == 5).then_some(start) }
}

/// One slow update.
#[derive(Clone, Copy, Debug)]
struct Update {
    correction_dph: f64,
    status: Status,
    bound: ErrorBound,
}

/// Each update of a run.
fn updates(gyro: &Compensator, run: &Run) -> Vec<Update> {
    let d = gyro.image().description();
    let dph = d.scale_factor_femto_arcsec as f64 * 1e-15 * d.quantum_nano_counts as f64 * 1e-9
        / (f64::from(d.tick_ns) * 1e-9)
        / 2.0_f64.powi(32);
    let main = &gyro.image().inputs()[0];
    let code = |celsius: f64| {
        let scaled = (celsius * 2.0_f64.powi(24) - f64::from(main.offset_q24)) / f64::from(main.gain.mantissa);
        (scaled * 2.0_f64.powi(main.gain.shift.into())).round() as i32
    };
    let (mut state, mut bound) = (State::new(), ErrorBound::new());
    let inputs = gyro.image().inputs().len();
    run.readings
        .iter()
        .enumerate()
        .map(|(at, reading)| {
            if run.restart == Some(at) {
                state = State::warm();
            }
            let mut codes = [None; 4];
            codes[0] = reading.map(code);
            gyro.update(&mut state, &codes[..inputs]).unwrap();
            bound.update(gyro.image(), &state);
            gyro.advance(&mut state, 0, d.period_ticks).unwrap();
            Update { correction_dph: state.target_increment() as f64 * dph, status: state.status(), bound }
        })
        .collect()
}

/// Σ of the largest effects of the rate terms, °/h.
fn largest_rate_effect(image: &Image) -> f64 {
    let d = image.description();
    let dph = d.scale_factor_femto_arcsec as f64 * 1e-15 * d.quantum_nano_counts as f64 * 1e-9
        / (f64::from(d.tick_ns) * 1e-9);
    let rate = image.terms().iter().filter(|term| term.multiplier == Multiplier::Rate && term.kind == Kind::Bias);
    rate.map(|term| f64::from(term.mantissa).abs() * 2.0_f64.powi(-9 - i32::from(term.shift)) * dph).sum()
}

/// Each fault of an image, with the run without it, update by update.
fn faults(seed: u64, gyro: &Compensator) -> impl Iterator<Item = (u64, Vec<(Update, Update)>)> + '_ {
    (0..RUNS).map(move |run| {
        let mut dice = Dice::new((seed << 20) + run);
        let celsius = profile(&mut dice);
        let kind = (seed + run) % 6;
        let faulty = with_fault(&celsius, kind, &mut dice);
        let healthy = Run { readings: celsius.iter().copied().map(Some).collect(), restart: None };
        (kind, updates(gyro, &faulty).into_iter().zip(updates(gyro, &healthy)).collect())
    })
}

#[test]
fn status_zero_is_never_wrong_by_a_fault() {
    let wrong = fraction(IMAGES, |seed| {
        let (image, after_step) = image(seed);
        let most_dph = MOST_DPH.max(MOST_PART * largest_rate_effect(&image)) + after_step;
        let gyro = Compensator::new(image);
        faults(seed, &gyro).enumerate().any(|(run, (kind, pairs))| {
            let off = |(with, without): &(Update, Update)| {
                if with.status == Status::OK { (with.correction_dph - without.correction_dph).abs() } else { 0.0 }
            };
            let (at, worst) =
                pairs.iter().map(off).enumerate().fold((0, 0.0), |best, now| if now.1 > best.1 { now } else { best });
            if worst > most_dph {
                println!("WRONG image {seed}, run {run}, kind {kind}: {worst:.3} of {most_dph:.3} °/h at {at}");
            }
            worst > most_dph
        })
    });
    evidence("an image of which one of 50 faults is wrong beyond its bound with status 0", wrong, "≤ 0", IMAGES);
}

/// The number next to the status, with any status: no update is off by more. It is of use, too: after a fault it falls to that of status 0.
#[test]
fn no_update_is_off_by_more_than_its_bound() {
    let wrong = fraction(IMAGES, |seed| {
        let gyro = Compensator::new(image(seed).0);
        faults(seed, &gyro).enumerate().any(|(run, (kind, pairs))| {
            let beyond = pairs.iter().position(|(with, without)| {
                let off_dph = (with.correction_dph - without.correction_dph).abs();
                with.bound.milli_dph() != UNBOUNDED && off_dph > f64::from(with.bound.milli_dph()) * 1e-3
            });
            if let Some(at) = beyond {
                let (with, without) = pairs[at];
                let off_dph = (with.correction_dph - without.correction_dph).abs();
                println!("BEYOND image {seed}, run {run}, kind {kind}: {off_dph:.3} at {at}, {:?}", with);
            }
            let least = pairs.iter().map(|(with, _)| with.bound.milli_dph()).min();
            let falls = pairs
                .iter()
                .filter(|(with, _)| with.status == Status::OK)
                .all(|(with, _)| Some(with.bound.milli_dph()) == least);
            assert!(falls, "image {seed}, run {run}, kind {kind}");
            beyond.is_some()
        })
    });
    evidence("an image of which one of 50 faults is wrong beyond the number next to its status", wrong, "≤ 0", IMAGES);
}

/// A thermometer that reads 85 °C in its first samples after power-on, in each training log, and a fault of 22 °C in service: the limits of a
/// step are those of the log without these samples.
#[test]
fn wrong_first_samples_of_the_logs_let_no_step_pass() {
    let limits = |is_wrong: bool| {
        let log = |seed: u64| {
            let mut log =
                Bench { cycles: 1, thermometer_step_c: 0.0625, ..Bench::new(seed, &crate::hostile::usual) }.log();
            log.rows.iter_mut().take(2).filter(|_| is_wrong).for_each(|row| row[1] = 85.0);
            log
        };
        let unit = fit(vec![log(1), log(2)], &Bench::setup(), "bias 3, rate 0").unwrap();
        let main = &unit.axes[0].correction.inputs[0];
        (
            main.max_step,
            main.max_rate_per_s,
            encode(&unit, &unit.axes[0], [0; 32], 1).unwrap().inputs()[0].largest_step_q8,
        )
    };
    let ((step_c, rate_cps, _), (wrong_step_c, wrong_rate_cps, of_image)) = (limits(false), limits(true));
    // Four steps of the thermometer, and three times 1 °C/min.
    assert_eq!((step_c, wrong_step_c), (0.25, 0.25));
    assert!((wrong_rate_cps / rate_cps - 1.0).abs() < 0.05 && rate_cps < 0.06, "{rate_cps} {wrong_rate_cps}");
    assert!(of_image <= 2 * 256, "{of_image}");
}
