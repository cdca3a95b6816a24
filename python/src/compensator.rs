//! The gyro's own processor, count by count.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sagnac_core::{Image, Misuse, SignatureBlock, State, Status};

use crate::errors::exception;

/// An image and the state of its compensator.
#[pyclass(module = "sagnac._sagnac")]
pub(crate) struct Compensator {
    compensator: sagnac_core::Compensator,
    state: State,
    status: Status,
}

fn misuse(misuse: Misuse) -> PyErr {
    exception(sagnac::Error::input(misuse.to_string()))
}

#[pymethods]
impl Compensator {
    /// Of an image's bytes, signed or not.
    #[new]
    fn new(image: &[u8]) -> PyResult<Self> {
        let refused = |e: String| exception(sagnac::Error::input(format!("not a usable image: {e}")));
        let (bytes, _) = SignatureBlock::split(image).map_err(|e| refused(e.to_string()))?;
        let image = Image::decode(bytes).map_err(|e| refused(e.to_string()))?;
        Ok(Self { compensator: sagnac_core::Compensator::new(image), state: State::new(), status: Status::OK })
    }

    /// Ticks between two slow updates.
    #[getter]
    fn period_ticks(&self) -> u32 {
        self.compensator.image().description().period_ticks
    }

    /// Codes that an update needs.
    #[getter]
    fn inputs(&self) -> usize {
        self.compensator.image().inputs().len()
    }

    /// Status bits of the last update or tick, in words.
    #[getter]
    fn status(&self) -> String {
        sagnac::verify::status_text(self.status)
    }

    fn update(&mut self, codes: Vec<Option<i32>>) -> PyResult<String> {
        self.status = self.compensator.update(&mut self.state, &codes).map_err(misuse)?;
        Ok(self.status())
    }

    fn tick(&mut self, counts: i32) -> PyResult<i32> {
        let out = self.compensator.tick(&mut self.state, counts).map_err(misuse)?;
        self.status = out.status;
        Ok(out.counts)
    }

    /// Ticks of `i4` counts; where an update is due the next row of `i4` codes is used. Returns the corrected counts, the status of each
    /// update, and how many of them there were.
    fn run<'py>(&mut self, py: Python<'py>, counts: &[u8], codes: &[u8]) -> PyResult<(Bound<'py, PyBytes>, Vec<u32>)> {
        let inputs = self.inputs();
        let (counts, codes) = (counts.as_chunks::<4>().0, codes.as_chunks::<4>().0);
        let mut rows = codes.chunks_exact(inputs.max(1));
        let mut statuses = Vec::new();
        let mut state = self.state;
        let mut status = self.status;
        let mut out = Vec::with_capacity(4 * counts.len());
        for count in counts {
            let count = i32::from_le_bytes(*count);
            let ticked = match self.compensator.tick(&mut state, count) {
                Err(Misuse::UpdateDue { .. }) => {
                    let row: Vec<Option<i32>> = match rows.next() {
                        Some(row) => row.iter().map(|code| known(i32::from_le_bytes(*code))).collect(),
                        None if inputs == 0 => Vec::new(),
                        None => {
                            let what = "an update is due, and there are no more codes";
                            return Err(exception(sagnac::Error::input(what)));
                        }
                    };
                    let updated = self.compensator.update(&mut state, &row).map_err(misuse)?;
                    statuses.push(u32::from(updated.bits()));
                    self.compensator.tick(&mut state, count)
                }
                ticked => ticked,
            };
            let ticked = ticked.map_err(misuse)?;
            status = ticked.status;
            out.extend_from_slice(&ticked.counts.to_le_bytes());
        }
        (self.state, self.status) = (state, status);
        Ok((PyBytes::new(py, &out), statuses))
    }
}

/// The least number is no code: no sample.
fn known(code: i32) -> Option<i32> {
    (code != i32::MIN).then_some(code)
}
