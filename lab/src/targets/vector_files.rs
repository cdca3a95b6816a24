//! The vector files as the checks of every target read them, and copies with one wrong output.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use sagnac_core::Image;
use sagnac_loops::LoopTable;
use sagnac_ports::TextFile;
use sagnac_vectors::{MAX_TABLE, RECORD, Words};

use crate::places;

/// The table of a vector file.
pub(crate) fn table(name: &str) -> Result<Vec<u8>> {
    let bytes = fs::read(places::vectors().join(name).with_extension("hex"))?;
    let mut words = Words::new(&bytes);
    let head = words.head()?;
    let mut room = [0; MAX_TABLE];
    Ok(words.table(&head, &mut room)?.to_vec())
}

pub(crate) fn image(name: &str) -> Result<Image> {
    Ok(Image::decode(&table(name)?)?)
}

pub(crate) fn loops() -> Result<LoopTable> {
    Ok(LoopTable::decode(&table("path-length-mirror")?)?)
}

pub(crate) fn write(folder: &Path, files: &[TextFile]) -> Result<()> {
    for file in files {
        let path = folder.join(&file.name);
        fs::create_dir_all(path.parent().context("a folder")?)?;
        fs::write(path, &file.text)?;
    }
    Ok(())
}

/// Which record of a vector file is changed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spoiled {
    /// One of the first: a slow reader that stops at it needs no second run of the whole file.
    Early,
    Last,
}

/// A copy of a vector file with the first output of a record changed: every check of it must fail.
pub(crate) fn spoiled(name: &str, folder: &Path, which: Spoiled) -> Result<PathBuf> {
    let text = fs::read_to_string(places::vectors().join(name).with_extension("hex"))?;
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    // For the path-length loop a record in which it is closed: the hardware's bench reads only such records.
    let closed = |words: &[&str]| u32::from_str_radix(words[8], 16).is_ok_and(|flags| flags & 256 != 0);
    let is_loop = name.starts_with("path-length");
    let is_record = |line: &&mut String| {
        let words: Vec<&str> = line.split(' ').collect();
        words.len() == RECORD && (!is_loop || closed(&words))
    };
    let mut records = lines.iter_mut().filter(is_record);
    let record =
        if which == Spoiled::Early { records.nth(8) } else { records.next_back() }.context("too few records")?;
    // A bit of the first word behind operation and inputs.
    let digit = if record.as_bytes()[9 * 9 + 7] == b'0' { "1" } else { "0" };
    record.replace_range(9 * 9 + 7..9 * 9 + 8, digit);
    let path = folder.join(format!("{name}-spoiled.hex"));
    fs::write(&path, lines.join("\n"))?;
    Ok(path)
}

pub(crate) fn files() -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(places::vectors()).context("testdata/vectors: run cargo xtask vectors")?;
    let mut paths: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    paths.sort();
    Ok(paths)
}
