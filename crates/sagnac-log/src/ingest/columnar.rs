//! Parquet and Arrow logs: record batches to rows.
//!
//! Column names have the same meaning as headers of a text log ([`crate::ingest::header`]); a null is an empty
//! field. The same values give the same rows as in text: numbers as `f64` (a 32-bit float exactly), times as in
//! their shortest decimal form. Rows are numbered as if one header line preceded them.
//!
//! Both decoders seek, so anything but a plain file is first copied to a temporary one. Before Arrow's decoder sees a
//! file, every length that it would trust is checked against the length of the file.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

use arrow_array::cast::AsArray;
use arrow_array::types::{
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType, Float32Type,
    Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrowPrimitiveType, RecordBatch};
use arrow_ipc::reader::StreamReader;
use arrow_schema::{ArrowError, DataType, Schema, TimeUnit};
use csv::ByteRecord;

use crate::error::{Error, Result};
use crate::ingest::ReadMode;
use crate::ingest::chunks::TableFeed;
use crate::ingest::header::Layout;
use crate::ingest::iso::iso_text;
use crate::ingest::number::{ISO_8601, parse_flag, parse_time_ns, parse_value, time_ns_of};
use crate::ingest::parquet_file::{parquet_batches, parquet_schema};
use crate::ingest::raw::{BAD_TEMPERATURE, Faults, NO_TIME, RawRows};
use crate::ingest::source::Source;

/// Rows decoded at once.
const BATCH_ROWS: usize = 8192;
/// Writers align the first message of a file to at most this.
const ARROW_PADDING: usize = 72;
/// Largest size of all unpacked buffers of a message.
const MAX_UNPACKED: u64 = 1 << 28;
/// Powers of ten of the units of Arrow's times to ns.
const UNITS: [(TimeUnit, u32); 4] =
    [(TimeUnit::Second, 9), (TimeUnit::Millisecond, 6), (TimeUnit::Microsecond, 3), (TimeUnit::Nanosecond, 0)];

/// Which of the three formats a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Parquet,
    ArrowFile,
    ArrowStream,
}

impl Form {
    fn of(magic: &[u8]) -> Self {
        match magic {
            b"PAR1" => Self::Parquet,
            b"ARROW1" => Self::ArrowFile,
            _ => Self::ArrowStream,
        }
    }
}

/// A log of columns whose header has been read.
pub(crate) struct Columnar {
    pub(crate) headers: Vec<String>,
    file: File,
    form: Form,
    hashing: Hashing,
}

/// The hash of a plain file, computed in parallel with the decoding.
enum Hashing {
    Done,
    Beside(Option<std::thread::JoinHandle<std::io::Result<u64>>>),
}

/// The same for a batch iterator of either decoder.
type Batches = Box<dyn Iterator<Item = std::result::Result<RecordBatch, ArrowError>> + Send>;

fn broken(what: &str, error: &dyn std::fmt::Display) -> Error {
    Error::input(format!("not a readable {what} file: {error}"))
}

/// Opens the file and reads the names of its columns.
pub(crate) fn open(source: Source) -> Result<Columnar> {
    let form = Form::of(source.format.magic);
    let (mut file, hashing) = match source.plain_file {
        Some(path) => {
            let file = File::open(&path).map_err(|e| Error::io_path(&path, "open", &e))?;
            let mut reader = source.reader;
            let beside = std::thread::spawn(move || std::io::copy(&mut reader, &mut std::io::sink()));
            (file, Hashing::Beside(Some(beside)))
        }
        None => (spooled(source)?, Hashing::Done),
    };
    let schema = match form {
        Form::Parquet => {
            let schema = guarded(|| parquet_schema(clone_of(&file)?).map_err(parquet_broken))?;
            schema.as_ref().clone()
        }
        _ => {
            check_arrow(&mut file, form)?;
            guarded(|| Ok(arrow_reader(&file, form, None)?.schema()))?.as_ref().clone()
        }
    };
    Ok(Columnar { headers: names(&schema), file, form, hashing })
}

fn names(schema: &Schema) -> Vec<String> {
    schema.fields().iter().map(|field| field.name().clone()).collect()
}

