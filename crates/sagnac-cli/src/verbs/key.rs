//! `sagnac key`: keys for signed images, signing, and the check of a signature.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use sagnac::{Error, Result};
use sagnac_core::{CHALLENGE_LEN, Image, SignatureBlock, SignatureError, Trusted};
use sagnac_log::ingest::hex;
use sagnac_log::write::write_bytes;
use sagnac_signature::{Keyed, Signer};

use crate::args::signature::{BlockArgs, block, model_bytes, public_key, words};
use crate::files::loading;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::verb::Verb;

/// Make a key, sign an image, or check a signature as a gyro would (Ed25519)
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac key new -o factory.key                      (and factory.pub, for the gyros)
  sagnac key sign unit.img --key factory.key --model RLG-28 --counter 12 -o unit.signed.img
  sagnac key verify unit.signed.img --key factory.pub --model RLG-28

Keys are PEM files as openssl has them. Exit status 1: the signature is not good.")]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Make a private key, readable by its owner alone, and its public key next to it
    New {
        /// Private key to write; the public one gets the ending .pub
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Sign a flash image
    Sign {
        /// Flash image
        #[arg(value_name = "IMAGE")]
        image: PathBuf,
        /// Private key
        #[arg(long, value_name = "FILE")]
        key: PathBuf,
        #[command(flatten)]
        block: BlockArgs,
        /// Signed image to write
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Check the signature of an image
    Verify {
        /// Signed flash image
        #[arg(value_name = "IMAGE")]
        image: PathBuf,
        /// Public key
        #[arg(long, value_name = "FILE")]
        key: PathBuf,
        /// Gyro type in the signature
        #[arg(long, value_name = "NAME")]
        model: Option<String>,
        /// Lowest trusted counter
        #[arg(long, value_name = "N", default_value_t = 0)]
        counter: u32,
    },
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        match &self.action {
            Action::New { output } => new(output, console),
            Action::Sign { image, key, block, output } => sign(image, key, block, output, console),
            Action::Verify { image, key, model, counter } => check(image, key, model.as_deref(), *counter, console),
        }
    }
}

fn new(output: &Path, console: &mut Console) -> Ran {
    let public_path = output.with_extension("pub");
    if public_path == output {
        return Err(Error::input(
            "the public key gets this ending",
            "give the private key another ending, such as unit.key",
        )
        .file(output.display().to_string()));
    }
    let failed = |e: sagnac_signature::KeyError| Error::io("key", "make", &std::io::Error::other(e));
    let key = Signer::generate().map_err(failed)?;
    let (private, public) = (key.to_pem().map_err(failed)?, key.public().to_pem().map_err(failed)?);
    // The public one first: if it cannot be written there is no private key without it.
    new_file(&public_path, public.as_bytes(), 0o644)?;
    if let Err(error) = new_file(output, private.as_bytes(), 0o600) {
        let _ = std::fs::remove_file(&public_path);
        return Err(error);
    }
    console.say(format!("wrote {} (keep it) and {}", output.display(), public_path.display()));
    console.say(format!("key {}", hex(&key.public().id())));
    Ok(Outcome::Done)
}

/// A file that did not exist: a key that is written over is lost, with every gyro that trusts it.
fn new_file(path: &Path, bytes: &[u8], mode: u32) -> Result<()> {
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode);
    #[cfg(not(unix))]
    let _ = mode;
    let mut file = options.open(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::AlreadyExists => {
            Error::input("exists already, and a key is never overwritten", "choose a new name")
                .file(path.display().to_string())
        }
        _ => Error::io_path(path, "create", &e),
    })?;
    file.write_all(bytes).and_then(|()| file.sync_all()).map_err(|e| {
        // A part of a key is none, and would keep its name.
        let _ = std::fs::remove_file(path);
        Error::io_path(path, "write", &e)
    })
}

fn sign(image: &Path, key: &Path, args: &BlockArgs, output: &Path, console: &mut Console) -> Ran {
    let (decoded, bytes, before) = loading::signed_image(image)?;
    if before.is_some() {
        return Err(Error::input("the image is signed already", "sign the image that `sagnac export` wrote")
            .file(image.display().to_string()));
    }
    let block = block(key, args, &bytes)?;
    write_bytes(output, &[bytes.as_slice(), &block.encode()].concat())?;
    console.say(format!("wrote {}: {}, {}", output.display(), about(&decoded), words(&block)));
    Ok(Outcome::Done)
}

fn check(path: &Path, key: &Path, model: Option<&str>, lowest: u32, console: &mut Console) -> Ran {
    let whole = loading::image_bytes_of(path)?;
    let (_, block) = SignatureBlock::split(&whole).map_err(|e| {
        Error::input(e.to_string(), "copy the image again from its source").file(path.display().to_string())
    })?;
    // Without --model the signed one is reported, not judged.
    let model = match (model, &block) {
        (Some(name), _) => model_bytes(name)?,
        (None, Some(block)) => block.model,
        (None, None) => [0; 16],
    };
    let key = public_key(key)?;
    // A board with this key, apart from its own identity.
    let board = Keyed { public_key: key.bytes(), model, lowest_counter: lowest, challenge: || [0; CHALLENGE_LEN] };
    match (Trusted::check(&whole, &board), block) {
        (Ok(trusted), Some(block)) => {
            console.say(format!("{}: good: {}, {}", path.display(), about(&trusted.image), words(&block)));
            Ok(Outcome::Done)
        }
        (Err(SignatureError::Image(error)), _) => {
            Err(Error::input(format!("not a usable image: {error}"), "copy the image again from its source")
                .file(path.display().to_string()))
        }
        (Err(error), block) => {
            console.say(format!("{}: NOT GOOD: {error}", path.display()));
            if let Some(block) = block {
                console.say(format!("it says: {}; the key here is {}", words(&block), hex(&key.id())));
            }
            Ok(Outcome::LimitsNotMet)
        }
        // A board with a key has no Ok without a block.
        (Ok(_), None) => Ok(Outcome::LimitsNotMet),
    }
}

fn about(image: &Image) -> String {
    let d = image.description();
    format!("axis {} of {}, image {}", char::from(d.axis), image.serial().unwrap_or("?"), d.sequence)
}
