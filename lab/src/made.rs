//! Files that the project made: each can be made anew, and tests hold that they are what this makes.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder};
use sagnac::calibration::Calibration;
use sagnac::export::{Polynomial, encode, image_bytes, import};
use sagnac_log::setup::Setup;
use sagnac_sim::{LaggedChamber, csv_bytes};
use xtask::shell::{root, said, text};

use crate::program;

/// Three cycles of the domain notes' chamber, a row every 5 s.
pub(crate) fn testdata() -> Result<()> {
    let folder = root().join("testdata/chamber");
    fs::create_dir_all(&folder)?;
    for cycle in 1..=3 {
        // No name and no time in the gzip header: the same rows give the same bytes.
        let mut gz = GzBuilder::new().write(Vec::new(), Compression::best());
        gz.write_all(&chamber_cycle(cycle))?;
        write(&folder.join(format!("cycle-{cycle}.csv.gz")), &gz.finish()?)?;
    }
    Ok(())
}

fn chamber_cycle(cycle: u64) -> Vec<u8> {
    csv_bytes(LaggedChamber { row_s: 5, ..LaggedChamber::domain_notes() }.run(cycle))
}

/// The manual, as the program prints it.
pub(crate) fn cli() -> Result<()> {
    let manual = said(60, text(&program::sagnac()?)?, &["manual", "markdown"], &root())?;
    write(&root().join("docs/reference/cli.md"), manual.as_bytes())
}

/// The JSON schema of the calibration record.
pub(crate) fn schema() -> Result<()> {
    write(&root().join("docs/reference/calibration.schema.json"), schema_text()?.as_bytes())
}

fn schema_text() -> Result<String> {
    let schema = schemars::schema_for!(Calibration);
    Ok(serde_json::to_string_pretty(&schema)? + "\n")
}

/// The image of docs/reference/image-format.md.
pub(crate) fn hexdump() -> Result<()> {
    let bytes = paper_image()?;
    let folder = root().join("testdata/image");
    fs::create_dir_all(&folder)?;
    write(&folder.join("paper.img"), &bytes)?;
    print!("{}", dump(&bytes));
    Ok(())
}

/// The paper's curve as an image. No parent: the example must not change with the program's version.
fn paper_image() -> Result<Vec<u8>> {
    let setup = Setup {
        serial: Some("PAPER-RIG".to_owned()),
        arcsec_per_count: Some(1.059),
        quantum: Some(0.25),
        ..Setup::default()
    };
    let polynomial = Polynomial { coefficients: vec![0.85, -46.0, 1043.39], window_s: 100.0, span_c: [17.94, 36.18] };
    let calibration = import(&polynomial, &setup)?;
    let axis = calibration.axes.first().context("no axis")?;
    Ok(image_bytes(&encode(&calibration, axis, [0; 32], 1)?))
}

fn dump(bytes: &[u8]) -> String {
    let row = |(row, chunk): (usize, &[u8])| {
        let hex: Vec<String> = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{:4}  {}\n", row * 16, hex.join(" "))
    };
    bytes.chunks(16).enumerate().map(row).collect()
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    println!("wrote {}", path.display());
    Ok(())
}

/// What is committed is what is made.
#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::GzDecoder;
    use sagnac_core::Image;

    use super::*;

    #[test]
    fn the_logs_in_testdata_are_those_that_testdata_makes() {
        for cycle in 1..=3 {
            let file = fs::File::open(root().join(format!("testdata/chamber/cycle-{cycle}.csv.gz"))).unwrap();
            let mut committed = Vec::new();
            GzDecoder::new(file).read_to_end(&mut committed).unwrap();
            assert!(committed == chamber_cycle(cycle), "cycle {cycle}: run `cargo xtask testdata`");
        }
    }

    #[test]
    fn the_schema_is_that_of_the_types() {
        let committed = fs::read_to_string(root().join("docs/reference/calibration.schema.json")).unwrap();
        assert!(committed == schema_text().unwrap(), "run `cargo xtask schema`");
    }

    #[test]
    fn the_worked_example_of_the_image_format_is_an_image() {
        let bytes = paper_image().unwrap();
        assert_eq!(fs::read(root().join("testdata/image/paper.img")).unwrap(), bytes, "run `cargo xtask hexdump`");
        assert_eq!(Image::decode(&bytes).unwrap().serial(), Some("PAPER-RIG"));
        let page = fs::read_to_string(root().join("docs/reference/image-format.md")).unwrap();
        assert!(page.contains(&dump(&bytes)), "docs/reference/image-format.md shows another image");
    }
}
