//! Tests that measure on many records.

mod noise;
