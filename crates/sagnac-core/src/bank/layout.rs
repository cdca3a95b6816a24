//! Layout of a bank, and the encoding of its parts.
//!
//! ```text
//! 0        32                 160       192                                    992          1120          1184
//! ┌────────┬──────────────────┬─────────┬──────────────────────────────────────┬────────────┬─────────────┐
//! │ commit │ notes × 4        │ head    │ image (at most 772), filled with ff  │ starts × 4 │ confirm × 2 │
//! └────────┴──────────────────┴─────────┴──────────────────────────────────────┴────────────┴─────────────┘
//! ```
//!
//! Every part begins at a multiple of 32 bytes and is programmed once between two erases. So flash that programs 1 to 32 bytes at a
//! time can hold it, with or without error correction.

use sha2::{Digest, Sha256};

use crate::bytes::{Reader, Writer, crc32_of};
use crate::codec::MAX_IMAGE_LEN;

/// Bytes that a bank uses. Its size is at least this, and a multiple of the flash's erase size.
pub const BANK_LEN: u32 = 1184;
/// Alignment of every part, and the largest programming unit of a flash that can hold a bank.
pub const REGION_ALIGNMENT: usize = 32;
pub(super) const COMMIT_AT: u32 = 0;
pub(super) const NOTES_AT: u32 = 32;
pub(super) const NOTES: u32 = 4;
pub(super) const HEAD_AT: u32 = 160;
pub(super) const IMAGE_AT: u32 = 192;
/// The image's area: whole units.
pub(super) const IMAGE_AREA: usize = MAX_IMAGE_LEN.next_multiple_of(REGION_ALIGNMENT);
/// A mark for each start of an image on trial.
pub(super) const STARTS_AT: u32 = IMAGE_AT + IMAGE_AREA as u32;
/// Places for the confirmation of such an image; the second is for a first one that was cut.
pub(super) const CONFIRM_AT: u32 = STARTS_AT + TRIAL_STARTS * REGION_ALIGNMENT as u32;
pub(super) const CONFIRMS: u32 = 2;
/// First byte after the last part.
pub(super) const END: u32 = CONFIRM_AT + CONFIRMS * REGION_ALIGNMENT as u32;
const _: () = assert!(END == BANK_LEN);

/// Starts that an image on trial has: at the next one it is withdrawn.
pub const TRIAL_STARTS: u32 = 4;

const HEAD_MAGIC: [u8; 8] = *b"SAGNACBK";
const COMMIT_MAGIC: [u8; 8] = *b"COMMITTD";
const BANK_VERSION: u32 = 3;
/// Bytes of the hash in a commit word.
const HASH_LEN: usize = 16;

/// One part.
pub(super) type Unit = [u8; REGION_ALIGNMENT];
/// An erased part.
pub(super) const BLANK: Unit = [0xff; REGION_ALIGNMENT];

/// The part before the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    /// Counts up with every image stored in either bank.
    pub(super) sequence: u32,
    /// Length of the image, bytes.
    pub(super) len: u32,
    /// The image is on trial until it is confirmed.
    pub(super) trial: bool,
}

impl Head {
    /// Its bytes; the last four are the CRC-32 of the others.
    pub(super) fn unit(&self) -> Unit {
        let mut unit = [0; REGION_ALIGNMENT];
        let mut w = Writer::new(&mut unit);
        let fields = [BANK_VERSION, self.sequence, self.len, u32::from(self.trial), 0];
        // Eight bytes and six words are 32.
        let _ = w.put(HEAD_MAGIC);
        for field in fields {
            let _ = w.put(field.to_le_bytes());
        }
        let _ = w.put(self.own_crc(&fields).to_le_bytes());
        unit
    }

    /// Decodes the head; `None` if the bytes hold none.
    pub(super) fn read(unit: &Unit) -> Option<Self> {
        let mut r = Reader::new(unit);
        let magic = r.take::<8>()?;
        let version = r.u32()?;
        let head = Self { sequence: r.u32()?, len: r.u32()?, trial: r.u32()? == 1 };
        let fits = magic == HEAD_MAGIC && version == BANK_VERSION && head.len as usize <= MAX_IMAGE_LEN;
        (fits && head.unit() == *unit).then_some(head)
    }

    fn own_crc(&self, fields: &[u32; 5]) -> u32 {
        let mut bytes = [0; 20];
        let mut w = Writer::new(&mut bytes);
        for field in fields {
            let _ = w.put(field.to_le_bytes());
        }
        crc32_of(&[&HEAD_MAGIC, &bytes])
    }

    /// The commit word of this head with this image, and of no other pair: SHA-256 of both, its first 16 bytes. A CRC would not do, for
    /// the CRC of an image that ends with its own CRC is the same number for every image.
    pub(super) fn commit(&self, image: &[u8]) -> Unit {
        let mut unit = [0; REGION_ALIGNMENT];
        let mut w = Writer::new(&mut unit);
        let hash: [u8; 32] = Sha256::new().chain_update(self.unit()).chain_update(image).finalize().into();
        let _ = w.put(COMMIT_MAGIC);
        let _ = w.put(self.sequence.to_le_bytes());
        let _ = w.put((!self.sequence).to_le_bytes());
        if let Some(first) = hash.first_chunk::<HASH_LEN>() {
            let _ = w.put(*first);
        }
        unit
    }
}

/// A note of a store's number. In the notes: the image that the other bank holds from store `number` or earlier is withdrawn. In a mark
/// of a start or a confirmation: the image of this bank's store `number` was started, or is confirmed.
///
/// The number and its complement, four times. Programming only clears bits, so in a torn pair some bit is one in both words, and the
/// pair is never read as another number. If one pair decays, three remain.
pub(super) fn note_unit(number: u32) -> Unit {
    let mut unit = BLANK;
    let mut w = Writer::new(&mut unit);
    for _ in 0..4 {
        let _ = w.put(number.to_le_bytes());
        let _ = w.put((!number).to_le_bytes());
    }
    unit
}

/// The number of such a note, if one of its pairs is intact.
pub(super) fn note_number(unit: &Unit) -> Option<u32> {
    let mut r = Reader::new(unit);
    let mut newest = None;
    while let (Some(number), Some(complement)) = (r.u32(), r.u32()) {
        // Four zero bytes in a blank unit would read as u32::MAX, a number that no store gets.
        if number == !complement && number != u32::MAX {
            newest = match newest {
                Some(other) if !is_newer(number, other) => newest,
                _ => Some(number),
            };
        }
    }
    newest
}

/// Store `number` came after store `other`. The numbers go round (RFC 1982): two that a flash holds lie near to each other, so that the
/// counter has no end.
pub(super) const fn is_newer(number: u32, other: u32) -> bool {
    number != other && number.wrapping_sub(other) < 1 << 31
}

/// The number after this one, without 0 and without that of a blank note.
pub(super) const fn next_number(number: u32) -> u32 {
    match number.wrapping_add(1) {
        0 | u32::MAX => 1,
        next => next,
    }
}
