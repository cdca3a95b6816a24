//! Logs: text by a grammar of dialects and headers, columns with the writers of Parquet and Arrow.

use std::sync::Arc;

use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float32Array, Float64Array, Int8Array, Int64Array, NullArray, RecordBatch,
    StringArray, StringViewArray, TimestampMicrosecondArray, UInt64Array, types::Int32Type,
};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions, StreamWriter};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression as Codec, GzipLevel, ZstdLevel};
use parquet::file::properties::{WriterProperties, WriterVersion};

use super::chance::Chance;
use crate::corpus::gzip;

/// Headers of a log's columns besides time.
const HEADERS: [&str; 22] = [
    "temperature_c",
    "temperature_k",
    "temperature_c_block",
    "temperature_c_cavity",
    "counts",
    "counts_x",
    "counts_y",
    "rate_dph",
    "rate_dps_z",
    "rate_radps",
    "reference_rate_dps",
    "table_angle_deg",
    "table_mark",
    "valid",
    "aux_volts",
    "aux_pressure",
    "comment",
    "operator",
    "Gyro [deg/s]",
    "temp",
    "temperature_f",
    "date",
];
const TIMES: [&str; 6] = ["time_s", "time_ms", "time_us", "time_ns", "time", "timestamp"];

/// A log: its name and bytes.
pub(super) struct Log {
    pub(super) name: &'static str,
    pub(super) bytes: Vec<u8>,
}

/// Further columns that a log can have next to each other.
const FURTHER: [&str; 6] =
    ["temperature_c_cavity", "temperature_c_mirror", "reference_rate_dps", "valid", "aux_volts", "comment"];

/// A column before it has a type.
struct Column {
    header: String,
    values: Vec<f64>,
}

/// Columns that mostly are those of a test: a time that goes on, a temperature that moves, counts or rates. Of a `sound` log they are.
fn columns(chance: &mut Chance, sound: bool) -> Vec<Column> {
    let rows = chance.pick(&[1, 3, 40, 400, 400, 400, 3000, 3000, 9000, 0]);
    let step = chance.pick(&[1.0, 1.0, 1.0, 20.0, 20.0, 20.0, 0.01, 600.0, 1e5]);
    let times = if chance.one_in(3) { &TIMES[..4] } else { &TIMES[..1] };
    let mut headers: Vec<String> =
        vec![chance.pick(times).to_owned(), HEADERS[0].to_owned(), chance.pick(&HEADERS[4..10]).to_owned()];
    for _ in 0..chance.pick(&[0, 0, 0, 1, 2]) {
        let further = chance.pick(&FURTHER).to_owned();
        if !headers.contains(&further) {
            headers.push(further);
        }
    }
    if !sound {
        let at = chance.below(headers.len());
        match chance.below(5) {
            0 => drop(headers.remove(at)),
            1 => headers.insert(at, chance.pick(&HEADERS).to_owned()),
            2 => headers[at] = chance.word(),
            3 => headers[0] = chance.pick(&TIMES).to_owned(),
            _ => {}
        }
    }
    let phase = chance.unit();
    headers
        .into_iter()
        .map(|header| {
            let value = |i: usize| value_of(&header, i as f64, step, phase);
            Column { values: (0..rows).map(value).collect(), header }
        })
        .collect()
}

fn value_of(header: &str, row: f64, step: f64, phase: f64) -> f64 {
    let wave = (row / 70.0 + 6.3 * phase).sin();
    match header.split(['_', ' ']).next().unwrap_or_default() {
        "time" | "timestamp" => {
            let unit =
                TIMES.iter().zip([1.0, 1e3, 1e6, 1e9]).find(|(name, _)| **name == header).map_or(1.0, |(_, unit)| unit);
            ((row + 1.0) * step * unit).round()
        }
        "temperature" if header.contains("_k") => 293.0 + 30.0 * wave,
        "temperature" => 15.0 + 40.0 * wave,
        "counts" => (60.0 * step + 3.0 * wave).round() + (row * 7.0 % 5.0).round(),
        "rate" => 10.0 + wave + (row * 13.0 % 7.0) / 10.0,
        "valid" => f64::from(u8::from(row as usize % 50 != 3)),
        "table" | "reference" => {
            if row as usize % 300 < 150 {
                10.0
            } else {
                -10.0
            }
        }
        _ => wave,
    }
}

/// A log in any form.
pub(super) fn log(chance: &mut Chance) -> Log {
    let sound = chance.one_in(2);
    let columns = columns(chance, sound);
    let Log { name, bytes } = match chance.below(5) {
        0..=2 => Log { name: "log.csv", bytes: text(chance, &columns, sound) },
        3 => Log { name: "log.parquet", bytes: columnar(chance, &columns, sound, true) },
        _ => Log { name: "log.arrow", bytes: columnar(chance, &columns, sound, false) },
    };
    let bytes = if !sound && chance.one_in(2) { chance.damage(bytes) } else { bytes };
    if chance.one_in(8) {
        let zipped = gzip(&bytes);
        return Log { name: "log.gz", bytes: if !sound && chance.one_in(3) { chance.damage(zipped) } else { zipped } };
    }
    Log { name, bytes }
}

