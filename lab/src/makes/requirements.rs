//! Requirements of the arithmetic on the target, and where each is met and tried: `docs/reference/traceability.md`.
//!
//! A requirement is one sentence or two in the core, next to the code that meets it: `/// **SAG-CORE-012** …`. C, Verilog, tests and the
//! list of the vectors name its number. The page is made from these places; a requirement that a column lacks, or a number that
//! nobody defines, is an error.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use xtask::shell::root;

use crate::made::Made;
use crate::places::TRACEABILITY;

const ID: &str = "SAG-CORE-";
/// Requirements that the hardware leaves to the processor next to it, and why.
const NOT_IN_HARDWARE: [(&str, &str); 9] = [
    ("SAG-CORE-019", "the processor that sends the image"),
    ("SAG-CORE-021", "no flash"),
    ("SAG-CORE-022", "no flash"),
    ("SAG-CORE-023", "the processor; the loader compares serial, axis and tick"),
    ("SAG-CORE-026", "one product at a time"),
    ("SAG-CORE-027", "none: block RAM with ECC, or the device's own scrubbing"),
    ("SAG-CORE-029", "no flash"),
    ("SAG-CORE-030", "no flash"),
    ("SAG-CORE-031", "the processor that gives the codes"),
];

const HEAD: &str = "# Requirements and where they are met

Made by `cargo xtask bless requirements` from the sources; do not edit. Each requirement is stated once, in the documentation of the function of
`sagnac-core` that meets it. C, Verilog, tests and [vectors](vectors.md) name its number next to their own code. `cargo xtask ci` refuses a requirement
without C, without a test, or without hardware unless a reason is given here, and a number that no requirement has.
[For those who certify](../explanation/certification.md) says what this table is good for, and what it is not.

| requirement | where |
|---|---|
";

/// One requirement and its places.
#[derive(Default)]
struct Requirement {
    text: String,
    rust: String,
    c: BTreeSet<String>,
    verilog: BTreeSet<String>,
    tests: BTreeSet<String>,
    vectors: BTreeSet<String>,
}

/// The page.
pub(crate) fn make() -> Result<Vec<Made>> {
    let mut all = BTreeMap::new();
    for path in sources("crates/sagnac-core/src", "rs")? {
        definitions(&path, &mut all)?;
    }
    for folder in ["crates/sagnac-core/src", "crates/sagnac-core/tests"] {
        for path in sources(folder, "rs")? {
            references(&path, &mut all, |requirement, place| requirement.tests.insert(place))?;
        }
    }
    for path in sources("ports/c", "c")? {
        references(&path, &mut all, |requirement, place| requirement.c.insert(place))?;
    }
    for path in sources("ports/verilog", "v")? {
        let module = path.file_stem().context("a name")?.to_string_lossy().into_owned();
        references(&path, &mut all, |requirement, _| requirement.verilog.insert(module.clone()))?;
    }
    let vectors = root().join("lab/src/makes/vectors/mod.rs");
    references(&vectors, &mut all, |requirement, place| requirement.vectors.insert(place))?;
    let mut page = HEAD.to_owned();
    for (id, requirement) in &all {
        page += &row(id, requirement)?;
    }
    ensure!(all.len() >= 20, "{} requirements", all.len());
    Ok(vec![Made::new(TRACEABILITY, page)])
}

fn row(id: &str, of: &Requirement) -> Result<String> {
    ensure!(!of.c.is_empty(), "{id} is nowhere in C");
    ensure!(!of.tests.is_empty(), "{id} has no test");
    let reason = NOT_IN_HARDWARE.iter().find(|(other, _)| *other == id).map(|(_, why)| *why);
    let verilog = match (of.verilog.is_empty(), reason) {
        (false, None) => list(&of.verilog),
        (true, Some(reason)) => reason.to_owned(),
        (true, None) => bail!("{id} is nowhere in Verilog, and no reason is given"),
        (false, Some(_)) => bail!("{id} is in Verilog, and a reason why not is given"),
    };
    let mut out = String::new();
    write!(out, "| **{id}** {} | Rust: `{}`<br>C: {}<br>Verilog: {verilog}<br>", of.text, of.rust, list(&of.c))?;
    write!(out, "Tests: {}", list(&of.tests))?;
    if !of.vectors.is_empty() {
        write!(out, "<br>Vectors: {}", list(&of.vectors))?;
    }
    out.push_str(" |\n");
    Ok(out)
}

fn list(names: &BTreeSet<String>) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Files of a folder and its folders, in order.
fn sources(folder: &str, extension: &str) -> Result<Vec<PathBuf>> {
    fn of(folder: &Path, extension: &str, out: &mut Vec<PathBuf>) -> Result<()> {
        for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                of(&path, extension, out)?;
            } else if path.extension().is_some_and(|own| own == extension) {
                out.push(path);
            }
        }
        Ok(())
    }
    let mut out = Vec::new();
    of(&root().join(folder), extension, &mut out)?;
    out.sort();
    Ok(out)
}

/// Reads the requirements that a file of the core states.
fn definitions(path: &Path, all: &mut BTreeMap<String, Requirement>) -> Result<()> {
    let text = fs::read_to_string(path)?;
    let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
    let module = if path.ends_with("mod.rs") { path.parent().and_then(Path::file_name) } else { path.file_stem() };
    let module = module.context("a name")?.to_string_lossy();
    for (at, line) in lines.iter().enumerate() {
        let Some((id, first)) = line.strip_prefix("/// **").and_then(|rest| rest.split_once("** ")) else { continue };
        if !id.starts_with(ID) {
            continue;
        }
        let more =
            lines[at + 1..].iter().map_while(|line| line.strip_prefix("/// ").filter(|rest| !rest.starts_with("**")));
        let text = std::iter::once(first).chain(more).collect::<Vec<_>>().join(" ");
        let function = name_after(&lines[at..]).with_context(|| format!("{id}: no function behind it"))?;
        let rust = format!("{module}::{function}");
        let before = all.insert(id.to_owned(), Requirement { text, rust, ..Requirement::default() });
        ensure!(before.is_none(), "{id} is stated twice");
    }
    Ok(())
}

/// Reads the numbers that a file names without stating them, each with the name of the function, or of the vectors, behind it.
fn references(
    path: &Path,
    all: &mut BTreeMap<String, Requirement>,
    put: impl Fn(&mut Requirement, String) -> bool,
) -> Result<()> {
    let text = fs::read_to_string(path)?;
    let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
    for (at, line) in lines.iter().enumerate() {
        let is_comment = line.starts_with("//") || line.starts_with("/*");
        if !is_comment || line.contains("**") {
            continue;
        }
        for part in line.split(ID).skip(1) {
            let number: String = part.chars().take_while(char::is_ascii_digit).collect();
            let id = format!("{ID}{number}");
            let requirement = all.get_mut(&id).with_context(|| format!("{}: {id} is not stated", path.display()))?;
            let place = name_after(&lines[at..]).unwrap_or_default();
            put(requirement, place);
        }
    }
    Ok(())
}

/// The name of the next Rust function, C function or vector file.
fn name_after(lines: &[&str]) -> Option<String> {
    let code =
        lines.iter().find(|line| !line.starts_with("//") && !line.starts_with("/*") && !line.starts_with("#["))?;
    let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    if let Some((_, rest)) = code.split_once(".made(\"") {
        return rest.split('"').next().map(str::to_owned);
    }
    if let Some((_, rest)) = code.split_once("fn ") {
        return Some(name(rest));
    }
    let (before, _) = code.split_once('(')?;
    before.rsplit([' ', '*']).next().map(name)
}
