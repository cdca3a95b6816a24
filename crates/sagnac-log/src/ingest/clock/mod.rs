//! The clock of a log: when each of its rows was sampled, from the stamps that it has.
//!
//! ```text
//! first rows ─▶ interval, and whether each row has a stamp of its own ─▶ StampReading
//! every piece ─▶ wraps and restarts (unbroken) ─▶ even rows behind shared or rounded stamps (even) ─▶ times of rows
//! ```
//!
//! | stamps | reading |
//! |---|---|
//! | one per row, regular but for lost rows | as they are |
//! | shared by packets of rows, or rounded to steps as coarse as a row | even rows |
//! | of 32 bits that wrap | the next turn of the counter |
//! | that start again | a run of its own |
//! | in bursts | two are possible: refused, unless `sample_interval_s` decides |
//!
//! Fails on rows that are sampled unevenly and share stamps: their times are lost.

pub(crate) mod even;
pub(crate) mod interval;
pub(crate) mod reading;
pub(crate) mod unbroken;
