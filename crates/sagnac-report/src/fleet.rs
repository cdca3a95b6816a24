//! The page of a fleet: yield, rigs, outliers, what drifts, which limit is tight.

use std::collections::BTreeMap;

use sagnac::fleet::{
    Acceptance, AxisResult, Capability, ControlChart, Odd, Quality, Quantity, RigEffect, Rule, UnitOutcome, UnitResult,
    Yield,
};
use sagnac::verify::SPECS;
use sagnac_log::error::Result;
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{counted, significant, unit, with_sigma};

use crate::charts::{Band, Chart, ChartEntry, ChartPage, Curve, PageTable, chart_report};
use crate::report::Report;

/// Values of a chart that are all drawn; of more, the lowest and highest of each stretch.
const MOST_DOTS: usize = 1200;
/// Values further from the centre are drawn at this many σ.
const MOST_SIGMAS: f64 = 6.0;
/// Rows of the table of outliers; more are counted.
const MOST_ODD: usize = 100;
/// Units with an entry of their own: those that a reader asks for first.
const MOST_ENTRIES: usize = 150;
/// A capability below this is no capability.
const CAPABLE: f64 = 1.33;

/// The state of a fleet as a report. `results` are those that it was made of, `order` says in what order its units are. The rates of `quality` are in
/// `units` already.
///
/// # Errors
/// Figures that cannot be written as JSON.
pub fn fleet_report(quality: &Quality, results: &[UnitResult], order: &str, units: RateUnit) -> Result<Report> {
    let named = Named::new(quality, results);
    let all = quality.yields.first().cloned().unwrap_or_default();
    let mut page = ChartPage {
        title: format!("Fleet of {}", counted(all.units, "unit", "units")),
        subtitle: format!("In the order of {order}."),
        verdicts: verdicts(quality, &all),
        notes: vec![
            "A chart's centre and σ are median and MAD of all its values. Independent normal values make some signals by chance. More signals \
             than expected mean that something changed."
                .to_owned(),
        ],
        results: vec![
            yields(quality),
            named.not_good(),
            odd(quality, &named),
            rigs(quality),
            capability(quality),
            refusals(quality),
        ],
        charts: quality.charts.iter().enumerate().filter_map(|(at, quantity)| chart(at, quantity)).collect(),
        tables: vec![signals(quality)],
        entries: named.entries(units),
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
        out.push((all.met == all.judged, format!("{} of {} retested units met every limit", all.met, all.judged)));
    }
    if quality.rigs.is_empty() && quality.compared > 0 {
        out.push((
            true,
            format!("No rig differs from the others ({})", counted(quality.compared, "comparison", "comparisons")),
        ));
    }
    out.extend(quality.rigs.iter().map(|effect| (false, rig_words(effect))));
    out
}

fn rig_words(effect: &RigEffect) -> String {
    let RigEffect { rig, quantity, difference, sigma, .. } = effect;
    format!(
        "Rig {rig}: {quantity} differs by {} {} from other rigs on the same lots",
        with_sigma(*difference, Some(*sigma)),
        unit(&effect.unit)
    )
}

fn table<const N: usize>(heading: &str, columns: [&str; N], rows: impl Iterator<Item = [String; N]>) -> PageTable {
    let rows = rows.map(Vec::from).collect();
    PageTable { heading: heading.to_owned(), columns: columns.map(str::to_owned).into(), rows, ..PageTable::default() }
}

fn part(some: usize, all: usize) -> String {
    if all == 0 { "-".to_owned() } else { format!("{} %", significant(100.0 * some as f64 / all as f64, 3)) }
}

fn yields(quality: &Quality) -> PageTable {
    let rows = quality.yields.iter().map(|lot_yield| {
        let Yield { lot, units, calibrated, judged, met, .. } = lot_yield;
        let lot = if lot.is_empty() { "all".to_owned() } else { lot.clone() };
        let [n, c, j, m] = [units, calibrated, judged, met].map(|count| (*count).to_string());
        [lot, n, c, part(*calibrated, *units), j, m, part(*met, *judged)]
    });
    table("Yield", ["lot", "units", "calibrated", "of units", "retested", "limits met", "of retested"], rows)
}

