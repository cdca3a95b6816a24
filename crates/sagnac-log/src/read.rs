//! Small files in: whole, and no longer than what they can be.
//!
//! A setup, limits or a record have some kilobytes. A path may name anything, a device without an end too, and its length may say nothing.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// The text of a file of at most `most_bytes`; `what` it is to be, for messages.
///
/// # Errors
/// A file that cannot be opened or read, that is longer, or that is not UTF-8. A byte order mark at its beginning is not part of it.
pub fn read_text(path: &Path, what: &str, most_bytes: u64) -> Result<String> {
    let file = File::open(path).map_err(|e| Error::io_path(path, what, &e))?;
    let mut bytes = Vec::new();
    file.take(most_bytes + 1).read_to_end(&mut bytes).map_err(|e| Error::io_path(path, what, &e))?;
    let named = |error: Error| error.file(path.display().to_string());
    if bytes.len() as u64 > most_bytes {
        return Err(named(Error::input(
            format!("cannot {what}: the file is larger than {most_bytes} bytes"),
            "give the right file: this one is too large",
        )));
    }
    let text = String::from_utf8(bytes).map_err(|_| {
        named(Error::input(format!("cannot {what}: it is not UTF-8 text"), "give a text file, saved as UTF-8"))
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}
