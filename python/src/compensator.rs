//! The gyro's own processor, count by count.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sagnac_core::{Image, Misuse, SignatureBlock, State, Status};

use crate::errors::exception;

/// An image and the state of its compensator.
#[derive(Clone)]
#[pyclass(module = "sagnac._sagnac", skip_from_py_object)]
pub(crate) struct Compensator {
    compensator: sagnac_core::Compensator,
    state: State,
    status: Status,
}

fn misuse(misuse: Misuse) -> PyErr {
    exception(sagnac::Error::input(misuse.to_string(), "give the values that the image's tick and period allow"))
}

#[pymethods]
impl Compensator {
    /// Of an image's bytes, signed or not.
    #[new]
    fn new(image: &[u8]) -> PyResult<Self> {
        let refused = |e: String| {
            exception(sagnac::Error::input(
                format!("not a usable image: {e}"),
                "export the calibration again: calibration.image(axis, 1)",
            ))
        };
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

    /// Another one in the same state.
    fn copy(&self) -> Self {
        self.clone()
    }

    /// Ticks of `i4` counts; where an update is due the next row of `i4` codes is used. Returns the corrected counts, and the status of each
    /// update. After an error the state is of no use.
    fn run<'py>(&mut self, py: Python<'py>, counts: &[u8], codes: &[u8]) -> PyResult<(Bound<'py, PyBytes>, Vec<u32>)> {
        let counts = counts.as_chunks::<4>().0;
        let mut rows = codes.as_chunks::<4>().0.chunks_exact(self.inputs().max(1));
        let mut statuses = Vec::new();
        let corrected = PyBytes::new_with(py, 4 * counts.len(), |out| {
            for (count, out) in counts.iter().zip(out.as_chunks_mut::<4>().0) {
                if self.state.ticks_to_update() == 0 {
                    statuses.push(self.update_from(rows.next())?);
                }
                let ticked = self.compensator.tick(&mut self.state, i32::from_le_bytes(*count)).map_err(misuse)?;
                self.status = ticked.status;
                *out = ticked.counts.to_le_bytes();
            }
            Ok(())
        });
        Ok((corrected?, statuses))
    }
}

impl Compensator {
    /// A slow update with the next row of codes; its status bits.
    fn update_from(&mut self, row: Option<&[[u8; 4]]>) -> PyResult<u32> {
        let none_needed = (self.inputs() == 0).then_some(&[][..]);
        let missing = || {
            exception(sagnac::Error::input(
                "an update is due, and there are no more codes",
                "give one row of codes for each update",
            ))
        };
        let row = row.or(none_needed).ok_or_else(missing)?;
        let codes: Vec<Option<i32>> = row.iter().map(|code| known(i32::from_le_bytes(*code))).collect();
        let updated = self.compensator.update(&mut self.state, &codes).map_err(misuse)?;
        Ok(u32::from(updated.bits()))
    }
}

/// The least number is no code: no sample.
fn known(code: i32) -> Option<i32> {
    (code != i32::MIN).then_some(code)
}
