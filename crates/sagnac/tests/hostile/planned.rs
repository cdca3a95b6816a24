//! A planned test with a prior next to the full one without, the standard profile, on many units, each checked against an independent retest.

use std::sync::OnceLock;

use rayon::prelude::*;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Model, UnitPrior, calibrate};
use sagnac::plan::{Chamber, Plan, PlanRequest, plan};
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac::window::WindowBuilder;
use sagnac_log::setup::Noise;

use super::lots::{Fleet, Gyro, MODEL, OF_UNITS, gyro};
use super::{Bench, Dice, N_DEG_RT_H, QUANTUM_ARCSEC};
use crate::support::at_rest;
use crate::support::evidence::Records;
use crate::support::reader;
use crate::support::rows::Rows;
use sagnac::Limits;

/// Quantization of a counter that is read as differences, arcsec: σ of a uniform part of a count.
const Q_ARCSEC: f64 = QUANTUM_ARCSEC * 0.288_675;

/// What came of many units.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) plan: Plan,
    /// Part of them that were refused by the prior's gate and need the full test.
    pub(crate) refused: f64,
    /// Part of the others whose retest met all limits, after the planned test with the prior.
    pub(crate) planned: f64,
    /// Part of the same whose retest met all limits after the full test without it, its model known.
    pub(crate) full: f64,
    /// Part of the others whose correction has an error within half of the limits on curve and rate.
    pub(crate) within_half: f64,
    /// Part of the 95 % intervals of the curve that hold.
    pub(crate) covered: f64,
    /// Part of units six σ odd that are refused: in the slope, the second order, the third, the rate effect.
    pub(crate) odd: [f64; 4],
}

/// What came of one: limits met after the planned and the full test, and how good the planned one's correction is.
struct Tested {
    met: [bool; 2],
    is_within_half: bool,
    held: f64,
}

/// The chamber of the planned test: steps of °C, °C/min and min.
static STEPS: OnceLock<Vec<[f64; 3]>> = OnceLock::new();

fn planned_c(minutes: f64) -> f64 {
    let (mut from, mut left) = (20.0, minutes);
    for [to, rate, soak] in STEPS.get().unwrap() {
        let ramp = (to - from).abs() / rate;
        if left < ramp {
            return from + (to - from) * left / ramp;
        }
        left -= ramp;
        if left < *soak {
            return *to;
        }
        (left, from) = (left - soak, *to);
    }
    from
}

/// Plans for the second lot of a fleet, and tests so many of its next units.
pub(crate) fn compared(units: Records) -> Outcome {
    let odd_units = units.part(4);
    let units = units.count();
    let fleet = Fleet::new(1, 3, |bench| *bench = bench.clone().standard());
    let (prior, limits) = (fleet.of_lot(), Limits::named_or_read("navigation-grade").unwrap());
    let mut chamber = Chamber::new(20.0, vec![1.0]);
    chamber.block_lag_min = 20.0;
    let noise = Noise::walk(N_DEG_RT_H).quantized(Q_ARCSEC);
    let plan = plan(&PlanRequest::new(prior.clone(), noise, limits.clone(), chamber)).unwrap();
    let steps = plan.steps.iter().map(|step| [step.to_c, step.rate_cpm, step.soak_min]).collect();
    assert_eq!(STEPS.get_or_init(|| steps).len(), plan.steps.len());
    let short_of = |gyro: Gyro, seed: u64| {
        gyro.log(seed, |bench| {
            (bench.row_s, bench.hours, bench.chamber_c) = (5.0, Some(plan.hours), planned_c);
        })
    };
    let one = |unit: u64| {
        let seed = 77_000_000 + 10 * unit;
        let gyro = gyro(fleet.lots[1], &mut Dice::new(seed));
        let short = short_of(gyro, seed + 1);
        let full = |seed: u64| gyro.log(seed, |bench| *bench = Bench { row_s: 5.0, ..bench.clone() }.standard());
        let by_plan = calibrated(short, Some(&prior)).ok()?;
        let by_full = calibrated(full(seed + 2), None).unwrap();
        let retest = full(seed + 3);
        let met = [&by_plan, &by_full].map(|made| accepted(made, retest.clone(), &limits));
        let (is_within_half, held) = values(&by_plan, gyro, &limits);
        Some(Tested { met, is_within_half, held })
    };
    let odd = |parameter: usize| {
        super::fraction(odd_units, |unit| {
            let mut of = fleet.lots[1];
            of[parameter] += if unit % 2 == 0 { 6.0 } else { -6.0 } * OF_UNITS[parameter];
            let seed = 88_000_000 + 10 * unit + parameter as u64;
            calibrated(short_of(gyro(of, &mut Dice::new(seed)), seed), Some(&prior)).is_err()
        })
    };
    let odd = [0, 1, 2, 3].map(odd);
    let all: Vec<_> = (0..units).into_par_iter().map(one).collect();
    let done: Vec<Tested> = all.into_iter().flatten().collect();
    let part = |of: f64| of / done.len() as f64;
    let count = |is: &dyn Fn(&Tested) -> bool| part(done.iter().filter(|one| is(one)).count() as f64);
    Outcome {
        odd,
        refused: 1.0 - done.len() as f64 / units as f64,
        planned: count(&|one| one.met[0]),
        full: count(&|one| one.met[1]),
        within_half: count(&|one| one.is_within_half),
        covered: part(done.iter().map(|one| one.held).sum()),
        plan,
    }
}

