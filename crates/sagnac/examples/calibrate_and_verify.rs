//! From two thermal cycles to a verdict on the standard retest, and the bytes for flash.
//!
//! `cargo run --example calibrate_and_verify`

use sagnac::{Limits, Model, Result, Setup};

fn main() -> Result<()> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/chamber");
    let log = |name: &str| format!("{folder}/{name}.csv.gz");
    let bench = Setup::read(format!("{folder}/bench.toml"))?;

    let calibration = sagnac::calibrate(&bench, [log("cycle-1"), log("cycle-2")], Model::Auto)?;
    for term in &calibration.axis('z')?.correction.terms {
        println!("{:?} over {}: {:.5} {}", term.shape, term.input, term.value, term.unit);
    }

    let proof = calibration.verify([log("retest")])?.limits(&Limits::read(format!("{folder}/limits.toml"))?)?;
    let axis = &proof.verification.axes[0];
    println!("σ {:.4} → {:.4} °/h", axis.before.sigma_dph, axis.after.sigma_dph);
    assert!(proof.passed());

    let image = calibration.image('z')?;
    println!("{} bytes for flash", image.len());
    assert!(image.starts_with(b"SAGNACIM"));
    Ok(())
}
