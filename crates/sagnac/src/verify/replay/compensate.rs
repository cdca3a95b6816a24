//! `sagnac compensate`: a log in, the same log corrected out, row by row.
//!
//! The first line is a stamp by which Sagnac knows its own output; the count or rate columns are
//! renamed `compensated_…` (`compensated_…_increment` where the log holds running totals: what comes
//! out is the row's own counts) and a `status` column is added. Rows that could not be read have no
//! corrected value and are left out (and counted).

use std::borrow::Cow;
use std::io::Write;

use sagnac_core::Status;

use crate::verify::{Correction, Replay};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::header::COMPENSATED_PREFIX;
use sagnac_log::ingest::{AngleUnit, COMPENSATED_STAMP, LogReader, LogSummary, unquoted};
use sagnac_log::setup::{Counter, Setup};
use sagnac_log::write::ParquetRows;
use sagnac_units::format::{one_line, printable};
use sagnac_units::s_from_ns;

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

/// A log that was corrected: what was read, and how much of it the correction is made for.
#[derive(Clone, Debug, Default)]
pub struct Compensated {
    /// What was read, and what was left out.
    pub log: LogSummary,
    /// Rows written.
    pub rows: u64,
    /// Rows without a correction: no temperature yet, or none for longer than the image's hold time, or an overflow.
    pub uncorrected: u64,
    /// Rows with the correction at the border of the fit's span, which the fit does not support.
    pub out_of_span: u64,
}

impl Compensated {
    /// Rows corrected within the span of the fit.
    pub fn corrected(&self) -> u64 {
        self.rows.saturating_sub(self.uncorrected + self.out_of_span)
    }

    /// The same as a fraction of the rows that were read, 0 to 1; 0 where there are none.
    pub fn fraction(&self) -> f64 {
        self.corrected() as f64 / self.log.rows.max(1) as f64
    }

    /// Counts a row that was corrected with this status.
    pub fn count(&mut self, status: Status) {
        let none = [Status::UNCORRECTED, Status::STALE, Status::OVERFLOW];
        self.rows += 1;
        if none.iter().any(|bit| status.contains(*bit)) {
            self.uncorrected += 1;
        } else if status.contains(Status::OUT_OF_SPAN) {
            self.out_of_span += 1;
        }
    }
}

/// Corrects a log as it is read; what was read and corrected.
///
/// # Errors
/// What the reader or the replay says; a failed write.
pub fn compensate(
    correction: &Correction,
    log: &mut LogReader,
    setup: &Setup,
    format: CorrectedFormat,
    out: &mut (dyn Write + Send),
) -> Result<Compensated> {
    let shape = log.shape().clone();
    let file = log.summary().file;
    let (images, readings) = correction.fit_to(&shape, setup).map_err(|e| e.file(&file))?;
    let mut replay = Replay::new(&images, &shape, readings.clone(), &file)?;
    let (columns, read, units) = (log.axis_columns(), log.columns_read(), log.rate_units());
    // An image's serial number may be any text.
    let serial = one_line(&correction.serial()).into_owned();
    let stamp = format!("{COMPENSATED_STAMP}: serial {serial}, images {}", correction.sha256());
    let mut rows = rows_out(log, setup, format, &stamp, out)?;
    let comma_is_decimal = format == CorrectedFormat::Csv && log.delimiter() != b',';
    let mut cells: Vec<Vec<u8>> = Vec::new();
    let mut done = Compensated::default();
    while let Some(batch) = log.next_batch()? {
        if batch.begins_run {
            replay = Replay::new(&images, &shape, readings.clone(), &file)?;
        }
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
            done.count(status);
        }
        rows.flush()?;
    }
    rows.finish()?;
    done.log = log.summary();
    if let (0, Some(most)) = (done.rows, done.log.tallies.most()) {
        let what = format!("no row could be corrected: {} are excluded as {}", most.rows, most.reason.name());
        return Err(Error::refused(what, "run `sagnac inspect LOG` to list the excluded rows").file(most.first));
    }
    Ok(done)
}

/// Headers of the corrected log, status last.
fn headers_out(log: &LogReader, setup: &Setup) -> Vec<String> {
    let columns = log.axis_columns();
    let suffix = if setup.counter == Some(Counter::Cumulative) { "_increment" } else { "" };
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
        CorrectedFormat::Parquet => {
            let columns = headers.into_iter().enumerate().map(|(index, name)| (name, log.content_of(index)));
            let stamped = (COMPENSATED_STAMP.trim_start_matches("# ").to_owned(), stamp.to_owned());
            Ok(Box::new(ParquetRows::new(out, columns.collect(), Some(stamped), log.delimiter() != b',')?))
        }
    }
}

/// A cell without what controls a terminal: a comment column may hold anything. Bytes that are no UTF-8 stay as they are where they are
/// letters of an older encoding.
fn without_controls(cell: &[u8]) -> Cow<'_, [u8]> {
    if cell.iter().all(|byte| (b' '..0x7f).contains(byte)) {
        return Cow::Borrowed(cell);
    }
    if let Ok(text) = std::str::from_utf8(cell) {
        return Cow::Owned(printable(text).into_owned().into_bytes());
    }
    let escaped = |byte: &u8| match byte {
        b'\n' | b' '..0x7f | 0xa0.. => vec![*byte],
        byte => format!("\\u{{{byte:x}}}").into_bytes(),
    };
    Cow::Owned(cell.iter().flat_map(escaped).collect())
}

/// Text out.
struct CsvOut<'a>(csv::Writer<&'a mut (dyn Write + Send)>);

impl<'a> CsvOut<'a> {
    fn new(out: &'a mut (dyn Write + Send), delimiter: u8, stamp: &str, headers: &[String]) -> Result<Self> {
        writeln!(out, "{stamp}").map_err(unwritten)?;
        let mut rows = Self(csv::WriterBuilder::new().delimiter(delimiter).comment(Some(b'#')).from_writer(out));
        rows.0
            .write_record(headers.iter().map(|header| without_controls(header.as_bytes())))
            .map_err(|e| unwritten(e.into()))?;
        rows.flush()?;
        Ok(rows)
    }
}

impl RowsOut for CsvOut<'_> {
    fn row(&mut self, cells: &[Vec<u8>]) -> Result<()> {
        self.0.write_record(cells.iter().map(|cell| without_controls(cell))).map_err(|e| unwritten(e.into()))
    }

    fn flush(&mut self) -> Result<()> {
        self.0.flush().map_err(unwritten)
    }

    fn finish(&mut self) -> Result<()> {
        self.flush()
    }
}

impl RowsOut for ParquetRows<'_> {
    fn row(&mut self, cells: &[Vec<u8>]) -> Result<()> {
        self.row(cells)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.finish()
    }
}

fn unwritten(error: std::io::Error) -> Error {
    Error::cannot("write", &error)
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
