//! Frames of the serial line.
//!
//! ```text
//! 0     2      3      4                4 + n       + 4
//! ┌─────┬──────┬──────┬────────────────┬───────────┐
//! │ SG  │ kind │ n    │ payload        │ CRC-32    │     n at most 64, little-endian
//! └─────┴──────┴──────┴────────────────┴───────────┘
//! ```
//!
//! The upper two bits of the kind are the axis: 1, 2, 3 for x, y, z; 0 for another one, or for every gyro of the line.
//!
//! The checksum covers kind, length and payload. If the bytes are not a frame, the reader skips one byte and looks for
//! the next `SG`. So lost or added bytes cost only the frames that they hit. (If one checksum ends in `S` and one of
//! the two equal bytes `S` is lost, one of the two frames is lost: the remaining bytes are the same in both cases.)
//!
//! Only the checksum detects a damaged frame; one in 2³² passes by chance.

use sagnac_core::bytes::crc32_of;

/// First two bytes of a frame.
pub const SYNC: [u8; 2] = *b"SG";
/// Longest payload.
pub const MAX_PAYLOAD: usize = 64;
/// Longest frame.
pub const MAX_FRAME: usize = HEAD + MAX_PAYLOAD + CRC;
const HEAD: usize = 4;
const CRC: usize = 4;
const AXIS_SHIFT: u32 = 6;

/// Largest kind: the upper two bits of its byte are the axis.
pub const MAX_KIND: u8 = 0x3F;

/// The axis of a frame from its letter: 1, 2, 3 for x, y, z, and 0 for any other.
pub const fn axis_code(letter: u8) -> u8 {
    match letter {
        b'x' | b'X' => 1,
        b'y' | b'Y' => 2,
        b'z' | b'Z' => 3,
        _ => 0,
    }
}

/// A frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Kind of the message.
    pub kind: u8,
    /// Axis that it comes from or goes to ([`axis_code`]); 0 for every one.
    pub axis: u8,
    len: u8,
    payload: [u8; MAX_PAYLOAD],
}

impl Frame {
    /// A frame of this kind, without an axis; `None` for a kind or a payload that is too large.
    pub fn new(kind: u8, payload: &[u8]) -> Option<Self> {
        let len = u8::try_from(payload.len()).ok().filter(|_| kind <= MAX_KIND)?;
        let mut frame = Self { kind, axis: 0, len, payload: [0; MAX_PAYLOAD] };
        frame.payload.get_mut(..payload.len())?.copy_from_slice(payload);
        Some(frame)
    }

    /// The same frame from or to the axis of this letter.
    pub const fn of_axis(mut self, letter: u8) -> Self {
        self.axis = axis_code(letter);
        self
    }

    /// A gyro of this axis reads it.
    pub const fn is_for(&self, letter: u8) -> bool {
        self.axis == 0 || self.axis == axis_code(letter)
    }

    /// Its payload.
    pub fn payload(&self) -> &[u8] {
        self.payload.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Its bytes: a buffer, and the number of bytes used.
    pub fn bytes(&self) -> ([u8; MAX_FRAME], usize) {
        let mut bytes = [0; MAX_FRAME];
        let head = [self.kind & MAX_KIND | self.axis << AXIS_SHIFT, self.len];
        let crc = crc32_of(&[&head, self.payload()]).to_le_bytes();
        let all = SYNC.iter().chain(&head).chain(self.payload()).chain(&crc);
        bytes.iter_mut().zip(all).for_each(|(slot, byte)| *slot = *byte);
        (bytes, HEAD + self.payload().len() + CRC)
    }
}

/// Finds frames in a stream of bytes.
#[derive(Clone, Debug)]
pub struct FrameReader {
    held: [u8; MAX_FRAME],
    len: usize,
    skipped: u64,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// An empty reader.
    pub const fn new() -> Self {
        Self { held: [0; MAX_FRAME], len: 0, skipped: 0 }
    }

    /// Number of bytes that belonged to no frame.
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Number of bytes held back because they may be the start of a frame.
    pub const fn buffered(&self) -> usize {
        self.len
    }

    /// Adds one byte. Returns a frame if one ends with it.
    ///
    /// After a damaged head the buffer may hold more whole frames. They are returned with the next bytes, or at once by
    /// [`FrameReader::next_buffered`].
    pub fn push(&mut self, byte: u8) -> Option<Frame> {
        if let Some(slot) = self.held.get_mut(self.len) {
            *slot = byte;
            self.len += 1;
        }
        self.next_buffered()
    }

    /// The next whole frame in the buffer.
    pub fn next_buffered(&mut self) -> Option<Frame> {
        while self.len > 0 {
            match self.parse() {
                Parsed::Frame(frame, len) => {
                    self.drop_front(len);
                    return Some(frame);
                }
                Parsed::MoreNeeded => return None,
                Parsed::NotHere => {
                    self.drop_front(1);
                    self.skipped = self.skipped.saturating_add(1);
                }
            }
        }
        None
    }

    /// The next whole frame in the buffer, when the line has been quiet: a beginning without its end is dropped byte by byte, so that
    /// what follows it does not wait for more. `None` when nothing is held any more.
    pub fn next_quiet(&mut self) -> Option<Frame> {
        loop {
            match self.next_buffered() {
                Some(frame) => return Some(frame),
                None if self.len == 0 => return None,
                None => {
                    self.drop_front(1);
                    self.skipped = self.skipped.saturating_add(1);
                }
            }
        }
    }

    fn drop_front(&mut self, count: usize) {
        self.held.copy_within(count.min(MAX_FRAME).., 0);
        self.len = self.len.saturating_sub(count);
    }

    fn parse(&self) -> Parsed {
        let held = self.held.get(..self.len).unwrap_or(&[]);
        let expected = SYNC.iter().zip(held);
        if expected.into_iter().any(|(wanted, byte)| wanted != byte) {
            return Parsed::NotHere;
        }
        let [_, _, kind, len, ..] = *held else { return Parsed::MoreNeeded };
        let payload_len = usize::from(len);
        if payload_len > MAX_PAYLOAD {
            return Parsed::NotHere;
        }
        let whole = HEAD + payload_len + CRC;
        let (Some(payload), Some(crc)) = (held.get(HEAD..HEAD + payload_len), held.get(HEAD + payload_len..whole))
        else {
            return Parsed::MoreNeeded;
        };
        if crc != crc32_of(&[&[kind, len], payload]).to_le_bytes() {
            return Parsed::NotHere;
        }
        Frame::new(kind & MAX_KIND, payload)
            .map_or(Parsed::NotHere, |frame| Parsed::Frame(Frame { axis: kind >> AXIS_SHIFT, ..frame }, whole))
    }
}

enum Parsed {
    Frame(Frame, usize),
    MoreNeeded,
    NotHere,
}
