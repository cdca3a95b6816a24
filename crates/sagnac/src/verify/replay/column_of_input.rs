//! Which column of a log each thermometer of an image reads.
//!
//! A calibration says it by name. An image alone holds no names: its first thermometer is the log's only one or that of
//! `--thermometer`, further ones are those of `--inputs`, in the image's order.

use sagnac_core::{Image, ValueSource};

use crate::calibration::{AxisCalibration, InputSource};
use crate::model::input::label;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::LogShape;
use sagnac_log::setup::Setup;

/// A column of a log that is read as a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogColumn {
    /// Place among the log's thermometers.
    Thermometer(usize),
    /// Place among its auxiliary columns.
    Aux(usize),
}

/// What the images of a log's axes read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct InputColumns {
    /// The thermometer of the fit.
    pub thermometer: Option<usize>,
    /// Per axis of the log and thermometer of its image; `None` where the target makes it from others.
    pub columns: Vec<Vec<Option<LogColumn>>>,
}

impl InputColumns {
    /// Images that read one thermometer, or none.
    pub fn of_one(images: &[Image], thermometer: Option<usize>) -> Self {
        let column =
            |image: &Image| image.inputs().iter().map(|_| thermometer.map(LogColumn::Thermometer)).collect::<Vec<_>>();
        Self { thermometer, columns: images.iter().map(column).collect() }
    }

    /// By the calibration's names, or those of the setup.
    pub(crate) fn find(
        images: &[Image],
        axes: Option<&[AxisCalibration]>,
        main: Option<usize>,
        shape: &LogShape,
        setup: &Setup,
    ) -> Result<Self> {
        let columns: Result<Vec<_>> = images
            .iter()
            .map(|image| {
                let letter = char::from(image.description().axis);
                let record = axes.and_then(|axes| axes.iter().find(|axis| axis.axis == letter));
                let own = image.inputs().iter().filter(|t| t.source == ValueSource::Code).count();
                let mut further = match record {
                    Some(record) => recorded(record, shape)?,
                    None => named(own.saturating_sub(1), shape, setup)?,
                }
                .into_iter();
                let column = |(at, source): (usize, ValueSource)| match (at, source) {
                    (_, ValueSource::Difference { .. } | ValueSource::Repeat { .. } | ValueSource::WarmUp) => None,
                    (0, ValueSource::Code) => main.map(LogColumn::Thermometer),
                    (_, ValueSource::Code) => further.next(),
                };
                Ok(image.inputs().iter().map(|t| t.source).enumerate().map(column).collect())
            })
            .collect();
        Ok(Self { thermometer: main, columns: columns? })
    }
}

/// Of a calibration's further inputs with codes of their own.
fn recorded(axis: &AxisCalibration, shape: &LogShape) -> Result<Vec<LogColumn>> {
    let find = |source: &InputSource| {
        let (what, name, column) = match source {
            InputSource::Difference(..) | InputSource::Repeat(_) => return None,
            InputSource::Thermometer(name) => {
                ("thermometer", name, place(&shape.thermometers, name).map(LogColumn::Thermometer))
            }
            InputSource::Column(name) => ("auxiliary column", name, place(&shape.aux, name).map(LogColumn::Aux)),
        };
        Some(column.ok_or_else(|| {
            let all: Vec<String> =
                shape.thermometers.iter().map(|t| label(t).to_owned()).chain(shape.aux.clone()).collect();
            Error::input(
                format!("the correction needs the {what} {name:?}, and the log has none of this name"),
                format!("map its column under [columns]. The log has: {}", Error::choices(&all)),
            )
        }))
    };
    axis.other_inputs().iter().filter_map(|input| find(&input.source)).collect()
}

/// Of an image without names.
fn named(wanted: usize, shape: &LogShape, setup: &Setup) -> Result<Vec<LogColumn>> {
    if wanted == 0 {
        return Ok(Vec::new());
    }
    // A difference is read as its two thermometers, of which the first of all is not named here.
    let main = setup.use_thermometer.as_deref().map_or("", label);
    let mut names: Vec<&str> = Vec::new();
    for name in setup.inputs.iter().flatten() {
        let known = shape.aux.iter().any(|aux| aux == name);
        let parts: Vec<&str> = if known { vec![name] } else { name.split(" - ").collect() };
        let one = parts.len() == 1;
        for part in parts.into_iter().filter(|part| one || *part != main) {
            if !names.contains(&part) {
                names.push(part);
            }
        }
    }
    if names.len() != wanted {
        return Err(Error::input(
            format!("the image reads {wanted} unnamed inputs next to the thermometer, and {} are named", names.len()),
            "name them in the image's order with --inputs, or give the calibration",
        )
        .column("inputs"));
    }
    let find = |name: &&str| {
        let thermometer = shape.thermometers.iter().position(|other| label(other) == *name);
        let column = thermometer.map(LogColumn::Thermometer).or_else(|| place(&shape.aux, name).map(LogColumn::Aux));
        column.ok_or_else(|| {
            Error::input(
                "the log has no input of this name",
                format!("add the column to the log, or map it under [columns] to aux_{name}"),
            )
            .column("inputs")
            .value(*name)
        })
    };
    names.iter().map(find).collect()
}

fn place(names: &[String], wanted: &str) -> Option<usize> {
    names.iter().position(|name| name == wanted)
}
