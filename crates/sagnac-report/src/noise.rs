//! The report of a noise budget: the curve with its confidence, the fitted terms, and their values.

use crate::charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
use crate::report::Report;
use sagnac::allan::NoiseBudget;
use sagnac_log::error::Result;
use sagnac_log::setup::RateUnit;
use sagnac_noise::{AllanTerm, AxisBudget, CurvePoint, TermValue};
use sagnac_units::format::{file_name, significant};

/// τ that the table lists at most.
const SHOWN_TAUS: usize = 40;

/// A noise budget as a report.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn noise_report(budget: &NoiseBudget, units: RateUnit) -> Result<Report> {
    let files: Vec<String> = budget.inputs.iter().map(|input| file_name(&input.file)).collect();
    let mut page = ChartPage {
        title: "Noise budget".to_owned(),
        subtitle: files.join(", "),
        notes: budget.warnings.iter().map(|warning| format!("Warning: {warning}.")).collect(),
        remarks: notes(budget, units),
        units,
        ..ChartPage::default()
    };
    page.results.push(terms_of_all(&budget.axes, units));
    if budget.axes.len() > 1 {
        page.charts.push(all_axes(&budget.axes));
    }
    page.charts.extend(budget.axes.iter().map(|axis| allan_chart(axis, units)));
    page.charts.extend(budget.axes.iter().filter_map(hadamard_chart));
    page.tables.extend(budget.axes.iter().filter_map(|axis| unresolved_table(axis, units)));
    page.tables.extend(budget.axes.iter().map(|axis| curve_table(axis, units)));
    let inputs = budget.inputs.iter().map(|i| vec![file_name(&i.file), i.rows.to_string(), i.sha256.clone()]);
    page.tables.push(table("Provenance", ["log", "rows", "SHA-256"], inputs));
    if !budget.excluded.is_empty() {
        let rows = budget.excluded.iter().map(|tally| {
            vec![tally.reason.name().replace('_', " "), tally.rows.to_string(), tally.reason.meaning().to_owned()]
        });
        page.tables.push(table("Left out", ["reason", "rows", "meaning"], rows));
    }
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

/// What B is: the flat part of the curve lies lower than it.
const MEANING_OF_B: &str = "Bias instability B is the coefficient of IEEE Std 952-1997: the flat part of the Allan deviation lies at \
                            √(2·ln 2/π)·B = 0.664·B, so that B is the least deviation over 0.664.";

/// The curves of all axes in one figure, with their intervals.
fn all_axes(axes: &[AxisBudget]) -> Chart {
    let curve = |axis: &AxisBudget| {
        let shown = axis.curve.iter().filter(|point| point.adev_dph > 0.0);
        let (x, y) = shown.map(|point| (point.tau_s, point.adev_dph)).unzip();
        Curve { label: format!("axis {}", axis.axis), x, y, dashed: false }
    };
    let bands = axes.iter().map(|axis| {
        let mut of_axis = band(axis.curve.iter().map(|p| (p.tau_s, p.lower_dph, p.upper_dph)));
        of_axis.iter_mut().for_each(|band| band.label.clear());
        of_axis.pop().unwrap_or_default()
    });
    Chart {
        id: "allan".to_owned(),
        group: "tau".to_owned(),
        title: "Allan deviation of all axes".to_owned(),
        caption: "Overlapping Allan deviation of every axis. Each band holds 95 % at each τ.".to_owned(),
        x_label: "averaging time τ, s".to_owned(),
        y_label: "deviation, °/h".to_owned(),
        curves: axes.iter().map(curve).collect(),
        bands: bands.collect(),
        decades: true,
        ..Chart::default()
    }
}

