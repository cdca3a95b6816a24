//! The keys of a scenario, as the simulator's own table has them.

use std::fmt::Write as _;

use anyhow::Result;
use sagnac_sim::manual;

use crate::made::Made;
use crate::places::SCENARIO_KEYS;

const HEAD: &str = "# Scenario

Made by `cargo xtask bless`; do not edit. Unknown keys and values outside
their range are refused before a run starts. Sources: [S] public sources; [M] general knowledge of the field, not verified; both as
marked in the project's domain notes. [D] is a choice of this simulator. A number without a default is required. The first of several
words is the default. `name`, `description` and `seed` come before the first table. `[[thermometer]]` and `[[fault]]` are lists.

A leg of `chamber.leg` is `{ soak_s }` (1 s to 10 years) or `{ to_c, rate_cpm }` (−100 … 150 °C at 0.001 … 50 °C/min, positive in both
directions). A leg of `input.table` is `{ rate_dps, for_s }` (−2000 … 2000 °/s for whole seconds; the rate changes at once).
";

pub(crate) fn make() -> Result<Vec<Made>> {
    let mut text = String::from(HEAD);
    for table in manual() {
        let list = if ["thermometer", "fault"].contains(&table.path) { "[[" } else { "[" };
        let end = if list == "[[" { "]]" } else { "]" };
        write!(text, "\n## {list}{}{end}\n\n{}\n\n", table.path, table.about.trim())?;
        text += "| key | | range | unit | default | source |\n|---|---|---|---|---|---|\n";
        for key in table.keys {
            let range = key.range.map_or_else(|| key.words.to_owned(), |(lo, hi)| format!("{lo} … {hi}"));
            let default = key.default.map_or_else(String::new, |value| value.to_string());
            let about = key.text.trim();
            writeln!(text, "| `{}` | {about} | {range} | {} | {default} | {} |", key.name, key.unit, key.source)?;
        }
    }
    Ok(vec![Made::new(SCENARIO_KEYS, text)])
}
