//! Thrift's compact protocol, walked without being interpreted: Parquet's footer and its page headers are written in it.
//!
//! Each element of a list or map has at least one byte, so a count beyond the remaining bytes is invalid; the decoder (parquet 59)
//! would read all of them, seconds for each such list. Of a footer the number of children of each element of the schema is kept, of a
//! page header its sizes; the decoder interprets the rest.

/// Largest depth of a structure.
const MOST_DEPTH: u32 = 64;
/// Field of the file's description that holds the schema, and of a schema's element that holds the number of its children.
const SCHEMA: u64 = 2;
const CHILDREN: u64 = 5;
/// Fields of a page header: its kind, its sizes unpacked and packed, and the structures that begin with its number of values.
const KIND: u64 = 1;
const UNPACKED: u64 = 2;
const PACKED: u64 = 3;
const VALUES_WITHIN: [u64; 3] = [5, 7, 8];
const VALUES: u64 = 1;
/// Of the last of these structures: bytes of the levels, which are not packed.
const LEVELS: [u64; 2] = [5, 6];

/// Sizes that a page header states; a negative one is [`u64::MAX`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PageSizes {
    /// 0 data, 1 index, 2 dictionary, 3 data of version 2.
    pub(crate) kind: u64,
    /// Bytes unpacked.
    pub(crate) unpacked: u64,
    /// Bytes in the file after the header.
    pub(crate) packed: u64,
    /// Number of values.
    pub(crate) values: u64,
    /// Bytes before the packed ones.
    pub(crate) levels: u64,
}

/// The bytes not read yet. Every step returns `None` if there are too few.
pub(crate) struct Walk<'a> {
    pub(crate) left: &'a [u8],
    /// Number of children of each element of the schema.
    pub(crate) children: Vec<u64>,
    /// Sizes of the page.
    pub(crate) page: PageSizes,
}

/// What a value is a part of, where it is of interest.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Part {
    /// The file's description itself.
    Description,
    /// An element of the schema.
    Element,
    /// A page header itself.
    Page,
    /// The structure of a page header that begins with the number of its values.
    Counts,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { left: bytes, children: Vec::new(), page: PageSizes::default() }
    }

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
    pub(crate) fn structure(&mut self, depth: u32, part: Option<Part>) -> Option<()> {
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
                (Some(Part::Page), KIND | UNPACKED | PACKED, 4..=6) => {
                    let value = unfolded(self.varint()?);
                    *(match field {
                        KIND => &mut self.page.kind,
                        UNPACKED => &mut self.page.unpacked,
                        _ => &mut self.page.packed,
                    }) = value;
                }
                (Some(Part::Counts), VALUES, 4..=6) => self.page.values = unfolded(self.varint()?),
                (Some(Part::Counts), levels, 4..=6) if LEVELS.contains(&levels) => {
                    self.page.levels = self.page.levels.saturating_add(unfolded(self.varint()?));
                }
                (Some(Part::Page), within, 12) if VALUES_WITHIN.contains(&within) => {
                    self.value(12, depth + 1, Some(Part::Counts))?;
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
                if part == Some(Part::Element) {
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
    use super::{PageSizes, Part, Walk};

    #[test]
    fn shapes_are_walked_and_lies_are_found() {
        let whole = |bytes: &[u8]| Walk::new(bytes).structure(0, Some(Part::Description)).is_some();
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
        let mut walk = Walk::new(&bytes);
        assert!(walk.structure(0, Some(Part::Description)).is_some());
        assert_eq!(walk.children, [2, 0, 0]);
    }

    /// Fields 1 to 3 and 5 of the format's page header: kind 0, 1,000 bytes unpacked, 300 packed, 50 values; a stop each.
    #[test]
    fn sizes_of_a_page_are_found() {
        let bytes = [0x15, 0, 0x15, 0xd0, 0x0f, 0x15, 0xd8, 0x04, 0x2c, 0x15, 100, 0, 0, 0xaa];
        let mut walk = Walk::new(&bytes);
        assert!(walk.structure(0, Some(Part::Page)).is_some());
        assert_eq!(walk.page, PageSizes { kind: 0, unpacked: 1000, packed: 300, values: 50, levels: 0 });
        assert_eq!(walk.left, [0xaa]);
    }
}
