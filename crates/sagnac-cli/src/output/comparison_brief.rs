//! A comparison in short: one verdict, the largest change of each axis, and the limits that are not met.

use sagnac::compare::{ComparedAxis, Comparison};
use sagnac::verify::{Judged, Verdict};
use sagnac_units::format::{counted, file_name, significant, unit};

use crate::output::brief::{Brief, Remark};
use crate::output::terminal::Tone;

/// Lines of changes, and of limits.
const SHOWN: usize = 4;

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
            format!(
                "{} met by the changes between {} records",
                counted(asked, "limit", "limits"),
                comparison.records.len()
            ),
        )
    } else if all.not_met == 0 && all.not_decided > 0 && comparison.shared_logs.is_empty() {
        ("NOT DECIDED", Tone::Open, format!("{} of {asked} limits; longer tests would", all.not_decided))
    } else {
        ("NOT ACCEPTED", Tone::Bad, why_not(comparison, all, asked))
    };
    let changes = comparison.axes.iter().flat_map(changes);
    let limits = comparison.axes.iter().flat_map(|axis| {
        let bad = axis.limits.iter().filter(|limit| limit.pass == Some(false));
        bad.map(|limit| limit_line(axis.axis, limit))
    });
    let limits: Vec<String> = limits.collect();
    let more = (limits.len() > SHOWN).then(|| format!("     {} more limits: -v", limits.len() - SHOWN));
    let body: Vec<String> = changes.take(SHOWN).chain(limits.into_iter().take(SHOWN)).chain(more).collect();
    let wrote = if wrote.is_empty() { String::new() } else { format!("wrote {}      ", wrote.join(", ")) };
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
fn changes(axis: &ComparedAxis) -> Vec<String> {
    let of_curves = axis.curves.iter().map(|curve| {
        let largest = |record: &Vec<[f64; 2]>| record.iter().map(|[value, _]| value.abs()).fold(0.0, f64::max);
        let change = curve.differences.iter().map(largest).fold(0.0, f64::max);
        let disagrees = if curve.disagrees() { "changed" } else { "unchanged within noise" };
        let place = curve
            .worst
            .as_ref()
            .map(|worst| format!(", {} σ at {:.0} °C", significant(worst.sigmas, 2), worst.temperature_c));
        let name = format!("axis {}: {} {disagrees}", axis.axis, curve.quantity);
        let size = if change > 0.0 {
            format!(", by up to {} {}", significant(change, 2), unit(&curve.unit))
        } else {
            String::new()
        };
        format!("{name}{size}{}", place.unwrap_or_default())
    });
    let of_numbers = axis.numbers.iter().filter(|number| number.verdict().is_some());
    let of_numbers = of_numbers.filter_map(|number| Some(format!("axis {}: {}", axis.axis, number.verdict()?)));
    of_curves.chain(of_numbers).collect()
}

fn limit_line(axis: char, limit: &Verdict) -> String {
    let mark = if limit.is_open() { "open" } else { "FAIL" };
    format!("{mark} axis {axis}: {} {}, limit {}", limit.name, limit.value_text(), significant(limit.limit, 3))
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
        let record = comparison.records.get(change.record).map_or(String::new(), |(name, _)| file_name(name));
        Remark::note(format!("{record}: {}", change.words()))
    });
    shared.into_iter().chain(untested).chain(changes).collect()
}
