//! The key of the emulated board, instead of fuses.
//!
//! Not for a gyro: the counter lives in memory, and the challenges count up, because the emulator has no random numbers. A board takes
//! its challenge from a random number generator, or from a counter that survives power-off.

use core::sync::atomic::{AtomicU8, Ordering};

use sagnac_signature::Keyed;

/// The public key that the program was built with, type `EMULATED`, counter 1.
pub const fn emulated_fuses() -> Keyed<fn() -> [u8; 16]> {
    Keyed {
        public_key: *include_bytes!(concat!(env!("OUT_DIR"), "/unit.key")),
        model: *b"EMULATED\0\0\0\0\0\0\0\0",
        lowest_counter: 1,
        challenge: count_up,
    }
}

fn count_up() -> [u8; 16] {
    static CHALLENGES: AtomicU8 = AtomicU8::new(0);
    [CHALLENGES.fetch_add(1, Ordering::Relaxed).wrapping_add(1); 16]
}
