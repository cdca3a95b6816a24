//! Branches of the exported C that the checks take, and what follows for MC/DC.
//!
//! gcov counts both ways out of every condition of a decision, not only of the decision. Where the conditions of a decision form a
//! tree, each tested after one other at most, all of these branches together imply MC/DC (Comar, Guitton, Hainque and Quinot, ERTS 2012).
//! [`trees`] refuses decisions that do not: a group with `||` before `&&`, or one with `&&` before `||`.
//!
//! What no check can take is listed with its reason in docs/explanation/on-target.md, and here.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use flate2::read::GzDecoder;
use serde_json::Value;
use xtask::shell::{root, stdout_of, text};

use super::{Given, MODULES};
use crate::targets::vector_files::files;

/// Branches that are never taken: file, code of the line, how many. Their reasons: docs/explanation/on-target.md.
const NOT_TAKEN: [(&str, &str, usize); 4] = [
    (
        "sagnac_banks.c",
        "is_there = (sagnac_gyro_accept(gyro, &banks->image) == SAGNAC_MATCHES) ? SAGNAC_YES : SAGNAC_NO;",
        1,
    ),
    ("sagnac_compensator.c", "if ((product <= (uint64_t)most) && (end >= 2147483640U) && (end <= 2147483656U)) {", 1),
    ("sagnac_frame.c", "if (reader->length < SAGNAC_MAX_FRAME) {", 1),
    ("sagnac_upload.c", "switch (result) {", 1),
];

pub(super) fn coverage(folder: &Path, given: &Given) -> Result<()> {
    let here = folder.join("coverage");
    if here.exists() {
        fs::remove_dir_all(&here)?;
    }
    fs::create_dir_all(&here)?;
    run_everything(folder, &here, given)?;
    let (mut taken, mut all, mut missed) = (0, 0, BTreeMap::new());
    for module in MODULES {
        let source = fs::read_to_string(folder.join(module))?;
        trees(module, &source)?;
        for (line, counts) in branches(folder, &here, module)? {
            let zeros = counts.iter().filter(|count| **count == 0).count();
            all += counts.len();
            taken += counts.len() - zeros;
            if zeros > 0 {
                let code = source.lines().nth(line - 1).unwrap_or_default().trim().to_owned();
                *missed.entry((module, code)).or_insert(0) += zeros;
            }
        }
    }
    for (file, code, count) in NOT_TAKEN {
        let found = missed.remove(&(file, code.to_owned())).unwrap_or(0);
        ensure!(found == count, "{file}: {code}: {found} branches not taken, {count} explained");
    }
    ensure!(missed.is_empty(), "branches that no check takes: {missed:#?}");
    ensure!(taken > 1400, "only {taken} branches taken");
    println!(
        "check: C: {taken} of {all} branches taken, {} explained; every decision is a tree, so MC/DC follows",
        all - taken
    );
    Ok(())
}

/// Every checking program, linked with modules that count.
fn run_everything(folder: &Path, here: &Path, given: &Given) -> Result<()> {
    for module in MODULES {
        let source = folder.join(module);
        stdout_of(300, "gcc", &["-std=c99", "-O0", "--coverage", "-c", text(&source)?], here)?;
    }
    let objects: Vec<String> = MODULES.iter().map(|module| module.replace(".c", ".o")).collect();
    let objects: Vec<&str> = objects.iter().map(String::as_str).collect();
    let include = format!("-I{}", text(folder)?);
    for program in [
        "check_vectors",
        "check_loader",
        "check_watch",
        "check_bound",
        "check_banks",
        "check_board",
        "check_edges",
        "check_line",
    ] {
        let source = root().join("firmware/c").join(program).with_extension("c");
        let own = ["-std=c99", "-O1", "-DWITH_KEY", &include, text(&source)?, "-o", program, "--coverage"];
        stdout_of(300, "gcc", &[&own[..], &objects, &["-lsodium"]].concat(), here)?;
    }
    let run = |program: &str, args: &[&str]| stdout_of(600, text(&here.join(program))?, args, here);
    for path in files()? {
        run("check_vectors", &[text(&path)?])?;
    }
    for (program, records) in [
        ("check_loader", &given.verdicts),
        ("check_watch", &given.watches),
        ("check_bound", &given.bounds),
        ("check_banks", &given.banks),
        ("check_board", &given.boards),
    ] {
        run(program, &[text(records)?])?;
    }
    run("check_edges", &["../line.loops"])?;
    for session in &given.lines {
        run("check_line", &["../line.img", "../line.loops", text(&session.input)?, "line.out"])?;
    }
    for session in &given.keyed {
        run("check_line", &["../line.img", "../line.loops", text(&session.input)?, "line.out", "../line.key"])?;
    }
    Ok(())
}

/// The counts of the branches of each line of a module.
fn branches(folder: &Path, here: &Path, module: &str) -> Result<Vec<(usize, Vec<u64>)>> {
    let object = module.replace(".c", ".o");
    stdout_of(120, "gcov", &["-b", "-c", "--json-format", &object], here)?;
    let file = fs::File::open(here.join(module.replace(".c", ".gcov.json.gz")))?;
    let mut json = String::new();
    GzDecoder::new(file).read_to_string(&mut json)?;
    let json: Value = serde_json::from_str(&json)?;
    let own = folder.join(module);
    let lines = json["files"].as_array().and_then(|all| all.iter().find(|file| file["file"].as_str() == own.to_str()));
    let lines =
        lines.and_then(|file| file["lines"].as_array()).with_context(|| format!("gcov says nothing of {module}"))?;
    let counts = |line: &Value| -> Option<(usize, Vec<u64>)> {
        let counts = line["branches"].as_array()?.iter().filter_map(|branch| branch["count"].as_u64()).collect();
        Some((line["line_number"].as_u64()? as usize, counts))
    };
    Ok(lines.iter().filter_map(counts).collect())
}

/// Every decision tests each of its conditions after one other at most.
fn trees(module: &str, source: &str) -> Result<()> {
    let code: String = source.split_whitespace().collect::<Vec<_>>().join(" ");
    match not_a_tree(&code) {
        None => Ok(()),
        Some(place) => anyhow::bail!("{module}: this decision is no tree, so branches do not imply MC/DC: … {place}"),
    }
}

/// The first group of conditions that another one follows from two places.
fn not_a_tree(code: &str) -> Option<&str> {
    // For each open parenthesis, whether its group has an `&&` or an `||` of its own.
    let mut open: Vec<[bool; 2]> = Vec::new();
    for (at, character) in code.char_indices() {
        let rest = &code[at..];
        match character {
            '(' => open.push([false; 2]),
            ')' => {
                let [and, or] = open.pop().unwrap_or_default();
                let next = rest[1..].trim_start();
                if (or && next.starts_with("&&")) || (and && next.starts_with("||")) {
                    return code.get(at.saturating_sub(60)..(at + 20).min(code.len()));
                }
            }
            '&' if rest.starts_with("&&") => {
                if let Some(group) = open.last_mut() {
                    group[0] = true;
                }
            }
            '|' if rest.starts_with("||") => {
                if let Some(group) = open.last_mut() {
                    group[1] = true;
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_that_follows_two_others_is_found() {
        for tree in
            ["if ((a) && (b) && (c))", "if ((a) || ((b) && (c)))", "if ((a) && ((b) || (c)))", "f(a && b); g(c) || d;"]
        {
            assert_eq!(not_a_tree(tree), None, "{tree}");
        }
        for other in ["if (((a) || (b)) && (c))", "x = ((a && b) || c);"] {
            assert!(not_a_tree(other).is_some(), "{other}");
        }
    }
}
