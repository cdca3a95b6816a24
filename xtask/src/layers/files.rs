//! Arrows between the files of a crate. Circles of files, and folders that hold too many, are findings.
//!
//! ```text
//! use, crate::, super:: ─▶ module by module as far as files go ─▶ the item ─▶ the file that defines it
//! ```
//!
//! An arrow goes to the file that defines the item: re-exports are followed home. Test modules are not read. `mod.rs` is a file like any
//! other, the crate's root is none. The reader takes a source as rustfmt writes it; it knows no item that a macro makes.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::paths::{self, code};

/// Most `.rs` files in a folder under `src/`; `mod.rs`, `lib.rs` and `main.rs` are not counted.
const MOST_FILES: usize = 15;
/// Roots of crates.
const ROOTS: [&str; 2] = ["lib.rs", "main.rs"];

/// A file as a module.
struct Module {
    /// `fit::rivals`; the root's is empty.
    path: Vec<String>,
    file: PathBuf,
    code: String,
}

/// The findings of a crate, by the folder of its sources.
pub(super) fn findings(source: &Path) -> Result<Vec<String>> {
    let modules = modules(source)?;
    let mut findings: Vec<String> = circles(&arrows(&modules))
        .into_iter()
        .map(|circle| format!("a circle of {} files: {}", circle.len(), circle.join(", ")))
        .collect();
    let mut folders: BTreeMap<&Path, usize> = BTreeMap::new();
    for module in &modules {
        let name = module.file.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if !["mod.rs", "lib.rs", "main.rs"].contains(&name) {
            *folders.entry(module.file.parent().unwrap_or(source)).or_default() += 1;
        }
    }
    let full = folders.into_iter().filter(|(_, count)| *count > MOST_FILES);
    let name = |folder: &Path| folder.strip_prefix(source).unwrap_or(folder).display().to_string();
    findings.extend(
        full.map(|(folder, count)| format!("the folder `{}` has {count} files, at most {MOST_FILES}", name(folder))),
    );
    Ok(findings)
}

fn modules(source: &Path) -> Result<Vec<Module>> {
    let (mut modules, mut folders) = (Vec::new(), vec![source.to_owned()]);
    while let Some(folder) = folders.pop() {
        let mut entries = fs::read_dir(&folder)
            .with_context(|| format!("{}", folder.display()))?
            .map(|entry| Ok(entry?.path()))
            .collect::<Result<Vec<_>>>()?;
        entries.sort();
        for path in entries {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                modules.push(module(source, path)?);
            }
        }
    }
    // Modules of tests have files of their own.
    let of_tests = |module: &Module| module.path.last().is_some_and(|name| name == "tests");
    modules.retain(|module| !of_tests(module));
    Ok(modules)
}

fn module(source: &Path, file: PathBuf) -> Result<Module> {
    let below = file.strip_prefix(source)?.with_extension("");
    let mut path: Vec<String> = below.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if path.last().is_some_and(|name| name == "mod")
        || path.len() == 1 && ROOTS.contains(&format!("{}.rs", path[0]).as_str())
    {
        path.pop();
    }
    let code = code(&fs::read_to_string(&file)?);
    Ok(Module { path, file, code })
}

type Arrows = BTreeMap<String, BTreeSet<String>>;

/// File by file, the files whose items it names.
fn arrows(modules: &[Module]) -> Arrows {
    let mut arrows = Arrows::new();
    for module in modules.iter().filter(|module| !module.path.is_empty()) {
        let name = module.path.join("::");
        let homes = named(module).into_iter().filter_map(|path| home(modules, &path, 0));
        let others = homes.filter(|home| !home.path.is_empty() && home.path != module.path);
        arrows.entry(name).or_default().extend(others.map(|home| home.path.join("::")));
    }
    arrows
}

/// The paths that a module names, each from the crate's root.
fn named(module: &Module) -> Vec<Vec<String>> {
    let absolute = |path: Vec<String>| from_root(&module.path, &path);
    let mut named: Vec<Vec<String>> = paths::paths(&module.code).into_iter().filter_map(absolute).collect();
    let uses = paths::uses(&module.code).into_iter().filter(|(is_shown, _)| !is_shown);
    // A path of a use that begins with neither is of a child or of another crate; the latter leads nowhere.
    named.extend(uses.filter_map(|(_, used)| from_root(&module.path, &used.path)));
    named
}

