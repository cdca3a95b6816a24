//! Calibrations: made, read, evaluated, applied.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, Int64Array, StringArray};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sagnac::compare::compare as compared;
use sagnac::diagnostics::ReportData;
use sagnac::export::{encode, image_bytes};
use sagnac::fit::{FitOptions, calibrate_with_report_data};
use sagnac::fleet::PriorFile;
use sagnac::verify::{Compensated, Correction, Replay, VerifyOptions, status_text, verify};
use sagnac::window::{WindowBuilder, Windows};
use sagnac::{Error, Result, Setup};
use sagnac_core::{Image, Status};
use sagnac_log::ingest::{AngleUnit, LogShape, ReadMode, sha256};
use sagnac_log::write::write_bytes;
use sagnac_ports::{FixedBias, c_files};
use sagnac_report::calibration_report;
use sagnac_units::s_from_ns;

use crate::columns::words;
use crate::errors::exception;
use crate::points::points_table;
use crate::settings;
use crate::sources::{Run, Sources};
use crate::table::Table;
use crate::verification::{Comparison, Verification};
use crate::work::away;

/// A record, and what it was made of where it was made here.
#[pyclass(frozen, module = "sagnac._sagnac")]
pub(crate) struct Calibration {
    record: Arc<sagnac::Calibration>,
    behind: Option<Arc<(Windows, ReportData)>>,
}

/// What `calibrate` is asked for, next to its runs and its setup.
#[derive(FromPyObject)]
pub(crate) struct Asked {
    #[pyo3(item)]
    model: String,
    #[pyo3(item)]
    warm_up: bool,
    #[pyo3(item)]
    remove_bias: bool,
    #[pyo3(item)]
    source_date_epoch: Option<i64>,
    #[pyo3(item)]
    prior: Option<PathBuf>,
    #[pyo3(item)]
    lot: Option<String>,
    #[pyo3(item)]
    keep_outliers: bool,
}

impl Asked {
    fn options(&self) -> Result<FitOptions> {
        let prior = match &self.prior {
            Some(path) => {
                let prior = PriorFile::read(path)?.of_unit(self.lot.as_deref());
                Some(prior.map_err(|e| e.file(path.display().to_string()))?)
            }
            None => None,
        };
        Ok(FitOptions::new(self.model.parse()?)
            .prior(prior)
            .source_date_epoch(self.source_date_epoch)
            .correct_warm_up(self.warm_up)
            .remove_bias(self.remove_bias))
    }
}

/// Fits runs; `setup` is a file and keys as JSON.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    runs: Vec<Run>,
    setup: (Option<String>, String),
    asked: Asked,
    progress: Option<Py<PyAny>>,
) -> PyResult<Calibration> {
    let sources = Sources::of(py, runs)?;
    away(py, move |stop| {
        let options = asked.options()?.progress(stop.progress(progress));
        let setup = settings::setup(Setup::default(), setup.0.as_deref(), &setup.1)?;
        let builder = WindowBuilder::read_all(sources.logs(&setup, ReadMode::Bulk, stop)?, &setup)?;
        let windows = if asked.keep_outliers { builder.keep_outliers() } else { builder }.finish();
        let (record, report_data) = calibrate_with_report_data(windows.clone(), &setup, &options)?;
        Ok(Calibration { record: Arc::new(record), behind: Some(Arc::new((windows, report_data))) })
    })
}

/// A record's text.
#[pyfunction]
pub(crate) fn parse_calibration(text: &str, name: &str) -> PyResult<Calibration> {
    let record = sagnac::Calibration::parse(text).map_err(|e| exception(e.file(name)))?;
    Ok(Calibration { record: Arc::new(record), behind: None })
}

