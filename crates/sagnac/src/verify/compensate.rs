//! `sagnac compensate`: a log in, the same log corrected out, row by row.
//!
//! The first line is a stamp by which Sagnac knows its own output; the count or rate columns are
//! renamed `compensated_…` (`compensated_…_increment` where the log holds running totals: what comes
//! out is the row's own counts) and a `status` column is added. Rows that could not be read have no
//! corrected value and are left out (and counted).

use std::io::Write;

use sagnac_core::Status;

use crate::error::{Error, Result};
use crate::ingest::header::COMPENSATED_PREFIX;
use crate::ingest::{AngleUnit, COMPENSATED_STAMP, LogReader, LogSummary, unquoted};
use crate::setup::{Counter, Setup};
use crate::units::s_from_ns;
use crate::verify::{Correction, Replay};

/// What a corrected log is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CorrectedFormat {
    /// Text with the delimiter of the log.
    Csv,
    /// Parquet: numbers as `f64` (times in ns as `i64`), columns that are not read as text.
    Parquet,
}

/// Where corrected rows go.
trait RowsOut {
    fn row(&mut self, cells: &[Vec<u8>]) -> Result<()>;
    /// What was given so far is to be seen now.
    fn flush(&mut self) -> Result<()>;
    fn finish(&mut self) -> Result<()>;
}

/// Corrects a log as it is read; what was read.
///
/// # Errors
/// What the reader or the replay says; a failed write.
pub fn compensate(
    correction: &Correction,
    log: &mut LogReader,
    setup: &Setup,
    format: CorrectedFormat,
    out: &mut (dyn Write + Send),
) -> Result<LogSummary> {
    let shape = log.shape().clone();
    let file = log.summary().file;
    let (images, sensor) = correction.fit_to(&shape, setup).map_err(|e| e.file(&file))?;
    let mut replay = Replay::new(&images, &shape, sensor, &file)?;
    let (columns, read, units) = (log.axis_columns(), log.columns_read(), log.rate_units());
    let stamp = format!("{COMPENSATED_STAMP}: serial {}, images {}", correction.serial(), correction.sha256());
    let mut rows = rows_out(log, setup, format, &stamp, out)?;
    let comma_is_decimal = format == CorrectedFormat::Csv && log.delimiter() != b',';
    let mut cells: Vec<Vec<u8>> = Vec::new();
    let mut written = 0_u64;
    while let Some(batch) = log.next_batch()? {
        let corrected = replay.correct(batch)?;
        for (row, fields) in batch.fields.iter().enumerate() {
            let duration_s = s_from_ns(batch.end_ns[row] - batch.start_ns[row]);
            // A comma in a column of words says nothing of numbers.
            let has_comma = |index: &usize| fields.get(*index).is_some_and(|field| field.contains(&b','));
            let decimal_comma = comma_is_decimal && read.iter().any(has_comma);
            let value = |axis: usize| {
                let text = value_text(corrected.angle[axis][row], shape.unit, units[axis], duration_s);
                if decimal_comma { text.replace('.', ",") } else { text }
            };
            let status = corrected.status.iter().fold(Status::OK, |all, axis| all | axis[row]);
            cells.clear();
            cells.extend(fields.iter().enumerate().map(|(index, field)| {
                let axis = columns.iter().position(|column| *column == index);
                axis.map_or_else(|| unquoted(field).to_vec(), |axis| value(axis).into_bytes())
            }));
            cells.push(status_text(status).into_bytes());
            rows.row(&cells)?;
            written += 1;
        }
        rows.flush()?;
    }
    rows.finish()?;
    let summary = log.summary();
    if let (0, Some(most)) = (written, summary.tallies.most()) {
        let what = format!("no row could be corrected: {} are left out as {}", most.rows, most.reason.name());
        return Err(Error::refused(what).file(most.first).help("`sagnac inspect` lists everything left out"));
    }
    Ok(summary)
}

/// Headers of the corrected log, status last.
fn headers_out(log: &LogReader, setup: &Setup) -> Vec<String> {
    let columns = log.axis_columns();
    let suffix = if setup.counter == Counter::Cumulative { "_increment" } else { "" };
    let headers = log.headers().iter().enumerate().map(|(index, header)| {
        if columns.contains(&index) { format!("{COMPENSATED_PREFIX}{header}{suffix}") } else { header.clone() }
    });
    headers.chain(std::iter::once("status".to_owned())).collect()
}

fn rows_out<'a>(
    log: &LogReader,
    setup: &Setup,
    format: CorrectedFormat,
    stamp: &str,
    out: &'a mut (dyn Write + Send),
) -> Result<Box<dyn RowsOut + 'a>> {
    let headers = headers_out(log, setup);
    match format {
        CorrectedFormat::Csv => Ok(Box::new(CsvOut::new(out, log.delimiter(), stamp, &headers)?)),
        #[cfg(feature = "parquet")]
        CorrectedFormat::Parquet => Ok(Box::new(parquet_out::ParquetOut::new(out, log, stamp, headers)?)),
        #[cfg(not(feature = "parquet"))]
        CorrectedFormat::Parquet => Err(Error::input("this program was built without Parquet")),
    }
}

/// Text out.
struct CsvOut<'a>(csv::Writer<&'a mut (dyn Write + Send)>);