fn parquet_broken(error: parquet::errors::ParquetError) -> Error {
    broken("Parquet", &error)
}

fn arrow_broken(error: &ArrowError) -> Error {
    broken("Arrow", error)
}

fn clone_of(file: &File) -> Result<File> {
    file.try_clone().map_err(|e| Error::input(format!("cannot read: {e}")))
}

/// Runs a decoder; its panic becomes an error about the file.
fn guarded<T>(decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err(Error::input("a damaged file (its decoder gave up)")))
}

/// All bytes of a source in a private temporary file.
fn spooled(source: Source) -> Result<File> {
    let mut reader = source.reader;
    let mut file = tempfile::tempfile().map_err(|e| Error::io("a temporary file", "make", &e))?;
    std::io::copy(&mut reader, &mut file).map_err(|e| Error::input(format!("cannot read on: {e}")))?;
    Ok(file)
}

/// Where Arrow's messages begin: in the file form after its magic and padding.
fn messages_at(file: &mut File, form: Form) -> Result<u64> {
    if form == Form::ArrowStream {
        return Ok(0);
    }
    let mut start = [0; ARROW_PADDING];
    let unreadable = |e: std::io::Error| Error::input(format!("cannot read: {e}"));
    file.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    file.read_exact(&mut start).map_err(|_| truncated())?;
    let first = start.chunks_exact(8).skip(1).position(|word| word.starts_with(&[0xff; 4]));
    Ok(8 * (1 + first.unwrap_or(0)) as u64)
}

fn truncated() -> Error {
    Error::input("a truncated or damaged Arrow file").help("copy or write it again")
}

/// With the columns of these places alone, if any are given: the others are not unpacked.
fn arrow_reader(file: &File, form: Form, wanted: Option<Vec<usize>>) -> Result<StreamReader<BufReader<File>>> {
    let mut file = clone_of(file)?;
    let at = messages_at(&mut file, form)?;
    file.seek(SeekFrom::Start(at)).map_err(|e| Error::input(format!("cannot read: {e}")))?;
    StreamReader::try_new_buffered(file, wanted).map_err(|e| arrow_broken(&e))
}

/// Reads through the messages and checks every length against the file's length; detects a truncated file.
fn check_arrow(file: &mut File, form: Form) -> Result<()> {
    let unreadable = |e: std::io::Error| Error::input(format!("cannot read: {e}"));
    let size = file.metadata().map_err(unreadable)?.len();
    if form == Form::ArrowFile {
        let mut tail = [0; 6];
        file.seek(SeekFrom::Start(size.saturating_sub(6))).map_err(unreadable)?;
        file.read_exact(&mut tail).map_err(unreadable)?;
        if tail != *b"ARROW1" || size < 24 {
            return Err(truncated());
        }
    }
    let mut at = messages_at(file, form)?;
    loop {
        if at == size {
            return Ok(());
        }
        let mut head = [0; 8];
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        file.read_exact(&mut head).map_err(|_| truncated())?;
        let [mark, length] = [&head[..4], &head[4..]].map(|part| i32::from_le_bytes(part.try_into().unwrap_or([0; 4])));
        if mark != -1 {
            return Err(Error::input("a damaged Arrow file, or one of a version before 0.15"));
        }
        if length == 0 {
            return Ok(());
        }
        let length = u64::try_from(length).map_err(|_| truncated())?;
        if at + 8 + length > size {
            return Err(truncated());
        }
        let mut metadata = vec![0; length as usize];
        file.read_exact(&mut metadata).map_err(|_| truncated())?;
        let body_at = at + 8 + length;
        let body = guarded(|| check_message(&metadata, file, body_at, size))?;
        at = body_at + body;
    }
}

