//! Arrows between the files of a crate. Circles of files, and folders that hold too many, are findings.
//!
//! An arrow goes to the file that defines the item. Test modules are not read. `mod.rs` is a file like any other, the crate's root is none.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Result;

use crate::source::modules::{Module, modules, used};

/// Most `.rs` files in a folder under `src/`; `mod.rs`, `lib.rs` and `main.rs` are not counted.
const MOST_FILES: usize = 15;
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

type Arrows = BTreeMap<String, BTreeSet<String>>;

/// File by file, the files whose items it names.
fn arrows(modules: &[Module]) -> Arrows {
    let names = |module: &Module| module.path.join("::");
    let others = |module| used(modules, module).into_iter().map(names).collect();
    modules.iter().filter(|module| !module.path.is_empty()).map(|module| (names(module), others(module))).collect()
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
