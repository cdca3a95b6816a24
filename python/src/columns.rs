//! Columns of numpy, part by part, as Arrow batches.
//!
//! The package cuts arrays into parts and gives the bytes of each: a copy of a part at a time, never of the whole.

use std::sync::Arc;

use arrow_array::{
    ArrayRef, BooleanArray, DurationNanosecondArray, Float64Array, Int64Array, NullArray, RecordBatch, StringArray,
    TimestampNanosecondArray, UInt64Array,
};
use arrow_buffer::{ArrowNativeType, Buffer, NullBuffer, ScalarBuffer};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};
use bytes::Bytes;
use pyo3::exceptions::PyStopIteration;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyList, PyTuple};

use crate::work::Stop;

/// An iterator of Python over lists of parts, one a column.
pub(crate) struct ColumnParts {
    iterator: Py<PyAny>,
    schema: SchemaRef,
    stop: Stop,
}

/// Names and kinds of columns: `f8`, `i8`, `u8`, `?`, `ns` (times in ns since 1970), `dur` (ns), `U` (text) and `none` (no values that
/// could be read).
pub(crate) fn schema_of(columns: &[(String, String)]) -> sagnac::Result<SchemaRef> {
    let field = |(name, kind): &(String, String)| {
        let kind = match kind.as_str() {
            "f8" => DataType::Float64,
            "i8" => DataType::Int64,
            "u8" => DataType::UInt64,
            "dur" => DataType::Duration(TimeUnit::Nanosecond),
            "none" => DataType::Null,
            "?" => DataType::Boolean,
            "ns" => DataType::Timestamp(TimeUnit::Nanosecond, None),
            "U" => DataType::Utf8,
            other => {
                return Err(sagnac::Error::input(
                    format!("a column cannot be of the kind {other}"),
                    "convert it to numbers, times or text",
                )
                .column(name));
            }
        };
        Ok(Field::new(name, kind, true))
    };
    Ok(Arc::new(Schema::new(columns.iter().map(field).collect::<sagnac::Result<Vec<_>>>()?)))
}

impl ColumnParts {
    pub(crate) fn new(iterator: Py<PyAny>, schema: SchemaRef, stop: Stop) -> Self {
        Self { iterator, schema, stop }
    }

    fn part(&self, py: Python<'_>) -> PyResult<Option<RecordBatch>> {
        let parts = match self.iterator.call_method0(py, "__next__") {
            Ok(parts) => parts,
            Err(e) if e.is_instance_of::<PyStopIteration>(py) => return Ok(None),
            Err(e) => return Err(e),
        };
        let parts = parts.bind(py).cast::<PyList>()?.clone();
        let fields = self.schema.fields().iter();
        let columns: PyResult<Vec<ArrayRef>> =
            fields.zip(parts.iter()).map(|(field, part)| array_of(field.data_type(), &part)).collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), columns?);
        batch.map(Some).map_err(|e| {
            crate::errors::exception(sagnac::Error::input(
                format!("the columns differ in length or kind: {e}"),
                "give columns of one length",
            ))
        })
    }
}

impl Iterator for ColumnParts {
    type Item = Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.stop.is_asked() {
            return Some(Err(stopped()));
        }
        match Python::attach(|py| self.part(py)) {
            Ok(batch) => batch.map(Ok),
            Err(raised) => {
                self.stop.raise(raised);
                Some(Err(stopped()))
            }
        }
    }
}

/// The error of a table whose reading was stopped; what stopped it is raised in its place.
pub(crate) fn stopped() -> ArrowError {
    ArrowError::ExternalError(Box::new(sagnac::Error::input("stopped", "call it again")))
}

/// A part is the bytes of its values, or those with a byte a row that is not 0 where there is no value; text is a list, and of a column
/// that cannot be read there is the number of rows.
fn array_of(kind: &DataType, part: &Bound<'_, PyAny>) -> PyResult<ArrayRef> {
    match kind {
        DataType::Utf8 => return Ok(Arc::new(StringArray::from(part.extract::<Vec<Option<String>>>()?))),
        DataType::Null => return Ok(Arc::new(NullArray::new(part.extract()?))),
        _ => {}
    }
    let (values, mask) = match part.cast::<PyTuple>() {
        Ok(both) => (both.get_item(0)?, Some(both.get_item(1)?)),
        Err(_) => (part.clone(), None),
    };
    let values = values.cast::<PyBytes>()?;
    let bytes = values.as_bytes();
    let mask = match &mask {
        Some(mask) => Some(mask.cast::<PyBytes>()?.as_bytes()),
        None => None,
    };
    let nulls = mask.map(|mask| NullBuffer::from_iter(mask.iter().map(|gone| *gone == 0)));
    let rows = if *kind == DataType::Boolean { bytes.len() } else { bytes.len() / 8 };
    if mask.is_some_and(|mask| mask.len() != rows) {
        return Err(crate::errors::exception(sagnac::Error::input(
            "the mask and its column differ in length",
            "give a mask with one value per row",
        )));
    }
    // numpy's NaT is the least number.
    let known = |ns: Vec<i64>| -> Vec<Option<i64>> {
        let is_gone = |row: usize| mask.is_some_and(|mask| mask[row] != 0);
        ns.into_iter().enumerate().map(|(row, ns)| Some(ns).filter(|ns| *ns != i64::MIN && !is_gone(row))).collect()
    };
    Ok(match kind {
        DataType::Float64 => Arc::new(Float64Array::new(scalars(values), nulls)),
        DataType::UInt64 => Arc::new(UInt64Array::new(scalars(values), nulls)),
        DataType::Boolean => Arc::new(BooleanArray::new(bytes.iter().map(|byte| *byte != 0).collect(), nulls)),
        DataType::Timestamp(..) => Arc::new(TimestampNanosecondArray::from(known(words(bytes, i64::from_le_bytes)))),
        DataType::Duration(_) => Arc::new(DurationNanosecondArray::from(known(words(bytes, i64::from_le_bytes)))),
        _ => Arc::new(Int64Array::new(scalars(values), nulls)),
    })
}

/// The bytes themselves as values of eight bytes each, or a copy where they are not where such values may be.
fn scalars<T: ArrowNativeType>(bytes: &Bound<'_, PyBytes>) -> ScalarBuffer<T> {
    let whole = bytes.as_bytes().len() / size_of::<T>();
    let shared = Buffer::from(Bytes::from_owner(PyBackedBytes::from(bytes.clone())));
    let is_aligned = shared.as_ptr().align_offset(align_of::<T>()) == 0;
    ScalarBuffer::new(if is_aligned { shared } else { Buffer::from(bytes.as_bytes()) }, 0, whole)
}

/// Values of eight bytes each.
pub(crate) fn words<T>(bytes: &[u8], of: impl Fn([u8; 8]) -> T) -> Vec<T> {
    bytes.as_chunks::<8>().0.iter().map(|word| of(*word)).collect()
}
