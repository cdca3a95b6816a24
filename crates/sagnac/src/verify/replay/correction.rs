//! The correction that a retest proves: the images of a gyro's axes, and the record that they come from.

use sagnac_core::Image;

use crate::calibration::{Calibration, LogUnit};
use crate::verify::replay::column_of_input::InputColumns;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogShape, hex, sha256};
use sagnac_log::setup::Setup;

/// Images, one per axis, and their record.
#[derive(Clone, Debug)]
pub struct Correction {
    /// One image per axis.
    pub images: Vec<Image>,
    /// The calibration they come from, if it is at hand.
    pub calibration: Option<Calibration>,
}

impl Correction {
    /// Encodes every axis of a calibration.
    ///
    /// # Errors
    /// What [`crate::export::encode`] says.
    pub fn from_calibration(calibration: Calibration) -> Result<Self> {
        let parent = sha256(calibration.to_json()?.as_bytes());
        let encoded: Result<Vec<Image>> = calibration
            .axes
            .iter()
            .map(|axis| {
                let image = crate::export::encode(&calibration, axis, parent, 1)?;
                // The proof is about what ships: through the bytes.
                Image::decode(&crate::export::image_bytes(&image)).map_err(|e| Error::defect(e.to_string()))
            })
            .collect();
        Ok(Self { images: encoded?, calibration: Some(calibration) })
    }

    /// An image alone.
    pub fn from_image(image: Image) -> Self {
        Self { images: vec![image], calibration: None }
    }

    /// The setup with which a retest is read: the calibration's own, or what the image knows.
    pub fn setup(&self) -> Setup {
        if let Some(calibration) = &self.calibration {
            let (arcsec_per_count, quantum) = match calibration.unit {
                LogUnit::Counts { arcsec_per_count, quantum } => (Some(arcsec_per_count), Some(quantum)),
                LogUnit::Rates { .. } => (None, None),
            };
            // The turn-ons of the calibration are not those of the retest.
            return Setup { arcsec_per_count, quantum, turn_ons: None, ..calibration.setup.clone() };
        }
        let Some(d) = self.images.first().map(|image| *image.description()) else {
            return Setup::default();
        };
        let quantum = d.quantum_nano_counts as f64 / 1e9;
        Setup {
            arcsec_per_count: Some(d.scale_factor_femto_arcsec as f64 / 1e15 / quantum),
            quantum: Some(quantum),
            axis: Some(char::from(d.axis)),
            ..Setup::default()
        }
    }

    /// Serial number in the images.
    pub fn serial(&self) -> String {
        self.images.first().and_then(Image::serial).unwrap_or_default().to_owned()
    }

    /// The image of each axis of a log, and the columns they read.
    ///
    /// # Errors
    /// An axis without image, a thermometer that the log does not have, another serial in the setup.
    pub fn fit_to(&self, shape: &LogShape, setup: &Setup) -> Result<(Vec<Image>, InputColumns)> {
        if let Some(wanted) = setup.serial.as_deref().filter(|serial| *serial != self.serial()) {
            return Err(Error::input(
                format!("the correction is for {:?}, and the setup asks for {wanted:?}", self.serial()),
                "give the correction of this gyro, or correct --serial",
            )
            .column("serial"));
        }
        let find = |axis: &char| {
            let image = self.images.iter().find(|image| char::from(image.description().axis) == *axis);
            image.copied().ok_or_else(|| {
                Error::input(
                    format!("the correction has no axis {axis}"),
                    "give the axis of a single-axis log with --axis, or map other columns to \"ignore\" under [columns]",
                )
            })
        };
        let images: Result<Vec<Image>> = shape.axes.iter().map(find).collect();
        let only = shape.thermometers.len() == 1;
        let own = self
            .calibration
            .as_ref()
            .and_then(Calibration::thermometer_name)
            .map(str::to_owned)
            .filter(|name| !(only && name.is_empty()));
        let sensor = match setup.use_thermometer.clone().or(own) {
            Some(name) => Some(shape.thermometers.iter().position(|other| *other == name).ok_or_else(|| {
                Error::input(
                    format!("the correction needs the thermometer {name:?}, and the log has none of this name"),
                    format!("map its column under [columns]. The log has: {}", Error::choices(&shape.thermometers)),
                )
            })?),
            None if shape.thermometers.is_empty() => None,
            None if only => Some(0),
            None => {
                let names = shape.thermometers.join(", ");
                let what =
                    format!("the log has several thermometers ({names}), and the image does not say which it uses");
                return Err(Error::input(what, "give its name with --thermometer"));
            }
        };
        let images = images?;
        let axes = self.calibration.as_ref().map(|calibration| calibration.axes.as_slice());
        let readings = InputColumns::find(&images, axes, sensor, shape, setup)?;
        Ok((images, readings))
    }

    /// SHA-256 of the images' bytes, in the order of the axes.
    pub fn sha256(&self) -> String {
        let bytes: Vec<u8> = self.images.iter().flat_map(crate::export::image_bytes).collect();
        hex(&sha256(&bytes))
    }
}
