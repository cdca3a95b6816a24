//! The signature of an image: what is signed, and what a board asks of it.
//!
//! ```text
//! 0        8          12         16          32        48              112
//! ┌────────┬──────────┬──────────┬───────────┬─────────┬────────────────┐
//! │ magic  │ version  │ counter  │ key id    │ model   │ signature      │     after the last byte of the image
//! └────────┴──────────┴──────────┴───────────┴─────────┴────────────────┘
//! signed:   "SAGNAC-IMAGE-1" padded to 16 bytes ‖ bytes 0 to 48 of the block ‖ all bytes of the image
//! ```
//!
//! The image itself holds serial number, axis, tick, scale factor and sequence number, so a signature binds the correction to one axis
//! of one gyro. The block adds the type of the gyro, the signer's own counter, and which key it was.
//!
//! The signature is Ed25519 (RFC 8032). This crate has none of its arithmetic: a [`Trust`] brings it (`sagnac-signature`), as it brings
//! the public key from a fuse and the counter from one-time-programmable memory. It is checked once, when an image arrives
//! ([`Trusted::check`]); at each start the bank's hash and the image's CRC find damage.
//!
//! Where it fails: whoever can write the flash itself, or the firmware, is not held by a signature that arrives over the line.

use core::fmt;

use sha2::{Digest, Sha256};

use crate::bytes::{Reader, Writer};
use crate::codec::{DecodeError, MAX_IMAGE_LEN};
use crate::image::Image;

/// Bytes of a signature block.
pub const SIGNATURE_LEN: usize = 112;
/// Longest image with its signature.
pub const MAX_SIGNED_LEN: usize = MAX_IMAGE_LEN + SIGNATURE_LEN;
/// Bytes of the block that are signed.
const SIGNED_HEAD: usize = 48;
const BLOCK_MAGIC: [u8; 8] = *b"SAGNACSG";
const BLOCK_VERSION: u16 = 1;
const IMAGE_DOMAIN: [u8; 16] = *b"SAGNAC-IMAGE-1\0\0";
const SERVICE_DOMAIN: [u8; 16] = *b"SAGNAC-SERVICE-2";
/// Bytes of a challenge of the service mode.
pub const CHALLENGE_LEN: usize = 16;

/// The block after a signed image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SignatureBlock {
    /// The signer's counter: a board refuses one below the lowest that it trusts.
    pub counter: u32,
    /// First half of the SHA-256 of the public key.
    pub key_id: [u8; 16],
    /// Type of the gyro, UTF-8, padded with zero bytes.
    pub model: [u8; 16],
    /// Ed25519 signature of [`SignatureBlock::message`].
    pub signature: [u8; 64],
}

/// Bytes to sign or verify: at most those of the longest image.
#[derive(Clone, Copy, Debug)]
pub struct SignedMessage {
    bytes: [u8; IMAGE_DOMAIN.len() + SIGNED_HEAD + MAX_IMAGE_LEN],
    len: usize,
}

impl SignedMessage {
    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }

    fn of(parts: &[&[u8]]) -> Option<Self> {
        let mut message = Self { bytes: [0; IMAGE_DOMAIN.len() + SIGNED_HEAD + MAX_IMAGE_LEN], len: 0 };
        for part in parts {
            let end = message.len + part.len();
            message.bytes.get_mut(message.len..end)?.copy_from_slice(part);
            message.len = end;
        }
        Some(message)
    }
}

/// The first half of the SHA-256 of a public key: names the key in a block.
pub fn key_id(public_key: &[u8; 32]) -> [u8; 16] {
    let hash: [u8; 32] = Sha256::digest(public_key).into();
    hash.first_chunk::<16>().copied().unwrap_or([0; 16])
}

/// What the answer to a challenge signs: `"SAGNAC-SERVICE-2" ‖ serial ‖ axis ‖ change ‖ challenge`. An answer is of no use on another gyro or
/// for another change (the kind of its message), and no image can be made of it.
pub fn service_message(serial: &[u8; 32], axis: u8, change: u8, challenge: &[u8; CHALLENGE_LEN]) -> SignedMessage {
    // 66 bytes fit.
    SignedMessage::of(&[&SERVICE_DOMAIN, serial, &[axis, change], challenge])
        .unwrap_or(SignedMessage { bytes: [0; IMAGE_DOMAIN.len() + SIGNED_HEAD + MAX_IMAGE_LEN], len: 0 })
}

impl SignatureBlock {
    /// Splits bytes into an image and its signature block: `None` instead of the block for bytes that end with none.
    ///
    /// # Errors
    /// [`SignatureError::Block`] for bytes that begin a block of an unknown version or with a reserved byte set.
    pub fn split(bytes: &[u8]) -> Result<(&[u8], Option<Self>), SignatureError> {
        let Some((image, block)) = bytes.split_last_chunk::<SIGNATURE_LEN>() else { return Ok((bytes, None)) };
        if !block.starts_with(&BLOCK_MAGIC) {
            return Ok((bytes, None));
        }
        Self::decode(block).map(|block| (image, Some(block))).ok_or(SignatureError::Block)
    }

    fn decode(bytes: &[u8; SIGNATURE_LEN]) -> Option<Self> {
        let mut r = Reader::new(bytes);
        let (magic, version, reserved) = (r.take::<8>()?, r.u16()?, r.u16()?);
        let block = Self { counter: r.u32()?, key_id: r.take()?, model: r.take()?, signature: r.take()? };
        (magic == BLOCK_MAGIC && version == BLOCK_VERSION && reserved == 0).then_some(block)
    }

