//! Lists that several verbs show: limits with their values, and the excluded rows.

use sagnac::verify::Verdict;
use sagnac_log::ingest::Tally;
use sagnac_units::format::significant;

use crate::output::terminal::table;

/// Every limit with its value, next to the value over every row where some were excluded.
pub(crate) fn limits_table(limits: &[Verdict], excluding: bool) -> String {
    let rows = limits.iter().map(|l| {
        let word = if l.word() == "not met" { "NOT MET" } else { l.word() };
        let word = l.remark().map_or(word.to_owned(), |remark| format!("{word}: {remark}"));
        let every = l.value_of_every_row.map_or("-".to_owned(), |value| significant(value, 4));
        let every = if excluding { vec![every] } else { Vec::new() };
        [vec![l.name.clone(), l.value_text()], every, vec![significant(l.limit, 4), l.margin_text(), word]].concat()
    });
    let head = if excluding {
        vec!["limit", "value", "of every row", "bound", "margin", ""]
    } else {
        vec!["limit", "value", "bound", "margin", ""]
    };
    table(&head, rows)
}

/// What was excluded, one line per reason.
pub(crate) fn excluded(tallies: &[Tally]) -> Vec<String> {
    tallies.iter().map(|tally| format!("excluded: {}", rows_of(tally))).collect()
}

/// The same of a replay, which reads a thermometer as the gyro's processor does.
pub(crate) fn not_replayed(tallies: &[Tally]) -> Vec<String> {
    let line = |tally: &Tally| match tally.reason.is_replayed() {
        true => format!("note: {}: corrected as the gyro does it; a calibration leaves them out", rows_of(tally)),
        false => format!("excluded: {}", rows_of(tally)),
    };
    tallies.iter().map(line).collect()
}

fn rows_of(tally: &Tally) -> String {
    let rows = if tally.rows == 1 { "1 row".to_owned() } else { format!("{} rows", tally.rows) };
    format!("{rows}, {} (first at {})", tally.reason.name(), tally.first)
}
