//! Reads logs: from bytes to checked rows.
//!
//! ```text
//! bytes                 Source: hash, gunzip, first bytes
//! columns               headers by role, numbers, times; RawRows: parsed, not judged; Feed: what the reader of a format gives
//! text, arrow, ulog     one format each ─▶ a Feed of pieces            formats: which of them has which first bytes
//! pieces                parsed on all threads, in order
//! checks                Aligner: temperatures to the time of counts ─▶ RowValidator ─▶ Batch
//! log_reader, logs, preview
//! ```
//!
//! A room names only those above it. Checks know no format, and a format knows no other.
//!
//! [`LogReader`] reads one file, batch by batch, and never holds the whole log. A file whose clock restarts while its running total
//! goes on can follow another one ([`LogReader::follow`]).

#[cfg_attr(not(feature = "parquet"), path = "without.rs")]
mod arrow;
mod bytes;
mod checks;
mod clock;
mod columns;
mod formats;
mod log_reader;
mod logs;
mod pieces;
mod preview;
mod text;
#[cfg_attr(not(feature = "ulog"), path = "without.rs")]
mod ulog;

#[cfg(feature = "parquet")]
pub use crate::ingest::arrow::{
    MemoryTable, ParquetRead, column_numbers, column_times, parquet_batches, parquet_schema, time_text,
};

pub use crate::ingest::bytes::source::{Watch, hex, sha256, sha256_of_file};
pub use crate::ingest::checks::batch::{AsRead, Batch, Bridge};
pub use crate::ingest::checks::full_scale::Clipped;
pub use crate::ingest::checks::reason::{Reason, Tallies, Tally};
pub use crate::ingest::checks::rows::CounterEnd;
pub use crate::ingest::checks::sketch::{Sketches, share_rows};
pub use crate::ingest::columns::feed::ReadMode;
pub use crate::ingest::columns::header::{
    self, COMPENSATED_STAMP, Content, TableColumn, already_compensated, table_of_windows,
};
pub use crate::ingest::columns::log_shape::{AngleUnit, LogShape, same_shape};
pub use crate::ingest::columns::names;
pub use crate::ingest::columns::number::{parse_time_ns, parse_value};
pub use crate::ingest::log_reader::{LogReader, LogSummary};
pub use crate::ingest::logs::Logs;
pub use crate::ingest::preview::{Sample, SampleColumn, sample, sample_reader};
pub use crate::ingest::text::lines::{fields_of, unquoted};
pub use crate::ingest::text::live_header::LiveHeader;
