//! `sagnac inspect` of a log: what it holds, and what it is good for.

use std::path::{Path, PathBuf};

use sagnac::Result;
use sagnac::survey::{AxisSurvey, Survey, ThermometerSurvey, survey};
use sagnac::window::{WindowBuilder, Windows, table_columns, table_row};
use sagnac_log::ingest::{AngleUnit, LogReader, LogShape, ReadMode, Tally, already_compensated, table_of_windows};
use sagnac_log::setup::{RateUnit, Setup};
use sagnac_log::write::write_rows;
use sagnac_report::survey_report;
use sagnac_units::format::{counted, significant};
use sagnac_units::s_from_ns;
use serde::Serialize;

use crate::args::report::ReportArgs;
use crate::args::setup::LogArgs;
use crate::args::units::UnitsArgs;
use crate::files::loading;
use crate::output::console::Console;
use crate::output::progress::open_log;
use crate::output::tables::excluded;
use crate::output::terminal::table;
use crate::verbs::inspect::results;

/// Output of `inspect --json` for a log.
#[derive(Serialize)]
struct LogObject {
    kind: &'static str,
    /// What it is good for, and what it lacks.
    survey: Survey,
    /// The setting without which `calibrate` does not run.
    #[serde(skip_serializing_if = "Option::is_none")]
    asks_for: Option<&'static str>,
    axes: Vec<LogAxis>,
    quantity: &'static str,
    rows: u64,
    sample_interval_s: f64,
    length_s: f64,
    windows: usize,
    windows_used: usize,
    excluded: Vec<Tally>,
    ignored_columns: Vec<String>,
}

#[derive(Serialize)]
struct LogAxis {
    axis: char,
    /// Null for counts of unknown scale.
    mean_dph: Option<f64>,
    /// Null for rates.
    mean_counts_per_s: Option<f64>,
}

const SCALE_KEY: &str = "arcsec_per_count";

/// How logs are read, and what is written of them.
pub(super) struct Wanted<'a> {
    pub(super) reading: &'a LogArgs,
    pub(super) report: &'a ReportArgs,
    pub(super) units: UnitsArgs,
    /// A table of the windows.
    pub(super) windows: Option<&'a Path>,
}

/// Logs that are runs of one test.
pub(super) fn several(paths: &[PathBuf], wanted: &Wanted<'_>, console: &mut Console) -> Result<()> {
    let (windows, setup) = match wanted.reading.windows(paths) {
        Err(error) if error.place.column.as_deref() == Some(SCALE_KEY) => {
            let given = wanted.reading.setup.over(Setup::default())?;
            let counted = Setup { arcsec_per_count: Some(1.0), ..given.clone() };
            let builder = WindowBuilder::read_all(loading::logs(paths, &counted, "reading")?, &counted)?;
            (wanted.reading.outliers(builder).finish(), given)
        }
        read => read?,
    };
    console.say(format!("{} logs, {} runs", paths.len(), windows.runs.len()));
    described(&windows, Vec::new(), "logs", &setup, wanted, console)
}

/// False for what is no log any more: corrected rows, or windows.
pub(super) fn log(path: &Path, wanted: &Wanted<'_>, console: &mut Console) -> Result<bool> {
    let given = wanted.reading.setup.over(Setup::default())?;
    let (reader, setup) = match open_as_far_as_known(path, given) {
        Err(error) if error.what == already_compensated().what => {
            return results::compensated(None, console).map(|()| false);
        }
        Err(error) if error.what == table_of_windows().what => return results::windows(console).map(|()| false),
        opened => opened?,
    };
    let shape = reader.shape().clone();
    console.say(shape_text(&shape));
    let windows = wanted.reading.outliers(WindowBuilder::read_all(vec![reader], &setup)?).finish();
    described(&windows, shape.ignored, "log", &setup, wanted, console).map(|()| true)
}

