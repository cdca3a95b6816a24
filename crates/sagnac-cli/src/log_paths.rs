//! A folder or a pattern in place of logs: the files that it means, in natural order (run-2 before run-10).

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use sagnac::{Error, Result};
use sagnac_units::format::file_name;

use crate::console::Console;

/// Endings of logs, each also with .gz behind it.
const ENDINGS: [&str; 6] = ["csv", "tsv", "parquet", "arrow", "feather", "ulg"];

/// The files that some arguments mean. A folder stands for the logs in it, a pattern (`runs/*.csv`) for what matches; anything else is one file.
/// What a folder or a pattern stands for is said on standard error.
pub(crate) fn expanded(paths: &[PathBuf], console: &mut Console) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        let found = if path.is_dir() {
            folder(path)?
        } else if is_pattern(path) {
            matches(path)?
        } else {
            all.push(path.clone());
            continue;
        };
        console.note(said(path, &found));
        all.extend(found);
    }
    Ok(all)
}

/// One line: how many, and the first and the last of them.
fn said(of: &Path, found: &[PathBuf]) -> String {
    let name = |path: &PathBuf| file_name(&path.display().to_string());
    match found {
        [one] => format!("{}: 1 log, {}", of.display(), name(one)),
        [first, .., last] => format!("{}: {} logs, {} … {}", of.display(), found.len(), name(first), name(last)),
        [] => String::new(),
    }
}

/// A name with the signs of a pattern that is no file by itself.
fn is_pattern(path: &Path) -> bool {
    !path.exists() && path.to_str().is_some_and(|text| text.contains(['*', '?', '[']))
}

/// True for the name of a log, packed or not; false for a hidden file.
fn is_log(path: &Path) -> bool {
    let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    !name.starts_with('.') && ENDINGS.iter().any(|ending| name.ends_with(&format!(".{ending}")))
}

fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e: std::io::Error| Error::io_path(path, "read", &e);
    let mut logs = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        if file.is_file() && is_log(&file) {
            logs.push(file);
        }
    }
    if logs.is_empty() {
        return Err(Error::input("no log in this folder").file(path.display().to_string()).help(format!(
            "the names of logs end in {}; name others one by one",
            Error::choices(&ENDINGS.map(str::to_owned))
        )));
    }
    in_order(&mut logs);
    Ok(logs)
}

fn matches(pattern: &Path) -> Result<Vec<PathBuf>> {
    let text = pattern.to_str().unwrap_or_default();
    let refused = |what: String| Error::input(what).file(text);
    let found = glob::glob(text).map_err(|e| refused(format!("not a pattern of names: {e}")))?;
    let mut logs: Vec<PathBuf> = found.filter_map(std::result::Result::ok).filter(|path| path.is_file()).collect();
    if logs.is_empty() {
        return Err(refused("no file matches this pattern".to_owned()));
    }
    in_order(&mut logs);
    Ok(logs)
}

fn in_order(logs: &mut [PathBuf]) {
    alphanumeric_sort::sort_path_slice(logs);
}
