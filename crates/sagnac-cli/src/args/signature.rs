//! Flags and files of signatures: keys, models, blocks.

use std::path::{Path, PathBuf};

use sagnac::{Error, Result};
use sagnac_core::SignatureBlock;
use sagnac_log::ingest::hex;
use sagnac_log::read::read_text;
use sagnac_signature::{PublicKey, Signer};

/// How an image is signed.
#[derive(clap::Args)]
pub(crate) struct SignArgs {
    /// Private key that signs the image (sagnac key new)
    #[arg(long, value_name = "KEY", requires = "model", requires = "counter")]
    pub(crate) sign: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) block: BlockArgs,
}

/// Statements of a signature next to the image.
#[derive(clap::Args)]
pub(crate) struct BlockArgs {
    /// Gyro type in the firmware, at most 16 bytes
    #[arg(long, value_name = "NAME")]
    pub(crate) model: Option<String>,
    /// Counter of the signer: a gyro refuses a lower one than its highest
    #[arg(long, value_name = "N")]
    pub(crate) counter: Option<u32>,
}

impl SignArgs {
    /// The signature block of an image's bytes, if a key is given.
    pub(crate) fn block_of(&self, image: &[u8]) -> Result<Option<SignatureBlock>> {
        self.sign.as_deref().map(|path| block(path, &self.block, image)).transpose()
    }
}

/// Signs an image's bytes.
pub(crate) fn block(key: &Path, args: &BlockArgs, image: &[u8]) -> Result<SignatureBlock> {
    let needed =
        |name: &str| Error::input("a signature needs it", "give --model NAME and --counter N").column(name.to_owned());
    let model = model_bytes(args.model.as_deref().ok_or_else(|| needed("--model"))?)?;
    let counter = args.counter.ok_or_else(|| needed("--counter"))?;
    let block = private_key(key)?.sign(image, model, counter);
    block.ok_or_else(|| {
        Error::input("the image is longer than an image can be", "export the calibration again with `sagnac export`")
    })
}

/// A model's name as a board has it.
pub(crate) fn model_bytes(name: &str) -> Result<[u8; 16]> {
    let mut bytes = [0; 16];
    match bytes.get_mut(..name.len()) {
        Some(room) if !name.is_empty() && !name.contains('\0') => {
            room.copy_from_slice(name.as_bytes());
            Ok(bytes)
        }
        _ => Err(Error::input("must have 1 to 16 bytes", "give the name that the board has, such as --model IMU-9")
            .column("--model")
            .value(name)),
    }
}

/// A model's name for people.
pub(crate) fn model_name(model: &[u8; 16]) -> String {
    let used = model.iter().position(|byte| *byte == 0).unwrap_or(model.len());
    String::from_utf8_lossy(model.get(..used).unwrap_or(&[])).escape_debug().to_string()
}

/// A signature block in words.
pub(crate) fn words(block: &SignatureBlock) -> String {
    format!("signed for {}, counter {}, by key {}", model_name(&block.model), block.counter, hex(&block.key_id))
}

/// The private key of a file.
pub(crate) fn private_key(path: &Path) -> Result<Signer> {
    Signer::from_pem(&pem(path)?).map_err(|e| {
        Error::input(e.to_string(), "give the private key that `sagnac key new` wrote").file(path.display().to_string())
    })
}

/// The public key of a `.pub` file, or of a private one.
pub(crate) fn public_key(path: &Path) -> Result<PublicKey> {
    let text = pem(path)?;
    let read = PublicKey::from_pem(&text).or_else(|e| Signer::from_pem(&text).map(|key| key.public()).map_err(|_| e));
    read.map_err(|e| {
        Error::input(e.to_string(), "give a key that `sagnac key new` wrote").file(path.display().to_string())
    })
}

/// The text of a key file, which has about 120 bytes.
fn pem(path: &Path) -> Result<String> {
    read_text(path, "read the key", 1 << 16)
}