/// Records of one unit next to each other.
#[pyfunction]
pub(crate) fn compare(records: Vec<(String, PyRef<'_, Calibration>)>, limits: Option<String>) -> PyResult<Comparison> {
    let records: Vec<_> = records.into_iter().map(|(name, record)| (name, record.record.as_ref().clone())).collect();
    let limits = limits.as_deref().map(settings::limits).transpose().map_err(exception)?;
    Ok(Comparison(compared(&records, limits.as_ref()).map_err(exception)?))
}

impl Calibration {
    fn behind(&self) -> PyResult<&(Windows, ReportData)> {
        self.behind
            .as_deref()
            .ok_or_else(|| exception(Error::input("a record from a file has no windows", "calibrate the runs again")))
    }

    fn axis(&self, letter: &str) -> PyResult<&sagnac::AxisCalibration> {
        let mut letters = letter.chars();
        match (letters.next(), letters.next()) {
            (Some(letter), None) => self.record.axis(letter).map_err(exception),
            _ => Err(exception(
                Error::input("an axis is one letter", "give one letter, such as \"x\"").column("axis").value(letter),
            )),
        }
    }

    fn images(&self, sequence: u32) -> Result<Vec<Image>> {
        let parent = sha256(self.record.to_json()?.as_bytes());
        self.record.axes.iter().map(|axis| encode(&self.record, axis, parent, sequence)).collect()
    }
}

/// Arrays of one value each for many temperatures: drift, lower, upper (NaN for null), scale; then whether each is in the span.
type Evaluated<'py> = ([Bound<'py, PyBytes>; 4], Bound<'py, PyBytes>);

