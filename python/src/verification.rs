//! What a retest came to, and records next to each other.

use std::sync::Arc;

use pyo3::prelude::*;
use sagnac::verify::Proof;
use sagnac_report::{Sheet, comparison_report, verification_report};

use crate::errors::exception;
use crate::points::points_table;
use crate::table::Table;

/// A verification, with the record that it is of.
#[pyclass(frozen, module = "sagnac._sagnac")]
pub(crate) struct Verification {
    pub(crate) proof: Proof,
    pub(crate) record: Arc<sagnac::Calibration>,
}

/// As the program prints it with `--json`.
fn json(of: &impl serde::Serialize) -> PyResult<String> {
    let broken = |e: serde_json::Error| exception(sagnac::Error::defect(format!("cannot write JSON: {e}")));
    serde_json::to_string_pretty(of).map(|text| text + "\n").map_err(broken)
}

#[pymethods]
impl Verification {
    #[getter]
    fn passed(&self) -> bool {
        self.proof.passed()
    }

    fn to_json(&self) -> PyResult<String> {
        json(&self.proof.verification)
    }

    fn report(&self) -> PyResult<String> {
        let Proof { verification, report_data, .. } = &self.proof;
        let report = verification_report(
            verification,
            Some(&self.record),
            report_data,
            &Sheet::default(),
            self.record.setup.units.unwrap_or_default(),
        );
        report.map(|report| report.html().to_owned()).map_err(exception)
    }

    fn residuals(&self, axis: &str) -> PyResult<Table> {
        let letters = self.proof.report_data.axes.iter().map(|axis| axis.axis.to_string());
        let Some(at) = letters.clone().position(|letter| letter == axis) else {
            let help = format!("choose one of these: {}", sagnac::Error::choices(&letters.collect::<Vec<_>>()));
            return Err(exception(
                sagnac::Error::input("the retest has no such axis", help).column("axis").value(axis),
            ));
        };
        points_table(&self.proof.report_data.axes[at].points)
    }
}

/// A comparison of records.
#[pyclass(frozen, module = "sagnac._sagnac")]
pub(crate) struct Comparison(pub(crate) sagnac::compare::Comparison);

#[pymethods]
impl Comparison {
    #[getter]
    fn passed(&self) -> bool {
        self.0.passed()
    }

    fn to_json(&self) -> PyResult<String> {
        json(&self.0)
    }

    fn report(&self) -> PyResult<String> {
        comparison_report(&self.0).map(|report| report.html().to_owned()).map_err(exception)
    }

    /// A line for each curve that was compared.
    fn words(&self) -> Vec<String> {
        let line = |axis: &sagnac::compare::ComparedAxis| {
            let curves =
                axis.curves.iter().map(|curve| format!("axis {}: {}", axis.axis, curve.verdict(&self.0.records)));
            curves.collect::<Vec<_>>()
        };
        self.0.axes.iter().flat_map(line).collect()
    }
}
