//! Do the 95 % intervals of a retest's own values hold: slopes, hysteresis, the residual over temperature, under white and slow noise? By a
//! generator that shares no code with the program. The truth of a value is that of the same drift without noise.

use crate::hostile;

use crate::hostile::{Bench, Now};
use crate::support::evidence::{Records, evidence};
use crate::support::rows::Rows;
use crate::support::{fit, reader};
use rayon::prelude::*;
use sagnac::verify::{AxisVerification, Correction, Estimate, VerifyOptions, verify};
use sagnac_log::setup::{Setup, WindowSize};

/// Records of each kind of noise.
const RECORDS: Records = Records::new(300).few(30);

/// What the calibration, which corrects nothing, leaves over.
fn put_in(now: Now) -> f64 {
    0.0003 * now.celsius + 0.01 * now.cpm + 0.01 * now.u().powi(2)
}

fn retest(unit: &Correction, setup: &Setup, log: Rows<3>) -> AxisVerification {
    let proof = verify(unit, vec![reader(log, setup)], setup, VerifyOptions::default()).unwrap();
    proof.verification.axes[0].clone()
}

const VALUES: [&str; 5] =
    ["slope over temperature", "slope over its rate", "hysteresis", "ramps less soaks", "residual over temperature"];

/// In the order of [`VALUES`].
fn values(axis: &AxisVerification) -> [Estimate; 5] {
    let residual = &axis.residual;
    [
        residual.temperature_slope,
        residual.rate_slope,
        axis.residual_diagnostics.hysteresis_dph,
        residual.ramp_offset_dph,
        residual.over_temperature_dph,
    ]
    .map(Option::unwrap)
}

/// Part of the records in which each value's interval holds its truth.
fn covered(setup: &Setup, records: Records, change: fn(&mut Bench<'_>)) -> [f64; 5] {
    let unit = fit(vec![Bench::new(1, &hostile::none).log()], setup, "bias 0").unwrap();
    let unit = Correction::from_calibration(unit).unwrap();
    let mut silent = Bench::retest(2, &put_in);
    silent.n_deg_rt_h = 1e-5;
    let truth = values(&retest(&unit, setup, silent.log()));
    let one = |seed: u64| {
        let mut bench = Bench::retest(7_000 + seed, &put_in);
        change(&mut bench);
        let found = values(&retest(&unit, setup, bench.log()));
        std::array::from_fn(|at| {
            f64::from(u8::from((found[at].value - truth[at].value).abs() <= 1.96 * found[at].sigma))
        })
    };
    let sum = |a: [f64; 5], b: [f64; 5]| std::array::from_fn(|at| a[at] + b[at]);
    records.each().into_par_iter().map(one).reduce(|| [0.0; 5], sum).map(|count| count / records.count() as f64)
}

#[test]
fn intervals_hold_under_white_and_slow_noise() {
    // Ramps less soaks are so near to the bound there that 300 records do not decide.
    const MORE: Records = Records::new(1000).few(30);
    type Noise = (&'static str, Records, fn(&mut Bench<'_>));
    let noises: [Noise; 5] = [
        ("white noise", RECORDS, |_| ()),
        ("B = 0.005 °/h", RECORDS, |bench| bench.b_dph = 0.005),
        ("B = 0.01 °/h", RECORDS, |bench| bench.b_dph = 0.01),
        ("K = 0.005 °/h/√h", RECORDS, |bench| bench.k_dph_rt_h = 0.005),
        ("Markov noise of 3,600 s", MORE, |bench| bench.markov = Some((3600.0, 0.01))),
    ];
    for (noise, records, change) in noises {
        let found = covered(&Bench::setup(), records, change);
        for (value, covered) in VALUES.iter().zip(found) {
            evidence(&format!("95 % interval of a retest's {value} covers, {noise}"), covered, "0.89 … 0.98", records);
        }
    }
}

/// In windows of 5 s the first 4,000 are 5.6 of 14.8 hours.
#[test]
fn intervals_hold_in_short_windows() {
    const FEWER: Records = Records::new(100).few(30);
    let setup = Setup { window: Some(WindowSize::Seconds(5.0)), ..Bench::setup() };
    let found = covered(&setup, FEWER, |bench| bench.k_dph_rt_h = 0.01);
    for (value, covered) in VALUES.iter().zip(found) {
        let claim = format!("95 % interval of a retest's {value} covers, K = 0.01 °/h/√h, windows of 5 s");
        evidence(&claim, covered, "0.89 … 1", FEWER);
    }
}