/// Opens a log. Counts without a stated scale are read with 1 arcsec per count, so that °/h means counts per second; the
/// returned setup still lacks the scale.
fn open_as_far_as_known(path: &Path, given: Setup) -> Result<(LogReader, Setup)> {
    match open_log(path, &given, ReadMode::Bulk, "reading") {
        Err(error) if error.place.column.as_deref() == Some(SCALE_KEY) && path.as_os_str() != "-" => {
            let setup = Setup { arcsec_per_count: Some(1.0), ..given };
            Ok((open_log(path, &setup, ReadMode::Bulk, "reading")?, Setup { arcsec_per_count: None, ..setup }))
        }
        opened => Ok((opened?, given)),
    }
}

fn shape_text(shape: &LogShape) -> String {
    let axes: Vec<String> = shape.axes.iter().map(char::to_string).collect();
    let quantity = match shape.unit {
        AngleUnit::Quanta { quantum, .. } => format!("counts, quantum {quantum}"),
        AngleUnit::Arcsec => "rates".to_owned(),
    };
    let thermometers = match shape.thermometers.len() {
        0 => "no thermometer".to_owned(),
        1 => "one thermometer".to_owned(),
        n => format!("{n} thermometers"),
    };
    let ignored =
        if shape.ignored.is_empty() { String::new() } else { format!("; not read: {}", shape.ignored.join(", ")) };
    format!("a log of {quantity}, axes {}, {thermometers}{ignored}", axes.join(" "))
}

fn described(
    windows: &Windows,
    ignored: Vec<String>,
    kind: &'static str,
    setup: &Setup,
    wanted: &Wanted<'_>,
    console: &mut Console,
) -> Result<()> {
    let scale_known = setup.arcsec_per_count.is_some() || windows.shape.unit == AngleUnit::Arcsec;
    let assumed = Setup { arcsec_per_count: setup.arcsec_per_count.or(Some(1.0)), ..setup.clone() };
    let mut survey = survey(windows, if scale_known { setup } else { &assumed })?;
    if !scale_known {
        survey
            .cautions
            .push("count size unknown: rates below are counts per second. Set --arcsec-per-count".to_owned());
    }
    let object = object_of(windows, survey, ignored, kind, scale_known);
    say(&object, scale_known, wanted.units.over(setup), console);
    if let Some(path) = wanted.windows {
        write_rows(path, table_columns(windows), (0..windows.len()).map(|at| table_row(windows, at)))?;
        console.say(format!("wrote {}", path.display()));
    }
    wanted.report.write(console, || survey_report(&object.survey, windows))?;
    console.object(&object)
}

fn say(object: &LogObject, scale_known: bool, units: RateUnit, console: &mut Console) {
    console.say(format!(
        "{} rows every {} s, {} s in all; {}, {} of them usable",
        object.rows,
        significant(object.sample_interval_s, 6),
        significant(object.length_s, 6),
        counted(object.windows, "window", "windows"),
        object.windows_used
    ));
    let Survey { good_for, reason, cautions, thermometers, coverage, axes, .. } = &object.survey;
    let because = reason.as_ref().map_or(String::new(), |why| format!(": {why}"));
    console.say(format!("verdict: {}{because}", good_for.name()));
    cautions.iter().for_each(|caution| console.say(format!("note: {caution}")));
    console.say("");
    console.say(axes_table(&object.axes, axes, scale_known, units));
    if !thermometers.is_empty() {
        console.say("");
        console.say(thermometers_table(thermometers));
    }
    if let Some(map) = coverage {
        console.say("");
        map.picture().iter().for_each(|line| console.say(line));
    }
    let lines = excluded(&object.excluded);
    if !lines.is_empty() {
        console.say("");
        lines.iter().for_each(|line| console.say(line));
    }
    missing(axes, console);
}

