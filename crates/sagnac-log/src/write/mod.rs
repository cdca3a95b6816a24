//! Writes files atomically: complete or not at all.

#[cfg_attr(not(feature = "parquet"), path = "without_parquet.rs")]
mod parquet_rows;
mod rows;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::read::is_input;
pub use parquet_rows::ParquetRows;
#[cfg(feature = "parquet")]
pub use parquet_rows::{CellColumns, ParquetBatches, parquet_properties};
pub use rows::write_rows;

/// Temporary files that are being written.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Names of temporary files begin so.
const PREFIX: &str = ".sagnac-";

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the unfinished files of all threads, for a program that is about to stop. The files that they would replace
/// stay unchanged, and no new one can be started afterwards.
pub fn remove_unfinished() {
    let mut unfinished = unfinished();
    for path in unfinished.drain(..) {
        // It may have become the result a moment ago.
        let _ = std::fs::remove_file(path);
    }
    // A thread that starts another file waits until the program ends.
    std::mem::forget(unfinished);
}

/// Removes what programs that were killed began to write into a folder. Only for a folder that no other program writes into.
///
/// # Errors
/// A folder that cannot be read, a file that cannot be removed.
pub fn remove_abandoned(folder: &Path) -> Result<()> {
    let failed = |e: std::io::Error| Error::io_path(folder, "clear", &e);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            std::fs::remove_file(entry.path()).map_err(failed)?;
        }
    }
    Ok(())
}

/// A temporary file that is known as long as it is unfinished.
struct Unfinished(PathBuf);

impl Unfinished {
    /// A new one in the folder of its target, known from the moment it is there. It is as readable as the file that it replaces, and
    /// otherwise as any new file of this user (umask).
    fn create(folder: &Path, target: &Path) -> std::io::Result<(tempfile::NamedTempFile, Self)> {
        let mut unfinished = unfinished();
        let mut builder = tempfile::Builder::new();
        let file = with_mode(builder.prefix(PREFIX), target).tempfile_in(folder)?;
        unfinished.push(file.path().to_owned());
        let known = Self(file.path().to_owned());
        Ok((file, known))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        unfinished().retain(|path| *path != self.0);
    }
}

/// Writes a file atomically: temporary file next to it, fsync, rename. Even after a failure the path holds
/// the old file or the new one. A symbolic link is followed; a device or pipe is written to directly.
///
/// # Errors
/// The error of `fill`, or one of the file system with the path.
pub fn write_atomically(path: &Path, fill: impl FnOnce(&mut (dyn Write + Send)) -> Result<()>) -> Result<()> {
    let failed = |e: &std::io::Error| Error::io_path(path, "write", e);
    refuse_no_file(path)?;
    if let Some(mut out) = standard_stream(path) {
        fill(&mut *out)?;
        return out.flush().map_err(|e| failed(&e));
    }
    if is_device(path) {
        // A device or a pipe is written to, never replaced.
        let mut out = std::fs::OpenOptions::new().write(true).open(path).map_err(|e| failed(&e))?;
        fill(&mut out)?;
        return out.flush().map_err(|e| failed(&e));
    }
    Whole::new(path, fill)?.put()
}

/// Writes several files, and removes those without bytes: all of them are whole before the first replaces what was there. A failure before
/// that, such as a full disk, leaves everything as it was.
///
/// # Errors
/// As [`write_atomically`]; a file that cannot be removed; a device or a pipe, which no file replaces.
pub fn write_together(files: &[(&Path, Option<&[u8]>)]) -> Result<()> {
    if let Some((device, _)) = files.iter().find(|(path, _)| is_device(path)) {
        return Err(Error::input(
            "a device or a pipe has the name of a file to write",
            "remove it, or give another name",
        )
        .file(device.display().to_string()));
    }
    let whole = |path: &Path, bytes: &[u8]| {
        refuse_no_file(path)?;
        Whole::new(path, |out| out.write_all(bytes).map_err(|e| Error::io_path(path, "write", &e)))
    };
    let new = files.iter().map(|(path, bytes)| bytes.map(|bytes| whole(path, bytes)).transpose());
    let new: Vec<Option<Whole>> = new.collect::<Result<_>>()?;
    for ((path, _), new) in files.iter().zip(new) {
        match new {
            Some(new) => new.put()?,
            None => match std::fs::remove_file(path) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io_path(path, "remove", &e)),
                _ => {}
            },
        }
    }
    Ok(())
}

/// A file that is whole on the disk, under another name than its own.
struct Whole {
    path: PathBuf,
    folder: PathBuf,
    file: tempfile::NamedTempFile,
    known: Unfinished,
}

