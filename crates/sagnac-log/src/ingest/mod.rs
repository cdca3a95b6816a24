//! Reads logs: from bytes to checked rows.
//!
//! ```text
//! Source (hash, gunzip, format) ─▶ ChunkReader (parsed in parallel: text, Parquet, Arrow, ULog) ─▶ Aligner
//!        (temperatures to the time of counts) ─▶ RowValidator (checked rows) ─▶ Batch
//! ```
//!
//! [`LogReader`] reads one file, batch by batch, and never holds the whole log. A file whose clock restarts while its running total
//! goes on can follow another one ([`LogReader::follow`]).

mod align;
#[cfg(feature = "parquet")]
mod arrow_file;
mod batch;
mod cells;
mod chunks;
#[cfg(feature = "parquet")]
mod column_values;
#[cfg(feature = "parquet")]
mod columnar;
mod counter;
mod expected;
mod feed;
mod foreign;
mod formats;
#[cfg(feature = "parquet")]
mod guard;
pub mod header;
mod interval;
mod iso;
mod live;
mod log_reader;
mod logs;
mod number;
#[cfg(feature = "parquet")]
mod parquet_file;
#[cfg(feature = "parquet")]
mod parquet_footer;
#[cfg(feature = "parquet")]
mod parquet_pages;
mod raw;
mod reason;
#[cfg(feature = "parquet")]
mod row_hash;
mod rows;
mod running_total;
mod sample;
mod shape;
mod sketch;
mod source;
mod table;
mod text;
mod text_head;
mod thermometer;
#[cfg(feature = "parquet")]
mod thrift;
#[cfg(feature = "ulog")]
mod ulog;

#[cfg(feature = "parquet")]
pub use crate::ingest::column_values::{column_numbers, column_times, time_text};
#[cfg(feature = "parquet")]
pub use crate::ingest::columnar::MemoryTable;
#[cfg(feature = "parquet")]
pub use crate::ingest::parquet_file::{ParquetRead, parquet_batches, parquet_schema};

pub use crate::ingest::batch::{Batch, Bridge};
pub use crate::ingest::feed::ReadMode;
pub use crate::ingest::formats::{FORMATS, Format};
pub use crate::ingest::header::{COMPENSATED_STAMP, Content, TableColumn, already_compensated, table_of_windows};
pub use crate::ingest::live::LiveHeader;
pub use crate::ingest::log_reader::{LogReader, LogSummary};
pub use crate::ingest::logs::Logs;
pub use crate::ingest::number::{parse_time_ns, parse_value};
pub use crate::ingest::reason::{Reason, Tallies, Tally};
pub use crate::ingest::rows::CounterEnd;
pub use crate::ingest::sample::{Sample, SampleColumn, sample, sample_reader};
pub(crate) use crate::ingest::shape::intervals_of;
pub use crate::ingest::shape::{AngleUnit, LogShape, same_shape};
pub use crate::ingest::sketch::{Sketches, share_rows};
pub use crate::ingest::source::{Watch, hex, sha256, sha256_of_file};
pub use crate::ingest::text::{fields_of, unquoted};
