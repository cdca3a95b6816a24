//! The inputs of a record as an image reads them: in their order, each with its source and a power of two as its unit.

use sagnac_core::ValueSource;

use crate::calibration::{AxisCorrection, Input, InputSource};
use crate::model::input::unit_exponent;
use sagnac_log::error::{Error, Result};

/// 2⁻²⁴ °C per °C.
pub(super) const Q24: f64 = (1 << 24) as f64;

/// A number beyond its field; `holds` says what the field takes.
pub(super) fn too_large(name: &str, value: f64, holds: &str) -> Error {
    let what = format!("does not fit the image, which holds {holds}");
    Error::input(what, "choose a smaller --model, or correct the value").column(name).value(value.to_string())
}

/// An input as the image reads it.
pub(super) struct InputChannel<'a> {
    pub(super) input: &'a Input,
    pub(super) source: ValueSource,
    /// One °C of the image is 2^exponent of its unit.
    pub(super) exponent: i8,
}

impl InputChannel<'_> {
    /// The border of the rate span that is farther from zero, units per minute.
    pub(super) fn rate_far(&self) -> Option<f64> {
        self.input.lag_s?;
        self.input.rate_span_per_min.map(|[lo, hi]| lo.abs().max(hi.abs())).filter(|far| *far > 0.0)
    }

    /// Units of the record per °C of the image.
    pub(super) fn unit(&self) -> f64 {
        2.0_f64.powi(self.exponent.into())
    }
}

/// The record's inputs in their order.
pub(super) fn channels(correction: &AxisCorrection) -> Result<Vec<InputChannel<'_>>> {
    let inputs = &correction.inputs;
    let index_of = |wanted: &String, of: &Input| {
        let place = inputs.iter().position(|other| other.source == InputSource::Thermometer(wanted.clone()));
        place.and_then(|at| u8::try_from(at).ok()).ok_or_else(|| {
            Error::input(
                "a difference names a thermometer that is no input",
                "calibrate again, or copy the file again from its source",
            )
            .column("inputs")
            .value(&of.name)
        })
    };
    let channel = |input| {
        let input: &Input = input;
        let (source, exponent) = match &input.source {
            InputSource::Thermometer(_) => (ValueSource::Code, 0),
            InputSource::Difference(of, less) => {
                (ValueSource::Difference { of: index_of(of, input)?, less: index_of(less, input)? }, 0)
            }
            InputSource::Column(_) => (ValueSource::Code, unit_exponent(input.valid_range)),
            InputSource::Repeat(of) => {
                let place = inputs.iter().position(|other| other.name == *of).and_then(|at| u8::try_from(at).ok());
                let of = place.ok_or_else(|| {
                    Error::input(
                        "the input repeats one that the record does not contain",
                        "calibrate again, or copy the file again from its source",
                    )
                    .column("inputs")
                    .value(&input.name)
                })?;
                let exponent = if correction.is_in_celsius(input) { 0 } else { unit_exponent(input.valid_range) };
                (ValueSource::Repeat { of }, exponent)
            }
        };
        Ok(InputChannel { input, source, exponent })
    };
    inputs.iter().map(channel).collect()
}
