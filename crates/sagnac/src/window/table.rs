//! The window table as a Parquet file: what `sagnac window` writes and `sagnac calibrate` reads back.
//!
//! One row per window. Angles are Int64 quanta for count logs, Float64 arcsec for rate logs. Each
//! row carries its short-τ sums (`short_tau_<axis>`: squares, numbers, degrees of freedom, one each per
//! octave) and the piece of its run's temperature track that ends with it
//! (`track_c_<name>`, `track_aux_<name>`, a list; the last row of a run carries the rest), so rows can be partitioned
//! by run without losing the lag filter's input. What belongs to no row (units, runs, hashes,
//! tallies, how the logs were read) stands as JSON under `sagnac.windows` in the schema's metadata.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, UInt32Type, UInt64Type};
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, UInt32Array, UInt64Array};
use arrow_schema::{Field, Schema};
use parquet::arrow::ArrowWriter;
use serde::{Deserialize, Serialize};

use crate::window::windows::{Run, RunFile, WindowRows, WindowShape, Windows};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{AngleUnit, LogSummary, Tallies, Tally};
use sagnac_log::ingest::{ParquetRead, parquet_batches, parquet_schema};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::setup::{Setup, WindowSize};
use sagnac_log::write::parquet_properties;
use sagnac_noise::ShortTauSums;

/// Version of the table's schema.
pub const TABLE_VERSION: u32 = 3;
const METADATA_KEY: &str = "sagnac.windows";

#[derive(Serialize, Deserialize)]
struct Metadata {
    version: u32,
    axes: Vec<char>,
    thermometers: Vec<String>,
    aux: Vec<String>,
    /// `None`: rates, angles in arcsec.
    arcsec_per_count: Option<f64>,
    quantum: Option<f64>,
    timed: bool,
    window: WindowSize,
    nominal_s: f64,
    period_ns: i64,
    sample_interval_s: f64,
    runs: Vec<RunMetadata>,
    tallies: Vec<Tally>,
    /// How the logs were read.
    setup: Setup,
}

#[derive(Serialize, Deserialize)]
struct RunMetadata {
    files: Vec<FileMetadata>,
    start_ns: i64,
    end_ns: i64,
}

#[derive(Serialize, Deserialize)]
struct FileMetadata {
    file: String,
    sha256: String,
    #[serde(default)]
    rows_sketch: String,
    rows: u64,
    start_ns: i64,
    tallies: Vec<Tally>,
}

/// Writes the table.
///
/// # Errors
/// What the writer says.
pub fn write_table(windows: &Windows, setup: &Setup, out: impl Write + Send) -> Result<()> {
    let broken = |e: &dyn std::fmt::Display| Error::input(format!("cannot write the window table: {e}"));
    let batch = to_batch(windows, setup)?;
    let mut writer = ArrowWriter::try_new(out, batch.schema(), Some(parquet_properties())).map_err(|e| broken(&e))?;
    writer.write(&batch).map_err(|e| broken(&e))?;
    writer.close().map_err(|e| broken(&e))?;
    Ok(())
}

/// Writes the windows as text, for people and spreadsheets: a line each, without the tracks and noise sums that
/// a calibration needs too.
///
/// # Errors
/// What the writer says.
pub fn write_table_csv(windows: &Windows, setup: &Setup, out: &mut dyn Write) -> Result<()> {
    let unwritten = |e: csv::Error| Error::input(format!("cannot write the window table: {e}"));
    let batch = to_batch(windows, setup)?;
    let mut csv = csv::Writer::from_writer(out);
    let schema = batch.schema();
    let flat: Vec<(&str, &ArrayRef)> = schema
        .fields()
        .iter()
        .zip(batch.columns())
        .filter(|(field, _)| !field.data_type().is_nested())
        .map(|(field, column)| (field.name().as_str(), column))
        .collect();
    csv.write_record(flat.iter().map(|(name, _)| name)).map_err(unwritten)?;
    for row in 0..batch.num_rows() {
        csv.write_record(flat.iter().map(|(_, column)| cell(column, row))).map_err(unwritten)?;
    }
    csv.flush().map_err(|e| Error::input(format!("cannot write the window table: {e}")))
}

/// A value as text; empty for none.
fn cell(column: &ArrayRef, row: usize) -> String {
    if column.is_null(row) {
        return String::new();
    }
    let float = column.as_primitive_opt::<Float64Type>().map(|c| c.value(row));
    let whole = column.as_primitive_opt::<Int64Type>().map(|c| c.value(row).to_string());
    let small = column.as_primitive_opt::<UInt32Type>().map(|c| c.value(row).to_string());
    let large = column.as_primitive_opt::<UInt64Type>().map(|c| c.value(row).to_string());
    let text = column.as_string_opt::<i32>().map(|c| c.value(row).to_owned());
    let float = float.map(|v| if v.is_nan() { String::new() } else { v.to_string() });
    float.or(whole).or(small).or(large).or(text).unwrap_or_default()
}