fn axes_table(means: &[LogAxis], axes: &[AxisSurvey], scale_known: bool, units: RateUnit) -> String {
    let cell = |value: Option<f64>| value.map_or("-".to_owned(), |v| significant(v, 7));
    let (factor, walk) = units.shown("deg/rt h");
    let rows = means.iter().zip(axes).map(|(mean, axis)| {
        let slope = axis.slope_dph_per_c.filter(|_| scale_known);
        vec![
            mean.axis.to_string(),
            cell(mean.mean_dph.map(|dph| units.of_dph(dph))),
            cell(mean.mean_counts_per_s),
            if scale_known { axis.arw_text(factor) } else { "-".to_owned() },
            slope.map_or("-".to_owned(), |[value, sigma]| units.with_sigma(value, Some(sigma))),
        ]
    });
    let name = units.name();
    let [mean, slope] = [format!("mean, {name}"), format!("slope, {name} per °C")];
    table(&["axis", &mean, "mean, counts/s", &format!("ARW, {walk}"), &slope], rows)
}

fn thermometers_table(all: &[ThermometerSurvey]) -> String {
    let cell = |value: Option<f64>, digits: i32| value.map_or("-".to_owned(), |v| significant(v, digits));
    let rows = all.iter().map(|t| {
        let name = if t.name.is_empty() { "temperature" } else { &t.name };
        let fixed = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        vec![
            name.to_owned(),
            fixed(t.min_c),
            fixed(t.max_c),
            cell(t.noise_c, 2),
            cell(t.resolution_c, 2),
            cell(t.reading_interval_s, 4),
        ]
    });
    table(&["thermometer", "min, °C", "max, °C", "noise, °C", "resolution, °C", "reading every, s"], rows)
}

/// Limits of an acceptance for which the log has no value; axes that lack the same share a line.
fn missing(axes: &[AxisSurvey], console: &mut Console) {
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    for axis in axes {
        for one in axis.unanswered.iter().flatten() {
            let line = format!("{}: {}", one.why, one.limits.join(", "));
            match said.iter_mut().find(|(known, _)| *known == line) {
                Some((_, letters)) => letters.push(axis.axis.to_string()),
                None => said.push((line, vec![axis.axis.to_string()])),
            }
        }
    }
    if said.is_empty() {
        return;
    }
    console.say("");
    console.say("this log cannot be checked against these limits:");
    for (line, letters) in said {
        let prefix = if letters.len() == axes.len() { String::new() } else { format!("axis {}: ", letters.join(" ")) };
        console.say(format!("  {prefix}{line}"));
    }
}

fn object_of(
    windows: &Windows,
    survey: Survey,
    ignored: Vec<String>,
    kind: &'static str,
    scale_known: bool,
) -> LogObject {
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    // A log too short for a single window still has a mean.
    let described: Vec<usize> = if used.is_empty() { (0..windows.len()).collect() } else { used.clone() };
    let total_s: f64 = described.iter().map(|i| windows.duration_s(*i)).sum();
    let axes = windows.shape.axes.iter().enumerate().map(|(index, axis)| {
        let angle: f64 = described.iter().map(|i| windows.rows.angle[index][*i]).sum();
        let per_s = angle / total_s;
        let finite = |value: f64| value.is_finite().then_some(value);
        let counts = match windows.shape.unit {
            AngleUnit::Quanta { quantum, .. } => finite(per_s * quantum),
            AngleUnit::Arcsec => None,
        };
        let mean_dph = finite(per_s * windows.shape.unit.arcsec()).filter(|_| scale_known);
        LogAxis { axis: *axis, mean_dph, mean_counts_per_s: counts }
    });
    LogObject {
        kind,
        survey,
        asks_for: (!scale_known).then_some(SCALE_KEY),
        axes: axes.collect(),
        quantity: if matches!(windows.shape.unit, AngleUnit::Arcsec) { "rates" } else { "counts" },
        rows: windows.runs.iter().flat_map(|run| &run.files).map(|file| file.summary.rows).sum(),
        sample_interval_s: windows.shape.sample_interval_s,
        length_s: windows.runs.iter().map(|run| s_from_ns(run.end_ns - run.start_ns)).sum(),
        windows: windows.len(),
        windows_used: used.len(),
        excluded: windows.tallies.list(),
        ignored_columns: ignored,
    }
}
