//! What `xtask` and `lab` share: starting other programs, and where those come from.

pub mod debian;
pub mod shell;