fn odd(quality: &Quality, named: &Named<'_>) -> PageTable {
    let shown = || quality.odd.iter().take(MOST_ODD);
    let rows = shown().map(|odd| [odd.of.clone(), odd.quantity.clone(), significant(odd.sigmas, 2)]);
    let more = quality.odd.len().saturating_sub(MOST_ODD);
    let heading = if more > 0 { format!("Outliers ({more} more)") } else { "Outliers".to_owned() };
    let entries = shown().map(|odd| named.id_of(unit_of(odd))).collect();
    PageTable { entries, ..table(&heading, ["unit and axis", "furthest in", "from the median, σ"], rows) }
}

/// A limit in words.
fn label_of(key: &str) -> &str {
    SPECS.iter().find(|spec| spec.key == key).map_or(key, |spec| spec.label)
}

/// An odd axis is named by its unit and its letter.
fn unit_of(odd: &Odd) -> &str {
    odd.of.rsplit_once(' ').map_or(odd.of.as_str(), |(unit, _)| unit)
}

/// Units that a reader will ask for: without a record, not accepted, or odd; each with why.
struct Named<'a> {
    units: Vec<(&'a UnitResult, Vec<String>)>,
    places: BTreeMap<&'a str, usize>,
}

impl<'a> Named<'a> {
    fn new(quality: &Quality, results: &'a [UnitResult]) -> Self {
        let mut odd: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for one in &quality.odd {
            let axis = one.of.rsplit(' ').next().unwrap_or_default();
            let words = format!("axis {axis}: {} {} σ from the median", one.quantity, significant(one.sigmas, 2));
            odd.entry(unit_of(one)).or_default().push(words);
        }
        let mut units = Vec::new();
        for of in results {
            let refused = of.refusal.iter().map(|why| format!("{}: {}", of.outcome.name(), why.reason));
            let not_judged = of.retest_refusal.iter().map(|why| format!("retest not judged: {}", why.reason));
            let limits = of.axes.iter().filter(|_| of.acceptance.is_bad()).flat_map(|axis| {
                let how = if of.acceptance == Acceptance::NotDecided { "not decided" } else { "not met" };
                axis.limits_not_met()
                    .into_iter()
                    .map(move |limit| format!("axis {}: {} {how}", axis.axis, label_of(limit)))
            });
            let mut why: Vec<String> = refused.chain(not_judged).chain(limits).collect();
            why.extend(odd.remove(of.unit.as_str()).into_iter().flatten());
            if !why.is_empty() && units.len() < MOST_ENTRIES {
                units.push((of, why));
            }
        }
        let places = units.iter().enumerate().map(|(at, (of, _))| (of.unit.as_str(), at)).collect();
        Self { units, places }
    }

    fn id_of(&self, unit: &str) -> Option<String> {
        self.places.contains_key(unit).then(|| format!("unit-{unit}"))
    }

    /// Those without a record or not accepted.
    fn not_good(&self) -> PageTable {
        let is_good = |of: &UnitResult| of.outcome == UnitOutcome::Calibrated && !of.acceptance.is_bad();
        let shown = || self.units.iter().filter(|(of, _)| !is_good(of));
        let rows = shown().map(|(of, why)| [of.unit.clone(), of.lot.clone(), of.rig.clone(), why.join("; ")]);
        let entries = shown().map(|(of, _)| self.id_of(&of.unit)).collect();
        PageTable { entries, ..table("Units to look at", ["unit", "lot", "rig", "why"], rows) }
    }

    fn entries(&self, units: RateUnit) -> Vec<ChartEntry> {
        let entry = |(of, why): &(&UnitResult, Vec<String>)| {
            let mut words = why.clone();
            let known = |name: &str, value: &str| (!value.is_empty()).then(|| format!("{name} {value}"));
            let place: Vec<String> = known("lot", &of.lot).into_iter().chain(known("rig", &of.rig)).collect();
            words.push([&[of.outcome.name().to_owned()][..], &place].concat().join(", "));
            let help = of.refusal.iter().chain(&of.retest_refusal).map(|why| why.help.clone());
            words.extend(help);
            if of.record_sha256.is_some() {
                words.push(format!("record: records/{}.cal.json", of.unit));
            }
            if of.acceptance != Acceptance::NoRetest {
                words.push(format!("limits {}, proof: proofs/{}.json", of.acceptance.name(), of.unit));
            }
            let tables = of
                .axes
                .iter()
                .flat_map(|axis| axis_tables(axis, units))
                .filter(|table| !table.rows.is_empty())
                .collect();
            ChartEntry { id: format!("unit-{}", of.unit), heading: of.unit.clone(), words, tables }
        };
        self.units.iter().map(entry).collect()
    }
}