/// The length of a message's body, if it and its unpacked buffers are consistent.
fn check_message(metadata: &[u8], file: &mut File, body_at: u64, size: u64) -> Result<u64> {
    let damaged = |e: &dyn std::fmt::Display| Error::input(format!("a damaged Arrow file: {e}"));
    let message = arrow_ipc::root_as_message(metadata).map_err(|e| damaged(&e))?;
    let body = u64::try_from(message.bodyLength()).map_err(|e| damaged(&e))?;
    if body_at.saturating_add(body) > size {
        return Err(truncated());
    }
    let dictionary = message.header_as_dictionary_batch().and_then(|batch| batch.data());
    let batch = message.header_as_record_batch().or(dictionary);
    let Some(batch) = batch else { return Ok(body) };
    let mut all = 0_u64;
    for buffer in batch.buffers().iter().flatten() {
        let (offset, length) = (u64::try_from(buffer.offset()), u64::try_from(buffer.length()));
        let (Ok(offset), Ok(length)) = (offset, length) else { return Err(damaged(&"a negative length")) };
        if offset.saturating_add(length) > body {
            return Err(damaged(&"a buffer beyond its message"));
        }
        if batch.compression().is_some() && length >= 8 {
            let mut unpacked = [0; 8];
            file.seek(SeekFrom::Start(body_at + offset)).map_err(|e| damaged(&e))?;
            file.read_exact(&mut unpacked).map_err(|e| damaged(&e))?;
            // −1: not compressed after all.
            all = all.saturating_add(u64::try_from(i64::from_le_bytes(unpacked)).unwrap_or(0));
            if all > MAX_UNPACKED {
                return Err(damaged(&"a batch that unpacks to more than 256 MiB; write smaller batches"));
            }
        }
    }
    Ok(body)
}

impl Columnar {
    /// Begins to decode. `mode` selects whether all columns are kept as text.
    pub(crate) fn feed(self, layout: &Layout, mode: ReadMode) -> Result<ColumnFeed> {
        let keep_fields = mode != ReadMode::Bulk;
        let wanted: Vec<usize> = if keep_fields { (0..layout.headers.len()).collect() } else { layout.columns_read() };
        let batches: Batches = match self.form {
            Form::Parquet => guarded(|| {
                let reader = parquet_batches(clone_of(&self.file)?, Some(&wanted), BATCH_ROWS);
                Ok(Box::new(reader.map_err(parquet_broken)?) as Batches)
            })?,
            form => guarded(|| Ok(Box::new(arrow_reader(&self.file, form, Some(wanted.clone()))?) as Batches))?,
        };
        let what = if self.form == Form::Parquet { "Parquet" } else { "Arrow" };
        let layout = layout.clone();
        Ok(ColumnFeed { batches, layout, keep_fields, hashing: self.hashing, what, waiting: None })
    }
}

/// Record batches to rows.
pub(crate) struct ColumnFeed {
    batches: Batches,
    layout: Layout,
    keep_fields: bool,
    hashing: Hashing,
    what: &'static str,
    /// A batch and the number of its rows that were already returned.
    waiting: Option<(RecordBatch, usize)>,
}

impl TableFeed for ColumnFeed {
    fn next(&mut self, rows: &mut RawRows) -> Result<bool> {
        // An Arrow batch may be of any size.
        let (batch, done) = match self.waiting.take() {
            Some(waiting) => waiting,
            None => match self.batches.next() {
                Some(batch) => (batch.map_err(|e| broken(self.what, &e))?, 0),
                None => return self.hashing.finish().map(|()| false),
            },
        };
        let length = (batch.num_rows() - done).min(BATCH_ROWS);
        if done + length < batch.num_rows() {
            self.waiting = Some((batch.clone(), done + length));
        }
        self.rows_of(&batch.slice(done, length), rows)?;
        Ok(true)
    }
}

impl Hashing {
    /// Waits until every byte is in the hash.
    fn finish(&mut self) -> Result<()> {
        let Self::Beside(beside) = self else { return Ok(()) };
        let Some(thread) = beside.take() else { return Ok(()) };
        let read = thread.join().map_err(|_| Error::input("a defect of this program: the file could not be hashed"))?;
        read.map(|_| ()).map_err(|e| Error::input(format!("cannot read on: {e}")))
    }
}

