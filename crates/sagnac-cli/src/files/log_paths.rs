//! A folder or a pattern instead of logs, and one line of what it stands for.

use std::path::{Path, PathBuf};

use sagnac::Result;
use sagnac_log::paths::logs_of;
use sagnac_units::format::file_name;

use crate::output::console::Console;

/// The files that some arguments mean. What a folder or a pattern stands for is said on standard error.
pub(crate) fn expanded(paths: &[PathBuf], console: &mut Console) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        match logs_of(path)? {
            Some(logs) => {
                console.note(said(path, &logs));
                all.extend(logs);
            }
            None => all.push(path.clone()),
        }
    }
    Ok(all)
}

/// One line: how many, and the first and the last of them.
fn said(place: &Path, logs: &[PathBuf]) -> String {
    let name = |path: &PathBuf| file_name(&path.display().to_string());
    match logs {
        [one] => format!("{}: 1 log, {}", place.display(), name(one)),
        [first, .., last] => format!("{}: {} logs, {} … {}", place.display(), logs.len(), name(first), name(last)),
        [] => String::new(),
    }
}
