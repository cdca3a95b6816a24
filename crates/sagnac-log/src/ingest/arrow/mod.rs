//! Parquet and Arrow: files that are checked before their decoders see them, and tables in memory.

mod columnar;
mod guard;
mod ipc;
mod parquet_file;
mod parquet_footer;
mod parquet_pages;
mod row_hash;
mod thrift;
mod values;

pub use columnar::MemoryTable;
pub use parquet_file::{ParquetRead, parquet_batches, parquet_schema};
pub use values::{column_numbers, column_times, time_text};

use crate::error::Result;
use crate::ingest::arrow::columnar::Columnar;
use crate::ingest::bytes::source::{HashHandle, Source};
use crate::ingest::columns::feed::{Open, Opened, Purpose, ReadMode};
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::names;
use crate::setup::Setup;

pub(crate) const OPEN: Option<Open> = Some(open);

fn open(source: Source, setup: &Setup, purpose: Purpose) -> Result<Opened> {
    let columnar = columnar::open(source, setup.memory)?;
    match purpose {
        Purpose::Rows(mode) => opened(columnar, setup, mode),
        Purpose::Preview => {
            // Only a time of Arrow's own type has a role: so it becomes text as a date, or in seconds.
            let layout = Layout { headers: columnar.headers.clone(), time: columnar.own_time(), ..Layout::default() };
            Ok(Opened::new(Box::new(columnar.feed(&layout, purpose.mode())?), layout))
        }
    }
}

/// A table in memory.
pub(crate) fn open_table(table: MemoryTable, hash: HashHandle, setup: &Setup, mode: ReadMode) -> Result<Opened> {
    opened(columnar::of_table(table, hash, setup.memory), setup, mode)
}

fn opened(columnar: Columnar, setup: &Setup, mode: ReadMode) -> Result<Opened> {
    let (columns, said) = names::mapped(&columnar.headers, &[], &[], &setup.columns);
    let assumed = if said.is_empty() { Vec::new() } else { vec![format!("read as: {}", said.join(", "))] };
    let layout = Layout::new(columnar.headers.clone(), &columns, setup.axis)?;
    Ok(Opened { assumed, ..Opened::new(Box::new(columnar.feed(&layout, mode)?), layout) })
}
