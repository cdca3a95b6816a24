//! The Python package next to its peers, in one process: `python/bench.py` in the environment that `cargo xtask wheel` makes.

use anyhow::{Result, ensure};
use xtask::shell::{root, stdout_of, target, text};

use crate::measures::bench::Bench;

pub(super) const HEADING: &str = "\n## In Python, on 10 million values in memory";

/// Time limit, s.
const LONGEST_S: u32 = 1200;

pub(super) fn measure(_: &Bench, page: &mut String) -> Result<()> {
    let python = target().join("python/full/bin/python");
    ensure!(python.exists(), "there is no wheel; make it with `cargo xtask wheel`");
    *page += "\n";
    *page += &stdout_of(LONGEST_S, text(&python)?, &["python/bench.py"], &root())?;
    Ok(())
}
