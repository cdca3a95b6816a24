//! A checksum over words of memory that fits into the tick's interrupt.
//!
//! ```text
//! sum ← rotate(sum xor word, 5) · 0x9E3779B1
//! ```
//!
//! Each step is a bijection of the sum, so every change within one word of 32 bits is found; a change of several words escapes once in
//! 2³². A CRC-32 of the same words costs ten times as much and finds no more of one upset. What is stored or sent has the CRC
//! ([`crate::bytes`]).

use core::hash::Hasher;

/// The sum of the words so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Checksum(u32);

impl Checksum {
    pub(crate) const START: Self = Self(0);

    pub(crate) const fn word(self, word: u32) -> Self {
        Self((self.0 ^ word).rotate_left(5).wrapping_mul(0x9e37_79b1))
    }

    pub(crate) const fn long(self, value: i64) -> Self {
        self.word(value as u32).word((value >> 32) as u32)
    }

    pub(crate) const fn sum(self) -> u32 {
        self.0
    }
}

/// What derives `Hash` can be summed: each of its fields is a step.
impl Hasher for Checksum {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(4) {
            *self = self.word(chunk.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte)));
        }
    }

    fn write_u32(&mut self, word: u32) {
        *self = self.word(word);
    }

    fn write_u64(&mut self, value: u64) {
        *self = self.long(value.cast_signed());
    }

    fn finish(&self) -> u64 {
        self.0.into()
    }
}
