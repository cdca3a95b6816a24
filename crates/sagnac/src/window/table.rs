//! Windows as a table to look at: a row for each, without the tracks and noise sums that a fit needs too. No program reads it back.

use sagnac_log::ingest::{AngleUnit, Content};

use crate::window::windows::Windows;

/// Of a thermometer, and of an auxiliary column: mean, variance, smallest and largest value.
const SENSOR_COLUMNS: [&str; 4] = ["mean_c", "variance_c2", "min_c", "max_c"];
const AUX_COLUMNS: [&str; 4] = ["aux", "variance_aux", "min_aux", "max_aux"];

/// The columns of the table, by name and content.
pub fn table_columns(windows: &Windows) -> Vec<(String, Content)> {
    use Content::{Nanoseconds, Number, Text};
    let shape = &windows.shape;
    let fixed = [
        ("run", Number),
        ("start_ns", Nanoseconds),
        ("end_ns", Nanoseconds),
        ("duration_ns", Nanoseconds),
        ("samples", Number),
        ("first_line", Number),
        ("reference_dps", Number),
        ("excluded", Text),
    ];
    let names_with = |prefixes: [&'static str; 4], names: &[String]| -> Vec<String> {
        names.iter().flat_map(|name| prefixes.map(|prefix| format!("{prefix}_{name}"))).collect()
    };
    let angles = shape.axes.iter().map(|axis| format!("angle_{axis}"));
    let sensors =
        names_with(SENSOR_COLUMNS, &shape.thermometers).into_iter().chain(names_with(AUX_COLUMNS, &shape.aux));
    let fixed = fixed.into_iter().map(|(name, content)| (name.to_owned(), content));
    fixed.chain(angles.chain(sensors).map(|name| (name, Number))).collect()
}

/// A window's cells; empty where there is no value. Angles of a log of counts are quanta, of a log of rates arcsec.
pub fn table_row(windows: &Windows, at: usize) -> Vec<String> {
    let (rows, whole) = (&windows.rows, matches!(windows.shape.unit, AngleUnit::Quanta { .. }));
    let number = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
    let mut cells = vec![
        rows.run[at].to_string(),
        rows.start_ns[at].to_string(),
        rows.end_ns[at].to_string(),
        rows.duration_ns[at].to_string(),
        rows.samples[at].to_string(),
        rows.first_line[at].to_string(),
        number(rows.reference_dps[at]),
        rows.excluded[at].map_or(String::new(), |reason| reason.name().to_owned()),
    ];
    let angle = |angle: &Vec<f64>| if whole { (angle[at] as i64).to_string() } else { number(angle[at]) };
    cells.extend(rows.angle.iter().map(angle));
    for columns in [
        [&rows.mean_c, &rows.variance_c2, &rows.min_c, &rows.max_c],
        [&rows.aux, &rows.aux_variance, &rows.aux_min, &rows.aux_max],
    ] {
        cells.extend((0..columns[0].len()).flat_map(|sensor| columns.map(|column| number(column[sensor][at]))));
    }
    cells
}