fn to_batch(windows: &Windows, setup: &Setup) -> Result<RecordBatch> {
    let (shape, rows) = (&windows.shape, &windows.rows);
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("run".into(), Arc::new(UInt32Array::from(rows.run.clone()))),
        ("start_ns".into(), Arc::new(Int64Array::from(rows.start_ns.clone()))),
        ("end_ns".into(), Arc::new(Int64Array::from(rows.end_ns.clone()))),
        ("duration_ns".into(), Arc::new(Int64Array::from(rows.duration_ns.clone()))),
        ("samples".into(), Arc::new(UInt32Array::from(rows.samples.clone()))),
        ("first_line".into(), Arc::new(UInt64Array::from(rows.first_line.clone()))),
        ("reference_dps".into(), float(&rows.reference_dps)),
        ("excluded".into(), Arc::new(StringArray::from_iter(rows.excluded.iter().map(|r| r.map(|r| r.name()))))),
    ];
    for (axis, angle) in shape.axes.iter().zip(&rows.angle) {
        let column: ArrayRef = match shape.unit {
            AngleUnit::Quanta { .. } => Arc::new(Int64Array::from_iter_values(angle.iter().map(|a| *a as i64))),
            AngleUnit::Arcsec => float(angle),
        };
        columns.push((format!("angle_{axis}"), column));
    }
    for (axis, sums) in shape.axes.iter().zip(&rows.short_tau) {
        let mut lists = ListBuilder::new(Float64Builder::new());
        for s in sums {
            [&s.squares, &s.numbers, &s.edf].into_iter().for_each(|part| lists.values().append_slice(part));
            lists.append(true);
        }
        columns.push((format!("short_tau_{axis}"), Arc::new(lists.finish())));
    }
    for (i, name) in shape.thermometers.iter().enumerate() {
        for (prefix, column) in SENSOR_COLUMNS.iter().zip([&rows.mean_c, &rows.variance_c2, &rows.min_c, &rows.max_c]) {
            columns.push((format!("{prefix}_{name}"), float(&column[i])));
        }
        columns.push((track_column(shape, i), tracks(windows, i)));
    }
    for (i, name) in shape.aux.iter().enumerate() {
        let all = [&rows.aux, &rows.aux_variance, &rows.aux_min, &rows.aux_max];
        for (prefix, column) in AUX_COLUMNS.iter().zip(all) {
            columns.push((format!("{prefix}_{name}"), float(&column[i])));
        }
    }
    for at in shape.thermometers.len()..shape.thermometers.len() + shape.aux.len() {
        columns.push((track_column(shape, at), tracks(windows, at)));
    }
    let fields: Vec<Field> =
        columns.iter().map(|(name, column)| Field::new(name, column.data_type().clone(), true)).collect();
    let json = serde_json::to_string(&metadata(windows, setup))
        .map_err(|e| Error::input(format!("cannot describe the windows: {e}")))?;
    let schema = Schema::new(fields).with_metadata(HashMap::from([(METADATA_KEY.to_owned(), json)]));
    RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, column)| column).collect())
        .map_err(|e| Error::input(format!("cannot build the window table: {e}")))
}

const SENSOR_COLUMNS: [&str; 4] = ["mean_c", "variance_c2", "min_c", "max_c"];
const AUX_COLUMNS: [&str; 4] = ["aux", "variance_aux", "min_aux", "max_aux"];

fn float(values: &[f64]) -> ArrayRef {
    Arc::new(Float64Array::from(values.to_vec()))
}

/// Name of a track's column: thermometers first, then auxiliary columns.
fn track_column(shape: &WindowShape, at: usize) -> String {
    let aux = || shape.aux.get(at - shape.thermometers.len()).map_or("", String::as_str);
    shape.thermometers.get(at).map_or_else(|| format!("track_aux_{}", aux()), |name| format!("track_c_{name}"))
}

