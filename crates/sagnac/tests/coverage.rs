//! A stated noise model; intervals over many records are in `measured/fit/coverage.rs`.

use crate::hostile::Bench;
use crate::measured::fit::coverage::weak_cubic;
use crate::support::fit;
use sagnac_log::setup::{Noise, Setup};

/// A stated noise model is that of the intervals: with what the gyro has they hold, and with ten times of it they are wider.
#[test]
fn a_stated_noise_model_wins() {
    let mut bench = Bench::new(5, &weak_cubic);
    (bench.cycles, bench.row_s, bench.k_dph_rt_h) = (1, 20.0, 0.01);
    let half = |noise: Option<Noise>| {
        let setup = Setup { noise, ..Bench::setup() };
        let made = fit(vec![bench.log()], &setup, "bias 3").unwrap();
        made.axes[0].predict(60.0).unwrap().curve_dph
    };
    let [white, own, more] =
        [(0.0, 0.0), (0.0, 0.01), (0.0, 0.1)].map(|(b, k)| half(Some(Noise::walk(0.003).slow(b, k))));
    assert!(white < 0.8 * own && 5.0 * own < more, "{white} {own} {more}");
    // Without a statement it is measured: within a factor of two and a half of the truth on one record.
    let measured = half(None);
    assert!(measured > own / 2.5 && measured < 2.5 * own, "{measured} {own}");
}
