//! The page of a fleet: yield, rigs, odd units, what drifts, which limit is tight.

use sagnac::fleet::{Capability, ControlChart, Quality, Quantity, RigEffect, Rule, Yield};
use sagnac_log::error::Result;
use sagnac_units::format::{counted, significant, unit, with_sigma};

use crate::charts::{Band, Chart, ChartPage, Curve, PageTable, chart_report};
use crate::report::Report;

/// Values of a chart that are all drawn; of more, the lowest and highest of each stretch.
const MOST_DOTS: usize = 1200;
/// Values further from the centre are drawn at this many σ.
const MOST_SIGMAS: f64 = 6.0;
/// Rows of the table of odd units; more are counted.
const MOST_ODD: usize = 100;
/// A capability below this is no capability.
const CAPABLE: f64 = 1.33;

/// The state of a fleet as a report. `order` says in what order its units are.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn fleet_report(quality: &Quality, order: &str) -> Result<Report> {
    let all = quality.yields.first().cloned().unwrap_or_default();
    let mut page = ChartPage {
        title: format!("Fleet of {}", counted(all.units, "unit", "units")),
        subtitle: format!("In the order of {order}."),
        verdicts: verdicts(quality, &all),
        notes: vec![
            "A chart's centre and σ are median and MAD of all its values. Signals by chance are those that independent normal values would make \
             as well; more of them say that something changed, not what."
                .to_owned(),
        ],
        results: vec![yields(quality), odd(quality), rigs(quality), capability(quality), refusals(quality)],
        charts: quality.charts.iter().enumerate().filter_map(|(at, quantity)| chart(at, quantity)).collect(),
        tables: vec![signals(quality)],
        ..ChartPage::default()
    };
    page.results.retain(|table| !table.rows.is_empty());
    page.tables.retain(|table| !table.rows.is_empty());
    chart_report(&page)
}

fn verdicts(quality: &Quality, all: &Yield) -> Vec<(bool, String)> {
    let mut out =
        vec![(all.calibrated == all.units, format!("{} of {} units have a calibration", all.calibrated, all.units))];
    if all.judged > 0 {
        out.push((all.met == all.judged, format!("{} of {} retested units met their limits", all.met, all.judged)));
    }
    if quality.rigs.is_empty() && quality.compared > 0 {
        out.push((
            true,
            format!("no rig differs from the others ({})", counted(quality.compared, "comparison", "comparisons")),
        ));
    }
    out.extend(quality.rigs.iter().map(|effect| (false, rig_words(effect))));
    out
}

fn rig_words(effect: &RigEffect) -> String {
    let RigEffect { rig, quantity, difference, sigma, .. } = effect;
    format!(
        "rig {rig}: {quantity} differs by {} {} from other rigs on the same lots",
        with_sigma(*difference, Some(*sigma)),
        unit(&effect.unit)
    )
}

fn table<const N: usize>(heading: &str, columns: [&str; N], rows: impl Iterator<Item = [String; N]>) -> PageTable {
    let rows = rows.map(Vec::from).collect();
    PageTable { heading: heading.to_owned(), columns: columns.map(str::to_owned).into(), rows }
}

fn part(some: usize, of: usize) -> String {
    if of == 0 { "-".to_owned() } else { format!("{} %", significant(100.0 * some as f64 / of as f64, 3)) }
}

fn yields(quality: &Quality) -> PageTable {
    let rows = quality.yields.iter().map(|of| {
        let Yield { lot, units, calibrated, judged, met, .. } = of;
        let lot = if lot.is_empty() { "all".to_owned() } else { lot.clone() };
        let [n, c, j, m] = [units, calibrated, judged, met].map(|count| (*count).to_string());
        [lot, n, c, part(*calibrated, *units), j, m, part(*met, *judged)]
    });
    table("Yield", ["lot", "units", "calibrated", "of units", "retested", "limits met", "of retested"], rows)
}

fn odd(quality: &Quality) -> PageTable {
    let rows =
        quality.odd.iter().take(MOST_ODD).map(|odd| [odd.of.clone(), odd.quantity.clone(), significant(odd.sigmas, 2)]);
    let more = quality.odd.len().saturating_sub(MOST_ODD);
    let heading = if more > 0 { format!("Odd units ({more} more)") } else { "Odd units".to_owned() };
    table(&heading, ["unit and axis", "furthest in", "from the median, σ"], rows)
}

fn rigs(quality: &Quality) -> PageTable {
    let rows = quality.rigs.iter().map(|effect| {
        let RigEffect { rig, quantity, unit: of, difference, sigma, axes, .. } = effect;
        [rig.clone(), quantity.clone(), with_sigma(*difference, Some(*sigma)), unit(of), axes.to_string()]
    });
    table("Rigs that differ", ["rig", "in", "rig less others", "unit", "axes"], rows)
}

