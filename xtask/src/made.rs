//! Files that the project made: each can be made anew, and tests hold that they are what this makes.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder};
use sagnac::calibration::Calibration;
use sagnac::export::{Polynomial, encode, image_bytes, import};
use sagnac::setup::Setup;
use sagnac_sim::{LaggedChamber, csv_bytes};

use crate::checks::root;

/// Three cycles of the domain notes' chamber, a row every 5 s.
pub(crate) fn testdata() -> Result<()> {
    let folder = root().join("testdata/chamber");
    fs::create_dir_all(&folder)?;
    let rig = LaggedChamber { row_s: 5, ..LaggedChamber::domain_notes() };
    for cycle in 1..=3_u64 {
        let path = folder.join(format!("cycle-{cycle}.csv.gz"));
        // No name and no time in the gzip header: the same rows give the same bytes.
        let mut gz = GzBuilder::new().write(fs::File::create(&path)?, Compression::best());
        gz.write_all(&csv_bytes(rig.run(cycle)))?;
        gz.finish()?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// The JSON schema of the calibration record.
pub(crate) fn schema() -> Result<()> {
    let schema = schemars::schema_for!(Calibration);
    let mut text = serde_json::to_string_pretty(&schema)?;
    text.push('\n');
    write(&root().join("docs/calibration.schema.json"), text.as_bytes())
}

/// The image of docs/image-format.md: the paper's curve.
pub(crate) fn hexdump() -> Result<()> {
    let setup = Setup {
        serial: Some("PAPER-RIG".to_owned()),
        arcsec_per_count: Some(1.059),
        quantum: Some(0.25),
        ..Setup::default()
    };
    let polynomial = Polynomial { coefficients: vec![0.85, -46.0, 1043.39], window_s: 100.0, span_c: [17.94, 36.18] };
    let calibration = import(&polynomial, &setup)?;
    let axis = calibration.axes.first().context("no axis")?;
    // No parent: the example must not change with the program's version.
    let bytes = image_bytes(&encode(&calibration, axis, [0; 32], 1)?);
    let folder = root().join("testdata/image");
    fs::create_dir_all(&folder)?;
    write(&folder.join("paper.img"), &bytes)?;
    for (row, chunk) in bytes.chunks(16).enumerate() {
        let hex: Vec<String> = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
        println!("{:4}  {}", row * 16, hex.join(" "));
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    println!("wrote {}", path.display());
    Ok(())
}
