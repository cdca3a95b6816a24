//! One log in every format: the same calibration, byte for byte, except the hash of the input.

use crate::support;

use std::io::{Cursor, Write};
use std::sync::Arc;

use crate::ulog_writer::ULogWriter;
use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, Float64Array, Int64Array, LargeStringArray, RecordBatch, StringArray,
    StringViewArray, TimestampMicrosecondArray,
};
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions, StreamWriter};
use arrow_schema::{Field, Schema};
use flate2::Compression;
use flate2::write::GzEncoder;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression as ParquetCompression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use sagnac::fit::{FitOptions, calibrate};
use sagnac::verify::{CorrectedFormat, Correction, compensate};
use sagnac::window::WindowBuilder;
use sagnac_log::MemoryBudget;
use sagnac_log::ingest::{LogReader, MemoryTable, ReadMode, sample_reader};
use sagnac_log::setup::Setup;
use sagnac_sim::LaggedChamber;

fn setup() -> Setup {
    Setup { arcsec_per_count: Some(0.15125), reference_c: Some(20.0), ..Setup::default() }
}

/// The columns of a log with every kind of field: missing, flagged, not a number.
struct Columns {
    time_s: Vec<f64>,
    temperature_c: Vec<Option<f64>>,
    counts: Vec<Option<i64>>,
    valid: Vec<bool>,
    volts: Vec<Option<f64>>,
}

fn columns() -> Columns {
    let rows = LaggedChamber { row_s: 20, ..LaggedChamber::domain_notes() }.run(5);
    let rows: Vec<_> = rows.enumerate().collect();
    let at = |n: usize, i: usize| i % n == n / 2;
    Columns {
        time_s: rows.iter().map(|(_, row)| row.time_s + 0.005).collect(),
        temperature_c: rows.iter().map(|(i, row)| (!at(977, *i)).then_some(row.temperature_c)).collect(),
        counts: rows.iter().map(|(i, row)| (!at(1201, *i)).then_some(row.counts as i64)).collect(),
        valid: rows.iter().map(|(i, _)| !at(1409, *i)).collect(),
        volts: rows.iter().map(|(i, _)| (!at(701, *i)).then_some(1.0 + *i as f64 / 3e4)).collect(),
    }
}

fn csv(c: &Columns, delimiter: char) -> Vec<u8> {
    let mut text = ["time_s", "temperature_c", "counts", "valid", "aux_volts"].join(&delimiter.to_string()) + "\n";
    for i in 0..c.time_s.len() {
        let optional = |value: Option<String>| value.unwrap_or_default();
        let cells = [
            c.time_s[i].to_string(),
            optional(c.temperature_c[i].map(|v| v.to_string())),
            optional(c.counts[i].map(|v| v.to_string())),
            u8::from(c.valid[i]).to_string(),
            optional(c.volts[i].map(|v| v.to_string())),
        ];
        text += &(cells.join(&delimiter.to_string()) + "\n");
    }
    text.into_bytes()
}

fn batch(c: &Columns) -> RecordBatch {
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Float64Array::from(c.time_s.clone()))),
        ("temperature_c", Arc::new(Float64Array::from(c.temperature_c.clone()))),
        ("counts", Arc::new(Int64Array::from(c.counts.clone()))),
        ("valid", Arc::new(BooleanArray::from(c.valid.clone()))),
        ("aux_volts", Arc::new(Float64Array::from(c.volts.clone()))),
    ];
    of_columns(columns)
}

fn of_columns(columns: Vec<(&str, ArrayRef)>) -> RecordBatch {
    let fields: Vec<Field> = columns.iter().map(|(n, c)| Field::new(*n, c.data_type().clone(), true)).collect();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns.into_iter().map(|(_, c)| c).collect()).unwrap()
}

