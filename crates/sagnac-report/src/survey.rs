//! The page of `inspect`: what a log is good for, where the test was, and what it lacks.

use crate::charts::{Chart, ChartPage, Curve, PageTable, chart_report};
use crate::report::Report;
use sagnac::survey::{CoverageMap, GoodFor, Survey};
use sagnac::window::Windows;
use sagnac_log::error::Result;
use sagnac_units::format::{file_name, significant, with_sigma};
use sagnac_units::s_from_ns;

/// A survey as a report.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn survey_report(survey: &Survey, windows: &Windows) -> Result<Report> {
    let mut files: Vec<String> =
        windows.runs.iter().flat_map(|run| &run.files).map(|file| file_name(&file.summary.file)).collect();
    // A file whose clock starts again has several runs.
    files.dedup();
    let because = survey.reason.as_ref().map_or(String::new(), |why| format!(": {why}"));
    let mut page = ChartPage {
        title: "Use of this log".to_owned(),
        subtitle: files.join(", "),
        verdicts: vec![(survey.good_for == GoodFor::Calibration, format!("{}{because}", survey.good_for.name()))],
        notes: survey.cautions.iter().map(|caution| format!("Note: {caution}.")).collect(),
        ..ChartPage::default()
    };
    page.charts.extend(coverage(survey));
    page.charts.extend(temperatures(windows));
    page.results.push(axes(survey));
    page.results.push(thermometers(survey));
    page.tables.push(unanswered(survey));
    page.tables.push(excluded(windows));
    page.results.retain(|table| !table.rows.is_empty());
    page.tables.retain(|table| !table.rows.is_empty());
    chart_report(&page)
}

fn table<const N: usize>(heading: &str, columns: [&str; N], rows: impl Iterator<Item = Vec<String>>) -> PageTable {
    PageTable {
        heading: heading.to_owned(),
        columns: columns.map(str::to_owned).into(),
        rows: rows.collect(),
        ..PageTable::default()
    }
}

fn cell(value: Option<f64>, digits: i32) -> String {
    value.map_or("-".to_owned(), |value| significant(value, digits))
}

/// The path of the test through temperature and rate.
fn coverage(survey: &Survey) -> Option<Chart> {
    let map = survey.coverage.as_ref()?;
    Some(Chart {
        id: "coverage".to_owned(),
        group: "coverage".to_owned(),
        title: "Temperatures and rates of the test".to_owned(),
        caption: "Mean rate of the windows at each temperature. A calibration holds in this area. Heating and cooling together separate \
                  hysteresis and rate terms from the curve."
            .to_owned(),
        x_label: "temperature, °C".to_owned(),
        y_label: "temperature rate, °C/min".to_owned(),
        curves: vec![leg(map, "heating", |rate| rate > 0.0), leg(map, "cooling", |rate| rate < 0.0)],
        ..Chart::default()
    })
}

/// Bins of a leg over the span.
const BINS: usize = 100;

/// Mean rate over temperature of the windows that heat, or cool.
fn leg(map: &CoverageMap, label: &str, is_of: fn(f64) -> bool) -> Curve {
    let [lo, hi] = map.temperature_c;
    let mut sums = vec![[0.0; 3]; BINS];
    for [celsius, rate] in map.path.iter().filter(|p| is_of(p[1])) {
        let at = ((celsius - lo) / (hi - lo) * BINS as f64) as usize;
        if let Some(sum) = sums.get_mut(at.min(BINS - 1)) {
            *sum = [sum[0] + celsius, sum[1] + rate, sum[2] + 1.0];
        }
    }
    let known: Vec<[f64; 2]> = sums.iter().filter(|s| s[2] > 0.0).map(|s| [s[0] / s[2], s[1] / s[2]]).collect();
    Curve {
        label: label.to_owned(),
        x: known.iter().map(|p| p[0]).collect(),
        y: known.iter().map(|p| p[1]).collect(),
        dashed: false,
    }
}

/// Temperature over time, a curve for each thermometer; runs follow each other.
fn temperatures(windows: &Windows) -> Option<Chart> {
    if !windows.shape.timed || windows.shape.thermometers.is_empty() {
        return None;
    }
    let rows = &windows.rows;
    let mut begun = 0.0;
    let starts: Vec<f64> = windows
        .runs
        .iter()
        .map(|run| {
            let at = begun;
            begun += run.length_s() / 3600.0;
            at
        })
        .collect();
    let hour = |i: usize| {
        let run = rows.run[i] as usize;
        starts[run] + s_from_ns(rows.start_ns[i] - windows.runs[run].start_ns) / 3600.0
    };
    let curve = |(at, name): (usize, &String)| {
        let known: Vec<usize> = (0..windows.len()).filter(|i| rows.mean_c[at][*i].is_finite()).collect();
        Curve {
            label: if name.is_empty() { "temperature".to_owned() } else { name.clone() },
            x: known.iter().map(|i| hour(*i)).collect(),
            y: known.iter().map(|i| rows.mean_c[at][*i]).collect(),
            dashed: false,
        }
    };
    Some(Chart {
        id: "temperature".to_owned(),
        group: "time".to_owned(),
        title: "Temperature over the test".to_owned(),
        caption: "Means of the windows; runs follow each other.".to_owned(),
        x_label: "time, h".to_owned(),
        y_label: "temperature, °C".to_owned(),
        curves: windows.shape.thermometers.iter().enumerate().map(curve).collect(),
        ..Chart::default()
    })
}

fn axes(survey: &Survey) -> PageTable {
    let rows = survey.axes.iter().map(|axis| {
        let slope = axis.slope_dph_per_c.map_or("-".to_owned(), |[value, sigma]| with_sigma(value, Some(sigma)));
        vec![axis.axis.to_string(), axis.arw_text(1.0), slope]
    });
    table("Axes", ["axis", "angle random walk, °/√h", "slope of a trial fit, °/h per °C"], rows)
}

fn thermometers(survey: &Survey) -> PageTable {
    let rows = survey.thermometers.iter().map(|t| {
        let name = if t.name.is_empty() { "temperature" } else { &t.name };
        vec![
            name.to_owned(),
            cell(t.min_c, 4),
            cell(t.max_c, 4),
            cell(t.noise_c, 2),
            cell(t.resolution_c, 2),
            cell(t.reading_interval_s, 4),
        ]
    });
    table(
        "Thermometers",
        ["thermometer", "min, °C", "max, °C", "noise, °C", "resolution, °C", "reading every, s"],
        rows,
    )
}

fn unanswered(survey: &Survey) -> PageTable {
    let rows = survey.axes.iter().flat_map(|axis| {
        let all = axis.unanswered.iter().flatten();
        all.map(|one| vec![axis.axis.to_string(), one.limits.join(", "), one.why.clone()])
    });
    table("Limits that cannot be checked with this log", ["axis", "limits", "why"], rows)
}

fn excluded(windows: &Windows) -> PageTable {
    let rows = windows.tallies.list().into_iter().map(|tally| {
        vec![tally.reason.name().replace('_', " "), tally.rows.to_string(), tally.reason.meaning().to_owned()]
    });
    table("Excluded rows", ["reason", "rows", "meaning"], rows)
}
