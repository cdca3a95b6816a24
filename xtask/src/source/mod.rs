//! The project's source as text: its packages, the modules of a crate, and the paths in a file.

pub(crate) mod modules;
pub(crate) mod packages;
pub(crate) mod paths;
