//! Two lags of one thermometer, a fast and a slow one: found where there are two, refused where there is one, and the same on the
//! target. By a generator that shares no code with the program.

use crate::hostile::{Bench, Now, fraction};
use crate::support::evidence::{Records, evidence};
use crate::support::fit;
use crate::support::rows::Rows;
use rayon::prelude::*;
use sagnac::calibration::{AxisCalibration, Calibration};

pub(crate) const FAST_S: f64 = 200.0;
const SLOW_S: f64 = 2000.0;
/// °/h per °C/min behind the fast and the slow lag.
const EFFECTS: [f64; 2] = [0.5, -0.5];
const RECORDS: Records = Records::new(60).few(30);
pub(crate) const TWO: &str = "bias 3, rate 0, slow rate 0";

fn cubic(now: Now) -> f64 {
    let u = now.u();
    0.3 * u - 0.1 * u * u + 0.1 * u * u * u
}

pub(crate) fn of_two(now: Now) -> f64 {
    cubic(now) + EFFECTS[0] * now.lagged_cpm + EFFECTS[1] * now.slow_cpm
}

fn of_one(now: Now) -> f64 {
    cubic(now) + EFFECTS[0] * now.lagged_cpm
}

/// One cycle of a bench whose block follows the chamber within minutes, so that ramps have corners.
pub(crate) fn log(seed: u64, drift: fn(Now) -> f64, fast_s: f64) -> Rows<3> {
    let mut bench = Bench::new(seed, &drift);
    (bench.cycles, bench.block_lag_s, bench.rate_lag_s, bench.slow_lag_s) = (1, 300.0, fast_s, SLOW_S);
    bench.log()
}

pub(crate) fn calibrated(seed: u64, drift: fn(Now) -> f64, fast_s: f64, model: &str) -> sagnac::Result<Calibration> {
    fit(vec![log(seed, drift, fast_s)], &Bench::setup(), model)
}

/// Fast lag, slow lag, and their two coefficients, each with its σ.
fn estimates(axis: &AxisCalibration) -> [(f64, f64); 4] {
    let lag = |lag: Option<sagnac::calibration::Lag>| {
        lag.map_or((f64::NAN, 0.0), |lag| (lag.value, lag.sigma.unwrap_or(0.0)))
    };
    let of = |name: &str| {
        let term = axis.correction.terms.iter().find(|term| axis.name_of(term) == name).unwrap();
        (term.value, term.sigma.unwrap())
    };
    [lag(axis.lag_s()), lag(axis.slow_lag_s()), of("rate 0"), of("slow rate 0")]
}

#[test]
fn two_lags_are_recovered_within_their_intervals() {
    let held = covered(FAST_S);
    evidence("95 % interval of the fast of two lags covers", held[0], "≥ 0.9", RECORDS);
    evidence("95 % interval of the slow of two lags covers", held[1], "≥ 0.9", RECORDS);
    evidence("95 % interval of the rate coefficient behind the fast of two lags covers", held[2], "≥ 0.9", RECORDS);
    evidence("95 % interval of the rate coefficient behind the slow of two lags covers", held[3], "≥ 0.9", RECORDS);
}

/// A rate effect without a lag next to a slow one: the fast lag is not resolved, and the rest covers all the same.
#[test]
fn a_slow_lag_beside_none_is_recovered() {
    let held = covered(0.1);
    evidence("95 % interval of a lag of 2,000 s beside a rate effect without one covers", held[1], "≥ 0.9", RECORDS);
    evidence("95 % interval of the rate coefficient without a lag beside a slow one covers", held[2], "≥ 0.9", RECORDS);
    evidence("95 % interval of the rate coefficient of a slow lag beside none covers", held[3], "≥ 0.9", RECORDS);
}

/// Part of the records in which the intervals of [`estimates`] cover.
fn covered(fast_s: f64) -> [f64; 4] {
    let truth = [fast_s, SLOW_S, EFFECTS[0], EFFECTS[1]];
    let of_record = |seed: u64| -> [bool; 4] {
        let made = calibrated(seed, of_two, fast_s, TWO).unwrap();
        let axis = &made.axes[0];
        let t = axis.residual().unwrap().t_quantile_975;
        let found = estimates(axis);
        if seed < 3 {
            println!("{found:?}");
        }
        std::array::from_fn(|i| (found[i].0 - truth[i]).abs() <= t * found[i].1)
    };
    let all: Vec<[bool; 4]> = RECORDS.each().into_par_iter().map(of_record).collect();
    std::array::from_fn(|i| all.iter().filter(|held| held[i]).count() as f64 / RECORDS.count() as f64)
}

/// Where there is one lag, a pair of lags means nothing: it is refused, and `auto` does not select it.
#[test]
fn one_lag_does_not_become_two() {
    let refused = |lag_s: f64| {
        fraction(RECORDS, |seed| {
            let refusal = calibrated(seed, of_one, lag_s, TWO).err();
            refusal.is_some_and(|error| error.to_string().contains("do not separate the two lags of temperature_c"))
        })
    };
    evidence("two lags are refused where there is one, of 60 s", refused(60.0), "≥ 0.95", RECORDS);
    evidence("two lags are refused where there is one, of 600 s", refused(600.0), "≥ 0.95", RECORDS);
    let second = |lag_s: f64| {
        fraction(RECORDS, |seed| {
            let made = calibrated(seed, of_one, lag_s, "auto").unwrap();
            made.axes[0].correction.model.contains("slow rate")
        })
    };
    evidence("`auto` selects a second lag where there is one, of 60 s", second(60.0), "≤ 0.05", RECORDS);
    evidence("`auto` selects a second lag where there is one, of 600 s", second(600.0), "≤ 0.05", RECORDS);
}

#[test]
fn auto_finds_the_second_lag() {
    let found = fraction(RECORDS, |seed| {
        let made = calibrated(seed, of_two, FAST_S, "auto").unwrap();
        made.axes[0].correction.model.contains("slow rate")
    });
    evidence("`auto` selects the second of two lags", found, "≥ 0.95", RECORDS);
}
