//! The report of a comparison: every record's curve with its band, and its deviation from the mean in σ.

use crate::charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
use sagnac::compare::{ComparedAxis, ComparedCurve, ComparedNumber, Comparison};
use sagnac::verify::{Judged, Verdict};
use sagnac_log::error::Result;
use sagnac_units::format::{celsius, significant};

/// Two-sided 95 % of a normal.
const TWO_SIGMA: f64 = 1.96;

/// A comparison as one self-contained HTML file.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn comparison_report(comparison: &Comparison) -> Result<String> {
    let mut page = ChartPage {
        title: format!("Calibrations of {} beside each other", comparison.serial),
        subtitle: comparison.records.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", "),
        ..ChartPage::default()
    };
    for axis in &comparison.axes {
        if let Some(pass) = axis.pass {
            let words = format!("Axis {}: {}", axis.axis, Judged::of(&axis.limits).words_of("a comparison"));
            page.verdicts.push((pass && comparison.passed(), words));
            page.results.push(limits(axis));
        }
        for curve in &axis.curves {
            let words = format!("Axis {}: {}", axis.axis, curve.verdict(&comparison.records));
            page.verdicts.push((!curve.disagrees(), words));
            page.charts.push(values(comparison, axis.axis, curve));
            page.charts.push(apart(comparison, axis.axis, curve));
            page.tables.push(table(comparison, axis.axis, curve));
        }
        page.notes.extend(
            axis.numbers
                .iter()
                .filter_map(ComparedNumber::verdict)
                .map(|words| format!("Axis {}: {words}.", axis.axis)),
        );
        page.results.push(numbers(comparison, axis));
    }
    if comparison.limits.is_some() && !comparison.shared_logs.is_empty() {
        let logs = comparison.shared_logs.join(", ");
        page.verdicts.push((false, format!("Not accepted: records were made from the same log ({logs})")));
    }
    if comparison.limits.is_some() && !comparison.untested_axes.is_empty() {
        page.verdicts.push((false, "Not accepted: an axis is not in every record".to_owned()));
    }
    chart_report(&page)
}

/// Every limit of an axis with its value.
fn limits(axis: &ComparedAxis) -> PageTable {
    let row = |l: &Verdict| {
        let remark = l.remark().unwrap_or_default();
        vec![l.name.clone(), l.value_text(), significant(l.limit, 4), l.margin_text(), l.word().to_owned(), remark]
    };
    PageTable {
        heading: format!("Limits of axis {}", axis.axis),
        columns: ["limit", "value", "bound", "margin", "verdict", ""].map(str::to_owned).to_vec(),
        rows: axis.limits.iter().map(row).collect(),
    }
}

fn values(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> Chart {
    let name = |record: usize| comparison.records[record].0.clone();
    let all = 0..comparison.records.len();
    let band = |record: usize| {
        let edge = |sign: f64| {
            let points = curve.values[record].iter().zip(&curve.sigmas[record]);
            points.map(|(value, sigma)| value + sign * TWO_SIGMA * sigma).collect()
        };
        Band { label: String::new(), x: curve.temperatures_c.clone(), lo: edge(-1.0), hi: edge(1.0) }
    };
    let line = |record: usize| Curve {
        label: name(record),
        x: curve.temperatures_c.clone(),
        y: curve.values[record].clone(),
        dashed: false,
    };
    Chart {
        id: format!("{}-{axis}", curve.quantity),
        group: format!("temperature-{axis}"),
        title: format!("Do the curves come back? Axis {axis}, {}", curve.quantity),
        caption: "Each curve with the band where its own fit puts it with 95 % confidence.".to_owned(),
        x_label: "temperature, °C".to_owned(),
        y_label: format!("{}, {}", curve.quantity, curve.unit),
        curves: all.clone().map(line).collect(),
        bands: all.map(band).collect(),
        ..Chart::default()
    }
}

fn apart(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> Chart {
    let line = |record: usize| {
        let points = curve.temperatures_c.iter().zip(&curve.z[record]);
        let (x, y) = points.filter_map(|(t, z)| Some((*t, (*z)?))).unzip();
        Curve { label: comparison.records[record].0.clone(), x, y, dashed: false }
    };
    Chart {
        id: format!("{}-apart-{axis}", curve.quantity),
        group: format!("temperature-{axis}"),
        title: format!("By how many sigmas do they stand apart? Axis {axis}, {}", curve.quantity),
        caption: "Distance of each record from the weighted mean of all, in the standard deviation of that distance. Beyond ±3 a record \
                  disagrees with the others by more than its interval explains."
            .to_owned(),
        x_label: "temperature, °C".to_owned(),
        y_label: "distance from the mean, σ".to_owned(),
        curves: (0..comparison.records.len()).map(line).collect(),
        ..Chart::default()
    }
}

fn numbers(comparison: &Comparison, axis: &ComparedAxis) -> PageTable {
    let mut columns = vec![String::new()];
    columns.extend(comparison.records.iter().map(|(name, _)| name.clone()));
    columns.extend(["unit", "farthest apart, σ"].map(str::to_owned));
    let rows = axis.numbers.iter().map(ComparedNumber::row);
    PageTable { heading: format!("Numbers of axis {}", axis.axis), columns, rows: rows.collect() }
}

fn table(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> PageTable {
    let mut columns = vec!["°C".to_owned()];
    columns.extend(comparison.records.iter().map(|(name, _)| name.clone()));
    columns.push("beyond their σ".to_owned());
    let row = |at: usize| {
        let mut row = vec![celsius(curve.temperatures_c[at])];
        row.extend(curve.row(at));
        row
    };
    PageTable {
        heading: format!("Axis {axis}, {}, {}", curve.quantity, curve.unit),
        columns,
        rows: (0..curve.temperatures_c.len()).map(row).collect(),
    }
}
