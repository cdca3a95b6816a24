//! The windows behind a result as a table.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, Int64Array, StringArray};
use pyo3::prelude::*;

use crate::table::Table;

/// Points of a report as a table; `after_dph` is null where a window was excluded.
pub(crate) fn points_table(points: &[sagnac::diagnostics::WindowPoint]) -> PyResult<Table> {
    let number = |of: fn(&sagnac::diagnostics::WindowPoint) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter(points.iter().map(|point| Some(of(point)).filter(|value| !value.is_nan()))))
    };
    let excluded = points.iter().map(|point| point.excluded.map(|reason| reason.name()));
    Table::of(vec![
        ("run".to_owned(), Arc::new(Int64Array::from_iter_values(points.iter().map(|point| point.run as i64)))),
        ("hours".to_owned(), number(|point| point.hours)),
        ("temperature_c".to_owned(), number(|point| point.temperature_c)),
        ("rate_cpm".to_owned(), number(|point| point.rate_cpm)),
        ("before_dph".to_owned(), number(|point| point.before_dph)),
        ("after_dph".to_owned(), number(|point| point.after_dph)),
        ("excluded".to_owned(), Arc::new(StringArray::from_iter(excluded))),
    ])
}
