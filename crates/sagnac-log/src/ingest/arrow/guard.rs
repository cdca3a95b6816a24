//! Decoders of other projects: their panics and errors as errors about the file.

use std::fs::File;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};

use arrow_schema::ArrowError;
use parquet::errors::ParquetError;

use crate::error::{Error, Result};

/// Runs a decoder; its panic becomes an error about the file.
pub(super) fn guarded<T>(decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err(Error::damaged("file (its decoder gave up)")))
}

pub(super) fn broken(what: &str, error: &dyn std::fmt::Display) -> Error {
    Error::damaged(format!("{what}: {error}"))
}

/// An error of Arrow's decoder, or one of our own in it.
pub(super) fn unread(what: &str, error: ArrowError) -> Error {
    match error {
        ArrowError::ExternalError(error) => own_or_broken(what, error),
        error => broken(what, &error),
    }
}

/// The same of Parquet's decoder.
pub(super) fn parquet_broken(error: ParquetError) -> Error {
    match error {
        ParquetError::External(error) => own_or_broken("Parquet file", error),
        error => broken("Parquet file", &error),
    }
}

fn own_or_broken(what: &str, error: Box<dyn std::error::Error + Send + Sync>) -> Error {
    error.downcast::<Error>().map_or_else(|other| broken(what, &other), |own| *own)
}

pub(super) fn clone_of(file: &File) -> Result<File> {
    file.try_clone().map_err(|e| Error::cannot("read", &e))
}

/// True where an unpacking reader has more bytes than were announced. A damaged one has not: its decoder reports it.
pub(super) fn is_longer(unpacking: impl Read, announced: u64) -> bool {
    let most = announced.saturating_add(1);
    std::io::copy(&mut unpacking.take(most), &mut std::io::sink()).is_ok_and(|length| length == most)
}