#[pymethods]
impl Calibration {
    fn to_json(&self) -> PyResult<String> {
        self.record.to_json().map_err(exception)
    }

    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.record.save(path).map_err(exception)
    }

    /// At temperatures and rates, `f8` each.
    fn evaluate<'py>(&self, py: Python<'py>, axis: &str, celsius: &[u8], cpm: &[u8]) -> PyResult<Evaluated<'py>> {
        let axis = self.axis(axis)?;
        let (celsius, cpm) = (words(celsius, f64::from_le_bytes), words(cpm, f64::from_le_bytes));
        let all: Vec<_> = celsius.iter().zip(&cpm).map(|(celsius, cpm)| axis.evaluate(*celsius, *cpm)).collect();
        let column = |value: fn(&sagnac::Evaluation) -> f64| {
            PyBytes::new(py, &all.iter().flat_map(|one| value(one).to_le_bytes()).collect::<Vec<u8>>())
        };
        let numbers = [
            column(|one| one.drift_dph),
            column(|one| one.lower_dph.unwrap_or(f64::NAN)),
            column(|one| one.upper_dph.unwrap_or(f64::NAN)),
            column(|one| one.scale_ppm),
        ];
        Ok((numbers, PyBytes::new(py, &all.iter().map(|one| u8::from(one.in_span)).collect::<Vec<u8>>())))
    }

    fn image<'py>(&self, py: Python<'py>, axis: &str, sequence: u32) -> PyResult<Bound<'py, PyBytes>> {
        let parent = sha256(self.to_json()?.as_bytes());
        let image = encode(&self.record, self.axis(axis)?, parent, sequence).map_err(exception)?;
        Ok(PyBytes::new(py, &image_bytes(&image)))
    }

    /// Writes the C sources; their paths.
    fn export_c(&self, folder: PathBuf, sequence: u32) -> PyResult<Vec<PathBuf>> {
        let images = self.images(sequence).map_err(exception)?;
        let biases = self.record.removed_dph().into_iter().map(FixedBias::of);
        let axes: Vec<_> = images.into_iter().zip(biases).collect();
        let files = c_files(&axes, None, &[]);
        let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.name)).collect();
        let write = || -> Result<()> {
            if let Some((_, path)) = files.iter().zip(&paths).find(|(file, path)| !file.may_replace(path)) {
                return Err(Error::input(
                    "the export would overwrite a file that another program wrote",
                    "export into an empty folder, such as export/",
                )
                .file(path.display().to_string()));
            }
            for (file, path) in files.iter().zip(&paths) {
                let above = path.parent().unwrap_or(Path::new("."));
                std::fs::create_dir_all(above).map_err(|e| Error::io_path(above, "make the folder", &e))?;
                write_bytes(path, file.text.as_bytes())?;
            }
            Ok(())
        };
        write().map_err(exception)?;
        Ok(paths)
    }

    fn verify(
        &self,
        py: Python<'_>,
        runs: Vec<Run>,
        setup: (Option<String>, String),
        limits: Option<String>,
        exclude: (bool, bool),
    ) -> PyResult<Verification> {
        let (sources, record) = (Sources::of(py, runs)?, Arc::clone(&self.record));
        away(py, move |stop| {
            let correction = Correction::from_calibration(record.as_ref().clone())?;
            let setup = settings::setup(correction.setup(), setup.0.as_deref(), &setup.1)?;
            let limits = limits.as_deref().map(settings::limits).transpose()?;
            let options = VerifyOptions::default().exclude_outliers(exclude.0).exclude_start(exclude.1);
            let proof = verify(&correction, sources.logs(&setup, ReadMode::Bulk, stop)?, &setup, options)?;
            let proof = match &limits {
                Some(limits) => proof.limits(limits)?,
                None => proof,
            };
            Ok(Verification { proof, record })
        })
    }

    /// A log as the gyro's processor would correct it.
    fn compensate(&self, py: Python<'_>, run: Run, setup: (Option<String>, String)) -> PyResult<(Table, u64, u64)> {
        let (sources, record) = (Sources::of(py, vec![run])?, Arc::clone(&self.record));
        let (columns, good, all) = away(py, move |stop| {
            let correction = Correction::from_calibration(record.as_ref().clone())?;
            let setup = settings::setup(correction.setup(), setup.0.as_deref(), &setup.1)?;
            corrected(&correction, &sources, &setup, stop)
        })?;
        Table::of(columns).map(|table| (table, good, all))
    }

    fn report(&self) -> PyResult<String> {
        let (_, report_data) = self.behind()?;
        calibration_report(&self.record, report_data, self.record.setup.units.unwrap_or_default())
            .map(|report| report.html().to_owned())
            .map_err(exception)
    }

    /// The windows that the runs were summed into.
    fn windows(&self) -> PyResult<Table> {
        let (windows, _) = self.behind()?;
        let rows = &windows.rows;
        let origin_ns = |at: usize| windows.runs.get(rows.run[at] as usize).map_or(0, |run| run.start_ns);
        let seconds = |of: &[i64]| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(
                of.iter().enumerate().map(|(at, ns)| s_from_ns(ns - origin_ns(at))),
            ))
        };
        let number = |of: &[f64]| -> ArrayRef {
            Arc::new(Float64Array::from_iter(of.iter().map(|value| (!value.is_nan()).then_some(*value))))
        };
        let mut columns: Vec<(String, ArrayRef)> = vec![
            ("run".to_owned(), Arc::new(Int64Array::from_iter_values(rows.run.iter().map(|run| i64::from(*run))))),
            ("start_s".to_owned(), seconds(&rows.start_ns)),
            ("end_s".to_owned(), seconds(&rows.end_ns)),
            ("samples".to_owned(), Arc::new(Int64Array::from_iter_values(rows.samples.iter().map(|n| i64::from(*n))))),
        ];
        for (at, axis) in windows.shape.axes.iter().enumerate() {
            let rate: Vec<f64> = (0..windows.len()).map(|window| windows.rate_dph(at, window)).collect();
            columns.push((format!("rate_dph_{axis}"), number(&rate)));
        }
        for (name, values) in windows.shape.thermometers.iter().zip(&rows.mean_c) {
            let name = if name.is_empty() { "temperature_c".to_owned() } else { format!("temperature_c_{name}") };
            columns.push((name, number(values)));
        }
        for (name, values) in windows.shape.aux.iter().zip(&rows.aux) {
            columns.push((format!("aux_{name}"), number(values)));
        }
        Table::of(columns)
    }

    /// The points of an axis: rate about its run's constant, and less the fit.
    fn residuals(&self, axis: &str) -> PyResult<Table> {
        let letter = self.axis(axis)?.axis;
        let (_, report_data) = self.behind()?;
        let points = report_data.axes.iter().find(|axis| axis.axis == letter).map_or(&[][..], |axis| &axis.points);
        points_table(points)
    }

    /// Level and text of each note about an axis.
    fn notes(&self, axis: &str) -> PyResult<Vec<(&'static str, String)>> {
        let units = self.record.setup.units.unwrap_or_default();
        Ok(self.axis(axis)?.notes(units).into_iter().map(|note| (note.level.name(), note.text)).collect())
    }

    /// Models that were tried for an axis.
    fn candidates(&self, axis: &str) -> PyResult<Table> {
        let fit = self.axis(axis)?.fit.as_ref();
        let all = fit.map_or(&[][..], |fit| &fit.candidates);
        let number = |of: fn(&sagnac::calibration::Candidate) -> Option<f64>| -> ArrayRef {
            Arc::new(Float64Array::from_iter(all.iter().map(of)))
        };
        Table::of(vec![
            ("model".to_owned(), Arc::new(StringArray::from_iter_values(all.iter().map(|one| &one.model)))),
            (
                "coefficients".to_owned(),
                Arc::new(Int64Array::from_iter_values(all.iter().map(|one| one.coefficients as i64))),
            ),
            ("held_out_dph".to_owned(), number(|one| one.held_out_dph)),
            ("slow_update_instructions".to_owned(), number(|one| one.slow_update_instructions.map(f64::from))),
            ("chosen".to_owned(), Arc::new(Int64Array::from_iter_values(all.iter().map(|one| i64::from(one.chosen))))),
        ])
    }
}

