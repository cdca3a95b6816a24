//! Parquet and Arrow: files that are checked before their decoders see them, and tables in memory.

pub(crate) mod columnar;
mod guard;
mod ipc;
pub(crate) mod parquet_file;
mod parquet_footer;
mod parquet_pages;
mod row_hash;
mod thrift;
pub(crate) mod values;
