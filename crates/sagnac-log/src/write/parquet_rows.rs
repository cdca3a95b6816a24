//! Rows of cells as Parquet.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, Int64Builder, StringBuilder};
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

use crate::error::{Error, Result};
use crate::ingest::{Content, parse_time_ns};

/// How every Parquet file of Sagnac is written.
pub fn parquet_properties() -> WriterProperties {
    WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by("sagnac".into()).build()
}

/// Rows written together.
const GROUP_ROWS: usize = 65_536;

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
    fn push(&mut self, cell: &str, decimal_comma: bool) {
        match self {
            Self::Number(column) if decimal_comma => column.append_option(cell.replacen(',', ".", 1).parse().ok()),
            Self::Number(column) => column.append_option(cell.parse().ok()),
            Self::Nanoseconds(column) => column.append_option(parse_time_ns(cell.as_bytes(), 0, decimal_comma)),
            Self::Text(column) => column.append_value(cell),
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

/// Writes rows of text cells as typed columns, in groups, so that memory does not grow with the rows.
pub struct ParquetRows<'a> {
    writer: Option<ArrowWriter<&'a mut (dyn Write + Send)>>,
    schema: Arc<Schema>,
    columns: Vec<Column>,
    rows: usize,
    decimal_comma: bool,
}

fn failed(error: &dyn std::fmt::Display) -> Error {
    Error::input(format!("cannot write Parquet: {error}"))
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
        let (names, contents): (Vec<String>, Vec<Content>) = columns.into_iter().unzip();
        let columns: Vec<Column> = contents.into_iter().map(Column::of).collect();
        let fields = names.into_iter().zip(&columns).map(|(name, c)| Field::new(name, c.data_type(), true));
        let metadata: HashMap<String, String> = metadata.into_iter().collect();
        let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()).with_metadata(metadata));
        let writer = ArrowWriter::try_new(out, Arc::clone(&schema), Some(parquet_properties()));
        let writer = Some(writer.map_err(|e| failed(&e))?);
        Ok(Self { writer, schema, columns, rows: 0, decimal_comma })
    }

    /// A row, a cell for each column.
    ///
    /// # Errors
    /// A failed write.
    pub fn row<C: AsRef<[u8]>>(&mut self, cells: &[C]) -> Result<()> {
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            column.push(&String::from_utf8_lossy(cell.as_ref()), self.decimal_comma);
        }
        self.rows += 1;
        if self.rows == GROUP_ROWS { self.write_group() } else { Ok(()) }
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
        let arrays = self.columns.iter_mut().map(Column::finish).collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(|e| failed(&e))?;
        self.rows = 0;
        self.writer.as_mut().map_or(Ok(()), |writer| writer.write(&batch)).map_err(|e| failed(&e))
    }
}
