//! Rows of cells as Parquet.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, Int64Builder, StringBuilder};
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use crate::error::{Error, Result};
use crate::ingest::{Content, parse_time_ns, parse_value};

/// How every Parquet file of Sagnac is written: statistics of each group of rows, and none of its pages, which a writer would hold until the end of the
/// file (25 MiB for three days at 4 kHz).
pub fn parquet_properties() -> WriterProperties {
    WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true)
        .set_created_by("sagnac".into())
        .build()
}

/// Rows of a group: a writer holds half a kilobyte for each column of each of them until the end of the file, and the rows of the last one.
const GROUP_ROWS: usize = 262_144;

/// Cells of one column.
enum Column {
    Number(Float64Builder),
    Nanoseconds(Int64Builder),
    Text(StringBuilder),
}

impl Column {
    fn of(content: Content) -> Self {
        match content {
            Content::Nanoseconds => Self::Nanoseconds(Int64Builder::new()),
            Content::Number => Self::Number(Float64Builder::new()),
            Content::Text => Self::Text(StringBuilder::new()),
        }
    }

    fn data_type(&self) -> DataType {
        match self {
            Self::Number(_) => DataType::Float64,
            Self::Nanoseconds(_) => DataType::Int64,
            Self::Text(_) => DataType::Utf8,
        }
    }

    /// A cell; in a column of numbers anything else is null.
    fn push(&mut self, cell: &[u8], decimal_comma: bool) {
        match self {
            Self::Number(column) => column.append_option(parse_value(cell, decimal_comma)),
            Self::Nanoseconds(column) => column.append_option(parse_time_ns(cell, 0, decimal_comma)),
            Self::Text(column) => column.append_value(String::from_utf8_lossy(cell)),
        }
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::Number(column) => Arc::new(column.finish()),
            Self::Nanoseconds(column) => Arc::new(column.finish()),
            Self::Text(column) => Arc::new(column.finish()),
        }
    }
}

/// Rows of text cells on their way to typed columns: numbers, nanoseconds, text; a cell that is none of its column is null.
pub struct CellColumns {
    schema: Arc<Schema>,
    columns: Vec<Column>,
    rows: usize,
    decimal_comma: bool,
}

impl CellColumns {
    /// Columns by name and content; entries of metadata. With `decimal_comma` numbers may have one.
    pub fn new(columns: Vec<(String, Content)>, metadata: HashMap<String, String>, decimal_comma: bool) -> Self {
        let (names, contents): (Vec<String>, Vec<Content>) = columns.into_iter().unzip();
        let columns: Vec<Column> = contents.into_iter().map(Column::of).collect();
        let fields = names.into_iter().zip(&columns).map(|(name, c)| Field::new(name, c.data_type(), true));
        let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()).with_metadata(metadata));
        Self { schema, columns, rows: 0, decimal_comma }
    }

    /// The columns' names and types.
    pub fn schema(&self) -> Arc<Schema> {
        Arc::clone(&self.schema)
    }

    /// Rows that wait.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// True without waiting rows.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// A row; a cell that is missing is null.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: impl IntoIterator<Item = C>) {
        let mut cells = cells.into_iter();
        for column in &mut self.columns {
            match cells.next() {
                Some(cell) => column.push(cell.as_ref(), self.decimal_comma),
                None => column.push(b"", self.decimal_comma),
            }
        }
        self.rows += 1;
    }

    /// The waiting rows.
    ///
    /// # Errors
    /// None that is known: every column has as many rows.
    pub fn take(&mut self) -> Result<RecordBatch> {
        let arrays = self.columns.iter_mut().map(Column::finish).collect();
        self.rows = 0;
        RecordBatch::try_new(self.schema(), arrays).map_err(|e| failed(&e))
    }
}

/// Writes rows of text cells as typed columns, in groups, so that memory does not grow with the rows.
pub struct ParquetRows<'a> {
    writer: Option<ArrowWriter<&'a mut (dyn Write + Send)>>,
    cells: CellColumns,
}

fn failed(error: &dyn std::fmt::Display) -> Error {
    Error::input(format!("cannot write Parquet: {error}"), "write to another folder, or to a .csv file")
}

impl<'a> ParquetRows<'a> {
    /// Columns by name and content; one entry of metadata. With `decimal_comma` numbers may have one.
    ///
    /// # Errors
    /// A failed write.
    pub fn new(
        out: &'a mut (dyn Write + Send),
        columns: Vec<(String, Content)>,
        metadata: Option<(String, String)>,
        decimal_comma: bool,
    ) -> Result<Self> {
        let cells = CellColumns::new(columns, metadata.into_iter().collect(), decimal_comma);
        let writer = ArrowWriter::try_new(out, cells.schema(), Some(parquet_properties()));
        Ok(Self { writer: Some(writer.map_err(|e| failed(&e))?), cells })
    }

    /// A row, a cell for each column.
    ///
    /// # Errors
    /// A failed write.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: &[C]) -> Result<()> {
        self.cells.row(cells);
        if self.cells.len() == GROUP_ROWS { self.write_group() } else { Ok(()) }
    }

    /// The last rows and the end of the file.
    ///
    /// # Errors
    /// A failed write.
    pub fn finish(&mut self) -> Result<()> {
        self.write_group()?;
        self.writer.take().map_or(Ok(()), |writer| writer.close().map(|_| ())).map_err(|e| failed(&e))
    }

    fn write_group(&mut self) -> Result<()> {
        let batch = self.cells.take()?;
        self.writer.as_mut().map_or(Ok(()), |writer| writer.write(&batch)).map_err(|e| failed(&e))
    }
}

/// Writes batches of one schema as Parquet, in groups of some tens of thousands of rows.
pub struct ParquetBatches<'a> {
    writer: ArrowWriter<&'a mut (dyn Write + Send)>,
}

impl<'a> ParquetBatches<'a> {
    /// Of this schema.
    ///
    /// # Errors
    /// A failed write.
    pub fn new(out: &'a mut (dyn Write + Send), schema: Arc<Schema>) -> Result<Self> {
        let properties = parquet_properties().into_builder().set_max_row_group_row_count(Some(GROUP_ROWS)).build();
        let writer = ArrowWriter::try_new(out, schema, Some(properties)).map_err(|e| failed(&e))?;
        Ok(Self { writer })
    }

    /// More rows.
    ///
    /// # Errors
    /// A failed write.
    pub fn write(&mut self, batch: &RecordBatch) -> Result<()> {
        self.writer.write(batch).map_err(|e| failed(&e))
    }

    /// The end of the file.
    ///
    /// # Errors
    /// A failed write.
    pub fn finish(self) -> Result<()> {
        self.writer.close().map(|_| ()).map_err(|e| failed(&e))
    }
}