fn parquet(batch: &RecordBatch, compression: ParquetCompression) -> Vec<u8> {
    let properties =
        WriterProperties::builder().set_compression(compression).set_max_row_group_row_count(Some(1000)).build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties)).unwrap();
    writer.write(batch).unwrap();
    writer.close().unwrap();
    bytes
}

/// In batches of 700 rows.
fn arrow_file(batch: &RecordBatch, compression: Option<CompressionType>) -> Vec<u8> {
    let options = IpcWriteOptions::default().try_with_compression(compression).unwrap();
    let mut writer = FileWriter::try_new_with_options(Vec::new(), &batch.schema(), options).unwrap();
    for at in (0..batch.num_rows()).step_by(700) {
        writer.write(&batch.slice(at, 700.min(batch.num_rows() - at))).unwrap();
    }
    writer.into_inner().unwrap()
}

fn arrow_stream(batch: &RecordBatch) -> Vec<u8> {
    let mut writer = StreamWriter::try_new(Vec::new(), &batch.schema()).unwrap();
    writer.write(batch).unwrap();
    writer.into_inner().unwrap()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = GzEncoder::new(Vec::new(), Compression::fast());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

/// The calibration's JSON without the hash of its input.
fn calibration(bytes: Vec<u8>, setup: &Setup) -> String {
    let log = LogReader::from_reader("log", Box::new(Cursor::new(bytes)), setup, ReadMode::Bulk).unwrap();
    calibration_of(log, setup)
}

fn calibration_of(log: LogReader, setup: &Setup) -> String {
    let windows = WindowBuilder::read_all(vec![log], setup).unwrap().finish();
    let options = FitOptions::new(support::model("bias 3"));
    let mut calibration = calibrate(windows, setup, &options).unwrap();
    for input in &mut calibration.provenance.inputs {
        assert_eq!(input.sha256.len(), 64);
        (input.sha256, input.file) = (String::new(), String::new());
    }
    calibration.to_json().unwrap()
}

#[test]
fn every_format_gives_the_same_calibration() {
    let c = columns();
    let expected = calibration(csv(&c, ','), &setup());
    assert!(expected.contains("flagged_invalid") && expected.contains("not_a_number"));
    let batch = batch(&c);
    let zstd = ParquetCompression::ZSTD(ZstdLevel::try_new(3).unwrap());
    let all = [
        ("tabs", csv(&c, '\t')),
        ("gzip of CSV", gzip(&csv(&c, ','))),
        ("Parquet", parquet(&batch, ParquetCompression::UNCOMPRESSED)),
        ("Parquet, snappy", parquet(&batch, ParquetCompression::SNAPPY)),
        ("Parquet, zstd", parquet(&batch, zstd)),
        ("Arrow file", arrow_file(&batch, None)),
        ("Arrow file, lz4", arrow_file(&batch, Some(CompressionType::LZ4_FRAME))),
        ("Arrow file, zstd", arrow_file(&batch, Some(CompressionType::ZSTD))),
        ("Arrow stream", arrow_stream(&batch)),
        ("gzip of Parquet", gzip(&parquet(&batch, ParquetCompression::SNAPPY))),
        ("gzip of Arrow", gzip(&arrow_file(&batch, None))),
    ];
    for (name, bytes) in all {
        assert!(calibration(bytes, &setup()) == expected, "{name} differs from CSV");
    }
}

/// A file on disk is decoded in place and hashed next to that; the hash is that of its bytes.
#[test]
fn files_are_hashed_as_they_are() {
    let batch = batch(&columns());
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in
        [("a.parquet", parquet(&batch, ParquetCompression::SNAPPY)), ("a.arrow", arrow_file(&batch, None))]
    {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let mut log = LogReader::open(&path, &setup(), ReadMode::Bulk).unwrap();
        while log.next_batch().unwrap().is_some() {}
        assert_eq!(log.summary().sha256, sagnac_log::ingest::hex(&sagnac_log::ingest::sha256(&bytes)), "{name}");
        assert_eq!(log.summary().rows, batch.num_rows() as u64);
    }
}

/// Arrow's own times and text columns give the same values as numbers.
#[test]
fn times_and_texts_of_columns() {
    let c = columns();
    let micros = |t: &f64| (t * 1e6).round() as i64;
    let texts: Vec<Option<String>> = c.temperature_c.iter().map(|t| t.map(|t| t.to_string())).collect();
    let times = TimestampMicrosecondArray::from(c.time_s.iter().map(micros).collect::<Vec<_>>());
    let other = of_columns(vec![
        ("time_s", Arc::new(times)),
        ("temperature_c", Arc::new(StringArray::from(texts))),
        ("counts", Arc::new(Int64Array::from(c.counts.clone()))),
        ("valid", Arc::new(Float64Array::from_iter_values(c.valid.iter().map(|v| f64::from(u8::from(*v)))))),
        ("aux_volts", Arc::new(Float64Array::from(c.volts.clone()))),
    ]);
    let same =
        calibration(parquet(&other, ParquetCompression::SNAPPY), &setup()) == calibration(csv(&c, ','), &setup());
    assert!(same);
}

#[test]
fn a_column_of_another_kind_is_refused_by_name() {
    let c = columns();
    let wrong = of_columns(vec![
        ("time_s", Arc::new(Float64Array::from(c.time_s.clone()))),
        ("temperature_c", Arc::new(BooleanArray::from(c.valid.clone()))),
        ("counts", Arc::new(Int64Array::from(c.counts.clone()))),
    ]);
    let bytes = parquet(&wrong, ParquetCompression::SNAPPY);
    let error = LogReader::from_reader("log", Box::new(Cursor::new(bytes)), &setup(), ReadMode::Bulk).err().unwrap();
    assert_eq!(error.place.column.as_deref(), Some("temperature_c"));
    assert!(error.what.contains("Boolean"), "{error}");
}

/// An hour of a warm-up at 5 Hz: the ULog and a CSV of the same 32-bit values and µs stamps.
fn px4() -> (ULogWriter, String) {
    let mut log = ULogWriter::new();
    log.format("sensor_gyro:uint64_t timestamp;float x;float y;float z;float temperature;");
    log.format("sensor_baro:uint64_t timestamp;float pressure;float temperature;");
    log.format("nested:uint64_t timestamp;sensor_baro[4] all;");
    log.subscribe("sensor_gyro", 3, 0);
    log.subscribe("sensor_gyro", 4, 1);
    log.subscribe("sensor_baro", 9, 0);
    let mut text = "time_us,rate_radps_x,rate_radps_y,rate_radps_z,temperature_c,temperature_c_baro\n".to_owned();
    let start_us = 256_551_281_491_u64;
    for i in 0..18_000_u64 {
        let time_us = start_us + i * 200_000;
        let warm = (20.0 + 40.0 * (1.0 - (-(i as f64) / 6000.0).exp())) as f32;
        let noise = ((i * 7919) % 1009) as f32 / 1009.0 - 0.5;
        let rates = [1e-4 * warm + 1e-3 * noise, -2e-5 * warm * warm / 40.0 - 1e-3 * noise, 7e-5 + 1e-3 * noise];
        let baro = (i % 5 == 0).then_some(warm + 3.25);
        if let Some(baro) = baro {
            log.data(9, time_us - 100, &[101_325.0, baro]);
        }
        log.data(3, time_us, &[rates[0], rates[1], rates[2], warm]);
        log.data(4, time_us + 7, &[9.0, 9.0, 9.0, 99.0]);
        let exact = |v: f32| f64::from(v).to_string();
        let cells: Vec<String> = rates.iter().chain([&warm]).map(|v| exact(*v)).collect();
        text += &format!("{time_us},{},{}\n", cells.join(","), baro.map_or(String::new(), exact));
    }
    (log, text)
}

#[test]
fn a_ulog_is_the_csv_of_its_values() {
    let (log, text) = px4();
    let setup =
        Setup { window: Some("20".parse().map(sagnac_log::setup::WindowSize::Seconds).unwrap()), ..Setup::default() };
    let setup = Setup { reference_c: Some(30.0), ..setup };
    let bytes = log.finish();
    // What `sagnac init` looks at: the same names and cells.
    let cells = |bytes: Vec<u8>| sample_reader("log", Box::new(Cursor::new(bytes))).unwrap().columns;
    let [of_ulog, of_text] = [cells(bytes.clone()), cells(text.clone().into_bytes())];
    assert_eq!(of_ulog.len(), 6);
    for (column, plain) in of_ulog.iter().zip(&of_text) {
        let rows = column.cells.len().min(plain.cells.len());
        assert!(rows > 900 && column.cells[..rows] == plain.cells[..rows], "{}", column.header);
        assert_eq!(column.header, plain.header);
    }
    assert!(calibration(bytes, &setup) == calibration(text.into_bytes(), &setup));
}

#[test]
fn a_ulog_that_was_cut_keeps_its_rows_and_says_so() {
    let (log, _) = px4();
    let mut bytes = log.finish();
    bytes.truncate(bytes.len() - 60);
    let mut reader =
        LogReader::from_reader("log", Box::new(Cursor::new(bytes)), &Setup::default(), ReadMode::Bulk).unwrap();
    let mut rows = 0;
    while let Some(batch) = reader.next_batch().unwrap() {
        rows += batch.len();
    }
    assert_eq!(rows, 17_999);
    let tallies = reader.summary().tallies.list();
    assert_eq!(tallies.iter().map(|t| (t.reason.name(), t.rows)).collect::<Vec<_>>(), [("ragged", 1)]);
}

/// Data appended after a truncated message is read, even if the head of that message is truncated.
#[test]
fn a_ulog_goes_on_where_data_was_appended() {
    let build = |left: usize| {
        let mut log = ULogWriter::new();
        log.format("sensor_gyro:uint64_t timestamp;float x;float y;float z;float temperature;");
        log.format("sensor_baro:uint64_t timestamp;float pressure;float temperature;");
        log.subscribe("sensor_gyro", 3, 0);
        log.subscribe("sensor_baro", 9, 0);
        // A thermometer with a message before the gyro's first.
        log.data(9, 900_000, &[101_325.0, 31.5]);
        (0..60).for_each(|i| log.data(3, 1_000_000 + i * 10_000, &[0.1, 0.2, 0.3, 25.0]));
        let mut bytes = log.finish();
        bytes.extend_from_slice(&[28, 0, b'D', 3, 0][..left]);
        // The offset is in the flags, after 16 bytes of header and 3 of the message's head.
        let at = (bytes.len() as u64).to_le_bytes();
        bytes[16 + 3 + 16..16 + 3 + 24].copy_from_slice(&at);
        let mut more = ULogWriter::new();
        (0..60).for_each(|i| more.data(3, 1_600_000 + i * 10_000, &[0.1, 0.2, 0.3, 25.0]));
        // Of the second part only its messages.
        bytes.extend_from_slice(&more.finish()[16 + 43..]);
        bytes
    };
    for left in 0..=5 {
        let source = Box::new(Cursor::new(build(left)));
        let mut log = LogReader::from_reader("log", source, &Setup::default(), ReadMode::Bulk).unwrap();
        let batch = log.next_batch().unwrap().unwrap();
        assert_eq!(batch.len(), 120, "{left} bytes of a message before what was appended");
        assert_eq!(batch.temperature_c[1][0], 31.5);
    }
}

#[test]
fn the_second_gyro_is_read_when_asked_for() {
    let (log, _) = px4();
    let setup = Setup { instance: Some(1), ..Setup::default() };
    let bytes = log.finish();
    let mut reader =
        LogReader::from_reader("log", Box::new(Cursor::new(bytes.clone())), &setup, ReadMode::Bulk).unwrap();
    let batch = reader.next_batch().unwrap().unwrap();
    assert_eq!(batch.temperature_c[0][0], 99.0);
    let third = Setup { instance: Some(2), ..Setup::default() };
    let error = LogReader::from_reader("log", Box::new(Cursor::new(bytes)), &third, ReadMode::Bulk).err().unwrap();
    assert!(error.what.contains("instance 2") && error.help.contains("sensor_gyro"));
}

/// A topic that is announced without a message is passed over where the file can be read again; a pipe cannot, and says so.
#[test]
fn a_silent_gyro_is_passed_over() {
    let mut log = ULogWriter::new();
    log.format("sensor_gyro:uint64_t timestamp;float x;float y;float z;float temperature;");
    log.format("sensor_combined:uint64_t timestamp;float[3] gyro_rad;");
    log.format("sensor_baro:uint64_t timestamp;float pressure;float temperature;");
    log.subscribe("sensor_gyro", 3, 0);
    log.subscribe("sensor_combined", 4, 0);
    log.subscribe("sensor_baro", 9, 0);
    log.data(9, 900_000, &[101_325.0, 31.5]);
    (0..9000).for_each(|i| log.data(4, 1_000_000 + i * 10_000, &[0.125, 0.25, 0.5]));
    let bytes = log.finish();
    let path = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(path.path(), &bytes).unwrap();
    let mut log = LogReader::open(path.path(), &Setup::default(), ReadMode::Bulk).unwrap();
    let mut rows = 0;
    while let Some(batch) = log.next_batch().unwrap() {
        assert!(rows > 0 || batch.temperature_c[0][0] == 31.5);
        rows += batch.len();
    }
    assert_eq!(rows, 9000);
    assert_eq!(log.summary().sha256, sagnac_log::ingest::hex(&sagnac_log::ingest::sha256(&bytes)));
    for piped in [gzip(&bytes), bytes] {
        let piped = Box::new(Cursor::new(piped));
        let error = LogReader::from_reader("log", piped, &Setup::default(), ReadMode::Bulk).err().unwrap();
        assert!(error.what.contains("sensor_combined has"), "{error}");
    }
}

/// Text of categories, of short and long form, and in another unit of storage is the same text.
#[test]
fn text_of_any_form_is_the_same() {
    let c = columns();
    let words = ["a", "bc", "a word longer than a view holds"];
    let text: Vec<&str> = (0..c.counts.len()).map(|i| words[i % 3]).collect();
    let categories: DictionaryArray<Int32Type> = text.iter().copied().collect();
    let forms: [ArrayRef; 4] = [
        Arc::new(StringArray::from(text.clone())),
        Arc::new(LargeStringArray::from(text.clone())),
        Arc::new(StringViewArray::from(text.clone())),
        Arc::new(categories),
    ];
    for form in forms {
        let kind = form.data_type().clone();
        let mut columns: Vec<(&str, ArrayRef)> = ["time_s", "temperature_c", "counts", "valid", "aux_volts"]
            .into_iter()
            .zip(batch(&c).columns().to_vec())
            .collect();
        columns.insert(1, ("note", form));
        let source = Box::new(Cursor::new(parquet(&of_columns(columns), ParquetCompression::SNAPPY)));
        let mut log = LogReader::from_reader("log", source, &setup(), ReadMode::BulkWithText).unwrap();
        let mut at = 0;
        while let Some(batch) = log.next_batch().unwrap() {
            for (line, fields) in batch.line.iter().zip(&batch.fields) {
                let row = *line as usize - 2;
                assert_eq!(
                    (&fields[1], &fields[3]),
                    (text[row].as_bytes(), c.counts[row].unwrap().to_string().as_bytes()),
                    "{kind}"
                );
                at += 1;
            }
        }
        assert!(at > c.counts.len() / 2, "{kind}: {at} rows");
    }
}

/// What unpacks to more than its share of the budget is refused, and read with a larger budget.
#[test]
fn a_file_beyond_its_share_of_memory_is_refused() {
    let rows = 3_000_000;
    let zeros = || Arc::new(Float64Array::from(vec![0.0; rows])) as ArrayRef;
    let time: ArrayRef = Arc::new(Float64Array::from_iter_values((0..rows).map(|i| i as f64)));
    let wide = of_columns(vec![("time_s", time), ("temperature_c", zeros()), ("rate_dph", zeros())]);
    let options = IpcWriteOptions::default().try_with_compression(Some(CompressionType::ZSTD)).unwrap();
    let mut writer = FileWriter::try_new_with_options(Vec::new(), &wide.schema(), options).unwrap();
    writer.write(&wide).unwrap();
    let bytes = writer.into_inner().unwrap();
    let read = |mebibytes: u64| {
        let memory = MemoryBudget::of_bytes(mebibytes << 20).unwrap();
        let source = Box::new(Cursor::new(bytes.clone()));
        LogReader::from_reader("log", source, &Setup { memory, ..Setup::default() }, ReadMode::Bulk)
    };
    // 72 MB in one batch: a quarter of 256 MiB is less, of 512 MiB is more.
    let error = read(256).err().unwrap();
    assert!(error.what.contains("more than 64 MiB") && error.help.contains("--memory"), "{error}");
    let mut log = read(512).unwrap();
    let mut read = 0;
    while let Some(batch) = log.next_batch().unwrap() {
        read += batch.len();
    }
    // The row before the first is missing.
    assert!(read >= rows - 1, "{read}");
}

/// Arrow's own times are written in the unit of their header, and what has no text is left empty.
#[test]
fn arrows_times_are_written_as_their_header_says() {
    let c = columns();
    let micros = |t: &f64| (t * 1e6).round() as i64;
    let times = TimestampMicrosecondArray::from(c.time_s.iter().map(micros).collect::<Vec<_>>());
    let other = of_columns(vec![
        ("time_s", Arc::new(times)),
        ("temperature_c", Arc::new(Float64Array::from(c.temperature_c.clone()))),
        ("counts", Arc::new(Int64Array::from(c.counts.clone()))),
        ("note", Arc::new(arrow_array::NullArray::new(c.counts.len()))),
    ]);
    let setup = setup();
    let source = Box::new(Cursor::new(parquet(&other, ParquetCompression::SNAPPY)));
    let mut log = LogReader::from_reader("log", source, &setup, ReadMode::BulkWithText).unwrap();
    let batch = log.next_batch().unwrap().unwrap();
    let field = |row: usize, column: usize| String::from_utf8(batch.fields[row][column].to_vec()).unwrap();
    assert_eq!(field(0, 0), c.time_s[0].to_string());
    assert_eq!(field(7, 0), c.time_s[7].to_string());
    assert_eq!(field(7, 3), "");
}

/// Only numbers decide whether a comma is decimal; words next to them do not.
#[test]
fn a_comma_among_words_is_not_decimal() {
    let c = columns();
    let setup = Setup { quantum: Some(0.5), ..setup() };
    let text = String::from_utf8(csv(&c, '\t')).unwrap();
    let with_words = |decimal_comma: bool| -> Vec<u8> {
        let lines = text.lines().enumerate().map(|(i, line)| {
            let line = if decimal_comma { line.replace('.', ",") } else { line.to_owned() };
            if i == 0 { format!("{line}\toperator\n") } else { format!("{line}\tby anna, b\n") }
        });
        lines.collect::<String>().into_bytes()
    };
    let log = LogReader::from_reader("log", Box::new(Cursor::new(with_words(false))), &setup, ReadMode::Bulk).unwrap();
    let windows = WindowBuilder::read_all(vec![log], &setup).unwrap().finish();
    let options = FitOptions::new(support::model("bias 2"));
    let correction = Correction::from_calibration(calibrate(windows, &setup, &options).unwrap()).unwrap();
    for decimal_comma in [false, true] {
        let source = Box::new(Cursor::new(with_words(decimal_comma)));
        let mut log = LogReader::from_reader("log", source, &setup, ReadMode::BulkWithText).unwrap();
        let mut out = Vec::new();
        compensate(&correction, &mut log, &setup, CorrectedFormat::Csv, &mut out).unwrap();
        let out = String::from_utf8(out).unwrap();
        let counts: Vec<&str> = out.lines().skip(2).map(|line| line.split('\t').nth(2).unwrap()).collect();
        assert!(
            counts.len() > 1000 && counts.iter().all(|text| text.contains(',') == decimal_comma),
            "{:?}",
            &counts[..3]
        );
    }
}

/// A corrected log as Parquet holds the numbers of the corrected log as text.
#[test]
fn corrected_logs_agree_in_both_formats() {
    let c = columns();
    let setup = setup();
    let log = LogReader::from_reader("log", Box::new(Cursor::new(csv(&c, ','))), &setup, ReadMode::Bulk).unwrap();
    let windows = WindowBuilder::read_all(vec![log], &setup).unwrap().finish();
    let options = FitOptions::new(support::model("bias 2"));
    let correction = Correction::from_calibration(calibrate(windows, &setup, &options).unwrap()).unwrap();
    let corrected = |bytes: Vec<u8>, format| {
        let source = Box::new(Cursor::new(bytes));
        let mut log = LogReader::from_reader("log", source, &correction.setup(), ReadMode::BulkWithText).unwrap();
        let mut out = Vec::new();
        compensate(&correction, &mut log, &correction.setup(), format, &mut out).unwrap();
        out
    };
    let text = String::from_utf8(corrected(csv(&c, ','), CorrectedFormat::Csv)).unwrap();
    let from_columns = corrected(parquet(&batch(&c), ParquetCompression::SNAPPY), CorrectedFormat::Csv);
    // A flag is 1 in one and true in the other.
    assert_eq!(text.replace(",1,", ",true,").lines().count(), String::from_utf8(from_columns).unwrap().lines().count());
    let bytes = corrected(csv(&c, ','), CorrectedFormat::Parquet);
    let reader =
        parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes)).unwrap();
    let mut values = Vec::new();
    for batch in reader.build().unwrap() {
        let batch = batch.unwrap();
        let column = batch.column_by_name("compensated_counts").unwrap();
        values.extend(column.as_any().downcast_ref::<Float64Array>().unwrap().values().to_vec());
    }
    let expected: Vec<f64> =
        text.lines().skip(2).map(|line| line.split(',').nth(2).unwrap().parse().unwrap()).collect();
    assert_eq!(values, expected);
}

