//! Logs of gyroscope tests, in and out.
//!
//! ```text
//! bench.toml ─▶ Setup ─┐
//! log file ────────────┴▶ ingest::LogReader (rows read, checked, counted) ─▶ batches of columns in SI names
//! results ─▶ write (complete or not at all)
//! ```
//!
//! [`setup`] holds the facts that a log does not contain. [`ingest`] streams CSV, Parquet, Arrow and PX4 logs in batches and
//! counts each rejected row with its reason, within a [`memory`] budget and on [`threads`] of a stated stack. [`read`] takes small files whole, [`paths`] finds logs in folders. [`mod@write`] replaces files atomically. An [`error`] states what was wrong, where
//! and what to do.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod error;
pub mod ingest;
pub mod memory;
pub mod paths;
pub mod read;
pub mod setup;
pub mod threads;
pub mod write;

pub use error::{Error, ErrorKind, Place, Result};
pub use memory::MemoryBudget;
pub use setup::Setup;