impl Whole {
    fn new(path: &Path, fill: impl FnOnce(&mut (dyn Write + Send)) -> Result<()>) -> Result<Self> {
        let (path, folder) = target_of(path)?;
        let failed = |e: &std::io::Error| Error::io_path(&path, "write", e);
        let (file, known) = Unfinished::create(&folder, &path).map_err(|e| failed(&plain(&e)))?;
        // The file itself, not its handle, whose errors would name the temporary path.
        let mut out = std::io::BufWriter::new(file.as_file());
        let named = |e: Error| if e.what.starts_with("cannot write") { e.file(path.display().to_string()) } else { e };
        fill(&mut out).map_err(named)?;
        out.flush().map_err(|e| failed(&e))?;
        drop(out);
        keep_mode(file.as_file(), &path).map_err(|e| failed(&e))?;
        file.as_file().sync_all().map_err(|e| failed(&e))?;
        if is_input(&path) {
            return Err(
                Error::input("the command reads this file", "write to another file").file(path.display().to_string())
            );
        }
        Ok(Self { path, folder, file, known })
    }

    /// Under its own name.
    fn put(self) -> Result<()> {
        let Self { path, folder, file, known } = self;
        file.persist(&path).map_err(|e| Error::io_path(&path, "write", &e.error))?;
        drop(known);
        if let Ok(folder) = std::fs::File::open(folder) {
            // Makes the rename itself durable where the system can.
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// Tries whether a file can be written, before the work that fills it: its folder is there and takes a file. A file that is there keeps its
/// bytes; a device or a pipe is not touched.
///
/// # Errors
/// As [`write_atomically`].
pub fn try_writing(path: &Path) -> Result<()> {
    refuse_no_file(path)?;
    if standard_stream(path).is_some() || is_device(path) {
        return Ok(());
    }
    let (path, folder) = target_of(path)?;
    Unfinished::create(&folder, &path).map(drop).map_err(|e| Error::io_path(&path, "write", &plain(&e)))
}

fn refuse_no_file(path: &Path) -> Result<()> {
    if path.as_os_str() == "-" {
        return Err(Error::input(
            "`-` is not a file name",
            "remove -o to write to standard output, or give a file name",
        )
        .column("-o"));
    }
    if path.is_dir() {
        return Err(Error::input("this is a folder, and the output is a file", "give the name of a file in it")
            .file(path.display().to_string()));
    }
    Ok(())
}

/// A device or a pipe is written to, never replaced.
fn is_device(path: &Path) -> bool {
    path.exists() && !path.is_file()
}

/// The file that is written, behind a symbolic link, and its folder.
fn target_of(path: &Path) -> Result<(PathBuf, PathBuf)> {
    let behind = path.is_symlink().then(|| path.canonicalize()).transpose();
    let target = behind.map_err(|e| Error::io_path(path, "write", &e))?.unwrap_or_else(|| path.to_owned());
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
    if !folder.is_dir() {
        let what = format!("cannot write: the folder {} does not exist", folder.display());
        return Err(Error::input(what, format!("make it first: mkdir -p {}", folder.display()))
            .file(target.display().to_string()));
    }
    Ok((target, folder))
}

/// The system's error without the name of the temporary file, which means nothing to a user.
fn plain(error: &std::io::Error) -> std::io::Error {
    error.kind().into()
}

/// Writes bytes atomically.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |out| out.write_all(bytes).map_err(|e| Error::io_path(path, "write", &e)))
}

/// This process' own standard output or error under one of its names. It is written to where it stands: a file that the shell appends to
/// would otherwise be replaced, or written over from its beginning.
fn standard_stream(path: &Path) -> Option<Box<dyn Write + Send>> {
    let is = |names: [&str; 3]| names.iter().any(|name| path == Path::new(name));
    if is(["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"]) {
        return Some(Box::new(std::io::stdout()));
    }
    is(["/dev/stderr", "/dev/fd/2", "/proc/self/fd/2"]).then(|| Box::new(std::io::stderr()) as Box<dyn Write + Send>)
}

/// The permissions of the file that is replaced, or those of a new file, from which the system takes the umask.
#[cfg(unix)]
fn with_mode<'a, 'b, 'c>(
    builder: &'a mut tempfile::Builder<'b, 'c>,
    target: &Path,
) -> &'a mut tempfile::Builder<'b, 'c> {
    use std::os::unix::fs::PermissionsExt;
    let before = std::fs::metadata(target).map(|metadata| metadata.permissions().mode() & 0o777);
    builder.permissions(std::fs::Permissions::from_mode(before.unwrap_or(0o666)))
}

#[cfg(not(unix))]
fn with_mode<'a, 'b, 'c>(builder: &'a mut tempfile::Builder<'b, 'c>, _: &Path) -> &'a mut tempfile::Builder<'b, 'c> {
    builder
}

/// A file that is replaced keeps the permissions that it had, also those that the umask would take.
#[cfg(unix)]
fn keep_mode(file: &std::fs::File, target: &Path) -> std::io::Result<()> {
    std::fs::metadata(target).map_or(Ok(()), |metadata| file.set_permissions(metadata.permissions()))
}

#[cfg(not(unix))]
fn keep_mode(_: &std::fs::File, _: &Path) -> std::io::Result<()> {
    Ok(())
}
