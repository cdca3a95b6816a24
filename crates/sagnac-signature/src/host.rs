//! Keys as PEM files, and signing.

use alloc::string::String;
use core::fmt;

use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use ed25519_dalek::pkcs8::{DecodePrivateKey as _, DecodePublicKey as _, EncodePrivateKey as _, EncodePublicKey as _};
use ed25519_dalek::{Signer as _, SigningKey, VerifyingKey};
use sagnac_core::{SignatureBlock, key_id, service_message};

/// Why a key cannot be made or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyError {
    /// The operating system gave no random bytes.
    NoEntropy,
    /// Not a private Ed25519 key as PKCS#8 PEM.
    NotAPrivateKey,
    /// Not a public Ed25519 key as SPKI PEM.
    NotAPublicKey,
    /// The key could not be written as PEM.
    Encoding,
}

impl fmt::Display for KeyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoEntropy => "the operating system gives no random bytes",
            Self::NotAPrivateKey => "not a private Ed25519 key (PKCS#8 PEM, \"BEGIN PRIVATE KEY\")",
            Self::NotAPublicKey => "not a public Ed25519 key (SPKI PEM, \"BEGIN PUBLIC KEY\")",
            Self::Encoding => "the key cannot be written as PEM",
        })
    }
}

impl core::error::Error for KeyError {}

/// A private key. Its bytes are erased when it is dropped.
pub struct Signer(SigningKey);

impl fmt::Debug for Signer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Signer(private)")
    }
}

impl Signer {
    /// A new key from the operating system's random bytes.
    ///
    /// # Errors
    /// [`KeyError::NoEntropy`].
    pub fn generate() -> Result<Self, KeyError> {
        let mut seed = [0; 32];
        getrandom::fill(&mut seed).map_err(|_| KeyError::NoEntropy)?;
        Ok(Self(SigningKey::from_bytes(&seed)))
    }

    /// The key of a seed of RFC 8032. For tests and for keys from a hardware module.
    pub fn from_seed(seed: &[u8; 32]) -> Self {
        Self(SigningKey::from_bytes(seed))
    }

    /// Reads PKCS#8 PEM.
    ///
    /// # Errors
    /// [`KeyError::NotAPrivateKey`].
    pub fn from_pem(text: &str) -> Result<Self, KeyError> {
        SigningKey::from_pkcs8_pem(text).map(Self).map_err(|_| KeyError::NotAPrivateKey)
    }

    /// PKCS#8 PEM. Keep the file from other readers.
    ///
    /// # Errors
    /// [`KeyError::Encoding`].
    pub fn to_pem(&self) -> Result<String, KeyError> {
        let pem = self.0.to_pkcs8_pem(LineEnding::LF).map_err(|_| KeyError::Encoding)?;
        Ok(String::from(pem.as_str()))
    }

    /// Its public key.
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    /// Signs an image's bytes. `None` for more bytes than any image has.
    pub fn sign(&self, image: &[u8], model: [u8; 16], counter: u32) -> Option<SignatureBlock> {
        let key_id = key_id(&self.public().bytes());
        let mut block = SignatureBlock { counter, key_id, model, signature: [0; 64] };
        block.signature = self.0.sign(block.message(image)?.bytes()).to_bytes();
        Some(block)
    }

    /// The answer to a challenge of a gyro's service mode. `change`: kind of the message that it is for.
    pub fn answer(&self, serial: &[u8; 32], axis: u8, change: u8, challenge: &[u8; 16]) -> [u8; 64] {
        self.0.sign(service_message(serial, axis, change, challenge).bytes()).to_bytes()
    }
}

/// A public key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey(VerifyingKey);

impl PublicKey {
    /// Reads SPKI PEM.
    ///
    /// # Errors
    /// [`KeyError::NotAPublicKey`].
    pub fn from_pem(text: &str) -> Result<Self, KeyError> {
        VerifyingKey::from_public_key_pem(text).map(Self).map_err(|_| KeyError::NotAPublicKey)
    }

    /// SPKI PEM.
    ///
    /// # Errors
    /// [`KeyError::Encoding`].
    pub fn to_pem(&self) -> Result<String, KeyError> {
        self.0.to_public_key_pem(LineEnding::LF).map_err(|_| KeyError::Encoding)
    }

    /// Its 32 bytes, as a board's fuse holds them.
    pub fn bytes(&self) -> [u8; 32] {
        self.0.to_bytes()
    }

    /// Names it in a signature block.
    pub fn id(&self) -> [u8; 16] {
        key_id(&self.bytes())
    }
}
