//! The main job, from paths to a verdict: the starting point for programs of your own.
//!
//! Each function is a few lines over the modules below; use those directly where this is not enough.

use std::path::Path;

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogReader, Logs, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_noise::Taus;

use crate::allan::{NoiseBudget, Request, noise_budget};
use crate::calibration::{AxisCalibration, Calibration, Evaluation};
use crate::export::{encode, image_bytes};
use crate::fit::{FitOptions, Model};
use crate::verify::{Correction, Proof, VerifyOptions, verify};
use crate::window::WindowBuilder;

/// Calibrates a gyro from the logs of its thermal test, each a run.
///
/// # Errors
/// A log that cannot be read, and [`crate::ErrorKind::Refused`] where the data cannot support a model.
pub fn calibrate<P: AsRef<Path>>(
    bench: &Setup,
    logs: impl IntoIterator<Item = P>,
    model: Model,
) -> Result<Calibration> {
    let windows = WindowBuilder::read_all(open(logs, bench), bench)?.finish();
    crate::fit::calibrate(windows, bench, &FitOptions::new(model))
}

/// The noise budget of a log at rest, in ten τ per decade.
///
/// # Errors
/// A log that cannot be read, or without a usable row.
pub fn allan(bench: &Setup, log: impl AsRef<Path>) -> Result<NoiseBudget> {
    let request = Request::new(Taus::LogSpaced);
    noise_budget(open([log], bench), None, bench, &request)
}

fn open<'a, P: AsRef<Path> + 'a>(logs: impl IntoIterator<Item = P, IntoIter: 'a>, bench: &'a Setup) -> Logs<'a> {
    Logs::opened_by(logs.into_iter().map(move |log| LogReader::open(log.as_ref(), bench, ReadMode::Bulk)))
}

impl Calibration {
    /// Replays retest logs through the image of this calibration, as the target would. They are read with the setup of the
    /// calibration.
    ///
    /// # Errors
    /// A log that cannot be read or does not fit the calibration.
    pub fn verify<P: AsRef<Path>>(&self, retests: impl IntoIterator<Item = P>) -> Result<Proof> {
        let correction = Correction::from_calibration(self.clone())?;
        let bench = correction.setup();
        verify(&correction, open(retests, &bench), &bench, VerifyOptions::default())
    }

    /// The bytes of the flash image of an axis.
    ///
    /// # Errors
    /// An axis that the calibration does not have, or a number that does not fit the image.
    pub fn image(&self, axis: char) -> Result<Vec<u8>> {
        let parent = sagnac_log::ingest::sha256(self.to_json()?.as_bytes());
        encode(self, self.axis(axis)?, parent, 1).map(|image| image_bytes(&image))
    }

    /// The calibration of an axis.
    ///
    /// # Errors
    /// An axis that the calibration does not have.
    pub fn axis(&self, letter: char) -> Result<&AxisCalibration> {
        let letters: Vec<String> = self.axes.iter().map(|axis| axis.axis.to_string()).collect();
        self.axes.iter().find(|axis| axis.axis == letter).ok_or_else(|| {
            Error::input(
                format!("the calibration has no axis {letter}"),
                format!("choose one of these: {}", Error::choices(&letters)),
            )
            .column("axis")
        })
    }

    /// The correction of a calibration of one axis at a temperature, °C, and its rate, °C/min.
    ///
    /// # Errors
    /// A calibration of several axes: use [`Calibration::axis`].
    pub fn evaluate(&self, temperature_c: f64, rate_cpm: f64) -> Result<Evaluation> {
        match self.axes.as_slice() {
            [axis] => Ok(axis.evaluate(temperature_c, rate_cpm)),
            _ => {
                Err(Error::input("the calibration has several axes", "choose one: axis('z')?.evaluate(…)")
                    .column("axis"))
            }
        }
    }
}
