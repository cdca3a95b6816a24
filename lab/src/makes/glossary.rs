//! The glossary as a page of the book: a copy of `GLOSSARY.md`, which GitHub shows next to the README.

use std::fs;

use anyhow::{Context, Result};
use xtask::shell::root;

use crate::made::Made;
use crate::places::{GLOSSARY, GLOSSARY_PAGE};

pub(crate) fn make() -> Result<Vec<Made>> {
    let glossary = fs::read_to_string(root().join(GLOSSARY))?;
    let (title, text) = glossary.split_once('\n').context("a glossary without a title")?;
    let page = format!("{title}\n\nMade by `cargo xtask bless` from `{GLOSSARY}`; do not edit.\n{text}");
    Ok(vec![Made::new(GLOSSARY_PAGE, page)])
}
