//! Checks a Parquet footer before its decoder sees it: its lists must have the length that they announce.
//!
//! The footer uses Thrift's compact protocol. Each element of a list or map has at least one byte, so a count beyond the
//! remaining bytes is invalid; the decoder (parquet 59) would read all of them, seconds for each such list. Only the
//! structure is checked; the decoder interprets the fields.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// `PAR1` and the length before it.
const TAIL: u64 = 8;
/// A larger footer is not checked here; the decoder refuses it.
const MOST_BYTES: u64 = 256 << 20;
/// Largest depth of a footer.
const MOST_DEPTH: u32 = 64;

/// False if the footer announces more than it holds. True also if there is none: the decoder reports that.
pub(crate) fn footer_is_whole(file: &File) -> bool {
    footer(file).is_none_or(|bytes| Walk { left: &bytes }.structure(0).is_some())
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
    fn structure(&mut self, depth: u32) -> Option<()> {
        loop {
            let header = self.byte()?;
            if header == 0 {
                return Some(());
            }
            if header >> 4 == 0 {
                self.varint()?;
            }
            // A boolean field is in its header.
            if !matches!(header & 15, 1 | 2) {
                self.value(header & 15, depth + 1)?;
            }
        }
    }

    /// A value of a kind; booleans are bytes here, as lists hold them.
    fn value(&mut self, kind: u8, depth: u32) -> Option<()> {
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
                self.elements(count, &[header & 15], depth)
            }
            11 => {
                let count = self.varint()?;
                if count == 0 {
                    return Some(());
                }
                let kinds = self.byte()?;
                self.elements(count, &[kinds >> 4, kinds & 15], depth)
            }
            12 => self.structure(depth),
            13 => self.skip(16),
            _ => None,
        }
    }

    fn elements(&mut self, count: u64, kinds: &[u8], depth: u32) -> Option<()> {
        if count > self.left.len() as u64 {
            return None;
        }
        (0..count).try_for_each(|_| kinds.iter().try_for_each(|kind| self.value(*kind, depth + 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::Walk;

    #[test]
    fn shapes_are_walked_and_lies_are_found() {
        let whole = |bytes: &[u8]| Walk { left: bytes }.structure(0).is_some();
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
}