fn capability(quality: &Quality) -> PageTable {
    let rows = quality.capability.iter().map(|of| {
        let Capability { limit, bound, asked, n, not_met, mean, sigma, cpk, .. } = of;
        let cpk = cpk.map_or("-".to_owned(), |[value, sigma]| {
            let tight = if value + 1.96 * sigma < CAPABLE { ", tight" } else { "" };
            with_sigma(value, Some(sigma)) + tight
        });
        let known = |value: f64| if value.is_finite() { significant(value, 3) } else { "-".to_owned() };
        let not_met = format!("{not_met} of {asked}");
        [limit.clone(), known(*bound), not_met, n.to_string(), known(*mean), known(*sigma), cpk]
    });
    table("Capability", ["limit", "bound", "not met", "values", "mean", "σ", "Cpk"], rows)
}

fn refusals(quality: &Quality) -> PageTable {
    let rows = quality.refusals.iter().map(|(reason, units)| [units.to_string(), reason.clone()]);
    table("Refusals and failures (# is a number)", ["units", "reason"], rows)
}

fn signals(quality: &Quality) -> PageTable {
    let rows = quality.charts.iter().flat_map(|quantity| {
        Rule::ALL.into_iter().filter_map(move |rule| {
            let (found, by_chance) = quantity.chart.count(rule);
            let chance = by_chance.map_or("-".to_owned(), |expected| significant(expected, 2));
            let last = quantity.chart.signals.iter().rev().find(|(_, broken)| *broken == rule);
            let last = last.map_or(String::new(), |(at, _)| quantity.of[*at].clone());
            (found > 0).then(|| [quantity.name.clone(), rule.name().to_owned(), found.to_string(), chance, last])
        })
    });
    table("Signals of the control charts", ["quantity", "rule", "points", "by chance", "last at"], rows)
}

/// Values, their moving average and its limits.
fn chart(at: usize, quantity: &Quantity) -> Option<Chart> {
    let Quantity { name, chart, .. } = quantity;
    let ControlChart { centre, sigma, values, ewma, ewma_half, .. } = chart;
    let edge = MOST_SIGMAS * sigma;
    let drawn = |value: f64| value.clamp(centre - edge, centre + edge);
    let number = |at: usize| (at + 1) as f64;
    let shown = thinned(values);
    let dots = |label: &str, at: &[usize]| Curve {
        label: label.to_owned(),
        x: at.iter().map(|at| number(*at)).collect(),
        y: at.iter().map(|at| drawn(values[*at])).collect(),
        dashed: false,
    };
    let mut beyond: Vec<usize> = chart.signals.iter().map(|(at, _)| *at).collect();
    beyond.dedup();
    // Where every second point is a signal, the signals are what is drawn.
    beyond.retain(|at| shown.binary_search(at).is_ok());
    let step = values.len().div_ceil(MOST_DOTS).max(1);
    let each: Vec<usize> = (0..values.len()).step_by(step).collect();
    let over = |of: &dyn Fn(usize) -> f64| each.iter().map(|at| of(*at)).collect::<Vec<f64>>();
    let line = |label: &str, y: Vec<f64>, dashed| Curve { label: label.to_owned(), x: over(&number), y, dashed };
    let of_unit = unit(&quantity.unit);
    (!shown.is_empty()).then(|| Chart {
        id: format!("chart-{at}"),
        group: "units".to_owned(),
        title: name.clone(),
        caption: format!(
            "Centre {}, σ {}. Rings broke a rule. Values further than {MOST_SIGMAS} σ are drawn there.",
            significant(*centre, 4),
            significant(*sigma, 3)
        ),
        x_label: "axes, in order".to_owned(),
        y_label: if of_unit.is_empty() { name.clone() } else { format!("{name}, {of_unit}") },
        dots: vec![dots("value", &shown), dots("signal", &beyond)],
        curves: vec![
            line("moving average", over(&|at| drawn(ewma[at])), false),
            line("median", over(&|_| *centre), true),
        ],
        bands: vec![Band {
            label: "limits of the moving average".to_owned(),
            x: over(&number),
            lo: over(&|at| centre - ewma_half[at]),
            hi: over(&|at| centre + ewma_half[at]),
        }],
        ..Chart::default()
    })
}

/// Indices of all values, or of the lowest and highest of each stretch.
fn thinned(values: &[f64]) -> Vec<usize> {
    let stretch = (2 * values.len()).div_ceil(MOST_DOTS);
    if stretch <= 2 {
        return (0..values.len()).collect();
    }
    let ends = |from: usize| {
        let to = values.len().min(from + stretch);
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let [low, high] = [(from..to).min_by(by_value), (from..to).max_by(by_value)];
        let mut both: Vec<usize> = low.into_iter().chain(high).collect();
        both.sort_unstable();
        both.dedup();
        both
    };
    (0..values.len()).step_by(stretch).flat_map(ends).collect()
}
