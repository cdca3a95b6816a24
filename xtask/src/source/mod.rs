//! The project's source as text: its packages, the modules of a crate, the paths in a file, the names of its types, and the words of its sentences.

#[cfg(test)]
mod book;
pub(crate) mod modules;
pub(crate) mod packages;
pub(crate) mod paths;
#[cfg(test)]
mod quoted;
#[cfg(test)]
mod types;
#[cfg(test)]
mod words;
