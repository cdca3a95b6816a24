//! The tests of `sagnac-sim` in one program: one compilation and one link for all of them.

mod gyros;
mod laws;
mod loops;
mod noise;
mod scenarios;