impl ColumnFeed {
    fn rows_of(&self, batch: &RecordBatch, rows: &mut RawRows) -> Result<()> {
        let layout = &self.layout;
        rows.reset(layout.axes.len(), layout.temperatures.len(), layout.aux.len());
        let length = batch.num_rows();
        rows.lines = length as u64;
        rows.line.extend(1..=length as u32);
        rows.faults.resize(length, Faults::NONE);
        if let Some((index, places)) = layout.time {
            times(self.column(batch, index)?, places, &mut rows.time_ns)
                .ok_or_else(|| self.wrong_type(batch, index))?;
        }
        for ((index, _, unit), out) in layout.axes.iter().zip(&mut rows.axes) {
            let unit = unit.unwrap_or(1.0);
            self.values(batch, *index, f64::NAN, out)?;
            out.iter_mut().for_each(|value| *value *= unit);
        }
        for ((index, _, zero), out) in layout.temperatures.iter().zip(&mut rows.temperatures_c) {
            self.values(batch, *index, BAD_TEMPERATURE, out)?;
            out.iter_mut().for_each(|value| *value -= zero);
        }
        for ((index, _), out) in layout.aux.iter().zip(&mut rows.aux) {
            self.values(batch, *index, f64::NAN, out)?;
        }
        if let Some((index, _)) = layout.reference {
            self.values(batch, index, f64::NAN, &mut rows.reference_dps)?;
        }
        if let Some(index) = layout.valid {
            flags(self.column(batch, index)?, &mut rows.faults).ok_or_else(|| self.wrong_type(batch, index))?;
        }
        if self.keep_fields {
            self.texts(batch, rows)?;
        }
        Ok(())
    }

    /// A column by its place in the layout; projection keeps the names.
    fn column<'a>(&self, batch: &'a RecordBatch, index: usize) -> Result<&'a dyn Array> {
        let name = &self.layout.headers[index];
        let column = batch.column_by_name(name).map(AsRef::as_ref);
        column.ok_or_else(|| Error::input("a part of the file lacks this column").column(name))
    }

    fn wrong_type(&self, batch: &RecordBatch, index: usize) -> Error {
        let name = &self.layout.headers[index];
        let kind = batch.column_by_name(name).map_or(String::new(), |column| column.data_type().to_string());
        Error::input(format!("a column of type {kind}, where numbers are needed"))
            .column(name)
            .help("write it as a number, or map it to \"ignore\" under [columns]")
    }

    /// Values of a column: NaN for null, `bad` for anything but a finite number.
    fn values(&self, batch: &RecordBatch, index: usize, bad: f64, out: &mut Vec<f64>) -> Result<()> {
        numbers(self.column(batch, index)?, bad, out).ok_or_else(|| self.wrong_type(batch, index))
    }

    /// Every column as text, as a CSV of it would hold.
    fn texts(&self, batch: &RecordBatch, rows: &mut RawRows) -> Result<()> {
        let mut columns = Vec::new();
        let read = self.layout.columns_read();
        for index in 0..self.layout.headers.len() {
            let column = self.column(batch, index)?;
            columns.push(match self.layout.time.filter(|(time, _)| *time == index) {
                // Arrow's own times in the unit that the header names.
                Some((_, places)) if !column.data_type().is_numeric() => {
                    rows.time_ns.iter().map(|time_ns| time_text(*time_ns, places)).collect()
                }
                _ => match texts(column) {
                    Some(texts) => texts,
                    // A column that is not read and has no plain text stays empty.
                    None if !read.contains(&index) => vec![String::new(); batch.num_rows()],
                    None => return Err(self.wrong_type(batch, index)),
                },
            });
        }
        rows.fields.extend(
            (0..batch.num_rows())
                .map(|row| columns.iter().map(|column: &Vec<String>| column[row].as_bytes()).collect::<ByteRecord>()),
        );
        Ok(())
    }
}

fn each<T: ArrowPrimitiveType>(column: &dyn Array, take: impl FnMut(Option<T::Native>)) -> Option<()> {
    column.as_primitive_opt::<T>()?.iter().for_each(take);
    Some(())
}