fn notes(budget: &NoiseBudget, units: RateUnit) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    if budget.axes.iter().any(|axis| matches!(axis.terms.get(AllanTerm::BiasInstability), TermValue::Found { .. })) {
        out.push(MEANING_OF_B.to_owned());
    }
    if budget.detrended {
        out.push(
            "The drift over temperature was removed first: at long τ these curves lie lower than the log's own.".into(),
        );
    }
    out.extend(budget.at_rest.iter().map(|span| format!("The longest rest alone: {span}.")));
    for axis in &budget.axes {
        if axis.rows > 0 {
            let stretches = match axis.stretches {
                1 => "one unbroken stretch".to_owned(),
                n => format!(
                    "{n} unbroken stretches, the longest of {} s; no difference spans a gap between them",
                    significant(axis.longest_s, 5)
                ),
            };
            let overlap = axis.full_overlap_s.map_or("Every start is used at every τ.".to_owned(), |s| {
                format!("Every start is used up to τ = {} s; above, starts lie at most τ/256 apart.", significant(s, 4))
            });
            out.push(format!(
                "Axis {}: {} rows of {} s in {stretches}. {overlap}",
                axis.axis,
                axis.rows,
                significant(axis.sample_interval_s, 6)
            ));
            out.extend(row_notes(axis, units).into_iter().map(|note| format!("Axis {}: {note}.", axis.axis)));
        }
    }
    out
}

/// What is said of an axis whose rows were lost or disturbed, line by line.
pub fn row_notes(axis: &AxisBudget, units: RateUnit) -> Vec<String> {
    let mut out = Vec::new();
    let excluded = axis.disturbed.as_ref().filter(|disturbed| disturbed.excluded).map_or(0, |disturbed| disturbed.rows);
    match axis.filled_rows.saturating_sub(excluded) {
        0 => {}
        1 => out.push("1 lost row is bridged by the mean of those around it".to_owned()),
        n => out.push(format!("{n} lost rows are bridged by the mean of those around them")),
    }
    let Some(disturbed) = &axis.disturbed else { return out };
    let sign = |away: f64| if away < 0.0 { "−" } else { "+" };
    let named = disturbed.first.iter().map(|row| {
        format!("{} ({}{} arcsec)", row.at, sign(row.deviation_arcsec), significant(row.deviation_arcsec.abs(), 3))
    });
    let more = if disturbed.rows > disturbed.first.len() as u64 { ", …" } else { "" };
    let one = disturbed.rows == 1;
    let them = if one { "it" } else { "them" };
    let rows = if one { "1 row is".to_owned() } else { format!("{} rows are", disturbed.rows) };
    let part = significant(100.0 * disturbed.fraction, 2);
    let named = named.collect::<Vec<_>>().join(", ");
    out.push(format!("{rows} far from those around {them}, {part} % of all: {named}{more}"));
    let otherwise = AllanTerm::ALL.iter().filter_map(|term| {
        let value = disturbed.alternative_terms.get(*term);
        let name = term.name().0;
        let (factor, unit) = units.shown(term.name().1);
        let letter = name.rsplit(' ').next().unwrap_or_default();
        matches!(value, TermValue::Found { .. }).then(|| {
            let [value, interval] = term_text(value, factor);
            format!("{letter} {value} ({interval}) {unit}")
        })
    });
    let otherwise = match otherwise.collect::<Vec<_>>() {
        none if none.is_empty() => "none of the five terms is resolvable".to_owned(),
        terms => terms.join(", "),
    };
    out.push(match disturbed.excluded {
        true => format!("the figures are without {them}; with {them}: {otherwise}"),
        false => format!("more than 0.5 % is no disturbance: the figures are with {them}; without {them}: {otherwise}"),
    });
    out
}

/// A value with its interval, as people read it.
pub fn term_text(value: &TermValue, factor: f64) -> [String; 2] {
    match value {
        TermValue::Found { value, lower: Some(lower), upper: Some(upper) } => {
            let [value, lower, upper] = [value, lower, upper].map(|number| significant(factor * number, 3));
            [value, format!("{lower} … {upper}")]
        }
        TermValue::Found { value, .. } => [significant(factor * value, 3), "not known: a bare curve".to_owned()],
        TermValue::Unresolved { .. } => ["-".to_owned(), "not resolvable".to_owned()],
    }
}

