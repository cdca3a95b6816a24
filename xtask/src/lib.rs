//! Shared by `xtask`, `lab` and the tests: running other programs, finding their packages, saying what is missing.

pub mod debian;
pub mod shell;
pub mod skip;
