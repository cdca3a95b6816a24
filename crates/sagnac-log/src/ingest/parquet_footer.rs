//! Checks a Parquet footer before its decoder sees it: its lists must have the length that they announce, and its schema a depth that
//! a log can have.
//!
//! The footer uses Thrift's compact protocol. Each element of a list or map has at least one byte, so a count beyond the
//! remaining bytes is invalid; the decoder (parquet 59) would read all of them, seconds for each such list. Apart from the schema only
//! the structure is checked; the decoder interprets the fields.
//!
//! The schema is a flat list in which each element states the number of its children, so a file of a few hundred bytes can nest groups
//! ten thousand deep, and the decoder recurses into them until its stack ends. Deeper than [`MOST_LEVELS`] is no log.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// `PAR1` and the length before it.
const TAIL: u64 = 8;
/// A larger footer is not checked here; the decoder refuses it.
const MOST_BYTES: u64 = 256 << 20;
/// Largest depth of a footer.
const MOST_DEPTH: u32 = 64;
/// Largest depth of a schema.
const MOST_LEVELS: usize = 32;
/// Field of the file's description that holds the schema, and of a schema's element that holds the number of its children.
const SCHEMA: u64 = 2;
const CHILDREN: u64 = 5;

/// Says what is wrong with a footer. `Ok` also if there is none: the decoder reports that.
pub(crate) fn check_footer(file: &File) -> Result<(), &'static str> {
    let Some(bytes) = footer(file) else { return Ok(()) };
    let mut walk = Walk { left: &bytes, children: Vec::new() };
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

fn footer(file: &File) -> Option<Vec<u8>> {
    let mut file = file.try_clone().ok()?;
    let length = file.metadata().ok()?.len();
    let mut tail = [0; TAIL as usize];
    file.seek(SeekFrom::Start(length.checked_sub(TAIL)?)).ok()?;
    file.read_exact(&mut tail).ok()?;
    let [a, b, c, d, magic @ ..] = tail;
    let footer = u64::from(u32::from_le_bytes([a, b, c, d]));
    if magic != *b"PAR1" || footer > length - TAIL || footer > MOST_BYTES {
        return None;
    }
    file.seek(SeekFrom::Start(length - TAIL - footer)).ok()?;
    let mut bytes = Vec::new();
    file.take(footer).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// The bytes not read yet. Every step returns `None` if there are too few.
struct Walk<'a> {
    left: &'a [u8],
    /// Number of children of each element of the schema.
    children: Vec<u64>,
}

/// Where a value stands: what is in it is of interest only in the schema.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    /// The file's description itself.
    Description,
    /// An element of the schema.
    Element,
}

impl Walk<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.left.split_first()?;
        self.left = rest;
        Some(*first)
    }

    fn skip(&mut self, bytes: u64) -> Option<()> {
        self.left = self.left.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Fields up to the stop.
    fn structure(&mut self, depth: u32, part: Option<Part>) -> Option<()> {
        let mut field = 0_u64;
        loop {
            let header = self.byte()?;
            if header == 0 {
                return Some(());
            }
            field = match header >> 4 {
                0 => unfolded(self.varint()?),
                step => field.wrapping_add(step.into()),
            };
            match (part, field, header & 15) {
                // A boolean field is in its header.
                (_, _, 1 | 2) => {}
                (Some(Part::Element), CHILDREN, 4..=6) => {
                    let count = unfolded(self.varint()?);
                    if let Some(last) = self.children.last_mut() {
                        *last = count;
                    }
                }
                (Some(Part::Description), SCHEMA, kind) => self.value(kind, depth + 1, Some(Part::Element))?,
                (_, _, kind) => self.value(kind, depth + 1, None)?,
            }
        }
    }

    /// A value of a kind; booleans are bytes here, as lists hold them.
    fn value(&mut self, kind: u8, depth: u32, part: Option<Part>) -> Option<()> {
        if depth > MOST_DEPTH {
            return None;
        }
        match kind {
            1..=3 => self.skip(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.skip(8),
            8 => self.varint().and_then(|length| self.skip(length)),
            9 | 10 => {
                let header = self.byte()?;
                let count = if header >> 4 == 15 { self.varint()? } else { u64::from(header >> 4) };
                self.elements(count, &[header & 15], depth, part)
            }
            11 => {
                let count = self.varint()?;
                if count == 0 {
                    return Some(());
                }
                let kinds = self.byte()?;
                self.elements(count, &[kinds >> 4, kinds & 15], depth, None)
            }
            12 => {
                if part.is_some() {
                    self.children.push(0);
                }
                self.structure(depth, part)
            }
            13 => self.skip(16),
            _ => None,
        }
    }

    fn elements(&mut self, count: u64, kinds: &[u8], depth: u32, part: Option<Part>) -> Option<()> {
        if count > self.left.len() as u64 {
            return None;
        }
        (0..count).try_for_each(|_| kinds.iter().try_for_each(|kind| self.value(*kind, depth + 1, part)))
    }
}

/// A number of Thrift's zigzag form; of a negative one, which no count is, something too large.
fn unfolded(value: u64) -> u64 {
    if value & 1 == 0 { value >> 1 } else { u64::MAX }
}

#[cfg(test)]
mod tests {
    use super::{Part, Walk, is_deep};

    #[test]
    fn shapes_are_walked_and_lies_are_found() {
        let whole =
            |bytes: &[u8]| Walk { left: bytes, children: Vec::new() }.structure(0, Some(Part::Description)).is_some();
        // i32 5; a list of three i64; a string; true; a struct with a double; stop.
        let good = [0x15, 10, 0x19, 0x36, 2, 4, 6, 0x18, 2, b'a', b'b', 0x11, 0x1c, 0x17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        assert!(whole(&good));
        for end in 0..good.len() {
            assert!(!whole(&good[..end]), "cut at {end}");
        }
        // A list of 2^31 − 1 booleans in nothing.
        assert!(!whole(&[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07, 0]));
        // Lists within lists without an end.
        assert!(!whole(&[0x19; 400]));
    }

    /// Fields 1 and 2: a version, and a list of three elements of which the first has two children.
    #[test]
    fn the_schema_is_found() {
        let bytes = [0x15, 2, 0x19, 0x3c, 0x48, 1, b'r', 0x15, 4, 0, 0x48, 1, b'a', 0, 0x48, 1, b'b', 0, 0];
        let mut walk = Walk { left: &bytes, children: Vec::new() };
        assert!(walk.structure(0, Some(Part::Description)).is_some());
        assert_eq!(walk.children, [2, 0, 0]);
    }

    #[test]
    fn depth_is_counted_and_not_width() {
        let nested = |levels: usize| [vec![1; levels], vec![0]].concat();
        assert!(!is_deep(&nested(32)) && is_deep(&nested(33)));
        // A thousand columns beside each other, each a list of three levels.
        let wide: Vec<u64> = std::iter::once(1000).chain((0..1000).flat_map(|_| [1, 1, 0])).collect();
        assert!(!is_deep(&wide));
        assert!(!is_deep(&[u64::MAX, 0, 0]));
    }
}