fn calibrated(log: Rows<3>, prior: Option<&UnitPrior>) -> sagnac::Result<Calibration> {
    let setup = Bench::setup();
    let model = if prior.is_some() { Model::Auto } else { MODEL.parse()? };
    let options = FitOptions::new(model).prior(prior.cloned());
    calibrate(WindowBuilder::read_all(vec![reader(log, &setup)], &setup)?.finish(), &setup, &options)
}

fn accepted(made: &Calibration, log: Rows<3>, limits: &Limits) -> bool {
    let setup = Bench::setup();
    let correction = Correction::from_calibration(made.clone()).unwrap();
    let proof = verify(&correction, vec![reader(log, &setup)], &setup, VerifyOptions::default()).unwrap();
    proof.limits(limits).unwrap().passed()
}

/// True where the correction's own error is within half of the limits on curve and rate; the part of its intervals that hold.
fn values(made: &Calibration, gyro: Gyro, limits: &Limits) -> (bool, f64) {
    let axis = &made.axes[0];
    let celsius: Vec<f64> = (0..12).map(|at| -40.0 + 10.0 * f64::from(at)).collect();
    let from = gyro.curve(axis.reference_c());
    let mut held = 0.0;
    let errors: Vec<f64> = celsius
        .iter()
        .map(|celsius| {
            let (drift_dph, half_dph) = at_rest(axis, *celsius);
            let off_dph = drift_dph - (gyro.curve(*celsius) - from);
            held += f64::from(u8::from(off_dph.abs() <= half_dph));
            off_dph
        })
        .collect();
    let mean = errors.iter().sum::<f64>() / 12.0;
    let rms = (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / 12.0).sqrt();
    let most = errors.iter().map(|error| (error - mean).abs()).fold(0.0, f64::max);
    let rate_error =
        |celsius: &f64| axis.rate_effect(*celsius).unwrap()[0] - gyro.rate[0] - gyro.rate[1] * (celsius - 15.0) / 55.0;
    let rate = (celsius.iter().map(rate_error).sum::<f64>() / 12.0).abs();
    let half = |limit: Option<f64>| 0.5 * limit.unwrap();
    let is_within = rms <= half(limits.temperature_residual_dph_max)
        && most <= half(limits.plateau_offset_dph_max)
        && rate <= half(limits.drift_dph_per_cpm_max)
        && 2.0 * rate <= half(limits.hysteresis_dph_max);
    (is_within, held / 12.0)
}