impl<'a> CsvOut<'a> {
    fn new(out: &'a mut (dyn Write + Send), delimiter: u8, stamp: &str, headers: &[String]) -> Result<Self> {
        writeln!(out, "{stamp}").map_err(unwritten)?;
        let mut rows = Self(csv::WriterBuilder::new().delimiter(delimiter).from_writer(out));
        rows.0.write_record(headers).map_err(|e| unwritten(e.into()))?;
        rows.flush()?;
        Ok(rows)
    }
}

impl RowsOut for CsvOut<'_> {
    fn row(&mut self, cells: &[Vec<u8>]) -> Result<()> {
        self.0.write_record(cells).map_err(|e| unwritten(e.into()))
    }

    fn flush(&mut self) -> Result<()> {
        self.0.flush().map_err(unwritten)
    }

    fn finish(&mut self) -> Result<()> {
        self.flush()
    }
}

#[cfg(feature = "parquet")]
mod parquet_out {
    use std::collections::HashMap;
    use std::io::Write;
    use std::sync::Arc;

    use arrow_array::builder::{Float64Builder, Int64Builder, StringBuilder};
    use arrow_array::{ArrayRef, RecordBatch};
    use arrow_schema::{DataType, Field, Schema};
    use parquet::arrow::ArrowWriter;

    use super::{Result, RowsOut};
    use crate::error::Error;
    use crate::ingest::{COMPENSATED_STAMP, Content, LogReader, parse_time_ns};
    use crate::window::parquet_properties;

    /// Rows written together.
    const GROUP_ROWS: usize = 65_536;

    enum Column {
        Number(Float64Builder),
        Nanoseconds(Int64Builder),
        Text(StringBuilder),
    }

    impl Column {
        fn data_type(&self) -> DataType {
            match self {
                Self::Number(_) => DataType::Float64,
                Self::Nanoseconds(_) => DataType::Int64,
                Self::Text(_) => DataType::Utf8,
            }
        }

        /// A cell; what is no number where numbers stand is null.
        fn push(&mut self, cell: &str, decimal_comma: bool) {
            let point = if decimal_comma { cell.replacen(',', ".", 1) } else { cell.to_owned() };
            match self {
                Self::Number(column) => column.append_option(point.parse().ok()),
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

    /// Parquet out.
    pub(super) struct ParquetOut<'a> {
        writer: Option<ArrowWriter<&'a mut (dyn Write + Send)>>,
        schema: Arc<Schema>,
        columns: Vec<Column>,
        rows: usize,
        decimal_comma: bool,
    }

    fn failed(error: &dyn std::fmt::Display) -> Error {
        Error::input(format!("cannot write Parquet: {error}"))
    }

    impl<'a> ParquetOut<'a> {
        pub(super) fn new(
            out: &'a mut (dyn Write + Send),
            log: &LogReader,
            stamp: &str,
            headers: Vec<String>,
        ) -> Result<Self> {
            let columns: Vec<Column> = (0..headers.len())
                .map(|index| match log.content_of(index) {
                    Content::Nanoseconds => Column::Nanoseconds(Int64Builder::new()),
                    Content::Number => Column::Number(Float64Builder::new()),
                    Content::Text => Column::Text(StringBuilder::new()),
                })
                .collect();
            let fields = headers.into_iter().zip(&columns).map(|(name, c)| Field::new(name, c.data_type(), true));
            let stamped = HashMap::from([(COMPENSATED_STAMP.trim_start_matches("# ").to_owned(), stamp.to_owned())]);
            let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()).with_metadata(stamped));
            let writer = ArrowWriter::try_new(out, Arc::clone(&schema), Some(parquet_properties()));
            let writer = Some(writer.map_err(|e| failed(&e))?);
            Ok(Self { writer, schema, columns, rows: 0, decimal_comma: log.delimiter() != b',' })
        }

        fn write_group(&mut self) -> Result<()> {
            let arrays = self.columns.iter_mut().map(Column::finish).collect();
            let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(|e| failed(&e))?;
            self.rows = 0;
            self.writer.as_mut().map_or(Ok(()), |writer| writer.write(&batch)).map_err(|e| failed(&e))
        }
    }

    impl RowsOut for ParquetOut<'_> {
        fn row(&mut self, cells: &[Vec<u8>]) -> Result<()> {
            for (column, cell) in self.columns.iter_mut().zip(cells) {
                column.push(&String::from_utf8_lossy(cell), self.decimal_comma);
            }
            self.rows += 1;
            if self.rows == GROUP_ROWS { self.write_group() } else { Ok(()) }
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }

        fn finish(&mut self) -> Result<()> {
            self.write_group()?;
            self.writer.take().map_or(Ok(()), |writer| writer.close().map(|_| ())).map_err(|e| failed(&e))
        }
    }
}

fn unwritten(error: std::io::Error) -> Error {
    Error::input(format!("cannot write: {error}"))
}

/// The corrected value in the column's own unit.
fn value_text(angle: f64, unit: AngleUnit, rate_unit: Option<f64>, duration_s: f64) -> String {
    match unit {
        AngleUnit::Quanta { quantum, .. } => {
            let decimals = quantum.to_string().split_once('.').map_or(0, |(_, fraction)| fraction.len());
            format!("{:.decimals$}", angle * quantum)
        }
        AngleUnit::Arcsec => (angle / duration_s / rate_unit.unwrap_or(1.0)).to_string(),
    }
}

/// Names of the bits, joined by `|`; `OK` for none.
pub fn status_text(status: Status) -> String {
    let names: Vec<&str> =
        Status::NAMES.iter().filter(|(bit, _)| status.contains(*bit)).map(|(_, name)| *name).collect();
    if names.is_empty() { "OK".to_owned() } else { names.join("|") }
}