/// Corrected rows, column by column.
struct CorrectedRows {
    lines: Vec<i64>,
    times_s: Vec<f64>,
    /// Per axis: angle in the log's unit, and status in words where there is something to say.
    angles: Vec<Vec<f64>>,
    statuses: Vec<Vec<Option<String>>>,
}

/// Columns of a corrected log, rows that were corrected within the span of the fit, and rows that there were.
type Corrected = (Vec<(String, ArrayRef)>, u64, u64);

/// Corrects a log.
fn corrected(correction: &Correction, sources: &Sources, setup: &Setup, stop: &crate::work::Stop) -> Result<Corrected> {
    let mut logs = sources.logs(setup, ReadMode::Bulk, stop)?;
    let mut log = logs.next().ok_or_else(|| Error::input("no log is given", "give one or more logs"))??;
    let (shape, name) = (log.shape().clone(), log.summary().file);
    let (images, readings) = correction.fit_to(&shape, setup).map_err(|e| e.file(&name))?;
    let mut replay = Replay::new(&images, &shape, readings, &name)?;
    let axes = shape.axes.len();
    let mut rows = CorrectedRows {
        lines: Vec::new(),
        times_s: Vec::new(),
        angles: vec![Vec::new(); axes],
        statuses: vec![Vec::new(); axes],
    };
    let mut counted = Compensated::default();
    while let Some(batch) = log.next_batch()? {
        let done = replay.correct(batch)?;
        rows.lines.extend(batch.line.iter().map(|line| *line as i64));
        rows.times_s.extend(batch.end_ns.iter().map(|ns| s_from_ns(*ns)));
        for row in 0..batch.len() {
            counted.count(done.status.iter().fold(Status::OK, |all, axis| all | axis[row]));
        }
        rows.angles.iter_mut().zip(&done.angle).for_each(|(all, part)| all.extend_from_slice(part));
        for (words, part) in rows.statuses.iter_mut().zip(&done.status) {
            words.extend(part.iter().map(|status| (*status != Status::OK).then(|| status_text(*status))));
        }
    }
    Ok((rows.columns(&shape, sources.are_files()), counted.corrected(), log.summary().rows))
}

impl CorrectedRows {
    /// Rows of a table are counted from 0; its line of headers is above them, and no other line but its rows.
    fn columns(self, shape: &LogShape, is_file: bool) -> Vec<(String, ArrayRef)> {
        let place: (String, ArrayRef) = if is_file {
            ("line".to_owned(), Arc::new(Int64Array::from(self.lines)))
        } else {
            ("row".to_owned(), Arc::new(Int64Array::from_iter_values(self.lines.iter().map(|line| line - 2))))
        };
        let mut columns = vec![place];
        if shape.timed {
            columns.push(("time_s".to_owned(), Arc::new(Float64Array::from(self.times_s))));
        }
        for ((axis, angle), status) in shape.axes.iter().zip(self.angles).zip(self.statuses) {
            let (name, values): (&str, ArrayRef) = match shape.unit {
                AngleUnit::Quanta { quantum: 1.0, .. } => {
                    ("counts", Arc::new(Int64Array::from_iter_values(angle.iter().map(|value| *value as i64))))
                }
                AngleUnit::Quanta { quantum, .. } => {
                    ("counts", Arc::new(Float64Array::from_iter_values(angle.iter().map(|value| *value * quantum))))
                }
                AngleUnit::Arcsec => ("angle_arcsec", Arc::new(Float64Array::from(angle))),
            };
            columns.push((format!("{name}_{axis}"), values));
            columns.push((format!("status_{axis}"), Arc::new(StringArray::from_iter(status))));
        }
        columns
    }
}
