//! Files that the command line names: told apart by their first bytes, opened, and never an input and an output at once.

mod checked;
pub(crate) mod interrupt;
pub(crate) mod loading;
pub(crate) mod log_paths;
pub(crate) mod named;
pub(crate) mod pipe;

pub(crate) use checked::Files;
