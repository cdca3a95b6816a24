//! The program under test: `sagnac`, built together with the lab.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, said, text};

/// A built `sagnac`.
#[derive(Clone)]
pub struct Program(PathBuf);

impl Program {
    /// The one at this place.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// The one beside the lab: `cargo xtask` builds both.
    pub fn beside_the_lab() -> Result<Self> {
        let lab = std::env::current_exe().context("where this program is")?;
        let program = lab.with_file_name("sagnac");
        ensure!(program.exists(), "{} is not built; run the lab by `cargo xtask`", program.display());
        Ok(Self(program))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Runs it in the workspace's folder and returns its output. Any status but success is an error.
    pub(crate) fn said(&self, args: &[&str]) -> Result<String> {
        self.said_in(&root(), args)
    }

    /// The same in another folder.
    pub(crate) fn said_in(&self, folder: &Path, args: &[&str]) -> Result<String> {
        said(300, text(&self.0)?, args, folder)
    }
}