/// Each row's piece of its run's track.
fn tracks(windows: &Windows, sensor: usize) -> ArrayRef {
    let mut lists = ListBuilder::new(Float64Builder::new());
    let mut given = vec![0; windows.runs.len()];
    for i in 0..windows.len() {
        let run_index = windows.rows.run[i] as usize;
        let run = &windows.runs[run_index];
        let track = &run.tracks[sensor];
        let last_of_run = windows.rows.run.get(i + 1) != Some(&windows.rows.run[i]);
        let until = if last_of_run {
            track.len()
        } else {
            let elapsed = windows.rows.end_ns[i] - run.start_ns;
            usize::try_from(elapsed / windows.shape.period_ns).unwrap_or(0).min(track.len())
        };
        lists.values().append_slice(track.get(given[run_index]..until).unwrap_or(&[]));
        lists.append(true);
        given[run_index] = given[run_index].max(until);
    }
    Arc::new(lists.finish())
}

fn file_metadata(file: &RunFile) -> FileMetadata {
    let LogSummary { file: name, sha256, rows, tallies, rows_sketch, follows_by_counter: _ } = &file.summary;
    FileMetadata {
        file: name.clone(),
        sha256: sha256.clone(),
        rows_sketch: rows_sketch.clone(),
        rows: *rows,
        start_ns: file.start_ns,
        tallies: tallies.list(),
    }
}

fn run_file(file: FileMetadata) -> RunFile {
    let FileMetadata { file, sha256, rows_sketch, rows, start_ns, tallies } = file;
    let tallies = Tallies::from_list(tallies);
    RunFile { start_ns, summary: LogSummary { file, sha256, rows, tallies, rows_sketch, follows_by_counter: false } }
}

fn metadata(windows: &Windows, setup: &Setup) -> Metadata {
    let shape = &windows.shape;
    let (arcsec_per_count, quantum) = match shape.unit {
        AngleUnit::Quanta { arcsec_per_count, quantum } => (Some(arcsec_per_count), Some(quantum)),
        AngleUnit::Arcsec => (None, None),
    };
    let runs = windows.runs.iter().map(|run| RunMetadata {
        files: run.files.iter().map(file_metadata).collect(),
        start_ns: run.start_ns,
        end_ns: run.end_ns,
    });
    Metadata {
        version: TABLE_VERSION,
        axes: shape.axes.clone(),
        thermometers: shape.thermometers.clone(),
        aux: shape.aux.clone(),
        arcsec_per_count,
        quantum,
        timed: shape.timed,
        window: shape.window,
        nominal_s: shape.nominal_s,
        period_ns: shape.period_ns,
        sample_interval_s: shape.sample_interval_s,
        runs: runs.collect(),
        tallies: windows.tallies.list(),
        setup: setup.clone(),
    }
}

/// True for a Parquet file that says it is such a table; any other may be a log.
///
/// # Errors
/// A file that cannot be opened. One that cannot be read as Parquet is no table.
pub fn is_table(path: &Path) -> Result<bool> {
    let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    let described = || Some(parquet_schema(file).ok()?.metadata().contains_key(METADATA_KEY));
    Ok(std::panic::catch_unwind(std::panic::AssertUnwindSafe(described)).ok().flatten().unwrap_or(false))
}

/// Most axes, thermometers or auxiliary columns; a log has at most as many.
const MOST_COLUMNS: usize = 256;
/// Windows decoded at once.
const BATCH_ROWS: usize = 1024;

/// Reads a table back, with the setup its logs were read with.
///
/// # Errors
/// No Parquet file, no window table of this version, columns that do not fit its description, or more values than the memory budget
/// has room for.
pub fn read_table(path: &Path, memory: MemoryBudget) -> Result<(Windows, Setup)> {
    // The decoder is not ours; whatever it does with a damaged file, the file is what is bad.
    let result = std::panic::catch_unwind(|| read(path, memory));
    let result = result.unwrap_or_else(|_| Err(Error::input("a damaged Parquet file (its decoder gave up)")));
    result.map_err(|e| e.file(path.display().to_string()))
}

fn read(path: &Path, memory: MemoryBudget) -> Result<(Windows, Setup)> {
    let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    let broken = |e: &dyn std::fmt::Display| Error::input(format!("not a readable Parquet file: {e}"));
    let schema = parquet_schema(file).map_err(|e| broken(&e))?;
    let json = schema.metadata().get(METADATA_KEY).cloned().ok_or_else(|| {
        Error::input("a Parquet file, but no window table of Sagnac")
            .help("`sagnac window LOG -o w.parquet` writes one")
    })?;
    let meta: Metadata =
        serde_json::from_str(&json).map_err(|e| Error::input(format!("its description is damaged: {e}")))?;
    if meta.version != TABLE_VERSION {
        return Err(Error::input(format!("window table version {}; this program reads {TABLE_VERSION}", meta.version))
            .help("make it again from its logs with `sagnac window`"));
    }
    meta.setup.check()?;
    check_columns(&meta)?;
    let setup = meta.setup.clone();
    let mut windows = empty_windows(meta);
    let file = File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    // Everything is kept: as windows, or as tracks.
    let values = (memory.windows() + memory.tracks()) / size_of::<f64>() as u64;
    let options = ParquetRead { roots: None, rows: BATCH_ROWS, values, memory };
    for batch in parquet_batches(file, &options).map_err(|e| broken(&e))? {
        append(&mut windows, &batch.map_err(|e| broken(&e))?)?;
    }
    check_indices(&windows)?;
    Ok((windows, setup))
}

