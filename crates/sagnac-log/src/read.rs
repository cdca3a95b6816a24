//! Files in: logs, setups, limits, records and keys are opened here, and small ones read whole, no longer than they can be.
//!
//! A setup, limits or a record have some kilobytes. A path may name anything, a device without an end too, and its length may say nothing.
//!
//! A program that asks for it ([`protect_inputs`]) never replaces a file that it opened as an input, whatever name, link or pattern led to it: the
//! file itself is compared, by device and number, once it is open. Systems without such numbers have no such protection.

use std::collections::HashSet;
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use crate::error::{Error, Result};

/// The text of a file of at most `most_bytes`; `what` it is to be, for messages.
///
/// # Errors
/// A file that cannot be opened or read, that is longer, or that is not UTF-8. A byte order mark at its beginning is not part of it.
pub fn read_text(path: &Path, what: &str, most_bytes: u64) -> Result<String> {
    text_of(open_input(path).map_err(|e| Error::io_path(path, what, &e))?, path, what, most_bytes)
}

/// The same of a file that the program wrote itself, and may replace.
///
/// # Errors
/// As [`read_text`].
pub fn read_own_text(path: &Path, what: &str, most_bytes: u64) -> Result<String> {
    text_of(File::open(path).map_err(|e| Error::io_path(path, what, &e))?, path, what, most_bytes)
}

fn text_of(file: File, path: &Path, what: &str, most_bytes: u64) -> Result<String> {
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

/// Device and number of each input; none while they are not protected.
static INPUTS: Mutex<Option<HashSet<[u64; 2]>>> = Mutex::new(None);

/// From now on this program replaces no file that it opened as an input, nor one that is its standard input.
pub fn protect_inputs() {
    let mut inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    inputs.get_or_insert_default().extend(standard_input().as_ref().and_then(identity));
}

#[cfg(unix)]
fn standard_input() -> Option<Metadata> {
    use std::os::fd::AsFd as _;
    let own = std::io::stdin().as_fd().try_clone_to_owned().ok()?;
    File::from(own).metadata().ok()
}

#[cfg(not(unix))]
fn standard_input() -> Option<Metadata> {
    None
}

/// Opens an input.
///
/// # Errors
/// As [`File::open`].
pub fn open_input(path: &Path) -> std::io::Result<File> {
    let file = File::open(path)?;
    if let Some(inputs) = INPUTS.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
        inputs.extend(file.metadata().ok().as_ref().and_then(identity));
    }
    Ok(file)
}

/// The file behind a path was opened as an input, and is protected.
pub(crate) fn is_input(path: &Path) -> bool {
    let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = |inputs: &HashSet<[u64; 2]>| {
        std::fs::metadata(path).ok().as_ref().and_then(identity).is_some_and(|it| inputs.contains(&it))
    };
    inputs.as_ref().is_some_and(known)
}

#[cfg(unix)]
fn identity(of: &Metadata) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt as _;
    of.is_file().then(|| [of.dev(), of.ino()])
}

#[cfg(not(unix))]
fn identity(_: &Metadata) -> Option<[u64; 2]> {
    None
}
