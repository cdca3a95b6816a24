//! `cargo xtask studies`: the programs `studies` of the crates, and the rows of the evidence that they write.
//!
//! ```text
//! cargo test --test studies -- measured::fit:: ─▶ target/evidence/fit.rows ─▶ docs/explanation/evidence/sagnac.csv
//! ```
//!
//! The rows of the tests that ran replace those of the same tests; others stay.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::{root, sh_in, target, text};
use xtask::skip::demands_everything;

/// A set of studies: its name, the modules of its tests, the table of its rows.
const SETS: [(&str, &str, &str); 4] = [
    ("fit", "measured::fit::", "sagnac"),
    ("verify", "measured::verify::", "sagnac"),
    ("noise", "measured::noise::", "sagnac-noise"),
    ("hours", "hours::", "sagnac"),
];

const HEAD: &str = "test,records,measured,bound,claim\n";

/// Runs one set.
pub(crate) fn studies(args: &[&str]) -> Result<()> {
    let names = || SETS.map(|(name, ..)| name).join(", ");
    let [wanted] = args else { bail!("which studies? {}", names()) };
    let Some((name, modules, table)) = SETS.into_iter().find(|(name, ..)| name == wanted) else {
        bail!("no studies of {wanted}; there are: {}", names())
    };
    let folder = target().join("evidence");
    fs::create_dir_all(&folder)?;
    let rows = folder.join(name).with_extension("rows");
    fs::write(&rows, "")?;
    let args = ["test", "--locked", "--test", "studies", "--no-fail-fast", "--", modules];
    // Those that take hours are ignored by any other run.
    let ignored: &[&str] = if name == "hours" { &["--ignored"] } else { &[] };
    let run = sh_in(&root(), "cargo", &[&args, ignored].concat(), &[("SAGNAC_EVIDENCE", text(&rows)?)]);
    let measured = fs::read_to_string(&rows).context("no row of evidence")?;
    ensure!(run.is_err() || !measured.is_empty(), "no test of {modules} has measured");
    let path = path(table);
    let committed = fs::read_to_string(&path).unwrap_or_else(|_| HEAD.to_owned());
    let merged = merged(&committed, &measured);
    fs::create_dir_all(path.parent().context("a table without a folder")?)?;
    fs::write(&path, &merged).with_context(|| format!("cannot write {}", path.display()))?;
    run?;
    let is_same = claims(&committed) == claims(&merged);
    ensure!(is_same || !demands_everything(), "{}: other claims than those committed; commit it", path.display());
    println!("studies of {name}: {} rows in {}", measured.lines().count(), path.display());
    Ok(())
}

fn path(table: &str) -> PathBuf {
    root().join("docs/explanation/evidence").join(table).with_extension("csv")
}

/// The test of a row.
fn test(row: &str) -> &str {
    row.split(',').next().unwrap_or_default()
}

/// The committed table with the rows of the tests that were run, sorted by test and, within one, in the order of its claims.
fn merged(committed: &str, measured: &str) -> String {
    let has_run = |row: &str| measured.lines().any(|new| test(new) == test(row));
    let kept = committed.lines().skip(1).filter(|row| !has_run(row));
    let mut rows: Vec<&str> = kept.chain(measured.lines()).collect();
    rows.sort_by_key(|row| test(row));
    HEAD.to_owned() + &rows.iter().map(|row| format!("{row}\n")).collect::<String>()
}

/// The rows without the measured figures, whose last digit may be another on another machine.
fn claims(table: &str) -> Vec<[&str; 4]> {
    let cells = |row| {
        let mut cells = str::splitn(row, 5, ',');
        let [test, records, _, bound, claim] = std::array::from_fn(|_| cells.next().unwrap_or_default());
        [test, records, bound, claim]
    };
    table.lines().map(cells).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_tests_that_ran_replace_their_own() {
        let committed = format!("{HEAD}a::x,60,0.9,≥ 0.88,\"one, two\"\nb::y,20,1,≥ 1,\"three\"\n");
        let after = merged(&committed, "c::z,20,0,≤ 0,\"four\"\na::x,60,0.93,≥ 0.88,\"one, two\"\n");
        let wanted = "a::x,60,0.93,≥ 0.88,\"one, two\"\nb::y,20,1,≥ 1,\"three\"\nc::z,20,0,≤ 0,\"four\"\n";
        assert_eq!(after, format!("{HEAD}{wanted}"));
        let again = merged(&after, "a::x,60,0.95,≥ 0.88,\"one, two\"\n");
        assert_eq!(claims(&again), claims(&after));
        assert_ne!(claims(&again), claims(&committed));
        assert_eq!(claims(&again)[1], ["a::x", "60", "≥ 0.88", "\"one, two\""]);
    }
}
