//! Ed25519 for flash images: [`verify`] and [`Keyed`] for the target, [`Signer`] and [`PublicKey`] for the host.
//!
//! What is signed, and what a board asks of a signature, is in [`sagnac_core`] ([`sagnac_core::SignatureBlock`],
//! [`sagnac_core::Trust`]); the arithmetic is `ed25519-dalek`'s. Verification is strict: a signature whose S is not reduced, a key of
//! small order, or a point that is not canonical is refused, so that one image has one signature and no second form of it.
//!
//! Measured on a Cortex-M4F in QEMU, an image of the greatest length (836 signed bytes), `opt-level = 3`, rustc 1.95, each library alone in a
//! program of its own (`cargo xtask firmware` counts the first within the board's program, 1,617,080 with Debian's compiler):
//!
//! | library | flash, bytes | instructions of a verification | links without a panic path |
//! |---|---|---|---|
//! | `ed25519-dalek` 3.0 | 56,952 | 1,776,480 | no |
//! | `salty` 0.3 | 15,084 | 2,935,360 | no |
//!
//! The first is chosen: it is the maintained one, host and target then refuse the same bytes, and a verification happens once, in the main
//! loop, when an image arrives. Neither links without a panic path; a board with a key therefore needs a panic handler, which resets.
//! The tick's interrupt has none of this code.
//!
//! On the host keys are PEM files (PKCS#8 and SPKI, as `openssl` writes and reads them).
#![no_std]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

#[cfg(feature = "host")]
extern crate alloc;

#[cfg(feature = "host")]
mod host;

#[cfg(feature = "host")]
pub use host::{KeyError, PublicKey, Signer};

use core::fmt;

use ed25519_dalek::{Signature, VerifyingKey};
use sagnac_core::{CHALLENGE_LEN, Trust};

/// Strict verification of an Ed25519 signature.
pub fn verify(public_key: &[u8; 32], message: &[u8], signature: &[u8; 64]) -> bool {
    let Ok(key) = VerifyingKey::from_bytes(public_key) else { return false };
    key.verify_strict(message, &Signature::from_bytes(signature)).is_ok()
}

/// What a board with a key trusts, from plain values. A board whose counter is in one-time-programmable memory implements [`Trust`] itself
/// and calls [`verify`].
#[derive(Clone, Copy)]
pub struct Keyed<C> {
    /// The public key.
    pub public_key: [u8; 32],
    /// Type of the gyro, UTF-8, padded with zero bytes.
    pub model: [u8; 16],
    /// Lowest counter that is trusted; rises with the images that are stored.
    pub lowest_counter: u32,
    /// Makes a challenge: random bytes, or a counter that survives power-off.
    pub challenge: C,
}

impl<C> fmt::Debug for Keyed<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Keyed").field("lowest_counter", &self.lowest_counter).finish_non_exhaustive()
    }
}

impl<C: FnMut() -> [u8; CHALLENGE_LEN]> Trust for Keyed<C> {
    fn public_key(&self) -> Option<[u8; 32]> {
        Some(self.public_key)
    }

    fn model(&self) -> [u8; 16] {
        self.model
    }

    fn lowest_counter(&self) -> u32 {
        self.lowest_counter
    }

    fn raise_lowest_counter(&mut self, to: u32) {
        self.lowest_counter = to;
    }

    fn verify(&self, public_key: &[u8; 32], message: &[u8], signature: &[u8; 64]) -> bool {
        verify(public_key, message, signature)
    }

    fn challenge(&mut self) -> [u8; CHALLENGE_LEN] {
        (self.challenge)()
    }
}
