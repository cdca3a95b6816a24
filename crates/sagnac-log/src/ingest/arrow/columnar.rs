//! Parquet and Arrow logs: record batches to rows.
//!
//! Column names have the same meaning as headers of a text log ([`crate::ingest::columns::header`]); a null is an empty
//! field. The same values give the same rows as in text: numbers as `f64` (a 32-bit float exactly), times as in
//! their shortest decimal form. Rows are numbered as if one header line preceded them.
//!
//! Both decoders seek, so anything but a plain file is first copied to a temporary one. Before Arrow's decoder sees a
//! file, every length that it would trust is checked against the length of the file.

use std::fs::File;
use std::path::PathBuf;
use std::thread::JoinHandle;

use arrow_array::{Array, RecordBatch};
use arrow_schema::{ArrowError, DataType, Schema, SchemaRef};
use csv::ByteRecord;

use crate::error::{Error, Result};
use crate::ingest::arrow::guard::{clone_of, guarded, parquet_broken, unread};
use crate::ingest::arrow::ipc::{ArrowForm, arrow_reader, check_arrow};
use crate::ingest::arrow::parquet_file::{ParquetRead, decoded_type, parquet_batches, parquet_schema};
use crate::ingest::arrow::row_hash::RowHash;
use crate::ingest::arrow::values::{flags, has_values, numbers, text_bytes, texts, time_text, times};
use crate::ingest::bytes::source::{HashHandle, Source};
use crate::ingest::columns::feed::{Feed, MAX_LINE_BYTES, ReadMode};
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::number::ISO_8601;
use crate::ingest::columns::raw::{Faults, RawRows, Slot};
use crate::memory::MemoryBudget;
use crate::read::open_input;
use crate::threads::spawn;

/// Most rows of a piece, and most values of it; of rows that are kept as text, most fields and most bytes of text.
const PIECE_ROWS: usize = 16_384;
const PIECE_VALUES: usize = 1 << 20;
const PIECE_FIELDS: usize = 1 << 17;
const PIECE_TEXT_BYTES: usize = 4 << 20;

/// Which of the three formats a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Parquet,
    Arrow(ArrowForm),
}

impl Form {
    fn of(start: &[u8]) -> Self {
        match start {
            [b'P', ..] => Self::Parquet,
            [b'A', ..] => Self::Arrow(ArrowForm::File),
            _ => Self::Arrow(ArrowForm::Stream),
        }
    }
}

/// A log of columns whose header has been read.
pub(crate) struct Columnar {
    pub(crate) headers: Vec<String>,
    schema: SchemaRef,
    origin: Origin,
    memory: MemoryBudget,
}

/// Where its batches come from.
enum Origin {
    File { file: File, form: Form, hashing: Hashing },
    Memory { batches: Batches, hash: HashHandle },
}

/// A table in memory, batch by batch.
pub struct MemoryTable {
    /// Name in messages and records.
    pub name: String,
    /// Its columns.
    pub schema: SchemaRef,
    /// Its batches, in order. An error of [`crate::Error`] as [`ArrowError::ExternalError`] comes out as it is.
    pub batches: Box<dyn Iterator<Item = std::result::Result<RecordBatch, ArrowError>> + Send>,
}

/// The hash of a file.
enum Hashing {
    Done,
    /// Computed in parallel with the decoding.
    Parallel(JoinHandle<std::io::Result<u64>>),
    /// Computed after it: no further thread was to be had.
    After(PathBuf, HashHandle),
    /// Of the rows: the table has no bytes of its own.
    OfRows(Box<RowHash>),
}

/// A batch iterator of either decoder.
type Batches = Box<dyn Iterator<Item = std::result::Result<RecordBatch, ArrowError>> + Send>;

/// Opens the file and reads the names of its columns.
pub(crate) fn open(source: Source, memory: MemoryBudget) -> Result<Columnar> {
    let form = Form::of(&source.start);
    let (mut file, hashing) = match source.plain_file.clone() {
        Some(path) => {
            let file = open_input(&path).map_err(|e| Error::io_path(&path, "open", &e))?;
            (file, Hashing::begin(source, path))
        }
        None => (spooled(source)?, Hashing::Done),
    };
    let schema = match form {
        Form::Parquet => guarded(|| parquet_schema(clone_of(&file)?).map_err(parquet_broken))?,
        Form::Arrow(form) => {
            check_arrow(&mut file, form, memory)?;
            guarded(|| Ok(arrow_reader(&file, form, None)?.schema()))?
        }
    };
    Ok(Columnar { headers: names(&schema), schema, origin: Origin::File { file, form, hashing }, memory })
}

/// The columns of a table in memory; `hash` becomes that of its rows.
pub(crate) fn of_table(table: MemoryTable, hash: HashHandle, memory: MemoryBudget) -> Columnar {
    let MemoryTable { schema, batches, .. } = table;
    Columnar { headers: names(&schema), schema, origin: Origin::Memory { batches, hash }, memory }
}

fn names(schema: &Schema) -> Vec<String> {
    schema.fields().iter().map(|field| field.name().clone()).collect()
}