fn in_memory(batch: &RecordBatch, part: usize) -> LogReader {
    let parts: Vec<_> =
        (0..batch.num_rows()).step_by(part).map(|at| Ok(batch.slice(at, part.min(batch.num_rows() - at)))).collect();
    let table = MemoryTable { name: "log".to_owned(), schema: batch.schema(), batches: Box::new(parts.into_iter()) };
    LogReader::from_table(table, &setup(), ReadMode::Bulk).unwrap()
}

/// A table in memory gives the calibration of its file. Its hash is that of its values: whatever parts they come in, whatever is next to them.
#[test]
fn a_table_in_memory_is_the_log_of_its_file() {
    let batch = batch(&columns());
    let expected = calibration(csv(&columns(), ','), &setup());
    let whole = |part: usize| {
        let mut log = in_memory(&batch, part);
        while log.next_batch().unwrap().is_some() {}
        log.summary()
    };
    let all = batch.num_rows();
    for part in [all, 700, 8192, 1] {
        assert_eq!(calibration_of(in_memory(&batch, part), &setup()), expected, "parts of {part}");
        assert_eq!(whole(part).sha256, whole(all).sha256, "parts of {part}");
    }
    // The same stretches as the file, so that a copy of it is no independent test.
    let bytes = Box::new(Cursor::new(csv(&columns(), ',')));
    let mut file = LogReader::from_reader("log", bytes, &setup(), ReadMode::Bulk).unwrap();
    while file.next_batch().unwrap().is_some() {}
    assert!(file.summary().rows_sketch == whole(all).rows_sketch && !whole(all).rows_sketch.is_empty());
    assert_ne!(file.summary().sha256, whole(all).sha256);
    let sha256_of = |batch: &RecordBatch| {
        let mut log = in_memory(batch, 1000);
        while log.next_batch().unwrap().is_some() {}
        log.summary().sha256
    };
    let with = |name: &str, column: ArrayRef| {
        let schema = batch.schema();
        let names = schema.fields().iter().map(|field| field.name().as_str());
        let mut columns: Vec<(&str, ArrayRef)> = names.zip(batch.columns().iter().cloned()).collect();
        match columns.iter_mut().find(|(other, _)| *other == name) {
            Some((_, other)) => *other = column,
            None => columns.push((name, column)),
        }
        sha256_of(&of_columns(columns))
    };
    let counts = columns().counts;
    let as_numbers = Float64Array::from_iter(counts.iter().map(|count| count.map(|count| count as f64)));
    assert_eq!(with("counts", Arc::new(as_numbers)), sha256_of(&batch), "numbers of another width");
    let notes = StringArray::from(vec!["a note"; all]);
    assert_eq!(with("remark", Arc::new(notes)), sha256_of(&batch), "a column that is not read");
    let mut other = counts;
    other[all / 2] = other[all / 2].map_or(Some(1), |count| Some(count + 1));
    assert_ne!(with("counts", Arc::new(Int64Array::from(other))), sha256_of(&batch), "one count more");
}