/// Coefficients and noise of an axis, and the limits of its retest.
fn axis_tables(of: &AxisResult, units: RateUnit) -> [PageTable; 2] {
    let known = |name: &str, value: Option<f64>, unit: &str| {
        let (factor, unit) = units.shown(unit);
        value.map(|value| [name.to_owned(), significant(factor * value, 4), unit])
    };
    let basis = of.common.iter().flat_map(|basis| {
        basis.terms.iter().zip(&basis.coefficients).zip(&basis.units).enumerate().map(
            |(at, ((term, value), of_unit))| {
                let variance = basis.covariance.get(at * (at + 3) / 2).copied();
                let (factor, unit) = units.shown(of_unit);
                [term.clone(), with_sigma(factor * value, variance.map(|variance| factor * variance.sqrt())), unit]
            },
        )
    });
    let noise = [
        known("σ of the residual", of.residual_dph, "°/h"),
        known("noise floor", of.noise_floor_dph, "°/h"),
        known("angle random walk", of.n_deg_rt_h, "°/√h"),
        known("bias instability", of.bias_instability_dph, "°/h"),
        known("retest, σ before", of.retest_before_dph, "°/h"),
        known("retest, σ after", of.retest_after_dph, "°/h"),
    ];
    let heading = format!(
        "Axis {}: {}, {} … {} °C",
        of.axis,
        of.model,
        significant(of.span_c[0], 3),
        significant(of.span_c[1], 3)
    );
    let figures = table(&heading, ["", "value", "unit"], basis.chain(noise.into_iter().flatten()));
    let limits = of.limits.iter().map(|limit| {
        let spec = SPECS.iter().find(|spec| spec.key == limit.name);
        let (factor, unit) = units.shown(spec.map_or("", |spec| spec.unit));
        let value = limit.value.map_or("not known".to_owned(), |value| significant(factor * value, 3));
        let met = match limit.met {
            Some(true) => "met",
            Some(false) => "not met",
            None => "not asked",
        };
        [label_of(&limit.name).to_owned(), value, significant(factor * limit.bound, 3), unit, met.to_owned()]
    });
    [figures, table(&format!("Axis {}: limits", of.axis), ["limit", "value", "bound", "unit", ""], limits)]
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
        let Capability { limit, unit: of_unit, bound, asked, n, not_met, mean, sigma, cpk, .. } = of;
        let cpk = cpk.map_or("-".to_owned(), |[value, sigma]| {
            let tight = if value + 1.96 * sigma < CAPABLE { ", tight" } else { "" };
            with_sigma(value, Some(sigma)) + tight
        });
        let known = |value: f64| if value.is_finite() { significant(value, 3) } else { "-".to_owned() };
        let not_met = format!("{not_met} of {asked}");
        [
            label_of(limit).to_owned(),
            known(*bound),
            unit(of_unit),
            not_met,
            n.to_string(),
            known(*mean),
            known(*sigma),
            cpk,
        ]
    });
    table("Capability", ["limit", "bound", "unit", "missed or undecided", "values", "mean", "σ", "Cpk"], rows)
}

fn refusals(quality: &Quality) -> PageTable {
    let rows = quality.refusals.iter().map(|(reason, units)| [units.to_string(), reason.clone()]);
    table("Refusals and failures (# is a number)", ["units", "reason"], rows)
}

fn signals(quality: &Quality) -> PageTable {
    let rows = quality.charts.iter().flat_map(|quantity| {
        Rule::ALL.into_iter().filter_map(move |rule| {
            let (count, by_chance) = quantity.chart.count(rule);
            let chance = by_chance.map_or("-".to_owned(), |expected| significant(expected, 2));
            let last = quantity.chart.signals.iter().rev().find(|(_, broken)| *broken == rule);
            let last = last.map_or(String::new(), |(at, _)| quantity.of[*at].clone());
            (count > 0).then(|| [quantity.name.clone(), rule.name().to_owned(), count.to_string(), chance, last])
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
    let over = |value: &dyn Fn(usize) -> f64| each.iter().map(|at| value(*at)).collect::<Vec<f64>>();
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
