//! Logs of tests: rows in memory, read as a table, or the bytes of a file where text is what is tested.

use std::fmt::Write as _;
use std::io::Cursor;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use sagnac_log::ingest::{LogReader, MemoryTable, ReadMode};
use sagnac_log::setup::Setup;

/// What a test reads as a log.
pub(crate) trait Log {
    fn reader(self, name: &str, setup: &Setup) -> LogReader;
}

/// A file.
impl Log for Vec<u8> {
    fn reader(self, name: &str, setup: &Setup) -> LogReader {
        LogReader::from_reader(name, Box::new(Cursor::new(self)), setup, ReadMode::Bulk).unwrap()
    }
}

/// Simulated rows, the time first; NaN where a row has no value.
#[derive(Clone)]
pub(crate) struct Rows<const N: usize> {
    pub(crate) headers: [&'static str; N],
    pub(crate) rows: Vec<[f64; N]>,
}

impl<const N: usize> Rows<N> {
    pub(crate) fn new(headers: [&'static str; N]) -> Self {
        Self { headers, rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, row: [f64; N]) {
        self.rows.push(row);
    }

    /// The rows of which it is true.
    pub(crate) fn filter(mut self, keep: impl Fn(&[f64; N]) -> bool) -> Self {
        self.rows.retain(keep);
        self
    }

    /// So many rows after another.
    pub(crate) fn chunks(&self, rows: usize) -> Vec<Self> {
        self.rows.chunks(rows).map(|part| Self { rows: part.to_vec(), ..*self }).collect()
    }

    /// The same as text.
    pub(crate) fn csv(&self) -> Vec<u8> {
        let mut text = self.headers.join(",");
        for row in &self.rows {
            for (at, value) in row.iter().enumerate() {
                text.push(if at == 0 { '\n' } else { ',' });
                if !value.is_nan() {
                    write!(text, "{value}").unwrap();
                }
            }
        }
        text.push('\n');
        text.into_bytes()
    }
}

/// A table in memory.
impl<const N: usize> Log for Rows<N> {
    fn reader(self, name: &str, setup: &Setup) -> LogReader {
        let column = |at: usize| -> ArrayRef {
            let values = self.rows.iter().map(|row| row[at]).collect::<Vec<f64>>();
            Arc::new(Float64Array::from(values))
        };
        let columns = self.headers.iter().enumerate().map(|(at, header)| (*header, column(at)));
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let (name, schema) = (name.to_owned(), batch.schema());
        let table = MemoryTable { name, schema, batches: Box::new(std::iter::once(Ok(batch))) };
        LogReader::from_table(table, setup, ReadMode::Bulk).unwrap()
    }
}

/// As a logger of so many decimals writes it.
pub(crate) fn to_decimals(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (value * scale).round() / scale
}
