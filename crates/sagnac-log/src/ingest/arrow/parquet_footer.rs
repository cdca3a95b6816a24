//! Checks a Parquet footer before its decoder sees it: its lists must have the length that they announce, and its schema a depth that
//! a log can have.
//!
//! The schema is a flat list in which each element states the number of its children, so a file of a few hundred bytes can nest groups
//! ten thousand deep, and the decoder recurses into them until its stack ends. Deeper than [`MOST_LEVELS`] is no log.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use crate::ingest::arrow::thrift::{Part, Walk};

/// `PAR1` and the length before it.
const TAIL: u64 = 8;
/// Largest footer, bytes. The decoder needs about twenty times its length.
const MOST_BYTES: u64 = 8 << 20;
/// Largest depth of a schema.
const MOST_LEVELS: usize = 32;

/// Says what is wrong with a footer. `Ok` also if there is none: the decoder reports that.
pub(crate) fn check_footer(file: &File) -> Result<(), &'static str> {
    let Some((mut file, at, length)) = place(file) else { return Ok(()) };
    if length > MOST_BYTES {
        return Err("a footer of more than 8 MiB");
    }
    let mut bytes = Vec::new();
    let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.take(length).read_to_end(&mut bytes));
    if read.is_err() {
        return Ok(());
    }
    let mut walk = Walk::new(&bytes);
    walk.structure(0, Some(Part::Description)).ok_or("a footer that announces more than it holds")?;
    if is_deep(&walk.children) { Err("a schema of more than 32 levels") } else { Ok(()) }
}

/// The depth of a schema in which each element, in order, has so many children.
fn is_deep(children: &[u64]) -> bool {
    // Elements that each open group still waits for.
    let mut open: Vec<u64> = Vec::new();
    for count in children {
        if let Some(waits) = open.last_mut() {
            *waits = waits.saturating_sub(1);
        }
        if *count > 0 {
            open.push(*count);
        }
        if open.len() > MOST_LEVELS {
            return true;
        }
        while open.last() == Some(&0) {
            open.pop();
        }
    }
    false
}

/// The file, and where in it the footer begins and how long it is.
fn place(file: &File) -> Option<(File, u64, u64)> {
    let mut file = file.try_clone().ok()?;
    let length = file.metadata().ok()?.len();
    let mut tail = [0; TAIL as usize];
    file.seek(SeekFrom::Start(length.checked_sub(TAIL)?)).ok()?;
    file.read_exact(&mut tail).ok()?;
    let [a, b, c, d, magic @ ..] = tail;
    let footer = u64::from(u32::from_le_bytes([a, b, c, d]));
    let at = (length - TAIL).checked_sub(footer)?;
    (magic == *b"PAR1").then_some((file, at, footer))
}

#[cfg(test)]
mod tests {
    use super::is_deep;

    #[test]
    fn depth_is_counted_and_not_width() {
        let nested = |levels: usize| [vec![1; levels], vec![0]].concat();
        assert!(!is_deep(&nested(32)) && is_deep(&nested(33)));
        // A thousand columns next to each other, each a list of three levels.
        let wide: Vec<u64> = std::iter::once(1000).chain((0..1000).flat_map(|_| [1, 1, 0])).collect();
        assert!(!is_deep(&wide));
        assert!(!is_deep(&[u64::MAX, 0, 0]));
    }
}
