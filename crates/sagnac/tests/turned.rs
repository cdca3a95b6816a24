//! A run at one rate of the table; many records are in `measured/verify/turned.rs`.

use crate::hostile::table::{Row, Table};
use crate::measured::verify::turned::calibrated;
use crate::support::reader;
use sagnac::Limits;
use sagnac::verify::{Correction, VerifyOptions, verify};

/// Runs of one rate each: what the scale factor is off would be read as a bias of 3 ppm of 36,000 °/h. No bias is known then.
#[test]
fn a_run_of_one_rate_tells_no_bias() {
    let limits: Limits = "bias_repeatability_dph_max = 0.035".parse().unwrap();
    let unit = calibrated(10.0, 0.0);
    let correction = Correction::from_calibration(unit).unwrap();
    let setup = Table::setup();
    for seed in 0..10 {
        let run = |start_s: f64, turns: fn(Row) -> f64| {
            reader(Table { turns, start_s, ..Table::new(60_000 + seed) }.log(), &setup)
        };
        let logs = vec![run(0.0, |_| 1.0), run(200_000.0, |_| 0.8)];
        let proof = verify(&correction, logs, &setup, VerifyOptions::default()).unwrap().limits(&limits).unwrap();
        let limit = &proof.verification.axes[0].limits[0];
        assert!(limit.pass == Some(false) && limit.value.is_none(), "{limit:?}");
    }
}
