//! Inputs crafted to abort, swell or hang a reader: deep, wide, long or huge, and all of them small as files.

use std::fmt::Write as _;
use std::sync::Arc;

use anyhow::{Context, Result};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, DictionaryArray, RecordBatch, StringArray};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions};
use sagnac_core::{Description, Image};

use super::{Case, Good, batch, case, good, gzip, of_columns, parquet};

/// A gzipped Parquet file whose schema is nested ten thousand deep.
const NEST: &[u8] = include_bytes!("../../../testdata/crafted/nest.gz");
/// Zstandard Parquet with a cell of 300 MB.
const CELL: &[u8] = include_bytes!("../../../testdata/crafted/cell.parquet");

pub(super) fn crafted(by: &Good) -> Result<Vec<Case>> {
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
        case("Parquet of 10 KB with a cell of 300 MB", "compensate unit.cal.json cell.parquet -o out.json")
            .file("unit.cal.json", by.record.clone())
            .file("cell.parquet", CELL)
            .place("cell.parquet"),
        case("Parquet whose rows all have the same text of 2 MiB", "compensate unit.cal.json log.parquet -o out.json")
            .file("unit.cal.json", by.record.clone())
            .file("log.parquet", parquet(&repeated_text()?))
            .place("note"),
        case("Arrow batch that announces a terabyte", "inspect log.arrow --arcsec-per-count 1")
            .file("log.arrow", announcing_a_terabyte()?)
            .place("log.arrow"),
        case("curve to 1e308", "allan curve.csv --report out.html")
            .file("curve.csv", "tau_s,adev_dph\n1,1\n2,1e308\n")
            .place("curve.csv"),
        case("curve of a record of 1e18 rows", "allan curve.csv --duration 9.9e11")
            .file("curve.csv", "tau_s,adev_dph\n1e-6,1\n2e-6,0.7\n1e3,1\n2e3,1\n")
            .place("--duration"),
        case("calibration with a number beyond any quantity", "compare unit.cal.json unit.cal.json --report out.html")
            .file("unit.cal.json", huge)
            .place("window_s"),
        case("calibration of 17 MB", "inspect unit.cal.json")
            .file("unit.cal.json", format!("{{\"format\": [{}]}}", vec!["[]"; 6_000_000].join(",")))
            .place("unit.cal.json"),
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

/// The good log with the same text in each row, which the file holds once.
fn repeated_text() -> Result<RecordBatch> {
    let batch = batch();
    let text = StringArray::from(vec!["x".repeat(2 << 20)]);
    let note = DictionaryArray::<Int32Type>::try_new(vec![0; batch.num_rows()].into(), Arc::new(text))?;
    let mut columns: Vec<(&str, ArrayRef)> =
        ["time_s", "temperature_c", "counts"].iter().zip(batch.columns()).map(|(n, c)| (*n, Arc::clone(c))).collect();
    columns.push(("note", Arc::new(note)));
    Ok(of_columns(columns))
}

/// The good log in a packed batch, whose first column announces 2^40 bytes.
fn announcing_a_terabyte() -> Result<Vec<u8>> {
    let options = IpcWriteOptions::default().try_with_compression(Some(CompressionType::ZSTD))?;
    let mut writer = FileWriter::try_new_with_options(Vec::new(), &batch().schema(), options)?;
    writer.write(&batch())?;
    let mut bytes = writer.into_inner()?;
    let length = (8 * batch().num_rows() as u64).to_le_bytes();
    let at = bytes.windows(8).position(|window| *window == length).context("no length of a column")?;
    bytes[at..at + 8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    Ok(bytes)
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
