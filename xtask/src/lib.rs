//! What `xtask` and `lab` share: starting other programs.

pub mod shell;