/// A path of a module as one from the crate's root.
fn from_root(module: &[String], path: &[String]) -> Option<Vec<String>> {
    let mut base = match path.first()?.as_str() {
        "crate" => return Some(path[1..].to_vec()),
        _ => module.to_vec(),
    };
    let mut rest = path;
    while let Some((first, more)) = rest.split_first() {
        match first.as_str() {
            "super" => drop(base.pop()?),
            "self" => (),
            _ => break,
        }
        rest = more;
    }
    base.extend_from_slice(rest);
    Some(base)
}

/// The module that defines what a path from the root names; `None` for another crate's.
fn home<'a>(modules: &'a [Module], path: &[String], depth: usize) -> Option<&'a Module> {
    let of = |path: &[String]| modules.iter().find(|module| module.path == path);
    // The longest beginning that is a module.
    let length = (0..=path.len()).rev().find(|length| of(&path[..*length]).is_some())?;
    let module = of(&path[..length])?;
    let Some(item) = path.get(length) else { return Some(module) };
    if defines(&module.code, item) || depth > 9 {
        return Some(module);
    }
    for (_, used) in paths::uses(&module.code) {
        let target = from_root(&module.path, &used.path)?;
        let is_it = used.name == *item;
        if is_it || used.name == "*" {
            let target = if is_it { target } else { [&target[..], &path[length..length + 1]].concat() };
            let known = target.len() > 1 || of(&target).is_some() || used.path[0] == "crate";
            if let Some(home) = known.then(|| home(modules, &target, depth + 1)).flatten()
                && (is_it || defines(&home.code, item))
            {
                return Some(home);
            }
        }
    }
    // What a macro makes, or an item of another crate that passes through.
    (length > 0 && length + 1 == path.len()).then_some(module)
}

/// True where an item of this name is declared.
fn defines(code: &str, item: &str) -> bool {
    const KINDS: [&str; 9] =
        ["fn ", "struct ", "enum ", "trait ", "type ", "const ", "static ", "union ", "macro_rules! "];
    KINDS.iter().any(|kind| {
        let declared = format!("{kind}{item}");
        code.match_indices(&declared).any(|(at, _)| {
            let behind = code[at + declared.len()..].chars().next();
            !behind.is_some_and(|c| c.is_alphanumeric() || c == '_')
        })
    })
}

/// The circles: files each of which reaches all others (strongly connected components).
fn circles(arrows: &Arrows) -> Vec<Vec<String>> {
    let reach = |from: &String| -> BTreeSet<String> {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            for next in arrows.get(file).into_iter().flatten() {
                if reached.insert(next.clone()) {
                    open.push(next);
                }
            }
        }
        reached
    };
    let reached: BTreeMap<&String, BTreeSet<String>> = arrows.keys().map(|file| (file, reach(file))).collect();
    let mut circles: BTreeSet<Vec<String>> = BTreeSet::new();
    for (file, to) in &reached {
        if to.contains(*file) {
            let back = |other: &&String| reached.get(other).is_some_and(|back| back.contains(*file));
            circles.insert(to.iter().filter(back).cloned().collect());
        }
    }
    circles.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn module(path: &str, code: &str) -> Module {
        let path: Vec<String> = path.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect();
        Module { file: path.iter().collect(), path, code: code.to_owned() }
    }

    /// Names as in the code: a re-export, one under another name, a glob, a child of `mod.rs`, an item of the module above.
    fn crate_of(b: &str) -> Vec<Module> {
        vec![
            module("", "mod a;\nmod b;"),
            module("a", "mod deep;\npub(crate) use deep::{Found as Known, other};\npub(crate) fn near() {}"),
            module("a::deep", "use super::near;\npub(crate) struct Found;\npub(crate) fn other() {}"),
            module("b", b),
        ]
    }

    #[test]
    fn an_arrow_goes_to_the_file_that_defines_the_item() {
        let to = |b: &str| -> Vec<String> { arrows(&crate_of(b))["b"].iter().cloned().collect() };
        assert_eq!(to("use crate::a::Known;"), ["a::deep"]);
        assert_eq!(to("use crate::a::{near, other};"), ["a", "a::deep"]);
        assert_eq!(to("use super::a::deep::Found;\nlet x = crate::a::near();"), ["a", "a::deep"]);
        assert_eq!(to("use std::fs;\nuse serde::Serialize;"), [""; 0]);
        assert_eq!(arrows(&crate_of(""))["a::deep"].iter().collect::<Vec<_>>(), ["a"]);
    }

    #[test]
    fn a_circle_has_all_its_files_and_no_other() {
        let back = crate_of("use crate::a::near;\npub(crate) fn last() {}");
        assert!(circles(&arrows(&back)).is_empty());
        let mut round = back;
        round[1].code += "\nuse crate::b::last;";
        assert_eq!(circles(&arrows(&round)), [["a", "b"]]);
    }
}
