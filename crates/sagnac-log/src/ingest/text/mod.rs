//! Delimited text: its head, and its lines as rows.

mod expected;
pub(crate) mod head;
pub(crate) mod lines;
pub(crate) mod live_header;
mod plain;