/// All bytes of a source in a private temporary file.
fn spooled(source: Source) -> Result<File> {
    let mut reader = source.reader;
    let mut file = tempfile::tempfile().map_err(|e| Error::io("a temporary file", "make", &e))?;
    std::io::copy(&mut reader, &mut file).map_err(|e| Error::cannot("read", &e))?;
    Ok(file)
}

impl Columnar {
    /// Begins to decode. `mode` selects whether all columns are kept as text.
    ///
    /// # Errors
    /// A column that is read has a type without values; what the decoder reports.
    pub(crate) fn feed(self, layout: &Layout, mode: ReadMode) -> Result<ColumnFeed> {
        let keep_fields = mode != ReadMode::Bulk;
        let read = layout.columns_read();
        if let Some(index) = read.iter().find(|index| !self.has_values(**index)) {
            return Err(wrong_type(&self.schema, &layout.headers[*index]));
        }
        // A column without values would be empty as text.
        let mut decoded: Vec<usize> =
            if keep_fields { (0..layout.headers.len()).filter(|i| self.has_values(*i)).collect() } else { read };
        decoded.sort_unstable();
        decoded.dedup();
        let mut places = vec![None; layout.headers.len()];
        decoded.iter().enumerate().for_each(|(place, index)| places[*index] = Some(place));
        let most = if keep_fields { PIECE_FIELDS } else { PIECE_VALUES };
        let columns = if keep_fields { layout.headers.len() } else { decoded.len() };
        let most_rows = (most / columns.max(1)).clamp(1, PIECE_ROWS);
        let memory = self.memory;
        let (batches, hashing, what): (Batches, _, _) = match self.origin {
            Origin::File { file, form: Form::Parquet, hashing } => {
                let read = ParquetRead { roots: Some(&decoded), rows: most_rows, values: u64::MAX, memory };
                let batches = guarded(|| parquet_batches(clone_of(&file)?, &read).map_err(parquet_broken))?;
                (Box::new(batches), hashing, "Parquet file")
            }
            Origin::File { file, form: Form::Arrow(form), hashing } => {
                (Box::new(guarded(|| arrow_reader(&file, form, Some(decoded)))?), hashing, "Arrow file")
            }
            Origin::Memory { batches, hash } => {
                // Every column is there, at its own place.
                decoded.iter().for_each(|index| places[*index] = Some(*index));
                (batches, Hashing::OfRows(Box::new(RowHash::new(layout, hash))), "table")
            }
        };
        let (layout, slots, schema) = (layout.clone(), Slot::of_columns(layout), self.schema);
        Ok(ColumnFeed { batches, layout, slots, schema, places, keep_fields, most_rows, hashing, what, waiting: None })
    }

    /// The first column that Arrow's types call a time, and its unit as text: a date, or seconds.
    pub(crate) fn own_time(&self) -> Option<(usize, u32)> {
        let places = |kind: &DataType| match kind {
            DataType::Timestamp(..) => Some(ISO_8601),
            DataType::Duration(_) => Some(9),
            _ => None,
        };
        self.schema.fields().iter().enumerate().find_map(|(index, field)| Some((index, places(field.data_type())?)))
    }

    fn has_values(&self, index: usize) -> bool {
        let kind = self.schema.fields().get(index).map(|field| field.data_type());
        kind.is_some_and(|kind| match self.origin {
            Origin::File { form: Form::Parquet, .. } => has_values(&decoded_type(kind)),
            Origin::File { .. } | Origin::Memory { .. } => has_values(kind),
        })
    }
}

fn wrong_type(schema: &Schema, name: &str) -> Error {
    let kind = schema.field_with_name(name).map_or(String::new(), |field| field.data_type().to_string());
    Error::input(
        format!("the column contains {kind}, and numbers are needed"),
        "write it as numbers, or map it to \"ignore\" under [columns]",
    )
    .column(name)
}

/// Record batches to rows.
pub(crate) struct ColumnFeed {
    batches: Batches,
    layout: Layout,
    /// One per column of the file.
    slots: Vec<Slot>,
    schema: SchemaRef,
    /// Place of each of the file's columns among those that are decoded.
    places: Vec<Option<usize>>,
    keep_fields: bool,
    /// Rows of a piece.
    most_rows: usize,
    hashing: Hashing,
    what: &'static str,
    /// A batch and the number of its rows that were already returned.
    waiting: Option<(RecordBatch, usize)>,
}

impl Feed for ColumnFeed {
    fn next(&mut self, _: &mut Vec<u8>, rows: &mut RawRows) -> Result<bool> {
        // An Arrow batch may be of any size.
        let (batch, done) = match self.waiting.take() {
            Some(waiting) => waiting,
            None => match self.batches.next() {
                Some(batch) => (batch.map_err(|e| unread(self.what, e))?, 0),
                None => return self.hashing.finish().map(|()| false),
            },
        };
        let length = (batch.num_rows() - done).min(self.most_rows);
        let mut piece = batch.slice(done, length);
        if self.keep_fields {
            piece = piece.slice(0, rows_of_short_text(&piece)?);
        }
        let done = done + piece.num_rows();
        if done < batch.num_rows() {
            self.waiting = Some((batch, done));
        }
        self.rows_of(&piece, rows)?;
        if let Hashing::OfRows(hash) = &mut self.hashing {
            hash.push(rows);
        }
        Ok(true)
    }
}

