//! Tests that measure on many records: `support/evidence.rs` says how many each program makes.

pub(crate) mod fit;
pub(crate) mod verify;
