//! Runs as the package gives them: a path, an Arrow stream, or columns.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use arrow_array::ffi_stream::ArrowArrayStreamReader;
use arrow_array::{RecordBatch, RecordBatchReader};
use arrow_pyarrow::FromPyArrow;
use arrow_schema::{ArrowError, SchemaRef};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sagnac::{Error, Result, Setup};
use sagnac_core::MAGIC;
use sagnac_log::ingest::{LogReader, Logs, MemoryTable, ReadMode};

use crate::columns::{ColumnParts, schema_of, stopped};
use crate::work::Stop;

/// A run of Python: what kind it is, its name, and what it is made of.
#[derive(FromPyObject)]
pub(crate) struct Run(String, String, Py<PyAny>);

/// Where rows come from.
enum Source {
    Path(PathBuf),
    /// Read once.
    Stream(String, Mutex<Option<ArrowArrayStreamReader>>),
    Columns(String, Mutex<Option<Py<PyAny>>>, SchemaRef),
}

/// Runs that are ready to be read, without Python's lock.
pub(crate) struct Sources(Vec<Source>);

impl Sources {
    pub(crate) fn of(py: Python<'_>, runs: Vec<Run>) -> PyResult<Self> {
        runs.into_iter().map(|run| source(py, run)).collect::<PyResult<_>>().map(Self)
    }

    /// True where every run is a file.
    pub(crate) fn are_files(&self) -> bool {
        self.0.iter().all(|source| matches!(source, Source::Path(_)))
    }

    /// Each opened when the one before is read.
    pub(crate) fn logs<'a>(&'a self, setup: &'a Setup, mode: ReadMode, stop: &'a Stop) -> Result<Logs<'a>> {
        for source in &self.0 {
            if let Source::Path(path) = source {
                std::fs::metadata(path).map_err(|e| Error::io_path(path, "open", &e))?;
                if begins_with(path, b"{") || begins_with(path, &MAGIC) {
                    return Err(Error::input(
                        "a log is needed, and this is an image or a calibration",
                        "give the log that the test recorded",
                    )
                    .file(path.display().to_string()));
                }
            }
        }
        Ok(Logs::opened_by(self.0.iter().map(move |source| source.open(setup, mode, stop))))
    }
}

/// What an object that says that it is a stream is not: a series of single values, a type that Arrow's Rust does not have.
fn no_stream(py: Python<'_>, raised: PyErr, name: &str) -> PyErr {
    if !raised.is_instance_of::<PyValueError>(py) {
        return raised;
    }
    let error = Error::input(
        format!("not a table: {}", raised.value(py)),
        "give a table with named columns, of numbers, times and text",
    )
    .file(name);
    crate::errors::exception(error)
}

fn begins_with(path: &Path, wanted: &[u8]) -> bool {
    let mut start = vec![0; wanted.len()];
    std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == wanted
}

fn source(py: Python<'_>, Run(kind, name, payload): Run) -> PyResult<Source> {
    let payload = payload.bind(py);
    Ok(match kind.as_str() {
        "path" => Source::Path(payload.extract()?),
        "stream" => {
            let stream = ArrowArrayStreamReader::from_pyarrow_bound(payload).map_err(|e| no_stream(py, e, &name))?;
            Source::Stream(name, Mutex::new(Some(stream)))
        }
        _ => {
            let (columns, iterator): (Vec<(String, String)>, Py<PyAny>) = payload.extract()?;
            let schema = schema_of(&columns).map_err(|e| crate::errors::exception(e.file(&name)))?;
            Source::Columns(name, Mutex::new(Some(iterator)), schema)
        }
    })
}

impl Source {
    fn open(&self, setup: &Setup, mode: ReadMode, stop: &Stop) -> Result<LogReader> {
        fn once<T>(of: &Mutex<Option<T>>, name: &str) -> Result<T> {
            let taken = of.lock().unwrap_or_else(PoisonError::into_inner).take();
            taken.ok_or_else(|| {
                Error::input("this table was read before", "make a new iterator for each call").file(name)
            })
        }
        let table = match self {
            Self::Path(path) => {
                let stop = stop.clone();
                // Unwinds the thread that reads: the file is not read further.
                let watch = move |_| {
                    if stop.is_asked() {
                        std::panic::resume_unwind(Box::new(()));
                    }
                };
                return LogReader::open_watched(path, setup, mode, Some(Box::new(watch)));
            }
            Self::Stream(name, stream) => {
                let stream = once(stream, name)?;
                let (schema, stop) = (stream.schema(), stop.clone());
                MemoryTable { name: name.clone(), schema, batches: Box::new(Stoppable { stream, stop }) }
            }
            Self::Columns(name, iterator, schema) => {
                let parts = ColumnParts::new(once(iterator, name)?, SchemaRef::clone(schema), stop.clone());
                MemoryTable { name: name.clone(), schema: SchemaRef::clone(schema), batches: Box::new(parts) }
            }
        };
        LogReader::from_table(table, setup, mode)
    }
}

/// A stream that ends on request.
struct Stoppable {
    stream: ArrowArrayStreamReader,
    stop: Stop,
}

impl Iterator for Stoppable {
    type Item = std::result::Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.stop.is_asked() { Some(Err(stopped())) } else { self.stream.next() }
    }
}
