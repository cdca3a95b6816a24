//! docs/reference/errors.md, made of the snapshot that holds every message of the broken inputs.

use std::fs;

use anyhow::{Context, Result};
use xtask::shell::root;

const HEAD: &str = "# What the program says of broken inputs

Made by `cargo xtask errors` from `crates/sagnac-cli/tests/snapshots/bad_input.snap`, which a test holds against the program: each
of these was made, run and looked at. Every message names what was wrong, where (file, line, column, value) and, where there is
something, what to do. Status 2: bad usage or input. Status 3: refused, because the data cannot support the answer. Whatever
happens, files that were there before stay as they are.
";

/// Writes it.
pub(crate) fn write() -> Result<()> {
    let path = root().join("docs/reference/errors.md");
    fs::write(&path, text()?).with_context(|| format!("cannot write {}", path.display()))?;
    println!("wrote {}", path.display());
    Ok(())
}

/// One table, in the order of the corpus.
fn text() -> Result<String> {
    let path = root().join("crates/sagnac-cli/tests/snapshots/bad_input.snap");
    let snapshot = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let body = snapshot.splitn(3, "---\n").nth(2).context("a snapshot without its head")?;
    let mut out = format!("{HEAD}\n| input | status | message |\n|---|---|---|\n");
    for case in body.split("# ").filter(|case| !case.trim().is_empty()) {
        let mut lines = case.lines().filter(|line| !line.is_empty());
        let name = lines.next().context("a case without a name")?;
        let status = lines.nth(1).and_then(|line| line.strip_prefix("status ")).context("a case without a status")?;
        let message: Vec<String> = lines.map(|line| line.trim().replace('|', "\\|").replace('<', "&lt;")).collect();
        out += &format!("| {name} | {status} | {} |\n", message.join("<br>"));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_is_that_of_the_snapshot() {
        let page = fs::read_to_string(root().join("docs/reference/errors.md")).unwrap();
        assert!(page == text().unwrap(), "run `cargo xtask errors`");
        assert!(page.lines().filter(|line| line.starts_with("| ")).count() > 50);
    }
}
