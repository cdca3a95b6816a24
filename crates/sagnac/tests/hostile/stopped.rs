//! Tests that end when they are complete, next to the full ones, each checked against an independent retest.

use rayon::prelude::*;
use sagnac::Limits;
use sagnac::calibration::Calibration;
use sagnac::fit::{FitOptions, Model, calibrate_with_report_data};
use sagnac::plan::{EnoughRequest, enough};
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac::window::WindowBuilder;

use super::{Bench, Dice, Now};
use crate::IS_STUDY;
use crate::support::evidence::{Bounds, Records, ratio};
use crate::support::reader;
use crate::support::rows::Rows;

/// Hours of the full test: three cycles.
pub(crate) const FULL_HOURS: f64 = 20.0;
/// A judgement is made so often, h, and must hold this many times in a row. The bench asks for half an hour only, and judges each minute.
const EVERY_H: f64 = if IS_STUDY { 1.0 } else { 2.0 };
/// Interval of a row, s.
const ROW_S: f64 = 5.0;
const IN_A_ROW: u32 = 2;
/// Kinds of drift.
const KINDS: u64 = 5;

/// The tests of many units.
#[derive(Debug)]
pub(crate) struct Stopped(Vec<One>);

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct One {
    /// It ended before the full one.
    pub(crate) ended: bool,
    /// Its hours over those of the full one.
    pub(crate) hours: f64,
    /// The retest met all limits, after the test that ended, and after the full one.
    pub(crate) met: bool,
    pub(crate) met_full: bool,
}

impl Stopped {
    /// Part of the units of which it is true.
    pub(crate) fn part(&self, is: fn(&One) -> bool) -> f64 {
        self.0.iter().filter(|one| is(one)).count() as f64 / self.0.len() as f64
    }

    /// Asserts the mean of the hours over those of the full test.
    pub(crate) fn assert_hours(&self, claim: &str, bounds: impl Into<Bounds>, units: Records) {
        let mean = |of: &[One]| of.iter().map(|one| one.hours).sum::<f64>() / of.len() as f64;
        ratio(claim, &self.0, mean, bounds, units);
    }
}

/// Drift of a unit.
pub(crate) type Unit = Box<dyn Fn(Now) -> f64 + Sync>;

/// A unit of the first kind with a memory of the direction, ±0.04 °/h, that grows between the eighth and the fourteenth hour: heating and hot, cooling and
/// cold.
pub(crate) fn growing_memory(number: u64) -> Unit {
    let drift = unit(KINDS * number);
    let memory = |now: Now| {
        let direction = if (90.0..290.0).contains(&(now.hours * 60.0 % 400.0)) { 1.0 } else { -1.0 };
        0.04 * direction * ((now.hours - 8.0) / 6.0).clamp(0.0, 1.0)
    };
    Box::new(move |now| drift(now) + memory(now))
}

/// A unit: its drift, of one of five kinds, with coefficients of its own.
pub(crate) fn unit(number: u64) -> Unit {
    let mut dice = Dice::new(5_000_000 + number);
    let mut near = |mean: f64| mean * (1.0 + 0.3 * dice.normal());
    let (a, b, c, rate) = (near(0.12), near(-0.05), near(0.03), near(0.04));
    let (knee_c, width_c, lag) = (near(25.0), near(15.0), near(0.03));
    match number % KINDS {
        // A cubic with a rate effect: what the models can hold.
        0 => Box::new(move |now| a * now.u() + b * now.u().powi(2) + c * now.u().powi(3) + rate * now.cpm),
        // A knee, which no polynomial holds exactly.
        1 => Box::new(move |now| a * now.u() + 0.04 * ((now.celsius - knee_c) / width_c).tanh() + rate * now.cpm),
        // An exponential.
        2 => Box::new(move |now| a * (0.8 * now.u()).exp() + rate * now.cpm * (1.0 + 0.4 * now.u())),
        // A fourth order, and a rate effect behind a lag.
        3 => Box::new(move |now| a * now.u() + b * now.u().powi(4) + rate * now.lagged_cpm),
        // Hardly any drift.
        _ => Box::new(move |now| 0.1 * a * now.u() + lag * 0.2 * now.cpm),
    }
}

fn bench(drift: &dyn Fn(Now) -> f64, seed: u64, [b_dph, k_dph_rt_h]: [f64; 2]) -> Bench<'_> {
    Bench { cycles: 3, row_s: ROW_S, rate_lag_s: 240.0, b_dph, k_dph_rt_h, ..Bench::new(seed, drift) }
}

/// The calibration of a test that ends when it is complete, with its hours; and that of the full one.
fn tested(log: &Rows<3>, request: &EnoughRequest) -> (Option<(f64, Calibration)>, Calibration) {
    let setup = Bench::setup();
    let fit = |windows| calibrate_with_report_data(windows, &setup, &FitOptions::new(Model::Auto));
    // The first rows, read as they came until then.
    let windows = |rows: usize| {
        let mut part = reader(Rows { rows: log.rows[..rows].to_vec(), ..*log }, &setup);
        let mut builder = WindowBuilder::new(part.shape(), &setup).unwrap();
        while let Some(batch) = part.next_batch().unwrap() {
            builder.push(batch).unwrap();
        }
        builder.so_far(part.summary())
    };
    let (mut stopped, mut in_a_row, mut due_h) = (None, 0, EVERY_H);
    let whole = windows(log.rows.len());
    let first_ns = whole.runs[0].start_ns;
    let (full, _) = fit(whole).unwrap();
    while stopped.is_none() && due_h < FULL_HOURS {
        let so_far = windows((due_h * 3600.0 / ROW_S) as usize);
        assert_eq!(so_far.runs[0].start_ns, first_ns);
        let made = fit(so_far).ok().filter(|(made, drawn)| enough(made, drawn, request).met);
        in_a_row = if made.is_some() { in_a_row + 1 } else { 0 };
        stopped = made.filter(|_| in_a_row >= IN_A_ROW).map(|(made, _)| (due_h, made));
        due_h += EVERY_H;
    }
    (stopped, full)
}

fn accepted(made: &Calibration, retest: Rows<3>, limits: &Limits) -> bool {
    let correction = Correction::from_calibration(made.clone()).unwrap();
    let setup = Bench::setup();
    let proof = verify(&correction, vec![reader(retest, &setup)], &setup, VerifyOptions::default()).unwrap();
    proof.limits(limits).unwrap().passed()
}

/// Tests so many units, of which each temperature is passed so often.
pub(crate) fn stopped(units: Records, limits: &Limits, passes: u32, unit: fn(u64) -> Unit) -> Stopped {
    let mut request = EnoughRequest::new(limits.clone());
    request.passes = passes;
    request.span_c = Some([-40.0, 69.0]);
    let one = |number: u64| {
        let drift = unit(number);
        // Units without flicker and walk, with little, and with much of them.
        let noise = [[0.0, 0.0], [0.001, 0.001], [0.002, 0.002]][(number / KINDS % 3) as usize];
        let (stopped, full) = tested(&bench(&drift, 10 * number + 1, noise).log(), &request);
        let retest = bench(&drift, 10 * number + 2, noise).standard().log();
        let met_full = accepted(&full, retest.clone(), limits);
        let (hours, met) = match &stopped {
            Some((hours, made)) => (*hours, accepted(made, retest, limits)),
            None => (FULL_HOURS, met_full),
        };
        One { ended: stopped.is_some(), hours: hours / FULL_HOURS, met, met_full }
    };
    Stopped(units.each().into_par_iter().map(one).collect())
}
