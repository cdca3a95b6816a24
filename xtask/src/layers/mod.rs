//! `cargo xtask layers`: checks the imports of the code against the tables in ARCHITECTURE.md.
//!
//! A *room* is a crate of the workspace, or a top-level module of a crate. A row of the tables names a room, describes it, and
//! lists the rooms that it uses. The check fails on
//!
//! * an arrow of the code that no row has, and an arrow of a row that the code does not have;
//! * a room without a row, and a row without a room;
//! * a circle;
//! * a circle of files, and a folder of more than 15 of them, in any crate (`files.rs`).
//!
//! Arrows between crates are the dependencies in Cargo.toml (of tests: not counted). Arrows between modules are paths that
//! begin with `crate::` outside of comments; the crate's root may use every module, and its own items belong to no room.

mod files;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::root;

use crate::source::packages::{Package, packages};
use crate::source::paths::{code, paths};

/// Room by room, the rooms that it uses.
type Arrows = BTreeMap<String, BTreeSet<String>>;

/// Workspaces of their own whose files are looked at too.
const OUTSIDE: [&str; 2] = ["fleet", "python"];

/// Heading of the table of crates.
const CRATES: &str = "Crates";

/// Checks the code against ARCHITECTURE.md.
pub(crate) fn layers() -> Result<()> {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).context("cannot read ARCHITECTURE.md")?;
    let drawn = drawing(&text)?;
    let packages = packages(".", true)?;
    let mut findings = Vec::new();
    for (scope, arrows) in &drawn {
        let found = match packages.get(scope) {
            Some(package) => rooms(&root().join(&package.folder).join("src"))?,
            None if scope == CRATES => crates(&packages),
            None => bail!("ARCHITECTURE.md has a table of `{scope}`, which is no crate of the workspace"),
        };
        findings.extend(differences(arrows, &found).into_iter().map(|what| format!("{scope}: {what}")));
        findings.extend(circle(arrows).map(|rooms| format!("{scope}: a circle in the drawing: {rooms}")));
    }
    let inside = packages.iter().map(|(name, package)| (name.as_str(), package.folder.as_str()));
    for (name, folder) in inside.chain(OUTSIDE.map(|name| (name, name))) {
        let source = root().join(folder).join("src");
        if source.is_dir() {
            findings.extend(files::findings(&source)?.into_iter().map(|what| format!("{name}: {what}")));
        }
    }
    ensure!(findings.is_empty(), "the code differs from ARCHITECTURE.md:\n  {}", findings.join("\n  "));
    let arrows: usize = drawn.values().flat_map(BTreeMap::values).map(BTreeSet::len).sum();
    println!(
        "layers: {} tables, {arrows} arrows: the code has exactly these, and no circle of rooms or files",
        drawn.len()
    );
    Ok(())
}

/// The tables of the page: under a heading `## Crates` or `## \`name\``, rows `| \`room\` | what it is | \`a\` \`b\` |`.
fn drawing(text: &str) -> Result<BTreeMap<String, Arrows>> {
    let mut all: BTreeMap<String, Arrows> = BTreeMap::new();
    let mut scope = None;
    for line in text.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            let name = heading.trim();
            scope = if name == CRATES { Some(CRATES) } else { quoted(name).next() };
            continue;
        }
        let (Some(scope), Some(row)) = (scope, line.strip_prefix('|')) else { continue };
        let cells: Vec<&str> = row.trim_end_matches('|').split('|').collect();
        let [room, _, uses] = cells[..] else { continue };
        let Some(room) = quoted(room).next() else { continue };
        let uses = quoted(uses).map(str::to_owned).collect();
        let before = all.entry(scope.to_owned()).or_default().insert(room.to_owned(), uses);
        ensure!(before.is_none(), "ARCHITECTURE.md has two rows of `{room}` under {scope}");
    }
    ensure!(all.contains_key(CRATES), "ARCHITECTURE.md has no table under `## {CRATES}`");
    Ok(all)
}

/// The texts between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// Dependencies among the packages of the workspace.
fn crates(packages: &BTreeMap<String, Package>) -> Arrows {
    packages.iter().map(|(name, package)| (name.clone(), package.uses.clone())).collect()
}

