//! What many calibrations of one truth show of its at-rest curve: error, coverage of the 95 % interval, models selected.

use rayon::prelude::*;
use sagnac::calibration::Calibration;
use sagnac_log::setup::Setup;

use super::{Bench, Now, usual};
use crate::support::at_rest;
use crate::support::evidence::{Bounds, Records, ratio};
use crate::support::fit;

pub(crate) type Truth = fn(Now) -> f64;

/// Temperatures at which the at-rest curve is compared, °C.
pub(crate) const AT_C: [f64; 9] = [-38.0, -25.0, -12.0, 0.0, 12.0, 36.0, 48.0, 58.0, 67.0];

/// What some records show.
#[derive(Debug, Default, Clone)]
pub(crate) struct Shown {
    /// Part of the intervals of the at-rest curve that hold the truth.
    pub(crate) coverage: f64,
    /// Mean half width of the intervals, °/h.
    pub(crate) width_dph: f64,
    /// Models that were selected, with how often.
    pub(crate) models: std::collections::BTreeMap<String, usize>,
    /// Mean square error of each record's curve, (°/h)².
    pub(crate) squares: Vec<f64>,
    /// Part of the records that show more noise than the setup states.
    pub(crate) louder: f64,
    /// Part of the records that say that their rows contradict the model.
    pub(crate) lacks: f64,
}

/// The usual gyro from four cycles, so that the calibration adds little of its own noise.
pub(crate) fn calibrated() -> Calibration {
    let logs = (1..=4).map(|seed| Bench::new(seed, &usual).log()).collect();
    fit(logs, &Bench::setup(), "bias 3, rate 0").unwrap()
}

pub(crate) fn shown(
    records: impl Into<Records>,
    runs: u64,
    truth: Truth,
    model: &str,
    change: fn(&mut Bench<'_>),
) -> Shown {
    shown_by(&Bench::setup(), records, runs, truth, model, change)
}

/// The same with a setup.
pub(crate) fn shown_by(
    setup: &Setup,
    records: impl Into<Records>,
    runs: u64,
    truth: Truth,
    model: &str,
    change: fn(&mut Bench<'_>),
) -> Shown {
    let seeds = records.into().each();
    let records = seeds.end;
    let one = |record: u64| -> Calibration {
        let logs = (0..runs).map(|run| {
            let mut bench = Bench::new(1000 * record + run, &truth);
            (bench.cycles, bench.row_s) = (1, 20.0);
            change(&mut bench);
            bench.log()
        });
        fit(logs.collect(), setup, model).unwrap()
    };
    let rest = |celsius: f64| truth(Now { celsius, cpm: 0.0, lagged_cpm: 0.0, slow_cpm: 0.0, hours: 0.0 });
    let each = |record: u64| {
        let made = one(record);
        let axis = &made.axes[0];
        let errors = AT_C.map(|celsius| {
            let (drift_dph, half_dph) = at_rest(axis, celsius);
            let off_dph = drift_dph - (rest(celsius) - rest(25.0));
            (off_dph, off_dph.abs() <= half_dph, half_dph)
        });
        let found = axis.fit.as_ref().unwrap();
        (axis.correction.model.clone(), [found.noise_exceeds_setup, found.lack_of_fit.is_some()], errors)
    };
    let all: Vec<_> = seeds.into_par_iter().map(each).collect();
    let mut out = Shown::default();
    let n = (all.len() * AT_C.len()) as f64;
    for (model, says, errors) in all {
        let [louder, lacks] = says.map(|said| f64::from(u8::from(said)) / records as f64);
        (out.louder, out.lacks) = (out.louder + louder, out.lacks + lacks);
        *out.models.entry(model).or_default() += 1;
        out.squares.push(errors.iter().map(|(error, ..)| error * error).sum::<f64>() / AT_C.len() as f64);
        for (_, holds, half) in errors {
            out.width_dph += half / n;
            out.coverage += f64::from(u8::from(holds)) / n;
        }
    }
    out
}

/// Asserts the error of one model's curve over that of another on the same records, root mean squares.
pub(crate) fn error_ratio(
    claim: &str,
    [found, best]: [&Shown; 2],
    bounds: impl Into<Bounds>,
    records: impl Into<Records>,
) {
    let pairs: Vec<[f64; 2]> = found.squares.iter().zip(&best.squares).map(|(a, b)| [*a, *b]).collect();
    let sum = |of: &[[f64; 2]], at: usize| of.iter().map(|pair| pair[at]).sum::<f64>();
    ratio(claim, &pairs, |of| (sum(of, 0) / sum(of, 1)).sqrt(), bounds, records);
}

/// Selected models with a term that the truth does not have.
pub(crate) fn useless(shown: &Shown, has: impl Fn(&str) -> bool) -> f64 {
    let all: usize = shown.models.values().sum();
    shown.models.iter().filter(|(model, _)| has(model)).map(|(_, n)| *n).sum::<usize>() as f64 / all as f64
}