/// What goes wrong while a table is read is what its owner said, with the table's name.
#[test]
fn a_table_that_breaks_off_is_an_error() {
    let batch = batch(&columns());
    let own = sagnac::Error::input("the generator raised ValueError: no more", "mend the generator");
    let batches = vec![Ok(batch.slice(0, 500)), Err(arrow_schema::ArrowError::ExternalError(Box::new(own)))];
    let table =
        MemoryTable { name: "run 1".to_owned(), schema: batch.schema(), batches: Box::new(batches.into_iter()) };
    // The first rows are read where it is opened.
    let error = LogReader::from_table(table, &setup(), ReadMode::Bulk).map(|_| ()).unwrap_err();
    assert_eq!(error.what, "the generator raised ValueError: no more");
    assert_eq!((error.place.file.as_deref(), error.help.as_str()), (Some("run 1"), "mend the generator"));
    // Batches of other columns than announced.
    let narrow = batch.project(&[0, 1]).unwrap();
    let table =
        MemoryTable { name: "run 2".to_owned(), schema: batch.schema(), batches: Box::new([Ok(narrow)].into_iter()) };
    let error =
        LogReader::from_table(table, &setup(), ReadMode::Bulk).err().map_or_else(String::new, |e| e.to_string());
    assert!(error.contains("run 2") && error.contains("lacks this column"), "{error}");
}

/// A recording that grows slowly is read as far as it goes: an empty batch says that no further row is there yet. A log of ten seconds a row
/// once had its first live fit after 4,096 rows.
#[test]
fn a_table_that_still_grows_is_read_as_far_as_it_goes() {
    let batch = batch(&columns());
    let come = [Ok(batch.slice(0, 500)), Ok(batch.slice(0, 0))];
    let batches = come.into_iter().chain(std::iter::from_fn(|| panic!("the rows that have come are not read yet")));
    let table = MemoryTable { name: "growing".to_owned(), schema: batch.schema(), batches: Box::new(batches) };
    let mut log = LogReader::from_table(table, &setup(), ReadMode::Bulk).unwrap();
    let mut rows = 0;
    while rows < 500 {
        rows += log.next_batch().unwrap().unwrap().len();
    }
    assert_eq!(rows, 500);
}
