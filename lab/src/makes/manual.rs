//! The manual, as the program prints it.

use anyhow::Result;

use crate::made::Made;
use crate::places::MANUAL;
use crate::program::Program;

pub(crate) fn make(program: &Program) -> Result<Vec<Made>> {
    Ok(vec![Made::new(MANUAL, program.stdout(&["manual", "markdown"])?)])
}