/// A primitive column as numbers.
fn all<T: ArrowPrimitiveType>(column: &dyn Array, number: impl Fn(T::Native) -> f64, out: &mut Vec<f64>) -> Option<()> {
    let column = column.as_primitive_opt::<T>()?;
    if column.null_count() == 0 {
        out.extend(column.values().iter().map(|value| number(*value)));
    } else {
        out.extend(column.iter().map(|value| value.map_or(f64::NAN, &number)));
    }
    Some(())
}

/// Numbers of any width, or text that holds them: NaN for null, `bad` for anything but a finite number.
fn numbers(column: &dyn Array, bad: f64, out: &mut Vec<f64>) -> Option<()> {
    let finite = |value: f64| if value.is_finite() { value } else { bad };
    match column.data_type() {
        DataType::Float64 => all::<Float64Type>(column, finite, out),
        DataType::Float32 => all::<Float32Type>(column, |v| finite(f64::from(v)), out),
        DataType::Int8 => all::<Int8Type>(column, f64::from, out),
        DataType::Int16 => all::<Int16Type>(column, f64::from, out),
        DataType::Int32 => all::<Int32Type>(column, f64::from, out),
        DataType::Int64 => all::<Int64Type>(column, |v| v as f64, out),
        DataType::UInt8 => all::<UInt8Type>(column, f64::from, out),
        DataType::UInt16 => all::<UInt16Type>(column, f64::from, out),
        DataType::UInt32 => all::<UInt32Type>(column, f64::from, out),
        DataType::UInt64 => all::<UInt64Type>(column, |v| v as f64, out),
        DataType::Utf8 | DataType::LargeUtf8 => each_text(column, |text| {
            let given = text.filter(|t| !t.is_empty());
            out.push(given.map_or(f64::NAN, |t| parse_value(t.as_bytes(), false).unwrap_or(bad)));
        }),
        _ => None,
    }
}

/// Whole numbers exactly.
fn integers(column: &dyn Array, out: &mut dyn FnMut(Option<i128>)) -> Option<()> {
    match column.data_type() {
        DataType::Int8 => each::<Int8Type>(column, |v| out(v.map(i128::from))),
        DataType::Int16 => each::<Int16Type>(column, |v| out(v.map(i128::from))),
        DataType::Int32 => each::<Int32Type>(column, |v| out(v.map(i128::from))),
        DataType::Int64 => each::<Int64Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt8 => each::<UInt8Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt16 => each::<UInt16Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt32 => each::<UInt32Type>(column, |v| out(v.map(i128::from))),
        DataType::UInt64 => each::<UInt64Type>(column, |v| out(v.map(i128::from))),
        _ => None,
    }
}

fn each_text<'a>(column: &'a dyn Array, take: impl FnMut(Option<&'a str>)) -> Option<()> {
    match column.data_type() {
        DataType::Utf8 => column.as_string_opt::<i32>()?.iter().for_each(take),
        _ => column.as_string_opt::<i64>()?.iter().for_each(take),
    }
    Some(())
}

/// Times in ns: numbers in the unit of the header, Arrow's own times in theirs.
fn times(column: &dyn Array, places: u32, out: &mut Vec<i64>) -> Option<()> {
    // Numbers are never dates, so their power of ten is not needed.
    let scale = |places: u32| 10_i128.pow(places.min(9));
    let whole =
        |value: Option<i128>, places: u32| value.and_then(|v| i64::try_from(v * scale(places)).ok()).unwrap_or(NO_TIME);
    let unit_places = |unit: TimeUnit| UNITS.iter().find(|(u, _)| *u == unit).map_or(0, |(_, places)| *places);
    match column.data_type() {
        DataType::Float64 => {
            let column = column.as_primitive_opt::<Float64Type>()?;
            let time = |value: f64| time_ns_of(value, places).unwrap_or(NO_TIME);
            if column.null_count() == 0 {
                out.extend(column.values().iter().map(|value| time(*value)));
            } else {
                out.extend(column.iter().map(|value| value.map_or(NO_TIME, time)));
            }
            Some(())
        }
        DataType::Float32 => each::<Float32Type>(column, |v| {
            out.push(v.and_then(|v| time_ns_of(f64::from(v), places)).unwrap_or(NO_TIME));
        }),
        DataType::Utf8 | DataType::LargeUtf8 => {
            let time = |text: &str| parse_time_ns(text.as_bytes(), places, false);
            each_text(column, |text| out.push(text.and_then(time).unwrap_or(NO_TIME)))
        }
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
            let (unit, own) = (*unit, unit_places(*unit));
            arrow_times(column, unit, &mut |value| out.push(whole(value.map(i128::from), own)))
        }
        _ => integers(column, &mut |value| out.push(whole(value.filter(|_| places != ISO_8601), places))),
    }
}

