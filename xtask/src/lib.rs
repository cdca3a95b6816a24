//! Shared by `xtask` and `lab`: running other programs and finding their packages.

pub mod debian;
pub mod shell;
