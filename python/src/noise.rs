//! The noise of a record.

use pyo3::prelude::*;
use sagnac::allan::{Request, noise_budget};
use sagnac::{Setup, Taus};
use sagnac_log::ingest::ReadMode;
use sagnac_log::setup::RateUnit;
use sagnac_report::noise_report;

use crate::errors::exception;
use crate::settings;
use crate::sources::{Run, Sources};
use crate::work::away;

/// A noise budget.
#[pyclass(frozen, module = "sagnac._sagnac")]
pub(crate) struct NoiseBudget {
    budget: sagnac::NoiseBudget,
    units: RateUnit,
}

/// The budget of runs at rest; `taus` is `log`, `octave`, `all` or a list.
#[pyfunction]
pub(crate) fn allan(
    py: Python<'_>,
    runs: Vec<Run>,
    setup: (Option<String>, String),
    taus: &str,
    given: Vec<f64>,
    exact: bool,
) -> PyResult<NoiseBudget> {
    let taus = match taus {
        "octave" => Taus::Octaves,
        "all" => Taus::All,
        "given" => Taus::Given(given),
        _ => Taus::LogSpaced,
    };
    let sources = Sources::of(py, runs)?;
    away(py, move |stop| {
        let setup = settings::setup(Setup::default(), setup.0.as_deref(), &setup.1)?;
        let logs = sources.logs(&setup, ReadMode::Bulk, stop)?;
        let budget = noise_budget(logs, None, &setup, &Request { exact, ..Request::new(taus) })?;
        Ok(NoiseBudget { budget, units: setup.units.unwrap_or_default() })
    })
}

#[pymethods]
impl NoiseBudget {
    fn to_json(&self) -> PyResult<String> {
        let broken = |e: serde_json::Error| exception(sagnac::Error::defect(format!("cannot write JSON: {e}")));
        serde_json::to_string_pretty(&self.budget).map(|text| text + "\n").map_err(broken)
    }

    fn report(&self) -> PyResult<String> {
        noise_report(&self.budget, self.units).map(|report| report.html().to_owned()).map_err(exception)
    }
}
