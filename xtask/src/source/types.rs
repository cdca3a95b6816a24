//! Names of types that stand for two things in one crate, or in a crate and one that it is built from.
//!
//! ```text
//! struct, enum, trait, type, union ─┬─▶ public or seen in its crate, twice in it ──────────────┐
//!                                   └─▶ public in a crate, and seen in one that is built from it ─┴▶ named, unless a row says why
//! ```
//!
//! A type of a test is private to it. Fails to see a type that a macro makes, and a variant or a function with the name of a type.

use std::collections::BTreeMap;

use anyhow::Result;
use xtask::shell::root;

use super::modules::modules;
use super::packages::packages;

/// Workspaces of their own.
const OUTSIDE: [&str; 2] = ["fleet", "python"];

/// Names that may stand twice, where, and why.
const TWICE: [(&str, &[&str], &str); 11] = [
    ("Args", &["sagnac-cli", "sagnac-fleet"], "the arguments of a verb go by its module: calibrate::Args"),
    ("ParquetRows", &["sagnac-log"], "one of them without the feature"),
    ("Calibration", PYTHON, CLASS),
    ("Comparison", PYTHON, CLASS),
    ("Compensator", PYTHON, CLASS),
    ("NoiseBudget", PYTHON, CLASS),
    ("Run", PYTHON, CLASS),
    ("Verification", PYTHON, CLASS),
    ("Role", &["sagnac-report"], "of a column of a log, and of a layer of a figure"),
    ("Watch", &["sagnac-log"], "a callback while files are read, and the watch of the target over its thermometers"),
    ("Stretches", &["sagnac"], "of equal temperatures in the lag filter, and of rows without gaps in a deviation"),
];
const PYTHON: &[&str] = &["sagnac-py"];
const CLASS: &str = "the class of Python has the name of the library's type that it holds";

/// A type: its name, whether other crates see it, and its file.
#[derive(Clone, Debug, PartialEq)]
struct Type {
    name: String,
    is_public: bool,
    file: String,
}

/// The types of a source that others see.
fn types(code: &str, file: &str) -> Vec<Type> {
    let declared = |line: &str| {
        let rest = line.trim_start().strip_prefix("pub")?;
        let (is_public, rest) = match rest.strip_prefix('(') {
            Some(rest) => (false, rest.split_once(") ")?.1),
            None => (true, rest.strip_prefix(' ')?),
        };
        let kinds = ["struct ", "enum ", "trait ", "type ", "union "];
        let rest = kinds.iter().find_map(|kind| rest.strip_prefix(kind))?;
        let name = rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
        // A macro gives the name otherwise.
        (!name.is_empty()).then(|| Type { name: name.to_owned(), is_public, file: file.to_owned() })
    };
    code.lines().filter_map(declared).collect()
}

/// `name: file, file` for every name that two types have: of a crate, or of it and one that it is built from.
fn twins(own: &[Type], used: &[Type]) -> Vec<String> {
    let mut named: BTreeMap<&str, Vec<&Type>> = BTreeMap::new();
    own.iter().for_each(|of_crate| named.entry(&of_crate.name).or_default().push(of_crate));
    let twin = |(name, own): (&str, Vec<&Type>)| {
        let public = used.iter().filter(|of_used| of_used.is_public && of_used.name == name);
        let all: Vec<&str> = own.into_iter().chain(public).map(|one| one.file.as_str()).collect();
        (all.len() > 1).then(|| format!("{name}: {}", all.join(", ")))
    };
    named.into_iter().filter_map(twin).collect()
}

/// The types of a package, and the packages that it is built from.
type PackageTypes = (Vec<Type>, Vec<String>);

/// The same of each package of the tree.
fn by_package() -> Result<BTreeMap<String, PackageTypes>> {
    let mut all = BTreeMap::new();
    for (folder, is_member) in std::iter::once((".", true)).chain(OUTSIDE.map(|folder| (folder, false))) {
        for (name, package) in packages(folder, is_member)? {
            let source = root().join(&package.folder).join("src");
            let mut types_of = Vec::new();
            for module in if source.is_dir() { modules(&source)? } else { Vec::new() } {
                let file = module.file.strip_prefix(root()).unwrap_or(&module.file).display().to_string();
                types_of.extend(types(&module.code, &file));
            }
            all.insert(name, (types_of, package.uses.into_iter().collect()));
        }
    }
    Ok(all)
}

#[test]
fn a_name_of_two_types_is_found() {
    let own =
        types("pub struct A {\n    pub(super) enum B<T> {\nstruct C;\npub(crate) type A = u8;\npub fn D() {}\n", "own");
    let named = |types: &[Type]| types.iter().map(|one| format!("{} {}", one.name, one.is_public)).collect::<Vec<_>>();
    assert_eq!(named(&own), ["A true", "B false", "A false"]);
    let used = types("pub trait B: Send {\npub(crate) struct A;\n", "used");
    assert_eq!(twins(&own, &used), ["A: own, own", "B: own, used"]);
    assert_eq!(twins(&used, &[]), Vec::<String>::new());
}

#[test]
fn a_type_has_a_name_of_its_own() {
    let packages = by_package().unwrap();
    let mut missing = Vec::new();
    let mut rows: Vec<&str> = TWICE.iter().map(|(name, ..)| *name).collect();
    for (package, (own, uses)) in &packages {
        let used: Vec<Type> =
            uses.iter().filter_map(|name| packages.get(name)).flat_map(|(of, _)| of.clone()).collect();
        for twin in twins(own, &used) {
            let name = twin.split(':').next().unwrap_or_default();
            let row = TWICE.iter().find(|(of, crates, _)| *of == name && crates.contains(&package.as_str()));
            rows.retain(|row| *row != name);
            missing.extend(row.is_none().then(|| format!("{package}: {twin}")));
        }
    }
    assert!(
        missing.is_empty(),
        "two types have one name: rename one by what it is, or add it to TWICE in {} with its reason:\n{}",
        file!(),
        missing.join("\n")
    );
    assert!(rows.is_empty(), "these stand no longer twice; delete their rows: {rows:?}");
}
