//! The program under study: `sagnac`, built with the lab in one go (xtask does that) and standing beside it.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

/// Where it is.
pub(crate) fn sagnac() -> Result<PathBuf> {
    let lab = std::env::current_exe().context("where this program is")?;
    let program = lab.with_file_name("sagnac");
    ensure!(program.exists(), "{} is not built; run the lab by `cargo xtask`", program.display());
    Ok(program)
}