/// Why a term is missing, with its bound in a unit. The budget states it in that of the term: `at most 0.22 °/√h`.
pub fn reason_text(term: AllanTerm, reason: &str, units: RateUnit) -> String {
    const BOUND: &str = "at most ";
    let own = term.name().1;
    let (factor, unit) = units.shown(own);
    let shown = reason.split_once(BOUND).and_then(|(before, after)| {
        let (number, after) = after.split_once(' ')?;
        let after = after.strip_prefix(own)?;
        Some(format!("{before}{BOUND}{} {unit}{after}", significant(factor * number.parse::<f64>().ok()?, 2)))
    });
    shown.filter(|_| units != RateUnit::DegPerHour).unwrap_or_else(|| reason.to_owned())
}

/// In the order of a data sheet. The first three are always listed, the others where an axis has them.
const LISTED: [AllanTerm; 5] = [
    AllanTerm::AngleRandomWalk,
    AllanTerm::BiasInstability,
    AllanTerm::RateRandomWalk,
    AllanTerm::Quantization,
    AllanTerm::RateRamp,
];

/// The terms with their 95 % intervals, a column per axis.
fn terms_of_all(axes: &[AxisBudget], units: RateUnit) -> PageTable {
    let cell = |axis: &AxisBudget, term: AllanTerm, factor: f64| match term_text(axis.terms.get(term), factor) {
        [value, interval] if value == "-" => interval,
        [value, interval] => format!("{value} ({interval})"),
    };
    let is_found = |term: AllanTerm| axes.iter().any(|axis| matches!(axis.terms.get(term), TermValue::Found { .. }));
    let listed = LISTED.into_iter().enumerate().filter(|(at, term)| *at < 3 || is_found(*term));
    let rows = listed.map(|(_, term)| {
        let (factor, unit) = units.shown(term.name().1);
        let cells = axes.iter().map(|axis| cell(axis, term, factor));
        std::iter::once(format!("{}, {unit}", term.name().0)).chain(cells).collect()
    });
    let columns = axes.iter().map(|axis| format!("axis {}", axis.axis));
    PageTable {
        heading: "Noise terms, with 95 % intervals".to_owned(),
        columns: std::iter::once("term".to_owned()).chain(columns).collect(),
        rows: rows.collect(),
        ..PageTable::default()
    }
}

/// Why terms of an axis are missing.
fn unresolved_table(axis: &AxisBudget, units: RateUnit) -> Option<PageTable> {
    let reason = |term: &AllanTerm| match axis.terms.get(*term) {
        TermValue::Unresolved { unresolved } => {
            Some(vec![term.name().0.to_owned(), reason_text(*term, unresolved, units)])
        }
        TermValue::Found { .. } => None,
    };
    let rows: Vec<Vec<String>> = AllanTerm::ALL.iter().filter_map(reason).collect();
    let heading = format!("Not resolvable, axis {}", axis.axis);
    (!rows.is_empty()).then(|| table(&heading, ["term", "reason"], rows.into_iter()))
}

fn curve_table(axis: &AxisBudget, units: RateUnit) -> PageTable {
    let step = axis.curve.len().div_ceil(SHOWN_TAUS).max(1);
    let end = |value: Option<f64>| value.map_or("-".to_owned(), |dph| units.number(dph, 4));
    let rows = axis.curve.iter().step_by(step).map(|point| {
        vec![
            significant(point.tau_s, 5),
            units.number(point.adev_dph, 5),
            end(point.lower_dph),
            end(point.upper_dph),
            point.n.map_or("-".to_owned(), |n| n.to_string()),
            point.edf.map_or("-".to_owned(), |edf| significant(edf, 3)),
        ]
    });
    let name = units.name();
    let [deviation, from, to] =
        [format!("Allan deviation, {name}"), format!("from, {name}"), format!("to (95 %), {name}")];
    let header = ["τ, s", &deviation, &from, &to, "differences", "degrees of freedom"];
    table(&format!("Curve of axis {}", axis.axis), header, rows)
}

