//! The program under test: `sagnac`, built together with the lab.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, stdout_of, text};

/// The package that has it.
const PACKAGE: &str = "sagnac-cli";

/// A built `sagnac`.
#[derive(Clone)]
pub struct Program(PathBuf);

impl Program {
    /// The program at this path.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// The program in the lab's folder: `cargo xtask` builds both.
    pub fn beside_the_lab() -> Result<Self> {
        let lab = std::env::current_exe().context("the path of this program is unknown")?;
        let program = lab.with_file_name("sagnac");
        ensure!(program.exists(), "{} is not built: cargo build --package {PACKAGE}", program.display());
        Ok(Self(program))
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Runs it in the workspace's folder and returns its output. Any status but success is an error.
    pub(crate) fn stdout(&self, args: &[&str]) -> Result<String> {
        self.stdout_in(&root(), args)
    }

    /// The same in another folder.
    pub(crate) fn stdout_in(&self, folder: &Path, args: &[&str]) -> Result<String> {
        stdout_of(300, text(&self.0)?, args, folder)
    }
}
