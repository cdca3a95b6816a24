//! The files of a crate as modules, and the module that defines a name.
//!
//! ```text
//! use, crate::, super:: ─▶ module by module as far as files go ─▶ the item ─▶ the file that defines it
//! ```
//!
//! Re-exports are followed home. Test modules are not read. The reader takes a source as rustfmt writes it; it knows no item that a macro
//! makes.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::paths::{self, code};

/// Roots of crates.
const ROOTS: [&str; 2] = ["lib.rs", "main.rs"];

/// A file as a module.
pub(crate) struct Module {
    /// `fit::rivals`; the root's is empty.
    pub(crate) path: Vec<String>,
    pub(crate) file: PathBuf,
    pub(crate) code: String,
}

/// The modules of a crate, by the folder of its sources.
pub(crate) fn modules(source: &Path) -> Result<Vec<Module>> {
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

/// The paths that a module names, each from the crate's root.
fn named(module: &Module) -> Vec<Vec<String>> {
    let absolute = |path: Vec<String>| from_root(&module.path, &path);
    let mut named: Vec<Vec<String>> = paths::paths(&module.code).into_iter().filter_map(absolute).collect();
    let uses = paths::uses(&module.code).into_iter().filter(|(is_shown, _)| !is_shown);
    // A path of a use that begins with neither is of a child or of another crate; the latter leads nowhere.
    named.extend(uses.filter_map(|(_, used)| from_root(&module.path, &used.path)));
    named
}

/// The modules whose items a module names, but for the crate's root and itself.
pub(crate) fn used<'a>(modules: &'a [Module], by: &Module) -> Vec<&'a Module> {
    let homes = named(by).into_iter().filter_map(|path| home(modules, &path, 0));
    homes.filter(|home| !home.path.is_empty() && home.path != by.path).collect()
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
