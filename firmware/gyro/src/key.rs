//! The key of the emulated board, in place of fuses.
//!
//! Not for a gyro: the counter lives in memory, and the challenges count up, because the emulator has no random numbers. A board takes
//! its challenge from a random number generator, or from a counter that survives power-off.

use sagnac_core::Trust;

/// The public key that the program was built with, type `EMULATED`, counter 1.
#[derive(Debug)]
pub struct EmulatedFuses {
    lowest: u32,
    challenges: u8,
}

impl EmulatedFuses {
    /// At power-on.
    pub const fn new() -> Self {
        Self { lowest: 1, challenges: 0 }
    }
}

impl Default for EmulatedFuses {
    fn default() -> Self {
        Self::new()
    }
}

impl Trust for EmulatedFuses {
    fn public_key(&self) -> Option<[u8; 32]> {
        Some(*include_bytes!(concat!(env!("OUT_DIR"), "/unit.key")))
    }

    fn model(&self) -> [u8; 16] {
        *b"EMULATED\0\0\0\0\0\0\0\0"
    }

    fn lowest_counter(&self) -> u32 {
        self.lowest
    }

    fn raise_lowest_counter(&mut self, to: u32) {
        self.lowest = to;
    }

    fn verify(&self, public_key: &[u8; 32], message: &[u8], signature: &[u8; 64]) -> bool {
        sagnac_signature::verify(public_key, message, signature)
    }

    fn challenge(&mut self) -> [u8; 16] {
        self.challenges = self.challenges.wrapping_add(1);
        [self.challenges; 16]
    }
}
