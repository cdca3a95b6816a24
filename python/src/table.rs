//! A table that any library reads: Arrow's stream interface as a capsule.

use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch, RecordBatchIterator};
use arrow_schema::{DataType, Field, Schema};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyList};

/// Columns of equal length.
#[pyclass(frozen, module = "sagnac._sagnac")]
pub(crate) struct Table(RecordBatch);

impl Table {
    /// Columns by their names; all may be null.
    pub(crate) fn of(columns: Vec<(String, ArrayRef)>) -> PyResult<Self> {
        let field = |(name, column): &(String, ArrayRef)| Field::new(name, column.data_type().clone(), true);
        let schema = Arc::new(Schema::new(columns.iter().map(field).collect::<Vec<_>>()));
        let batch = RecordBatch::try_new(schema, columns.into_iter().map(|(_, column)| column).collect());
        batch
            .map(Self)
            .map_err(|e| crate::errors::exception(sagnac::Error::defect(format!("cannot make the table: {e}"))))
    }
}

#[pymethods]
impl Table {
    fn __len__(&self) -> usize {
        self.0.num_rows()
    }

    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.0.schema_ref().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// A column: the bytes of its numbers (`f8` with NaN for null, or `i8` without nulls) or a list of its text.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<(&'static str, Bound<'py, PyAny>)> {
        let missing = || pyo3::exceptions::PyKeyError::new_err(name.to_owned());
        let column = self.0.column_by_name(name).ok_or_else(missing)?;
        Ok(match column.data_type() {
            DataType::Int64 if column.null_count() == 0 => {
                let values = column.as_primitive::<Int64Type>().values();
                let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                ("i8", PyBytes::new(py, &bytes).into_any())
            }
            DataType::Int64 => {
                let values = column.as_primitive::<Int64Type>().iter();
                let bytes: Vec<u8> =
                    values.flat_map(|value| value.map_or(f64::NAN, |value| value as f64).to_le_bytes()).collect();
                ("f8", PyBytes::new(py, &bytes).into_any())
            }
            DataType::Float64 => {
                let values = column.as_primitive::<Float64Type>().iter();
                let bytes: Vec<u8> = values.flat_map(|value| value.unwrap_or(f64::NAN).to_le_bytes()).collect();
                ("f8", PyBytes::new(py, &bytes).into_any())
            }
            _ => ("U", PyList::new(py, column.as_string::<i32>().iter())?.into_any()),
        })
    }

    /// As lists by name.
    fn to_pydict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (field, column) in self.0.schema_ref().fields().iter().zip(self.0.columns()) {
            let list = match column.data_type() {
                DataType::Int64 => PyList::new(py, column.as_primitive::<Int64Type>().iter())?,
                DataType::Float64 => PyList::new(py, column.as_primitive::<Float64Type>().iter())?,
                _ => PyList::new(py, column.as_string::<i32>().iter())?,
            };
            all.set_item(field.name(), list)?;
        }
        Ok(all)
    }

    /// Arrow's PyCapsule interface; the types are always those of the table.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        let batches = RecordBatchIterator::new([Ok(self.0.clone())], self.0.schema());
        PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(batches)), c"arrow_array_stream")
    }
}
