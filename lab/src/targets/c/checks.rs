//! Checks of the exported text itself: types, MISRA, the constants, C++.

use std::fs;
use std::path::Path;

use anyhow::{Result, ensure};
use xtask::shell::{output, root, stdout_of, text};

use super::{MODULES, STRICT};
use crate::targets::vector_files::table;

pub(super) fn all(folder: &Path) -> Result<()> {
    as_a_user(folder)?;
    no_other_types(folder)?;
    misra(folder)?;
    constants(folder)?;
    from_cpp(folder)
}

/// What the README of the export says: `make check`.
fn as_a_user(folder: &Path) -> Result<()> {
    let flags = format!("CFLAGS={}", STRICT.join(" "));
    let said = stdout_of(600, "make", &["-j2", &flags, "clean", "check"], folder)?;
    let files = fs::read_dir(folder.join("vectors"))?.count();
    ensure!(said.matches("records equal").count() == files, "make check: {said}");
    println!("check: C: make check in the exported folder: {files} files of vectors equal");
    Ok(())
}

/// Headers in a C++ program that links the library.
fn from_cpp(folder: &Path) -> Result<()> {
    let mut source = String::new();
    for module in MODULES {
        source += &format!("#include \"{}\"\n", module.replace(".c", ".h"));
    }
    source += "#include \"sagnac_unit.h\"\nstatic_assert(SAGNAC_VERSION_NUMBER > 0UL, \"a version\");\n\
               int main() { static sagnac_board board; sagnac_trust trust; sagnac_trust_nobody(&trust); return static_cast<int>(board.trial + trust.has_key + \
               (sagnac_image_check(&sagnac_image_x) == SAGNAC_IMAGE_OK ? 0U : 1U)); }\n";
    fs::write(folder.join("from_cpp.cpp"), source)?;
    let flags = ["-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-I."];
    stdout_of(300, "gcc", &["-std=c99", "-c", "sagnac_unit.c", "-o", "unit.o"], folder)?;
    stdout_of(
        300,
        "g++",
        &[&flags[..], &["from_cpp.cpp", "unit.o", "libsagnac.a", "-o", "from-cpp"]].concat(),
        folder,
    )?;
    stdout_of(60, text(&folder.join("from-cpp"))?, &[], folder)?;
    println!("check: C: every header in a C++ program, linked and run");
    Ok(())
}

/// Nothing but stdint.h, no 8-bit type, no floating point, no allocation.
fn no_other_types(folder: &Path) -> Result<()> {
    for name in MODULES.iter().chain(&["sagnac_unit.c"]).flat_map(|name| [(*name).to_owned(), name.replace(".c", ".h")])
    {
        let text = fs::read_to_string(folder.join(&name))?;
        for line in text.lines().filter(|line| line.starts_with("#include <")) {
            ensure!(line == "#include <stdint.h>", "{name}: {line}");
        }
        // Comments may contain the refused words.
        let mut code = text.clone();
        while let (Some(from), Some(to)) = (code.find("/*"), code.find("*/")) {
            code.replace_range(from..to + 2, "");
        }
        for word in code.split(|c: char| !c.is_alphanumeric() && c != '_') {
            let refused = ["int8_t", "uint8_t", "char", "short", "float", "double", "malloc", "free"];
            ensure!(!refused.contains(&word), "{name} uses {word}");
        }
    }
    println!("check: C: only stdint.h, no 8-bit type, no floating point, no allocation");
    Ok(())
}

/// Accepted findings of cppcheck's MISRA add-on: rule and count. docs/explanation/on-target.md gives the reasons.
const JUSTIFIED: [(&str, usize); 4] =
    [("misra-c2012-2.5", 7), ("misra-c2012-8.7", 2), ("misra-c2012-9.3", 2), ("misra-c2012-11.5", 1)];

fn misra(folder: &Path) -> Result<()> {
    let args = ["--addon=misra", "--enable=style,warning,portability", "--std=c99", "-q", "--template={id}"];
    let all = [&args[..], &MODULES, &["sagnac_unit.c"]].concat();
    let found = output(600, "cppcheck", &all, folder)?;
    ensure!(found.status.success(), "cppcheck: {}", found.status);
    let stderr = String::from_utf8_lossy(&found.stderr);
    let mut findings: Vec<&str> = stderr.lines().filter(|line| !line.trim().is_empty()).collect();
    findings.sort_unstable();
    let mut left = findings.clone();
    for (rule, times) in JUSTIFIED {
        let count = left.iter().filter(|id| **id == rule).count();
        ensure!(count == times, "cppcheck: {rule} {count} times, docs/explanation/on-target.md justifies {times}");
        left.retain(|id| *id != rule);
    }
    ensure!(left.is_empty(), "cppcheck: {left:?}");
    println!(
        "check: C: cppcheck with MISRA C:2012: {} findings, all justified in docs/explanation/on-target.md",
        findings.len()
    );
    Ok(())
}

/// The compiled constants equal the loaded ones.
fn constants(folder: &Path) -> Result<()> {
    let (unit_image, unit_loops) = (folder.join("unit.img"), folder.join("unit.loops"));
    fs::write(&unit_image, table("compensator-full")?)?;
    fs::write(&unit_loops, table("path-length-mirror")?)?;
    let source = root().join("firmware/c/check_constants.c");
    let program = folder.join("check-constants");
    let given = ["-DIMAGE=sagnac_image_x", "-I.", "sagnac_unit.c", text(&source)?, "-o", text(&program)?];
    stdout_of(300, "gcc", &[&STRICT[..], &given, &MODULES].concat(), folder)?;
    stdout_of(60, text(&program)?, &[text(&unit_image)?, text(&unit_loops)?], folder)?;
    println!("check: C: the constants of sagnac_unit.c are what the loaders read");
    Ok(())
}