/// Axes, thermometers and auxiliary columns are each named once, and an axis is one letter or digit.
fn check_columns(meta: &Metadata) -> Result<()> {
    let refused = |what: &str| Err(Error::input(format!("its description is damaged: {what}")));
    let twice = |names: &[String]| names.iter().enumerate().any(|(at, name)| names[..at].contains(name));
    let axes: Vec<String> = meta.axes.iter().map(char::to_string).collect();
    // So many at most that no search for a second one takes long.
    let most = [meta.axes.len(), meta.thermometers.len(), meta.aux.len()].into_iter().max().unwrap_or(0);
    if most > MOST_COLUMNS {
        return refused(&format!("more than {MOST_COLUMNS} columns of one kind"));
    }
    if axes.is_empty() || twice(&axes) || !meta.axes.iter().all(char::is_ascii_alphanumeric) {
        return refused("its axes are not letters or digits, each once");
    }
    if twice(&meta.thermometers) || twice(&meta.aux) {
        return refused("a column is named twice");
    }
    Ok(())
}

fn empty_windows(meta: Metadata) -> Windows {
    let columns = |n: usize| vec![Vec::new(); n];
    let sensors = meta.thermometers.len();
    let rows = WindowRows {
        angle: columns(meta.axes.len()),
        short_tau: vec![Vec::new(); meta.axes.len()],
        mean_c: columns(sensors),
        variance_c2: columns(sensors),
        min_c: columns(sensors),
        max_c: columns(sensors),
        aux: columns(meta.aux.len()),
        aux_variance: columns(meta.aux.len()),
        aux_min: columns(meta.aux.len()),
        aux_max: columns(meta.aux.len()),
        ..WindowRows::default()
    };
    let unit = match (meta.arcsec_per_count, meta.quantum) {
        (Some(arcsec_per_count), Some(quantum)) => AngleUnit::Quanta { arcsec_per_count, quantum },
        _ => AngleUnit::Arcsec,
    };
    let runs = meta.runs.into_iter().map(|run| Run {
        files: run.files.into_iter().map(run_file).collect(),
        start_ns: run.start_ns,
        end_ns: run.end_ns,
        tracks: columns(sensors + meta.aux.len()),
    });
    Windows {
        runs: runs.collect(),
        rows,
        tallies: Tallies::from_list(meta.tallies),
        shape: WindowShape {
            axes: meta.axes,
            thermometers: meta.thermometers,
            aux: meta.aux,
            unit,
            timed: meta.timed,
            window: meta.window,
            nominal_s: meta.nominal_s,
            period_ns: meta.period_ns,
            sample_interval_s: meta.sample_interval_s,
        },
    }
}