    /// Its bytes.
    pub fn encode(&self) -> [u8; SIGNATURE_LEN] {
        let mut bytes = [0; SIGNATURE_LEN];
        let mut w = Writer::new(&mut bytes);
        // 112 bytes in all, as a test reads back.
        let _ = w.put(BLOCK_MAGIC);
        let _ = w.put(BLOCK_VERSION.to_le_bytes());
        let _ = w.put([0; 2]);
        let _ = w.put(self.counter.to_le_bytes());
        let _ = w.put(self.key_id);
        let _ = w.put(self.model);
        let _ = w.put(self.signature);
        bytes
    }

    /// What the signature of this block over an image covers; `None` for more bytes than any image has.
    pub fn message(&self, image: &[u8]) -> Option<SignedMessage> {
        let block = self.encode();
        SignedMessage::of(&[&IMAGE_DOMAIN, block.get(..SIGNED_HEAD)?, image])
    }
}

/// Why a signature is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignatureError {
    /// A block of an unknown version, or with a reserved byte set.
    Block,
    /// The board has a key and the image no signature.
    Unsigned,
    /// Signed with another key.
    OtherKey,
    /// For another type of gyro.
    Model,
    /// The signer's counter is below the lowest that the board trusts.
    OldCounter {
        /// Counter of the block.
        offered: u32,
        /// Lowest counter of the board.
        lowest: u32,
    },
    /// The signature is not that of these bytes.
    Signature,
    /// The signed bytes are no image.
    Image(DecodeError),
}

impl fmt::Display for SignatureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Block => f.write_str("the signature block is of an unknown version or damaged"),
            Self::Unsigned => f.write_str("the image is not signed, and this gyro asks for a signature"),
            Self::OtherKey => f.write_str("signed with another key"),
            Self::Model => f.write_str("signed for another type of gyro"),
            Self::OldCounter { offered, lowest } => {
                write!(f, "the signer's counter is {offered}; this gyro trusts {lowest} or more")
            }
            Self::Signature => f.write_str("the signature does not match the image"),
            Self::Image(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for SignatureError {}

/// What a board trusts, and the arithmetic to check it. Implement it over the part's own fuses and counters.
pub trait Trust {
    /// The public key, from a fuse or the firmware. `None`: this board has no key and takes unsigned images.
    fn public_key(&self) -> Option<[u8; 32]>;

    /// Type of the gyro, UTF-8, padded with zero bytes.
    fn model(&self) -> [u8; 16];

    /// Lowest counter of a signature that is trusted.
    fn lowest_counter(&self) -> u32;

    /// Raises the lowest counter, for example in one-time-programmable memory. Called after an image with this counter is stored. A
    /// board that cannot keep one does nothing: then an old signed image can return if its sequence number is newer.
    fn raise_lowest_counter(&mut self, to: u32);

    /// Ed25519 verification of RFC 8032; `false` for a key or signature that is not canonical.
    fn verify(&self, public_key: &[u8; 32], message: &[u8], signature: &[u8; 64]) -> bool;

    /// A new random challenge of the service mode. Only asked of a board with a key.
    fn challenge(&mut self) -> [u8; CHALLENGE_LEN];
}

/// A board without a key: every image that is made for its gyro is accepted from whoever reaches the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoKey;

impl Trust for NoKey {
    fn public_key(&self) -> Option<[u8; 32]> {
        None
    }

    fn model(&self) -> [u8; 16] {
        [0; 16]
    }

    fn lowest_counter(&self) -> u32 {
        0
    }

    fn raise_lowest_counter(&mut self, _to: u32) {}

    fn verify(&self, _public_key: &[u8; 32], _message: &[u8], _signature: &[u8; 64]) -> bool {
        false
    }

    fn challenge(&mut self) -> [u8; CHALLENGE_LEN] {
        [0; CHALLENGE_LEN]
    }
}

/// An image that a board may store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trusted {
    /// The image.
    pub image: Image,
    /// The counter of its signature; `None` for an unsigned image on a board without a key.
    pub counter: Option<u32>,
}

impl Trusted {
    /// Checks bytes that arrived as an image, with or without a signature block. A board without a key ignores the block.
    ///
    /// # Errors
    /// [`SignatureError`], the cheapest check first: block, presence, key, model, counter, the signature itself, the image.
    #[inline(never)]
    pub fn check(bytes: &[u8], trust: &impl Trust) -> Result<Self, SignatureError> {
        let (image, block) = SignatureBlock::split(bytes)?;
        let decoded = || Image::decode(image).map_err(SignatureError::Image);
        let Some(public_key) = trust.public_key() else { return Ok(Self { image: decoded()?, counter: None }) };
        let block = block.ok_or(SignatureError::Unsigned)?;
        if block.key_id != key_id(&public_key) {
            return Err(SignatureError::OtherKey);
        }
        if block.model != trust.model() {
            return Err(SignatureError::Model);
        }
        let lowest = trust.lowest_counter();
        if block.counter < lowest {
            return Err(SignatureError::OldCounter { offered: block.counter, lowest });
        }
        let message = block.message(image).ok_or(SignatureError::Signature)?;
        if !trust.verify(&public_key, message.bytes(), &block.signature) {
            return Err(SignatureError::Signature);
        }
        Ok(Self { image: decoded()?, counter: Some(block.counter) })
    }
}