fn arrow_times(column: &dyn Array, unit: TimeUnit, out: &mut dyn FnMut(Option<i64>)) -> Option<()> {
    let duration = matches!(column.data_type(), DataType::Duration(_));
    match (unit, duration) {
        (TimeUnit::Second, false) => each::<TimestampSecondType>(column, out),
        (TimeUnit::Millisecond, false) => each::<TimestampMillisecondType>(column, out),
        (TimeUnit::Microsecond, false) => each::<TimestampMicrosecondType>(column, out),
        (TimeUnit::Nanosecond, false) => each::<TimestampNanosecondType>(column, out),
        (TimeUnit::Second, true) => each::<DurationSecondType>(column, out),
        (TimeUnit::Millisecond, true) => each::<DurationMillisecondType>(column, out),
        (TimeUnit::Microsecond, true) => each::<DurationMicrosecondType>(column, out),
        (TimeUnit::Nanosecond, true) => each::<DurationNanosecondType>(column, out),
    }
}

/// Rows whose flag is not set.
fn flags(column: &dyn Array, faults: &mut [Faults]) -> Option<()> {
    let mut slots = faults.iter_mut();
    let mut flag = |set: bool| {
        if let Some(fault) = slots.next() {
            *fault = fault.with(Faults::FLAGGED, !set);
        }
    };
    match column.data_type() {
        DataType::Boolean => column.as_boolean_opt()?.iter().for_each(|v| flag(v == Some(true))),
        DataType::Utf8 | DataType::LargeUtf8 => {
            each_text(column, |text| flag(text.and_then(|t| parse_flag(t.as_bytes())).unwrap_or(false)))?;
        }
        _ => {
            let mut values = Vec::new();
            numbers(column, f64::NAN, &mut values)?;
            values.iter().for_each(|value| flag(*value == 1.0));
        }
    }
    Some(())
}

/// A time as a plain decimal in units of 10^`places` ns, exactly; empty for none.
fn time_text(time_ns: i64, places: u32) -> String {
    if time_ns == NO_TIME {
        return String::new();
    }
    if places == ISO_8601 {
        return iso_text(time_ns);
    }
    let unit = 10_u64.pow(places);
    let (whole, rest) = (time_ns.unsigned_abs() / unit, time_ns.unsigned_abs() % unit);
    let sign = if time_ns < 0 { "-" } else { "" };
    let fraction = format!("{rest:0width$}", width = places as usize);
    let fraction = fraction.trim_end_matches('0');
    if rest == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
}

fn texts(column: &dyn Array) -> Option<Vec<String>> {
    let mut out = Vec::with_capacity(column.len());
    match column.data_type() {
        DataType::Utf8 | DataType::LargeUtf8 => each_text(column, |text| out.push(text.unwrap_or("").to_owned()))?,
        DataType::Boolean => {
            let text = |v: Option<bool>| v.map_or(String::new(), |v| v.to_string());
            out.extend(column.as_boolean_opt()?.iter().map(text));
        }
        DataType::Float64 | DataType::Float32 => {
            let mut values = Vec::new();
            numbers(column, f64::INFINITY, &mut values)?;
            let text = |value: &f64| if value.is_nan() { String::new() } else { value.to_string() };
            out.extend(values.iter().map(text));
        }
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
            arrow_times(column, *unit, &mut |v| out.push(v.map_or(String::new(), |v| v.to_string())))?;
        }
        _ => integers(column, &mut |value| out.push(value.map_or(String::new(), |v| v.to_string())))?,
    }
    Some(out)
}
