//! A whole table in one file: CSV, or Parquet for a name in .parquet.

use std::path::Path;

use crate::error::{Error, Result};
use crate::ingest::Content;
use crate::write::{ParquetRows, write_atomically};

/// Writes rows of text cells under their columns; an empty cell is no value.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_rows<C: AsRef<[u8]>>(
    path: &Path,
    columns: Vec<(String, Content)>,
    rows: impl Iterator<Item = Vec<C>>,
) -> Result<()> {
    let is_parquet = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"));
    let failed = |e: csv::Error| Error::io_path(path, "write", &e.into());
    write_atomically(path, |out| {
        if is_parquet {
            let mut table = ParquetRows::new(out, columns, None, false)?;
            for row in rows {
                table.row(&row)?;
            }
            return table.finish();
        }
        let mut table = csv::Writer::from_writer(out);
        table.write_record(columns.iter().map(|(name, _)| name)).map_err(failed)?;
        for row in rows {
            table.write_record(&row).map_err(failed)?;
        }
        table.flush().map_err(|e| Error::io_path(path, "write", &e))
    })
}
