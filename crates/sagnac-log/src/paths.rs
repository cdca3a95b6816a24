//! A folder or a pattern instead of logs: the files that it means, in natural order (run-2 before run-10).

use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};

/// What makes a name a pattern.
const SIGNS: [char; 3] = ['*', '?', '['];
/// Endings of logs, each also with .gz behind it.
const ENDINGS: [&str; 6] = ["csv", "tsv", "parquet", "arrow", "feather", "ulg"];

/// A sign of a pattern stands for a part of one name; hidden files are passed over.
const AS_FILES: glob::MatchOptions =
    glob::MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };

/// The logs that a path means: those of a folder, or what a pattern (`runs/*.csv`) matches; `None` for any other path, which is one file.
///
/// # Errors
/// A folder without a log or that cannot be read, a pattern that matches nothing.
pub fn logs_of(path: &Path) -> Result<Option<Vec<PathBuf>>> {
    match path {
        path if path.is_dir() => folder(path).map(Some),
        path if is_pattern(path) => matches(path).map(Some),
        _ => Ok(None),
    }
}

/// The folders in a folder, in natural order; hidden ones are passed over.
///
/// # Errors
/// A folder that cannot be read.
pub fn folders_in(path: &Path) -> Result<Vec<PathBuf>> {
    let mut all = entries(path)?;
    all.retain(|entry| entry.is_dir() && !is_hidden(entry));
    in_order(&mut all);
    Ok(all)
}

/// The files in a folder, in natural order; hidden ones are passed over.
///
/// # Errors
/// A folder that cannot be read.
pub fn files_in(path: &Path) -> Result<Vec<PathBuf>> {
    let mut all = entries(path)?;
    all.retain(|entry| is_file(entry) && !is_hidden(entry));
    in_order(&mut all);
    Ok(all)
}

/// Those of some names that are logs by their endings, in natural order: for stores whose files are not this machine's.
pub fn logs_among(mut names: Vec<PathBuf>) -> Vec<PathBuf> {
    names.retain(|name| is_log(name));
    in_order(&mut names);
    names
}

/// Those of some names that a pattern matches, in natural order.
///
/// # Errors
/// Not a pattern; no name that it matches.
pub fn matches_among(pattern: &str, mut names: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let refused = |what: String| {
        Error::input(what, "give an existing file, or a pattern such as 'run-*.csv' in quotes").file(pattern)
    };
    let matcher = glob::Pattern::new(&pattern.replace("[^", "[!"))
        .map_err(|e| refused(format!("not a pattern of names: {e}")))?;
    // As on a file system: a sign stands for a part of one name, and hidden ones are passed over.
    names.retain(|name| matcher.matches_path_with(name, AS_FILES));
    if names.is_empty() {
        return Err(refused("no file matches this pattern".to_owned()));
    }
    in_order(&mut names);
    Ok(names)
}

/// A name with the signs of a pattern that is no file by itself.
fn is_pattern(path: &Path) -> bool {
    !path.exists() && path.to_str().is_some_and(|text| text.contains(SIGNS))
}

/// A file, or a link to one that is away: that cannot be read, and it is meant all the same.
fn is_file(path: &Path) -> bool {
    path.is_file() || path.is_symlink() && !path.exists()
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

/// True for the name of a log, packed or not; false for a hidden file.
fn is_log(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    !is_hidden(path) && ENDINGS.iter().any(|ending| name.ends_with(&format!(".{ending}")))
}

fn entries(path: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e: std::io::Error| Error::io_path(path, "read", &e);
    let entries = std::fs::read_dir(path).map_err(failed)?;
    entries.map(|entry| entry.map(|entry| entry.path()).map_err(failed)).collect()
}

fn folder(path: &Path) -> Result<Vec<PathBuf>> {
    let mut logs = entries(path)?;
    logs.retain(|file| is_file(file) && is_log(file));
    if logs.is_empty() {
        return Err(Error::input(
            "the folder contains no log",
            format!("give files by name, or rename them: logs end in {}", Error::choices(&ENDINGS.map(str::to_owned))),
        )
        .file(path.display().to_string()));
    }
    in_order(&mut logs);
    Ok(logs)
}

fn matches(pattern: &Path) -> Result<Vec<PathBuf>> {
    let refused = |what: String| {
        Error::input(what, "give an existing file, or a pattern such as 'run-*.csv' in quotes")
            .file(pattern.display().to_string())
    };
    let mut found = vec![PathBuf::new()];
    for part in pattern.components() {
        found = match part.as_os_str().to_str() {
            Some("**") => found.iter().flat_map(|folder| with_all_below(folder)).collect(),
            Some(signs) if matches!(part, Component::Normal(_)) && signs.contains(SIGNS) => {
                let matcher = glob::Pattern::new(&signs.replace("[^", "[!"))
                    .map_err(|e| refused(format!("not a pattern of names: {e}")))?;
                found.iter().flat_map(|folder| named(folder, &matcher)).collect()
            }
            _ => found.into_iter().map(|folder| folder.join(part)).collect(),
        };
    }
    found.retain(|path| is_file(path));
    if found.is_empty() {
        return Err(refused("no file matches this pattern".to_owned()));
    }
    in_order(&mut found);
    Ok(found)
}

/// A folder and all below it, without links and hidden ones.
fn with_all_below(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![folder.to_owned()];
    let mut at = 0;
    while let Some(above) = all.get(at).cloned() {
        let place = if above.as_os_str().is_empty() { Path::new(".") } else { &above };
        let entries = std::fs::read_dir(place).into_iter().flatten().flatten();
        let folders = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
        all.extend(folders.map(|entry| above.join(entry.file_name())).filter(|path| !is_hidden(path)));
        at += 1;
    }
    all
}

/// What stands in a folder under a name that matches. A folder that cannot be read has nothing; a sign of the pattern also stands for bytes of a
/// name that are no text.
fn named(folder: &Path, matcher: &glob::Pattern) -> Vec<PathBuf> {
    let place = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(place).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name());
    names.filter(|name| matcher.matches_with(&name.to_string_lossy(), AS_FILES)).map(|name| folder.join(name)).collect()
}

/// Puts paths into natural order.
pub fn in_order(paths: &mut [PathBuf]) {
    alphanumeric_sort::sort_path_slice(paths);
}
