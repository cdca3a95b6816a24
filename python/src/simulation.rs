//! A simulated test as a table.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array};
use pyo3::prelude::*;
use sagnac::Error;
use sagnac_sim::{LogText, Scenario, ScenarioError};

use crate::table::Table;
use crate::work::away;

/// The log of a scenario's test: its columns as `sagnac simulate` writes them.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, toml: String, seed: Option<u64>) -> PyResult<Table> {
    let columns = away(py, move |stop| {
        let refused = |problem: ScenarioError| {
            let error = Error::input(
                problem.message.clone(),
                "correct the key: docs/reference/scenario.md lists each with its unit and range",
            );
            let error = if problem.key.is_empty() { error } else { error.column(problem.key.clone()) };
            problem.line.map_or(error.clone(), |line| error.line(line))
        };
        let scenario = Scenario::from_toml(&toml).map_err(refused)?;
        let mut run = scenario.build().map_err(refused)?.start(seed.unwrap_or(scenario.seed));
        let mut text = LogText::new(&scenario);
        let names = text.headers().to_vec();
        let mut columns: Vec<Vec<Option<f64>>> = vec![Vec::new(); names.len()];
        run.each_row(|row, second| {
            if stop.is_asked() {
                return Err(Error::input("stopped", "call it again"));
            }
            let line = std::str::from_utf8(text.line(row, second)).unwrap_or("");
            columns
                .iter_mut()
                .zip(line.trim_end().split(','))
                .for_each(|(column, cell)| column.push(cell.parse().ok()));
            Ok(())
        })?;
        let column =
            |(name, values): (String, Vec<Option<f64>>)| (name, Arc::new(Float64Array::from(values)) as ArrayRef);
        Ok(names.into_iter().zip(columns).map(column).collect::<Vec<_>>())
    })?;
    Table::of(columns)
}
