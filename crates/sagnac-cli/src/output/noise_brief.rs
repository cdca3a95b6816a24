//! The noise of a record in short: N, B, K of each axis, and the least Allan deviation.

use sagnac::allan::NoiseBudget;
use sagnac_log::setup::RateUnit;
use sagnac_noise::{AllanTerm, AxisBudget, TermValue};
use sagnac_units::format::{counted, file_name, significant};

use crate::output::brief::{Brief, Remark};
use crate::output::terminal::{Tone, lines_of};

/// Terms shown, and their column.
const SHOWN: [(AllanTerm, &str); 4] = [
    (AllanTerm::AngleRandomWalk, "N"),
    (AllanTerm::BiasInstability, "B"),
    (AllanTerm::RateRandomWalk, "K"),
    (AllanTerm::Quantization, "Q"),
];

/// With the notes on rows, axis by axis, and what was written.
pub(crate) fn noise_brief(budget: &NoiseBudget, notes: &[(char, String)], wrote: &[String], units: RateUnit) -> Brief {
    let is_found = |term| budget.axes.iter().any(|axis| matches!(axis.terms.get(term), TermValue::Found { .. }));
    let shown: Vec<_> =
        SHOWN.into_iter().filter(|(term, _)| *term != AllanTerm::Quantization || is_found(*term)).collect();
    let titles = shown.iter().map(|(term, letter)| format!("{letter}, {}", units.shown(term.name().1).1));
    let least = format!("least deviation, {}", units.name());
    let titles: Vec<String> = ["axis".to_owned()].into_iter().chain(titles).chain([least]).collect();
    let of_axes = budget.axes.iter().map(|axis| row(axis, &shown, units));
    let rows: Vec<Vec<String>> = [titles].into_iter().chain(of_axes).collect();
    let warnings = budget.warnings.iter().map(Remark::warning);
    let of_rows = notes.iter().map(|(axis, text)| Remark { axes: vec![*axis], ..Remark::note(text) });
    let unresolved = budget.axes.iter().flat_map(|axis| {
        let letters = SHOWN.iter().filter(|(term, _)| matches!(axis.terms.get(*term), TermValue::Unresolved { .. }));
        let names: Vec<&str> = letters.map(|(_, letter)| *letter).collect();
        let text = format!("{} not resolved by this record: -v says why", names.join(", "));
        (!names.is_empty()).then(|| Remark { axes: vec![axis.axis], ..Remark::note(text) })
    });
    let wrote = (!wrote.is_empty()).then(|| format!("wrote   {}", wrote.join(", ")));
    Brief {
        of: budget.inputs.first().map_or("noise".to_owned(), |input| file_name(&input.file)),
        word: "",
        tone: Tone::Plain,
        verdict: verdict(budget),
        body: lines_of(&rows),
        remarks: warnings.chain(of_rows).chain(unresolved).collect(),
        last: wrote.into_iter().chain(["details: -v, intervals and curve: --report noise.html".to_owned()]).collect(),
    }
}

fn verdict(budget: &NoiseBudget) -> String {
    let axes = counted(budget.axes.len(), "axis", "axes");
    let Some(first) = budget.axes.first().filter(|axis| axis.rows > 0) else {
        return format!("noise of {axes}, from a bare curve");
    };
    if let Some(span) = &budget.at_rest {
        return format!("noise of {axes}, the longest rest alone: {span}");
    }
    let hours = first.rows as f64 * first.sample_interval_s / 3600.0;
    let logs = if budget.inputs.len() > 1 { format!(", {} logs", budget.inputs.len()) } else { String::new() };
    format!(
        "noise of {axes}, {} h of rows of {} s{logs}",
        significant(hours, 3),
        significant(first.sample_interval_s, 4)
    )
}

fn row(axis: &AxisBudget, shown: &[(AllanTerm, &str)], units: RateUnit) -> Vec<String> {
    let number = |term: AllanTerm, value: f64| significant(units.shown(term.name().1).0 * value, 3);
    let term = |term: AllanTerm| match axis.terms.get(term) {
        TermValue::Found { value, lower: Some(lower), upper: Some(upper) } => {
            format!("{} ({} … {})", number(term, *value), number(term, *lower), number(term, *upper))
        }
        TermValue::Found { value, .. } => number(term, *value),
        TermValue::Unresolved { .. } => "-".to_owned(),
    };
    let least = axis.curve.iter().min_by(|a, b| a.adev_dph.total_cmp(&b.adev_dph));
    let least = least.map_or("-".to_owned(), |point| {
        format!("{} at {} s", units.number(point.adev_dph, 3), significant(point.tau_s, 3))
    });
    let terms = shown.iter().map(|(wanted, _)| term(*wanted));
    [axis.axis.to_string()].into_iter().chain(terms).chain([least]).collect()
}
