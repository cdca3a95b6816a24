//! The fit of every axis: windows in, a calibration record and the points of its report out.

use crate::calibration::log_files;
use crate::calibration::{
    AxisCorrection, Calibration, FORMAT, MINOR_VERSION, NoiseTrace, Provenance, Target, UNASSIGNED, VERSION, program,
};
use crate::diagnostics::{ReportData, run_spans};
use crate::fit::options::{FitOptions, check_with_prior};
use crate::fit::problem::exclusions::check as check_exclusions;
use crate::fit::record::axis::{count_of, fit_axis};
use crate::image::rate_unit;
use crate::rate_table::input::RateTableInput;
use crate::window::{WindowShape, Windows, refuse_still};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::Reason;
use sagnac_log::setup::Setup;
use sagnac_units::s_from_ns;

/// Fits every axis.
///
/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] where the data cannot support the answer: no temperature, too small a
/// span, T0 outside it, too few windows, terms that cannot be separated.
pub fn calibrate(windows: Windows, setup: &Setup, options: &FitOptions) -> Result<Calibration> {
    calibrate_with_report_data(windows, setup, options).map(|(calibration, _)| calibration)
}

/// The same, with the points behind it for a report.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with_report_data(
    mut windows: Windows,
    setup: &Setup,
    options: &FitOptions,
) -> Result<(Calibration, ReportData)> {
    check_with_prior(options)?;
    let rates = setup.input_rates_of_log(None, &windows.shape.axes);
    let stated = &Setup { input_rate_dph: rates.map_err(|e| of_file(e, &windows))?, earth: None, ..setup.clone() };
    let sensor = sensor_of(&windows.shape, stated).map_err(|e| of_file(e, &windows))?;
    check_aux(&windows.shape, stated)?;
    for i in 0..windows.len() {
        if windows.rows.mean_c[sensor][i].is_nan() {
            windows.exclude(i, Reason::NoTemperature);
        }
    }
    check_exclusions(&windows)?;
    RateTableInput::leave_out_unknown(&mut windows, stated)?;
    refuse_still(&windows).map_err(|e| of_file(e, &windows))?;
    let (mut axes, mut drawn) = (Vec::new(), Vec::new());
    for axis in 0..windows.shape.axes.len() {
        let fitted = fit_axis(&windows, axis, sensor, stated, options);
        let (record, of_report) = fitted.map_err(|e| of_file(e, &windows))?;
        axes.push(record);
        drawn.push(of_report);
    }
    let report_data = ReportData { runs: run_spans(&windows), timed: windows.shape.timed, axes: drawn };
    let shape = &windows.shape;
    let target = Target::of(stated)?;
    let unit = match count_of(&windows, stated) {
        Some(unit) => unit,
        None => {
            let corrections: Vec<(char, &AxisCorrection)> = axes.iter().map(|a| (a.axis, &a.correction)).collect();
            rate_unit(target, &corrections)?
        }
    };
    let calibration = Calibration {
        format: FORMAT.to_owned(),
        version: VERSION,
        minor_version: MINOR_VERSION,
        serial: setup.serial.clone().unwrap_or_else(|| UNASSIGNED.to_owned()),
        unit,
        target,
        window: shape.window,
        window_s: shape.nominal_s,
        sample_interval_s: shape.sample_interval_s,
        axes,
        setup: setup.clone(),
        provenance: provenance(&windows, options),
    };
    Ok((calibration, report_data))
}

fn sensor_of(shape: &WindowShape, setup: &Setup) -> Result<usize> {
    if shape.thermometers.is_empty() {
        return Err(Error::refused(
            "the log has no temperature column",
            "name the column temperature_c, or map it under [columns]",
        ));
    }
    let Some(wanted) = &setup.use_thermometer else {
        return Ok(0);
    };
    shape.thermometers.iter().position(|name| name == wanted).ok_or_else(|| {
        Error::input(
            "the log has no thermometer of this name",
            format!("choose one of these: {}", Error::choices(&shape.thermometers)),
        )
        .column("use_thermometer")
        .value(wanted)
    })
}

/// Refuses a setup for a missing column, which would otherwise have no effect silently.
fn check_aux(shape: &WindowShape, setup: &Setup) -> Result<()> {
    setup.aux.iter().find(|aux| !shape.aux.contains(&aux.name)).map_or(Ok(()), |stray| {
        Err(Error::input(
            "the log has no auxiliary column of this name",
            format!("choose one of these: {}", Error::choices(&shape.aux)),
        )
        .column("aux.name")
        .value(&stray.name))
    })
}

fn provenance(windows: &Windows, options: &FitOptions) -> Provenance {
    let newest = windows.runs.iter().map(|run| run.end_ns).max().unwrap_or(0);
    let (time_s, time_source) = match options.source_date_epoch {
        Some(epoch) => (epoch as f64, "SOURCE_DATE_EPOCH"),
        None => (s_from_ns(newest), "newest input sample"),
    };
    Provenance {
        program: program(),
        time_s,
        time_source: time_source.to_owned(),
        inputs: log_files(windows),
        noise_trace: NoiseTrace::of(windows),
    }
}

/// Names the log, where there is only one.
fn of_file(error: Error, windows: &Windows) -> Error {
    match windows.runs.as_slice() {
        [run] if run.files.len() == 1 => error.file(run.name()),
        _ => error,
    }
}
