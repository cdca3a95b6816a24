//! Two lags of one thermometer, a fast and a slow one: found where there are two, refused where there is one, and the same on the
//! target. By a generator that shares no code with the program.

use crate::hostile::{Bench, Now, fraction};
use crate::support::evidence::evidence;
use crate::support::{fit, retest};
use rayon::prelude::*;
use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::export::{encode, image_bytes};
use sagnac_core::{Image, ValueSource};

const FAST_S: f64 = 200.0;
const SLOW_S: f64 = 2000.0;
/// °/h per °C/min behind the fast and the slow lag.
const EFFECTS: [f64; 2] = [0.5, -0.5];
const RECORDS: u64 = 60;
const TWO: &str = "bias 3, rate 0, slow rate 0";

fn cubic(now: Now) -> f64 {
    let u = now.u();
    0.3 * u - 0.1 * u * u + 0.1 * u * u * u
}

fn of_two(now: Now) -> f64 {
    cubic(now) + EFFECTS[0] * now.lagged_cpm + EFFECTS[1] * now.slow_cpm
}

fn of_one(now: Now) -> f64 {
    cubic(now) + EFFECTS[0] * now.lagged_cpm
}

/// One cycle of a bench whose block follows the chamber within minutes, so that ramps have corners.
fn log(seed: u64, drift: fn(Now) -> f64, fast_s: f64) -> Vec<u8> {
    let mut bench = Bench::new(seed, &drift);
    (bench.cycles, bench.block_lag_s, bench.rate_lag_s, bench.slow_lag_s) = (1, 300.0, fast_s, SLOW_S);
    bench.log()
}

fn calibrated(seed: u64, drift: fn(Now) -> f64, fast_s: f64, model: &str) -> sagnac::Result<Calibration> {
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

/// A rate effect without a lag beside a slow one: the fast lag is not resolved, and the rest covers all the same.
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
    let all: Vec<[bool; 4]> = (0..RECORDS).into_par_iter().map(of_record).collect();
    std::array::from_fn(|i| all.iter().filter(|held| held[i]).count() as f64 / RECORDS as f64)
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

/// The record as JSON and its image hold both lags. The target's own code leaves on the log of the fit what the host's fit left, and on
/// a second log less than half of what one lag leaves.
#[test]
fn the_target_applies_both_lags() {
    let made = calibrated(1, of_two, FAST_S, TWO).unwrap();
    let axis = &made.axes[0];
    assert_eq!(Calibration::parse(&made.to_json().unwrap()).unwrap(), made);
    let [main, slow] = axis.correction.inputs.as_slice() else { panic!("{:?}", axis.correction.inputs) };
    assert_eq!((slow.name.as_str(), slow.repeats()), ("slow temperature_c", Some(main.name.as_str())));
    assert!(main.lag_s.unwrap().value * 3.0 <= slow.lag_s.unwrap().value);
    assert_eq!(axis.nonlinear().iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["lag", "slow lag"]);

    let image = encode(&made, axis, [0; 32], 1).unwrap();
    assert_eq!((image.format_minor(), image.inputs()[1].source), (4, ValueSource::Repeat { of: 0 }));
    assert_eq!(Image::decode(&image_bytes(&image)), Ok(image));

    let after = |made: &Calibration, seed: u64| {
        retest(made, log(seed, of_two, FAST_S), &Bench::setup()).axes[0].after.sigma_dph
    };
    let host = axis.residual().unwrap().sigma_dph;
    let one = calibrated(1, of_two, FAST_S, "bias 3, rate 0").unwrap();
    let (own, with, without) = (after(&made, 1), after(&made, 2), after(&one, 2));
    println!("residual σ: host {host:.5}, target {own:.5}; second log, two lags {with:.5}, one {without:.5} °/h");
    assert!((own / host - 1.0).abs() < 0.02, "{own} {host}");
    assert!(with < 0.5 * without, "{with} {without}");
}

/// A record whose slow lag is not the slower one, or that repeats what it does not have, is refused.
#[test]
fn a_record_with_lags_out_of_order_is_refused() {
    let made = calibrated(1, of_two, FAST_S, TWO).unwrap();
    let changed = |change: &dyn Fn(&mut AxisCalibration)| {
        let mut made = made.clone();
        change(&mut made.axes[0]);
        made.to_json().and_then(|text| Calibration::parse(&text)).map_err(|e| e.to_string())
    };
    assert!(changed(&|_| ()).is_ok());
    let swapped = |axis: &mut AxisCalibration| axis.correction.inputs[1].lag_s.as_mut().unwrap().value = 100.0;
    let other = |axis: &mut AxisCalibration| {
        axis.correction.inputs[1].source = sagnac::calibration::InputSource::Repeat("cavity".to_owned());
    };
    let narrow = |axis: &mut AxisCalibration| axis.correction.inputs[1].valid_range[0] += 1.0;
    for change in [&swapped as &dyn Fn(&mut AxisCalibration), &other, &narrow] {
        let refusal = changed(change).unwrap_err();
        assert!(refusal.contains("slow temperature_c"), "{refusal}");
    }
}
