//! Inputs crafted to abort, swell or hang a reader: deep, wide, long or huge, and all of them small as files.

use std::fmt::Write as _;

use sagnac_core::{Description, Image};

use super::{Case, Good, case, good, gzip};

/// A gzipped Parquet file whose schema is nested ten thousand deep.
const NEST: &[u8] = include_bytes!("../../../../testdata/crafted/nest.gz");

pub(super) fn crafted(by: &Good) -> anyhow::Result<Vec<Case>> {
    let fast = {
        let own = Image::decode(&by.image)?;
        let tick = Description { tick_ns: 1_000, period_ticks: 1, slew_ticks: 0, ..*own.description() };
        sagnac::export::image_bytes(&Image::new(tick)?)
    };
    let huge = by.record.replacen("\"window_s\": 100.0", "\"window_s\": 1e300", 1);
    Ok(vec![
        case("Parquet with a schema ten thousand deep", "inspect nest.gz").file("nest.gz", NEST).place("nest.gz"),
        case("255 columns of 41 rows that last for days", "inspect log.csv --arcsec-per-count 1 --window 200000")
            .file("log.csv", wide())
            .place("log.csv"),
        case("twelve million rows in a gzip of 70 KB", "inspect rows.gz --arcsec-per-count 1")
            .file("rows.gz", gzip(&[b"temperature_c,rate_dph\n".as_slice(), &b"20,1\n".repeat(12_000_000)].concat()))
            .place("rows.gz"),
        case("curve to 1e308", "allan curve.csv --report out.json")
            .file("curve.csv", "tau_s,adev_dph\n1,1\n2,1e308\n")
            .place("curve.csv"),
        case("curve of a record of 1e18 rows", "allan curve.csv --duration 9.9e11")
            .file("curve.csv", "tau_s,adev_dph\n1e-6,1\n2e-6,0.7\n1e3,1\n2e3,1\n")
            .place("--duration"),
        case("calibration with a number beyond any quantity", "compare unit.cal.json unit.cal.json --report out.json")
            .file("unit.cal.json", huge)
            .place("window_s"),
        case("a device without an end as setup", "calibrate log.csv --setup /dev/zero")
            .file("log.csv", good())
            .place("/dev/zero"),
        case("a device without an end as limits", "verify unit.cal.json log.csv --limits /dev/zero")
            .file("unit.cal.json", by.record.clone())
            .file("log.csv", good())
            .place("/dev/zero"),
        case("a device without an end as calibration", "export /dev/zero --to image -o out.json").place("/dev/zero"),
        case("a device without an end as key", "key sign unit.img --key /dev/zero --model A --counter 1 -o out.json")
            .file("unit.img", by.image.clone())
            .place("/dev/zero"),
        case("image with a temperature period of a microsecond", "compensate unit.img log.csv -o out.json")
            .file("unit.img", fast)
            .file("log.csv", good())
            .place("log.csv"),
    ])
}

/// 41 rows 1e5 s apart, each with 255 auxiliary columns: tracks every second would take 8 GB.
fn wide() -> String {
    let mut text = "time_s,temperature_c,counts".to_owned();
    for at in 0..255 {
        // Writing to a String cannot fail.
        let _ = write!(text, ",aux_a{at}");
    }
    text.push('\n');
    for row in 1..=41 {
        let _ = write!(text, "{},{},5", row * 100_000, 20 + row % 20);
        text.push_str(&",1".repeat(255));
        text.push('\n');
    }
    text
}