fn text(chance: &mut Chance, columns: &[Column], sound: bool) -> Vec<u8> {
    let delimiter = chance.pick(&[",", ",", ";", "\t"]);
    let end = chance.pick(if sound { &["\n", "\r\n"] } else { &["\n", "\r"] });
    let quoted = chance.one_in(10);
    let damaged_one_in = chance.pick(if sound { &[usize::MAX, 3000] } else { &[300, 30] });
    let mut text = String::new();
    if chance.one_in(10) {
        text.push('\u{feff}');
    }
    for _ in 0..chance.pick(&[0, 0, 0, 1, 3]) {
        text += &format!("# {}{end}", chance.word());
    }
    let cell = |cell: String| if quoted { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell };
    let header: Vec<String> = columns.iter().map(|column| cell(column.header.clone())).collect();
    text += &(header.join(delimiter) + end);
    for row in 0..columns.first().map_or(0, |column| column.values.len()) {
        let cells: Vec<String> = columns
            .iter()
            .map(|column| match damaged_one_in != usize::MAX && chance.one_in(damaged_one_in) {
                true if chance.one_in(4) => cell(chance.word()),
                true => cell(chance.number().to_owned()),
                false => cell(column.values[row].to_string()),
            })
            .collect();
        text += &cells.join(delimiter);
        if damaged_one_in != usize::MAX && chance.one_in(damaged_one_in) {
            text += delimiter;
        }
        text += end;
    }
    text.into_bytes()
}

/// The columns with types, as Parquet or one of Arrow's two forms.
fn columnar(chance: &mut Chance, columns: &[Column], sound: bool, as_parquet: bool) -> Vec<u8> {
    let arrays = columns.iter().map(|column| (column.header.clone(), array(chance, &column.values, sound), true));
    let Ok(batch) = RecordBatch::try_from_iter_with_nullable(arrays.collect::<Vec<_>>()) else { return Vec::new() };
    let written = if as_parquet { parquet(chance, &batch) } else { arrow(chance, &batch) };
    written.unwrap_or_default()
}

fn array(chance: &mut Chance, values: &[f64], sound: bool) -> ArrayRef {
    let damaged = if sound { 0 } else { chance.pick(&[0, 300, 20]) };
    let values: Vec<Option<f64>> = values
        .iter()
        .map(|value| match damaged > 0 && chance.one_in(damaged) {
            true => (!chance.one_in(3)).then(|| chance.double()),
            false => Some(*value),
        })
        .collect();
    let texts = || values.iter().map(|value| value.map(|value| value.to_string()));
    let whole = || values.iter().map(|value| value.map(|value| value as i64));
    // Of a sound log in types that keep its values.
    let kinds: &[usize] =
        if sound { &[4, 5, 6, 11, 11, 11, 11] } else { &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 11, 11, 11, 11] };
    match chance.pick(kinds) {
        0 => Arc::new(Float32Array::from_iter(values.iter().map(|value| value.map(|value| value as f32)))),
        1 => Arc::new(Int64Array::from_iter(whole())),
        2 => Arc::new(UInt64Array::from_iter(values.iter().map(|value| value.map(|value| value as u64)))),
        3 => Arc::new(Int8Array::from_iter(values.iter().map(|value| value.map(|value| value as i8)))),
        4 => Arc::new(StringArray::from_iter(texts())),
        5 => Arc::new(StringViewArray::from_iter(texts())),
        6 => {
            let texts: Vec<Option<String>> = texts().collect();
            Arc::new(texts.iter().map(Option::as_deref).collect::<DictionaryArray<Int32Type>>())
        }
        7 => Arc::new(BooleanArray::from_iter(values.iter().map(|value| value.map(|value| value > 0.0)))),
        8 => Arc::new(TimestampMicrosecondArray::from_iter(whole())),
        9 => Arc::new(NullArray::new(values.len())),
        10 => {
            let mut lists = ListBuilder::new(Float64Builder::new());
            values.iter().for_each(|value| lists.append_value(vec![*value; 3]));
            Arc::new(lists.finish())
        }
        _ => Arc::new(Float64Array::from_iter(values)),
    }
}

fn parquet(chance: &mut Chance, batch: &RecordBatch) -> anyhow::Result<Vec<u8>> {
    let codecs = [
        Codec::UNCOMPRESSED,
        Codec::SNAPPY,
        Codec::GZIP(GzipLevel::default()),
        Codec::ZSTD(ZstdLevel::default()),
        Codec::LZ4_RAW,
        Codec::LZ4,
    ];
    let properties = WriterProperties::builder()
        .set_compression(chance.pick(&codecs))
        .set_writer_version(chance.pick(&[WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0]))
        .set_dictionary_enabled(chance.one_in(2))
        .set_data_page_row_count_limit(chance.pick(&[10, 1000, 20_000]))
        .set_max_row_group_row_count(Some(chance.pick(&[37, 500, 1 << 20])))
        .build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(batch)?;
    writer.close()?;
    Ok(bytes)
}

fn arrow(chance: &mut Chance, batch: &RecordBatch) -> anyhow::Result<Vec<u8>> {
    let codec = chance.pick(&[None, Some(CompressionType::LZ4_FRAME), Some(CompressionType::ZSTD)]);
    let options = IpcWriteOptions::default().try_with_compression(codec)?;
    let rows = chance.pick(&[50, 1000, usize::MAX]);
    let pieces = (0..batch.num_rows()).step_by(rows).map(|at| batch.slice(at, rows.min(batch.num_rows() - at)));
    if chance.one_in(2) {
        let mut writer = FileWriter::try_new_with_options(Vec::new(), &batch.schema(), options)?;
        pieces.into_iter().try_for_each(|piece| writer.write(&piece))?;
        return Ok(writer.into_inner()?);
    }
    let mut writer = StreamWriter::try_new_with_options(Vec::new(), &batch.schema(), options)?;
    pieces.into_iter().try_for_each(|piece| writer.write(&piece))?;
    Ok(writer.into_inner()?)
}
