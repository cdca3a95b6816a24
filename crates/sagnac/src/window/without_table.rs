//! The window table in a program that was built without Parquet: refused, or not recognised.

use std::io::Write;
use std::path::Path;

use sagnac_log::error::{Error, Result};
use sagnac_log::memory::MemoryBudget;
use sagnac_log::setup::Setup;

use crate::window::windows::Windows;

/// False: the reader of logs refuses any Parquet file.
///
/// # Errors
/// None.
pub fn is_table(_: &Path) -> Result<bool> {
    Ok(false)
}

/// As with Parquet.
///
/// # Errors
/// Always.
pub fn read_table(path: &Path, _: MemoryBudget) -> Result<(Windows, Setup)> {
    Err(Error::without("Parquet").file(path.display().to_string()))
}

/// As with Parquet.
///
/// # Errors
/// Always.
pub fn write_table(_: &Windows, _: &Setup, _: impl Write + Send) -> Result<()> {
    Err(Error::without("Parquet"))
}

/// As with Parquet, which names its columns.
///
/// # Errors
/// Always.
pub fn write_table_csv(_: &Windows, _: &Setup, _: &mut dyn Write) -> Result<()> {
    Err(Error::without("Parquet"))
}
