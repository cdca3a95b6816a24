//! The report of a comparison: every record's curve with its band, and its deviation from the mean in σ.

use crate::charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
use crate::report::Report;
use sagnac::compare::{Change, ComparedAxis, ComparedCurve, ComparedNumber, Comparison};
use sagnac::verify::{Judged, Verdict};
use sagnac_log::error::Result;
use sagnac_units::format::{celsius, file_name, significant, unit};

/// Two-sided 95 % of a normal.
const TWO_SIGMA: f64 = 1.96;

/// A comparison as a report.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn comparison_report(comparison: &Comparison) -> Result<Report> {
    let mut page = ChartPage {
        title: format!("Calibrations of {}, compared", comparison.serial),
        subtitle: names(comparison).join(", "),
        ..ChartPage::default()
    };
    for axis in &comparison.axes {
        if let Some(pass) = axis.pass {
            let words = format!("Axis {}: {}", axis.axis, Judged::of(&axis.limits).words_of("a comparison"));
            page.verdicts.push((pass && comparison.passed(), words));
            page.results.push(limits(axis));
        }
        for curve in &axis.curves {
            let words = format!("Axis {}: {}", axis.axis, curve.verdict(&named(comparison)));
            page.verdicts.push((!curve.disagrees(), words));
            page.notes.extend(curve.change(&named(comparison)).map(|words| format!("Axis {}: {words}.", axis.axis)));
            page.charts.push(difference(comparison, axis.axis, curve));
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
    if !comparison.shared_logs.is_empty() {
        let logs = comparison.shared_logs.join(", ");
        let word = if comparison.limits.is_some() { "Not accepted: these" } else { "These" };
        page.verdicts.insert(0, (false, format!("{word} records share a log ({logs}): they agree too well")));
    }
    if comparison.limits.is_some() && !comparison.untested_axes.is_empty() {
        page.verdicts.push((false, "Not accepted: an axis is not in every record".to_owned()));
    }
    if !comparison.changes.is_empty() {
        page.results.insert(0, changes(comparison));
    }
    chart_report(&page)
}

/// A record's name without its folder.
fn name(comparison: &Comparison, record: usize) -> String {
    file_name(&comparison.records[record].0)
}

/// The records without their folders.
fn named(comparison: &Comparison) -> Vec<(String, f64)> {
    comparison.records.iter().map(|(name, time_s)| (file_name(name), *time_s)).collect()
}

fn names(comparison: &Comparison) -> Vec<String> {
    (0..comparison.records.len()).map(|record| name(comparison, record)).collect()
}

/// Changes other than in the values.
fn changes(comparison: &Comparison) -> PageTable {
    let row = |change: &Change| {
        let record = name(comparison, change.record);
        vec![record, change.kind.clone(), change.what.clone(), change.from.clone(), change.to.clone()]
    };
    PageTable {
        heading: format!("Changes since {}", name(comparison, 0)),
        columns: ["record", "kind", "what", "from", "to"].map(str::to_owned).to_vec(),
        rows: comparison.changes.iter().map(row).collect(),
        ..PageTable::default()
    }
}

/// Each record less the first, with the band of the difference.
fn difference(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> Chart {
    let edge =
        |all: &[[f64; 2]], sign: f64| all.iter().map(|[value, sigma]| value + sign * TWO_SIGMA * sigma).collect();
    let x = || curve.temperatures_c.clone();
    let named = |record: usize| format!("{} less {}", name(comparison, record), name(comparison, 0));
    let bands = curve.differences.iter().map(|all| Band {
        label: String::new(),
        x: x(),
        lo: edge(all, -1.0),
        hi: edge(all, 1.0),
    });
    let lines = curve.differences.iter().enumerate().map(|(at, all)| Curve {
        label: named(at + 1),
        x: x(),
        y: all.iter().map(|[value, _]| *value).collect(),
        dashed: false,
    });
    let zero = Curve { label: "no change".to_owned(), x: x(), y: vec![0.0; curve.temperatures_c.len()], dashed: true };
    Chart {
        id: format!("{}-difference-{axis}", curve.quantity),
        group: format!("temperature-{axis}"),
        title: format!("Change of axis {axis}, {}", curve.quantity),
        caption: "The difference from the first record, with the band where it is with 95 % confidence. Where zero is outside the band, \
                  the gyro has changed."
            .to_owned(),
        x_label: "temperature, °C".to_owned(),
        y_label: format!("difference of {}, {}", curve.quantity, unit(&curve.unit)),
        curves: lines.chain([zero]).collect(),
        bands: bands.collect(),
        ..Chart::default()
    }
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
        ..PageTable::default()
    }
}

fn values(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> Chart {
    let all = 0..comparison.records.len();
    let band = |record: usize| {
        let edge = |sign: f64| {
            let points = curve.values[record].iter().zip(&curve.sigmas[record]);
            points.map(|(value, sigma)| value + sign * TWO_SIGMA * sigma).collect()
        };
        Band { label: String::new(), x: curve.temperatures_c.clone(), lo: edge(-1.0), hi: edge(1.0) }
    };
    let line = |record: usize| Curve {
        label: name(comparison, record),
        x: curve.temperatures_c.clone(),
        y: curve.values[record].clone(),
        dashed: false,
    };
    Chart {
        id: format!("{}-{axis}", curve.quantity),
        group: format!("temperature-{axis}"),
        title: format!("Curves of axis {axis}, {}", curve.quantity),
        caption: "Each curve with its own 95 % band.".to_owned(),
        x_label: "temperature, °C".to_owned(),
        y_label: format!("{}, {}", curve.quantity, unit(&curve.unit)),
        curves: all.clone().map(line).collect(),
        bands: all.map(band).collect(),
        ..Chart::default()
    }
}

fn apart(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> Chart {
    let line = |record: usize| {
        let points = curve.temperatures_c.iter().zip(&curve.z[record]);
        let (x, y) = points.filter_map(|(t, z)| Some((*t, (*z)?))).unzip();
        Curve { label: name(comparison, record), x, y, dashed: false }
    };
    Chart {
        id: format!("{}-apart-{axis}", curve.quantity),
        group: format!("temperature-{axis}"),
        title: format!("Deviation from the mean in σ, axis {axis}, {}", curve.quantity),
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
    columns.extend(names(comparison));
    columns.extend(["unit", "farthest apart, σ"].map(str::to_owned));
    let rows = axis.numbers.iter().map(ComparedNumber::row);
    PageTable {
        heading: format!("Numbers of axis {}", axis.axis),
        columns,
        rows: rows.collect(),
        ..PageTable::default()
    }
}

fn table(comparison: &Comparison, axis: char, curve: &ComparedCurve) -> PageTable {
    let mut columns = vec!["°C".to_owned()];
    columns.extend(curve.titles(&named(comparison)));
    let row = |at: usize| {
        let mut row = vec![celsius(curve.temperatures_c[at])];
        row.extend(curve.row(at));
        row
    };
    PageTable {
        heading: format!("Axis {axis}, {}, {}", curve.quantity, unit(&curve.unit)),
        columns,
        rows: curve.by_change().into_iter().map(row).collect(),
        ..PageTable::default()
    }
}
