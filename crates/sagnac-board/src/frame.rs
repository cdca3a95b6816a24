//! Frames of the serial line.
//!
//! ```text
//! 0     2      3      4                4 + n       + 4
//! ┌─────┬──────┬──────┬────────────────┬───────────┐
//! │ SG  │ kind │ n    │ payload        │ CRC-32    │     n at most 64, little-endian
//! └─────┴──────┴──────┴────────────────┴───────────┘
//! ```
//!
//! The checksum is over kind, length and payload. A reader that finds something else skips a byte and looks for the
//! next `SG`: bytes lost or added cost the frames that they hit and no other. (A lost `S` between two frames, the end of
//! one checksum or the start of the next frame, costs one of the two: the bytes that are left are the same.)
//!
//! Where it fails: a damaged frame is found by its checksum alone; by chance one in 2³² is not.

use sagnac_core::bytes::crc32_of;

/// First two bytes of a frame.
pub const SYNC: [u8; 2] = *b"SG";
/// Longest payload.
pub const MAX_PAYLOAD: usize = 64;
/// Longest frame.
pub const MAX_FRAME: usize = HEAD + MAX_PAYLOAD + CRC;
const HEAD: usize = 4;
const CRC: usize = 4;

/// A frame as it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// What it is.
    pub kind: u8,
    len: u8,
    payload: [u8; MAX_PAYLOAD],
}

impl Frame {
    /// A frame of this kind; `None` for a payload that is too long.
    pub fn new(kind: u8, payload: &[u8]) -> Option<Self> {
        let mut frame = Self { kind, len: u8::try_from(payload.len()).ok()?, payload: [0; MAX_PAYLOAD] };
        frame.payload.get_mut(..payload.len())?.copy_from_slice(payload);
        Some(frame)
    }

    /// What it holds.
    pub fn payload(&self) -> &[u8] {
        self.payload.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Its bytes at the front of a buffer, and how many.
    pub fn bytes(&self) -> ([u8; MAX_FRAME], usize) {
        let mut bytes = [0; MAX_FRAME];
        let head = [self.kind, self.len];
        let crc = crc32_of(&[&head, self.payload()]).to_le_bytes();
        let all = SYNC.iter().chain(&head).chain(self.payload()).chain(&crc);
        bytes.iter_mut().zip(all).for_each(|(slot, byte)| *slot = *byte);
        (bytes, HEAD + self.payload().len() + CRC)
    }
}

/// Finds frames in a stream of bytes.
#[derive(Clone, Debug)]
pub struct Reader {
    held: [u8; MAX_FRAME],
    len: usize,
    skipped: u64,
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}

impl Reader {
    /// Nothing read yet.
    pub const fn new() -> Self {
        Self { held: [0; MAX_FRAME], len: 0, skipped: 0 }
    }

    /// Bytes that belonged to no frame.
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Bytes that may yet become a frame.
    pub const fn pending(&self) -> usize {
        self.len
    }

    /// The next byte; a frame if one ends with it.
    ///
    /// Bytes behind a damaged head may hold whole frames already; they come out with the bytes that follow
    /// ([`Reader::next_held`] gives them at once).
    pub fn take(&mut self, byte: u8) -> Option<Frame> {
        if let Some(slot) = self.held.get_mut(self.len) {
            *slot = byte;
            self.len += 1;
        }
        self.next_held()
    }

    /// A frame among the bytes that are held, if there is a whole one.
    pub fn next_held(&mut self) -> Option<Frame> {
        while self.len > 0 {
            match self.look() {
                Looked::Frame(frame, len) => {
                    self.drop_front(len);
                    return Some(frame);
                }
                Looked::MoreNeeded => return None,
                Looked::NotHere => {
                    self.drop_front(1);
                    self.skipped = self.skipped.saturating_add(1);
                }
            }
        }
        None
    }

    fn drop_front(&mut self, count: usize) {
        self.held.copy_within(count.min(MAX_FRAME).., 0);
        self.len = self.len.saturating_sub(count);
    }

    fn look(&self) -> Looked {
        let held = self.held.get(..self.len).unwrap_or(&[]);
        let expected = SYNC.iter().zip(held);
        if expected.into_iter().any(|(wanted, byte)| wanted != byte) {
            return Looked::NotHere;
        }
        let [_, _, kind, len, ..] = *held else { return Looked::MoreNeeded };
        let payload_len = usize::from(len);
        if payload_len > MAX_PAYLOAD {
            return Looked::NotHere;
        }
        let whole = HEAD + payload_len + CRC;
        let (Some(payload), Some(crc)) = (held.get(HEAD..HEAD + payload_len), held.get(HEAD + payload_len..whole))
        else {
            return Looked::MoreNeeded;
        };
        if crc != crc32_of(&[&[kind, len], payload]).to_le_bytes() {
            return Looked::NotHere;
        }
        Frame::new(kind, payload).map_or(Looked::NotHere, |frame| Looked::Frame(frame, whole))
    }
}

enum Looked {
    Frame(Frame, usize),
    MoreNeeded,
    NotHere,
}
