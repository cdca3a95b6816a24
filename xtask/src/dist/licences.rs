//! The licences of all libraries that are compiled into the program.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, stdout_of};

/// A library in the program: name, version, licence, folder of its source.
struct Library {
    name: String,
    licence: String,
    source: PathBuf,
}

/// Names and licences of the libraries, then each licence text once, with the libraries that it belongs to.
pub(super) fn third_parties() -> Result<String> {
    let libraries = libraries()?;
    let mut out = String::from("Sagnac is compiled together with the libraries below. Their licences follow.\n\n");
    let mut texts: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for library in &libraries {
        out += &format!("{}: {}\n", library.name, library.licence);
        for text in texts_of(&library.source)? {
            texts.entry(text).or_default().insert(library.name.clone());
        }
    }
    let plot = root().join("crates/sagnac-report/src/vendor/uplot/LICENSE");
    out += "uPlot (in reports): MIT\n";
    texts.entry(fs::read_to_string(plot)?).or_default().insert("uPlot".to_owned());
    for (text, names) in texts {
        let names: Vec<String> = names.into_iter().collect();
        out += &format!("\n{}\n{}\n\n{}\n", "-".repeat(80), names.join(", "), text.trim());
    }
    Ok(out)
}

/// The libraries that cargo compiles into the program, except ours.
fn libraries() -> Result<Vec<Library>> {
    let args = ["tree", "--locked", "--package", "sagnac-cli", "--edges", "normal", "--prefix", "none"];
    let stdout = stdout_of(120, "cargo", &[&args[..], &["--format", "{p}|{l}"]].concat(), &root())?;
    let lines: BTreeSet<&str> = stdout.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    let mut libraries = Vec::new();
    for line in lines {
        let (package, licence) = line.split_once('|').with_context(|| format!("a line of cargo tree: {line}"))?;
        // Ours, and procedural macros, whose code is not in the program.
        if package.contains(" (/") || package.contains("(proc-macro)") {
            continue;
        }
        let (name, version) = package.split_once(" v").with_context(|| format!("a package without version: {line}"))?;
        let (name, licence) = (format!("{name} {version}"), licence.to_owned());
        libraries.push(Library { source: source_of(&name)?, name, licence });
    }
    ensure!(libraries.len() > 50, "only {} libraries", libraries.len());
    Ok(libraries)
}

/// The folder to which cargo unpacked a library.
fn source_of(name: &str) -> Result<PathBuf> {
    let home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| home + "/.cargo"))?;
    let folder = name.replace(' ', "-");
    let registries = fs::read_dir(Path::new(&home).join("registry/src"))?;
    let mut found = registries.flatten().map(|registry| registry.path().join(&folder));
    found.find(|path| path.is_dir()).with_context(|| format!("the source of {name} is not in {home}"))
}

/// The licence texts of a package; some packages only name their licence.
fn texts_of(source: &Path) -> Result<Vec<String>> {
    let mut texts = Vec::new();
    for entry in fs::read_dir(source)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
        let is_text =
            ["LICEN", "COPYING", "NOTICE", "UNLICENSE", "COPYRIGHT"].iter().any(|start| name.starts_with(start));
        if is_text && path.is_file() {
            texts.push(String::from_utf8_lossy(&fs::read(&path)?).replace("\r\n", "\n").trim().to_owned());
        }
    }
    texts.sort();
    Ok(texts)
}