fn allan_chart(axis: &AxisBudget, units: RateUnit) -> Chart {
    let shown: Vec<&CurvePoint> = axis.curve.iter().filter(|point| point.adev_dph > 0.0).collect();
    let taus: Vec<f64> = shown.iter().map(|point| point.tau_s).collect();
    let line = |label: &str, dashed, y: Vec<f64>| Curve { label: label.to_owned(), x: taus.clone(), y, dashed };
    let mut curves = vec![line("overlapping Allan deviation", false, shown.iter().map(|p| p.adev_dph).collect())];
    if let Some(fitted) = &axis.fitted {
        curves.push(line(
            "all five together, resolved or not",
            false,
            taus.iter().map(|tau| fitted.variance(*tau).sqrt()).collect(),
        ));
        let (lo, hi) =
            shown.iter().fold((f64::INFINITY, 0.0_f64), |(lo, hi), p| (lo.min(p.adev_dph), hi.max(p.adev_dph)));
        for term in AllanTerm::ALL {
            if let TermValue::Found { .. } = axis.terms.get(term) {
                let y = |tau: &f64| fitted.root(term) * term.variance(*tau).sqrt();
                // A slope is drawn over the range of the curve only.
                let points = taus.iter().filter(|tau| (lo / 3.0..hi * 3.0).contains(&y(tau)));
                let (x, y) = points.map(|tau| (*tau, y(tau))).unzip();
                curves.push(Curve { label: term.name().0.to_owned(), x, y, dashed: true });
            }
        }
    }
    let values: Vec<String> = AllanTerm::ALL
        .iter()
        .filter_map(|term| match axis.terms.get(*term) {
            TermValue::Found { value, .. } => {
                let (factor, unit) = units.shown(term.name().1);
                Some(format!("{} {} {unit}", term.name().0, significant(factor * value, 3)))
            }
            TermValue::Unresolved { .. } => None,
        })
        .collect();
    let values = if values.is_empty() { "none is resolved".to_owned() } else { values.join(", ") };
    Chart {
        id: format!("allan-{}", axis.axis),
        group: "tau".to_owned(),
        title: format!("Allan deviation, axis {}", axis.axis),
        caption: format!("Terms: {values}. Dashed: each term alone. The band holds 95 % at each τ."),
        x_label: "averaging time τ, s".to_owned(),
        y_label: "deviation, °/h".to_owned(),
        curves,
        bands: band(axis.curve.iter().map(|p| (p.tau_s, p.lower_dph, p.upper_dph))),
        decades: true,
        ..Chart::default()
    }
}

fn band(points: impl Iterator<Item = (f64, Option<f64>, Option<f64>)>) -> Vec<Band> {
    let mut band = Band { label: "95 % interval".to_owned(), ..Band::default() };
    for (tau_s, lower, upper) in points {
        if let (Some(lower), Some(upper)) = (lower.filter(|l| *l > 0.0), upper) {
            band.x.push(tau_s);
            band.lo.push(lower);
            band.hi.push(upper);
        }
    }
    if band.x.len() > 1 { vec![band] } else { Vec::new() }
}

fn hadamard_chart(axis: &AxisBudget) -> Option<Chart> {
    let shown: Vec<_> = axis.hadamard.iter().filter(|point| point.hdev_dph > 0.0).collect();
    let curve = Curve {
        label: "overlapping Hadamard deviation".to_owned(),
        x: shown.iter().map(|p| p.tau_s).collect(),
        y: shown.iter().map(|p| p.hdev_dph).collect(),
        dashed: false,
    };
    let allan: Vec<&CurvePoint> = axis.curve.iter().filter(|point| point.adev_dph > 0.0).collect();
    let allan_curve = Curve {
        label: "overlapping Allan deviation".to_owned(),
        x: allan.iter().map(|p| p.tau_s).collect(),
        y: allan.iter().map(|p| p.adev_dph).collect(),
        dashed: true,
    };
    (!shown.is_empty()).then(|| Chart {
        id: format!("hadamard-{}", axis.axis),
        group: "tau".to_owned(),
        title: format!("Hadamard deviation, axis {}", axis.axis),
        caption: "The Hadamard deviation does not see a steady ramp. Rate random walk alone brings it to 0.71 of the Allan deviation: only where it is well below that does a ramp make the difference.".to_owned(),
        x_label: "averaging time τ, s".to_owned(),
        y_label: "deviation, °/h".to_owned(),
        curves: vec![curve, allan_curve],
        bands: band(axis.hadamard.iter().map(|p| (p.tau_s, p.lower_dph, p.upper_dph))),
        decades: true,
        ..Chart::default()
    })
}