fn append(windows: &mut Windows, batch: &RecordBatch) -> Result<()> {
    let missing =
        |name: &str| Error::input("this column of the window table is missing or of another type").column(name);
    let column = |name: &str| {
        let whole = |c: &&ArrayRef| c.len() == batch.num_rows() && (name == "excluded" || c.null_count() == 0);
        batch.column_by_name(name).filter(whole).ok_or_else(|| missing(name))
    };
    let floats = |name: &str| {
        let values = column(name)?.as_primitive_opt::<Float64Type>().ok_or_else(|| missing(name))?.values().to_vec();
        within_bounds(name, &values).map(|()| values)
    };
    let longs = |name: &str| {
        column(name)?.as_primitive_opt::<Int64Type>().map(|c| c.values().to_vec()).ok_or_else(|| missing(name))
    };
    let words = |name: &str| {
        column(name)?.as_primitive_opt::<UInt32Type>().map(|c| c.values().to_vec()).ok_or_else(|| missing(name))
    };
    let (shape, rows) = (&windows.shape, &mut windows.rows);
    let run = words("run")?;
    rows.start_ns.extend(longs("start_ns")?);
    rows.end_ns.extend(longs("end_ns")?);
    rows.duration_ns.extend(longs("duration_ns")?);
    rows.samples.extend(words("samples")?);
    rows.reference_dps.extend(floats("reference_dps")?);
    let lines = column("first_line")?.as_primitive_opt::<UInt64Type>().ok_or_else(|| missing("first_line"))?;
    rows.first_line.extend(lines.values());
    let reasons = column("excluded")?.as_string_view_opt().ok_or_else(|| missing("excluded"))?;
    for reason in reasons {
        let parsed = reason.map(|r| serde_json::from_value(serde_json::Value::from(r))).transpose();
        rows.excluded.push(parsed.map_err(|_| missing("excluded"))?);
    }
    for (axis, angle) in shape.axes.iter().zip(&mut rows.angle) {
        let name = format!("angle_{axis}");
        match shape.unit {
            AngleUnit::Quanta { .. } => angle.extend(longs(&name)?.into_iter().map(|q| q as f64)),
            AngleUnit::Arcsec => angle.extend(floats(&name)?),
        }
    }
    for (axis, slot) in shape.axes.iter().zip(&mut rows.short_tau) {
        let name = format!("short_tau_{axis}");
        let lists = column(&name)?.as_list_opt::<i32>().ok_or_else(|| missing(&name))?;
        for list in lists.iter() {
            let all = list.as_ref().and_then(|l| l.as_primitive_opt::<Float64Type>()).ok_or_else(|| missing(&name))?;
            within_bounds(&name, all.values())?;
            let third = all.len() / 3;
            let part = |n: usize| all.values().get(n * third..(n + 1) * third).unwrap_or(&[]).to_vec();
            slot.push(ShortTauSums { squares: part(0), numbers: part(1), edf: part(2) });
        }
    }
    for (i, sensor) in shape.thermometers.iter().enumerate() {
        let slots = [&mut rows.mean_c, &mut rows.variance_c2, &mut rows.min_c, &mut rows.max_c];
        for (prefix, slot) in SENSOR_COLUMNS.iter().zip(slots) {
            slot[i].extend(floats(&format!("{prefix}_{sensor}"))?);
        }
    }
    for at in 0..shape.thermometers.len() + shape.aux.len() {
        let name = track_column(shape, at);
        let lists = column(&name)?.as_list_opt::<i32>().ok_or_else(|| missing(&name))?;
        for (list, run) in lists.iter().zip(&run) {
            let piece =
                list.as_ref().and_then(|l| l.as_primitive_opt::<Float64Type>()).ok_or_else(|| missing(&name))?;
            within_bounds(&name, piece.values())?;
            let target = windows.runs.get_mut(*run as usize).and_then(|run| run.tracks.get_mut(at));
            target.ok_or_else(|| missing("run"))?.extend(piece.values());
        }
    }
    for (i, name) in shape.aux.iter().enumerate() {
        let slots = [&mut rows.aux, &mut rows.aux_variance, &mut rows.aux_min, &mut rows.aux_max];
        for (prefix, slot) in AUX_COLUMNS.iter().zip(slots) {
            slot[i].extend(floats(&format!("{prefix}_{name}"))?);
        }
    }
    rows.run.extend(run);
    Ok(())
}

/// No angle, temperature or rate of a window is beyond this, in any unit; a value that is missing is NaN.
const MOST: f64 = 1e20;

fn within_bounds(name: &str, values: &[f64]) -> Result<()> {
    match values.iter().find(|value| value.abs() > MOST) {
        None => Ok(()),
        Some(value) => {
            let error = Error::input("no window of a gyro has so large a value; the window table is damaged");
            Err(error.column(name).value(value.to_string()))
        }
    }
}

fn check_indices(windows: &Windows) -> Result<()> {
    let runs = windows.runs.len();
    let rows = &windows.rows;
    let sane = |ns: &i64| ns.unsigned_abs() < 1 << 62;
    let in_order = |i: usize| {
        let (start, end) = (rows.start_ns[i], rows.end_ns[i]);
        let run = windows.runs.get(rows.run[i] as usize);
        sane(&start) && sane(&end) && start < end && run.is_some_and(|run| run.start_ns <= start && end <= run.end_ns)
    };
    let sound = windows.runs.iter().all(|run| !run.files.is_empty())
        && rows.run.iter().all(|run| (*run as usize) < runs)
        && rows.run.is_sorted()
        && windows.runs.iter().all(|run| sane(&run.start_ns) && sane(&run.end_ns))
        && (0..windows.len()).all(in_order)
        && windows.rows.duration_ns.iter().all(|d| *d > 0)
        && rows.short_tau.iter().flatten().all(|s| s.squares.len() < 64 && s.squares.len() == s.edf.len())
        && windows.shape.period_ns > 0;
    if sound {
        Ok(())
    } else {
        Err(Error::input("the window table contradicts itself (runs, durations, noise or period)"))
    }
}