/// The first rows of a batch, at least one, whose text together is short enough to be copied.
fn rows_of_short_text(batch: &RecordBatch) -> Result<usize> {
    let mut all = vec![0_usize; batch.num_rows()];
    for (column, field) in batch.columns().iter().zip(batch.schema_ref().fields()) {
        for (sum, bytes) in all.iter_mut().zip(text_bytes(column)) {
            // No longer than a line of text may be.
            if bytes > MAX_LINE_BYTES {
                return Err(Error::input(
                    "a text field is larger than 1 MiB",
                    "map the column to \"ignore\" under [columns], or remove it from the file",
                )
                .column(field.name()));
            }
            *sum += bytes;
        }
    }
    let mut sum = 0_usize;
    let fits = all.iter().take_while(|bytes| {
        sum = sum.saturating_add(**bytes);
        sum <= PIECE_TEXT_BYTES
    });
    Ok(fits.count().max(1).min(batch.num_rows()))
}

impl Hashing {
    /// Begins to hash in parallel with the decoding, if there may be a further thread.
    fn begin(source: Source, path: PathBuf) -> Self {
        let (mut reader, hash) = (source.reader, source.hash);
        match spawn("hash", move || std::io::copy(&mut reader, &mut std::io::sink())) {
            Ok(thread) => Self::Parallel(thread),
            Err(_) => Self::After(path, hash),
        }
    }

    /// Waits until every byte is in the hash.
    fn finish(&mut self) -> Result<()> {
        let unread = |e: std::io::Error| Error::cannot("read", &e);
        match std::mem::replace(self, Self::Done) {
            Self::Done => Ok(()),
            Self::OfRows(mut hash) => {
                hash.finish();
                Ok(())
            }
            Self::Parallel(thread) => {
                let defect = |_| Error::defect("the file could not be hashed");
                thread.join().map_err(defect)?.map(|_| ()).map_err(unread)
            }
            Self::After(path, hash) => {
                let file = open_input(&path).map_err(|e| Error::io_path(&path, "open", &e))?;
                hash.begin_anew_with(file).map_err(unread)
            }
        }
    }
}

impl ColumnFeed {
    fn rows_of(&self, batch: &RecordBatch, rows: &mut RawRows) -> Result<()> {
        rows.reset(&self.layout);
        let length = batch.num_rows();
        rows.line.extend(1..=length as u32);
        rows.faults.resize(length, Faults::NONE);
        for (index, slot) in self.slots.iter().enumerate().filter(|(_, slot)| **slot != Slot::Skipped) {
            let column = self.column(batch, index)?;
            let read = match *slot {
                Slot::Time(places) => times(column, places, &mut rows.time_ns),
                Slot::Valid => flags(column, &mut rows.faults),
                number => rows.numbers(number).and_then(|out| numbers(column, number.bad(), out)),
            };
            read.ok_or_else(|| wrong_type(&self.schema, &self.layout.headers[index]))?;
        }
        rows.finish(&self.slots, length as u64);
        if self.keep_fields {
            self.texts(batch, rows)?;
        }
        Ok(())
    }

    /// A column by its place in the layout, if it is decoded.
    fn decoded<'a>(&self, batch: &'a RecordBatch, index: usize) -> Option<&'a dyn Array> {
        self.places.get(index).copied().flatten().and_then(|place| batch.columns().get(place)).map(AsRef::as_ref)
    }

    fn column<'a>(&self, batch: &'a RecordBatch, index: usize) -> Result<&'a dyn Array> {
        let missing = || {
            Error::input(
                "a part of the file lacks this column",
                "write the file again with the same columns in every part",
            )
            .column(&self.layout.headers[index])
        };
        self.decoded(batch, index).ok_or_else(missing)
    }

    /// Every column as text, as a CSV of it would hold; one of a type without values stays empty.
    fn texts(&self, batch: &RecordBatch, rows: &mut RawRows) -> Result<()> {
        let mut columns = Vec::new();
        for index in 0..self.layout.headers.len() {
            let Some(column) = self.decoded(batch, index) else {
                columns.push(vec![String::new(); batch.num_rows()]);
                continue;
            };
            columns.push(match self.layout.time.filter(|(time, _)| *time == index) {
                // Arrow's own times in the unit that the header names.
                Some((_, places)) if !column.data_type().is_numeric() => {
                    rows.time_ns.iter().map(|time_ns| time_text(*time_ns, places)).collect()
                }
                _ => texts(column).ok_or_else(|| wrong_type(&self.schema, &self.layout.headers[index]))?,
            });
        }
        rows.fields.extend(
            (0..batch.num_rows())
                .map(|row| columns.iter().map(|column: &Vec<String>| column[row].as_bytes()).collect::<ByteRecord>()),
        );
        Ok(())
    }
}
