//! The tests of `sagnac-log` in one program: one compilation and one link for all of them.

mod batches;
mod ingest;
