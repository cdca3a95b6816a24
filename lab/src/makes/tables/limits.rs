//! The tables of `docs/reference/limits.md`: every limit of a retest, and those of them that a comparison asks.

use std::fmt::Write as _;
use std::fs;

use anyhow::Result;
use sagnac::compare::COMPARED;
use sagnac::verify::SPECS;
use xtask::shell::root;

use crate::made::{Made, between_marks, marks};
use crate::places::LIMITS;

pub(crate) fn make() -> Result<Vec<Made>> {
    let mut of_retest = String::from("| key | value | bound | unit | retests | exactly |\n|---|---|---|---|---|---|\n");
    for spec in SPECS {
        let unit = if spec.unit.is_empty() { "-" } else { spec.unit };
        let [bound, retests, exactly] = [spec.bound.words(), spec.applies.words(), spec.exactly.trim()];
        writeln!(of_retest, "| `{}` | {} | {bound} | {unit} | {retests} | {exactly} |", spec.key, spec.label)?;
    }
    let mut of_records = String::from("| key | value of a comparison | from |\n|---|---|---|\n");
    for asked in &COMPARED {
        writeln!(of_records, "| `{}` | {} | {} |", asked.key, asked.label, asked.from)?;
    }
    let page = fs::read_to_string(root().join(LIMITS))?;
    let page = between_marks(&page, &marks("limits", "limits"), &of_retest)?;
    Ok(vec![Made::new(LIMITS, between_marks(&page, &marks("compared", "limits"), &of_records)?)])
}
