//! The correction of a gyro over temperature with its 95 % interval, at rest and on a ramp.
//!
//! `cargo run --example evaluate_a_record`

use sagnac::{Model, Result, Setup};

fn main() -> Result<()> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/chamber");
    let bench = Setup::read(format!("{folder}/bench.toml"))?;
    // A stated model instead of the search: the orders of its series, in the words of `--model`.
    let model: Model = "bias 3, rate 0".parse()?;
    let calibration = sagnac::calibrate(&bench, [format!("{folder}/cycle-1.csv.gz")], model)?;

    println!("   °C   at rest, °/h            at 1 °C/min, °/h");
    for celsius in [-40.0, -10.0, 25.0, 50.0, 70.0] {
        let (rest, ramp) = (calibration.evaluate(celsius, 0.0)?, calibration.evaluate(celsius, 1.0)?);
        let half = |e: &sagnac::Evaluation| e.upper_dph.map_or(f64::NAN, |upper| upper - e.drift_dph);
        println!(
            "{celsius:5.0}  {:8.4} ± {:.4}   {:8.4} ± {:.4}",
            rest.drift_dph,
            half(&rest),
            ramp.drift_dph,
            half(&ramp)
        );
    }
    // Zero at the reference temperature and at rest: the correction removes the variation.
    assert!(calibration.evaluate(25.0, 0.0)?.drift_dph.abs() < 1e-12);
    assert!(!calibration.evaluate(90.0, 0.0)?.in_span, "outside the span the target says OUT_OF_SPAN");
    Ok(())
}
