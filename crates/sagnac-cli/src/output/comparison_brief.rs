//! A comparison in short: one verdict, the largest change of each axis, and the limits that are not met.

use sagnac::compare::{ComparedAxis, Comparison};
use sagnac::verify::{Judged, Verdict};
use sagnac_units::format::{significant, unit};

use crate::output::brief::{Brief, Remark};
use crate::output::terminal::Tone;

/// Lines of changes, and of limits.
const SHOWN: usize = 5;

/// With what was written.
pub(crate) fn comparison_brief(comparison: &Comparison, wrote: &[String]) -> Brief {
    let all = Judged::of(comparison.axes.iter().flat_map(|axis| &axis.limits));
    let asked = all.met + all.not_met + all.not_decided;
    let (word, tone, verdict) = if comparison.axes.iter().all(|axis| axis.pass.is_none()) {
        ("", Tone::Plain, format!("{} records compared, no limits given", comparison.records.len()))
    } else if comparison.passed() {
        (
            "ACCEPTED",
            Tone::Good,
            format!("{asked} limits met by the changes between {} records", comparison.records.len()),
        )
    } else if all.not_met == 0 && all.not_decided > 0 && comparison.shared_logs.is_empty() {
        ("NOT DECIDED", Tone::Open, format!("{} of {asked} limits; longer tests would", all.not_decided))
    } else {
        ("NOT ACCEPTED", Tone::Bad, why_not(comparison, all, asked))
    };
    let changes = comparison.axes.iter().flat_map(|axis| changes(axis, comparison));
    let limits = comparison.axes.iter().flat_map(|axis| {
        let bad = axis.limits.iter().filter(|limit| limit.pass == Some(false));
        bad.map(|limit| limit_line(axis.axis, limit))
    });
    let body: Vec<String> = changes.take(SHOWN).chain(limits.take(SHOWN)).collect();
    let wrote = (!wrote.is_empty()).then(|| format!("wrote {}      ", wrote.join(", "))).unwrap_or_default();
    Brief {
        of: comparison.serial.clone(),
        word,
        tone,
        verdict,
        body,
        remarks: remarks(comparison),
        last: vec![format!("{wrote}details: -v")],
    }
}

fn why_not(comparison: &Comparison, all: Judged, asked: usize) -> String {
    if !comparison.shared_logs.is_empty() {
        "records were made from the same log".to_owned()
    } else if !comparison.untested_axes.is_empty() {
        "an axis is not in every record".to_owned()
    } else if asked == 0 {
        "none of the limits is asked of a comparison".to_owned()
    } else {
        format!("{} of {asked} limits missed", all.not_met)
    }
}

/// The largest change of each curve, and the numbers that are apart.
fn changes(axis: &ComparedAxis, comparison: &Comparison) -> Vec<String> {
    let of_curves = axis.curves.iter().filter_map(|curve| {
        let largest = |record: &Vec<[f64; 2]>| record.iter().map(|[value, _]| value.abs()).fold(0.0, f64::max);
        let change = curve.differences.iter().map(largest).fold(0.0, f64::max);
        let disagrees = if curve.disagrees() { "changed" } else { "unchanged within the noise" };
        let place = curve.worst.as_ref().map(|worst| {
            let record = comparison.records.get(worst.record).map_or("", |(name, _)| name.as_str());
            format!("; {record} is {} σ from the mean at {:.0} °C", significant(worst.sigmas, 2), worst.temperature_c)
        });
        let name = format!("axis {}: {} {disagrees}", axis.axis, curve.quantity);
        let size = if change > 0.0 {
            format!(", by up to {} {}", significant(change, 2), unit(&curve.unit))
        } else {
            String::new()
        };
        Some(format!("{name}{size}{}", place.unwrap_or_default()))
    });
    let of_numbers = axis.numbers.iter().filter(|number| number.verdict().is_some());
    let of_numbers = of_numbers.filter_map(|number| Some(format!("axis {}: {}", axis.axis, number.verdict()?)));
    of_curves.chain(of_numbers).collect()
}

fn limit_line(axis: char, limit: &Verdict) -> String {
    let mark = if limit.undecided_hours.is_some() { "open" } else { "FAIL" };
    let remark = limit.remark().map_or(String::new(), |remark| format!(" ({remark})"));
    format!("{mark} axis {axis}: {} {}, limit {}{remark}", limit.name, limit.value_text(), significant(limit.limit, 3))
}

fn remarks(comparison: &Comparison) -> Vec<Remark> {
    let shared = (!comparison.shared_logs.is_empty()).then(|| {
        Remark::warning(format!(
            "these records share a log ({}): they agree too well",
            comparison.shared_logs.join(", ")
        ))
    });
    let missing: Vec<String> = comparison.untested_axes.iter().map(char::to_string).collect();
    let untested = (!missing.is_empty())
        .then(|| Remark::warning(format!("axis {} is not in every record and not compared", missing.join(", "))));
    let changes = comparison.changes.iter().map(|change| {
        let record = comparison.records.get(change.record).map_or("", |(name, _)| name.as_str());
        Remark::note(format!("{record}: {}", change.words()))
    });
    shared.into_iter().chain(untested).chain(changes).collect()
}
