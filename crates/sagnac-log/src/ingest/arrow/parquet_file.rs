//! Parquet with checks against damaged files.
//!
//! The decoder (parquet 59) trusts three things in a damaged file. All were found by fuzzing and are checked here:
//!
//! * Reads beyond the end return nothing, and its Thrift reader treats that as a skipped byte. A page header that
//!   announces a list of 2^31 elements is then read to the last one: an hour for a file of a kilobyte. Here a repeated
//!   read at the end is an error ([`ParquetFile`]).
//! * It reads every list of the footer to the announced length, however long
//!   ([`crate::ingest::arrow::parquet_footer`]).
//! * It allocates memory for as many values as a dictionary page announces. Here a page must hold at least one bit for each.
//! * It allocates what a page header announces, and copies a cell of text into each row that has it. Here the pages are compared with
//!   the memory budget first ([`crate::ingest::arrow::parquet_pages`]), and text is decoded as views of its page.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::sync::Arc;

use arrow_schema::{DataType, Field, Fields, SchemaRef};
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReader, RowGroups};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_field_levels};
use parquet::column::page::{Page, PageIterator, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{ChunkReader, FileReader, Length};
use parquet::file::serialized_reader::SerializedFileReader;

use crate::ingest::arrow::parquet_footer::check_footer;
use crate::ingest::arrow::parquet_pages::unpacked;
use crate::memory::MemoryBudget;

/// Which columns are decoded, and what they may take.
#[derive(Clone, Copy, Debug)]
pub struct ParquetRead<'a> {
    /// Indices of the columns; all if `None`.
    pub roots: Option<&'a [usize]>,
    /// Most rows of a batch.
    pub rows: usize,
    /// Most values of all columns together: for a reader that keeps them.
    pub values: u64,
    /// What the pages of the columns may unpack to.
    pub memory: MemoryBudget,
}

/// Batches of some columns. Text comes as views of the page that holds it.
///
/// # Errors
/// Errors of the decoder on the footer; pages that unpack to more than their share of the memory budget; more values than permitted.
pub fn parquet_batches(file: File, read: &ParquetRead<'_>) -> Result<ParquetRecordBatchReader> {
    let file = ParquetFile(file);
    let described = described(&file)?;
    let schema = described.metadata().file_metadata().schema_descr_ptr();
    let mask = match read.roots {
        Some(roots) => ProjectionMask::roots(&schema, roots.iter().copied()),
        None => ProjectionMask::all(),
    };
    let sizes =
        unpacked(&file.0, described.metadata(), |leaf| mask.leaf_included(leaf)).map_err(ParquetError::General)?;
    let share = read.memory.decoder();
    if sizes.pages > share {
        let help = "write it with smaller pages or smaller cells";
        return Err(ParquetError::External(Box::new(read.memory.exceeded(
            "pages that unpack together to",
            share,
            help,
        ))));
    }
    if sizes.values > read.values {
        return Err(ParquetError::General(format!("more than {} values", read.values)));
    }
    let rows = usize::try_from(share / sizes.row.max(1)).unwrap_or(read.rows).clamp(1, read.rows);
    let levels = parquet_to_arrow_field_levels(&schema, mask, Some(&decoded_types(described.schema().fields())))?;
    let groups = DoubtedGroups(Arc::new(SerializedFileReader::new(file)?));
    ParquetRecordBatchReader::try_new_with_row_groups(&levels, &groups, rows, None)
}

/// The type as which a column is decoded: text and bytes as views, any other as it is.
pub(super) fn decoded_type(kind: &DataType) -> DataType {
    match kind {
        DataType::Utf8 | DataType::LargeUtf8 => DataType::Utf8View,
        DataType::Binary | DataType::LargeBinary => DataType::BinaryView,
        DataType::Dictionary(_, values) if matches!(**values, DataType::Utf8 | DataType::LargeUtf8) => {
            DataType::Utf8View
        }
        kind => kind.clone(),
    }
}

fn decoded_types(fields: &Fields) -> Fields {
    let decoded = |field: &Arc<Field>| field.as_ref().clone().with_data_type(decoded_type(field.data_type()));
    fields.iter().map(decoded).collect()
}

/// Names and types of the columns, with the writer's metadata.
///
/// # Errors
/// As [`parquet_batches`].
pub fn parquet_schema(file: File) -> Result<SchemaRef> {
    Ok(Arc::clone(described(&ParquetFile(file))?.schema()))
}

fn described(file: &ParquetFile) -> Result<ArrowReaderMetadata> {
    check_footer(&file.0).map_err(|what| ParquetError::General(what.to_owned()))?;
    ArrowReaderMetadata::load(file, Default::default())
}

/// Row groups whose pages are checked before they are decoded.
struct DoubtedGroups(Arc<dyn FileReader>);

impl RowGroups for DoubtedGroups {
    fn num_rows(&self) -> usize {
        self.0.num_rows()
    }

    fn column_chunks(&self, column: usize) -> Result<Box<dyn PageIterator>> {
        Ok(Box::new(DoubtedChunks(self.0.column_chunks(column)?)))
    }

    fn row_groups(&self) -> Box<dyn Iterator<Item = &RowGroupMetaData> + '_> {
        self.0.row_groups()
    }

    fn metadata(&self) -> &ParquetMetaData {
        RowGroups::metadata(&self.0)
    }
}

struct DoubtedChunks(Box<dyn PageIterator>);

impl Iterator for DoubtedChunks {
    type Item = Result<Box<dyn PageReader>>;

    fn next(&mut self) -> Option<Self::Item> {
        Some(self.0.next()?.map(|pages| Box::new(DoubtedPages(pages)) as Box<dyn PageReader>))
    }
}

impl PageIterator for DoubtedChunks {}

struct DoubtedPages(Box<dyn PageReader>);

impl Iterator for DoubtedPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for DoubtedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.0.get_next_page()?;
        if let Some(Page::DictionaryPage { buf, num_values, .. }) = &page
            && *num_values as usize > buf.len().saturating_mul(8)
        {
            let what = format!("a dictionary of {num_values} values in {} bytes", buf.len());
            return Err(ParquetError::General(what));
        }
        Ok(page)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.0.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.0.skip_next_page()
    }
}

/// Permitted reads at the end: readers look for the end once or twice.
const PATIENCE: u32 = 8;

/// The file, for the decoder.
struct ParquetFile(File);

/// Bytes from an offset on.
struct UntilEnd {
    inner: BufReader<File>,
    at_end: u32,
}

impl Read for UntilEnd {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(out)?;
        if read == 0 && !out.is_empty() {
            self.at_end += 1;
            if self.at_end > PATIENCE {
                return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the file ends before its content"));
            }
        }
        Ok(read)
    }
}

impl Length for ParquetFile {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for ParquetFile {
    type T = UntilEnd;

    fn get_read(&self, start: u64) -> Result<UntilEnd> {
        Ok(UntilEnd { inner: self.0.get_read(start)?, at_end: 0 })
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        self.0.get_bytes(start, length)
    }
}
