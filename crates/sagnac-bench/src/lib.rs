//! The live bench: a thermal test recorded as it runs, shown, warned of, and ended when enough is known.
//!
//! ```text
//! sources ─▶ recorder ─▶ journal ─┬▶ rows ─▶ windows, noise, warnings ─▶ fit so far, limits, hours to go ─▶ page, terminal
//!                                 └▶ at the end: rows ─▶ Parquet, the log of the test ─▶ calibration, report
//! ```
//!
//! The journal is the recording; everything else is made from it ([`journal`]). So what is shown live, what a resumed recording shows and what the
//! finished log holds are the same rows.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod decode;
pub mod journal;
pub mod live;
#[cfg(feature = "page")]
pub mod page;
mod record;
mod rows;
pub mod serial_line;
mod session;
pub mod source;
mod start;

pub use record::{Published, SourceState, SourceStatus, Sources};
pub use rows::{Finished, JournalRows, finish};
pub use session::{Session, journal_of};
pub use start::Start;