/// Imports among the top-level modules of a crate.
fn rooms(source: &Path) -> Result<Arrows> {
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(source).with_context(|| format!("{}", source.display()))? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned();
        let is_module = path.join("mod.rs").is_file() || path.extension().is_some_and(|extension| extension == "rs");
        if is_module && !["lib", "main"].contains(&name.as_str()) {
            names.insert(name);
        }
    }
    let mut arrows: Arrows = names.iter().map(|name| (name.clone(), BTreeSet::new())).collect();
    for name in &names {
        for file in files_of(source, name)? {
            let text = fs::read_to_string(&file)?;
            let of_crate = paths(&code(&text)).into_iter().filter(|path| path[0] == "crate");
            let uses = of_crate.map(|path| path[1].clone()).filter(|used| names.contains(used) && used != name);
            arrows.entry(name.clone()).or_default().extend(uses);
        }
    }
    Ok(arrows)
}

/// The files of a module: `name.rs` and everything in `name/`.
fn files_of(source: &Path, name: &str) -> Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = Some(source.join(format!("{name}.rs"))).into_iter().filter(|f| f.is_file()).collect();
    let mut folders = vec![source.join(name)];
    while let Some(folder) = folders.pop() {
        if !folder.is_dir() {
            continue;
        }
        for entry in fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    Ok(files)
}

/// Arrows of the drawing that the code lacks, and of the code that the drawing lacks.
fn differences(drawn: &Arrows, found: &Arrows) -> Vec<String> {
    let mut out = Vec::new();
    for room in found.keys().filter(|room| !drawn.contains_key(*room)) {
        out.push(format!("`{room}` has no row"));
    }
    for (room, uses) in drawn {
        let Some(code) = found.get(room) else {
            out.push(format!("`{room}` has a row, but is no room of the code"));
            continue;
        };
        out.extend(code.difference(uses).map(|used| format!("`{room}` uses `{used}`, which its row does not have")));
        out.extend(uses.difference(code).map(|used| format!("`{room}` does not use `{used}`, which its row has")));
    }
    out
}

/// The rooms of a circle, as text.
fn circle(arrows: &Arrows) -> Option<String> {
    let mut open: Arrows = arrows.clone();
    loop {
        let done: Vec<String> = open
            .iter()
            .filter(|(_, uses)| uses.iter().all(|used| !open.contains_key(used)))
            .map(|(r, _)| r.clone())
            .collect();
        if done.is_empty() {
            let rooms: Vec<&str> = open.keys().map(String::as_str).collect();
            return (!rooms.is_empty()).then(|| rooms.join(", "));
        }
        done.iter().for_each(|room| {
            open.remove(room);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrows(of: &[(&str, &[&str])]) -> Arrows {
        of.iter().map(|(room, uses)| ((*room).to_owned(), uses.iter().map(|u| (*u).to_owned()).collect())).collect()
    }

    #[test]
    fn a_new_arrow_an_old_one_and_a_circle_are_named() {
        let drawn = arrows(&[("a", &["b"]), ("b", &[]), ("gone", &[])]);
        let found = arrows(&[("a", &[]), ("b", &["a"]), ("new", &[])]);
        let message = differences(&drawn, &found).join("; ");
        for part in ["`new` has no row", "`a` does not use `b`", "`b` uses `a`", "`gone` has a row"] {
            assert!(message.contains(part), "{message}");
        }
        assert_eq!(circle(&drawn), None);
        assert_eq!(circle(&arrows(&[("a", &["b"]), ("b", &["a"]), ("c", &["a"])])).as_deref(), Some("a, b, c"));
    }

    #[test]
    fn the_drawing_is_the_tables_under_their_headings() {
        let text = "## Crates\n| room | what | uses |\n|---|---|---|\n| `a` | words | `b` |\n| `b` | words | |\n\n## `a`\n| `x` | words | `y` `z` |\n";
        let drawn = drawing(text).unwrap();
        assert_eq!(drawn["Crates"], arrows(&[("a", &["b"]), ("b", &[])]));
        assert_eq!(drawn["a"], arrows(&[("x", &["y", "z"])]));
        assert!(drawing("nothing").is_err());
    }
}
