//! What a verb of the command line is to the program.

use std::path::PathBuf;

use crate::output::console::{Console, Ran};

/// The arguments of a verb, and its work.
pub(crate) trait Verb {
    /// True where one JSON object goes to standard output.
    fn json(&self) -> bool {
        false
    }

    /// The arguments that are logs: a folder or a pattern stands for the logs in it.
    fn logs(&mut self) -> Option<&mut Vec<PathBuf>> {
        None
    }

    fn run(&self, console: &mut Console) -> Ran;
}
