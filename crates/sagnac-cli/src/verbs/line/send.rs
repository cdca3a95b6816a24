//! `sagnac line send`: one message to a gyro's serial line.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use sagnac::{Error, Result};
use sagnac_board::frame::axis_code;
use sagnac_board::{Change, Message};
use sagnac_log::write::write_bytes;

use crate::args::signature::private_key;
use crate::files::Files;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::verb::Verb;

/// Send one message to a gyro: confirm, roll back, or open its service mode
#[derive(clap::Args)]
#[command(after_help = "\
Examples (the replies appear in sagnac line read):
  sagnac line send confirm -o /dev/ttyUSB0
  sagnac line send service commit -o /dev/ttyUSB0
  sagnac line send answer commit --challenge 0f1e… --key factory.key --serial RLG-7 --axis z -o /dev/ttyUSB0")]
pub(crate) struct Args {
    #[command(subcommand)]
    message: LineMessage,
    /// The line, or a file
    #[arg(short, long, value_name = "PATH", global = true, default_value = "-")]
    output: PathBuf,
    /// Axis letter of the gyro that the message is for; every gyro of the line without it
    #[arg(long, global = true)]
    axis: Option<char>,
}

#[derive(Subcommand)]
enum LineMessage {
    /// Keep the image on trial
    Confirm,
    /// Go back to the previous image
    RollBack,
    /// Ask a gyro with a key for a challenge
    Service {
        /// The change to make
        change: LineChange,
    },
    /// Answer the challenge, which opens the service mode for this change
    Answer {
        /// The change that the challenge was asked for
        change: LineChange,
        /// The challenge, as sagnac line read prints it
        #[arg(long, value_name = "HEX")]
        challenge: String,
        /// Private key
        #[arg(long, value_name = "FILE")]
        key: PathBuf,
        /// Serial number of the gyro
        #[arg(long)]
        serial: String,
    },
}

/// A change that the service mode is opened for.
#[derive(Clone, Copy, clap::ValueEnum)]
enum LineChange {
    /// An upload
    Commit,
    /// Back to the previous image
    RollBack,
    /// Keep the image on trial
    Confirm,
}

impl LineChange {
    fn on_line(self) -> Change {
        match self {
            Self::Commit => Change::Commit,
            Self::RollBack => Change::RollBack,
            Self::Confirm => Change::Confirm,
        }
    }
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        let message = match &self.message {
            LineMessage::Confirm => Message::Confirm,
            LineMessage::RollBack => Message::RollBack,
            LineMessage::Service { change } => Message::Service(change.on_line()),
            LineMessage::Answer { change, challenge, key, serial } => {
                let file = Some(&self.output).filter(|path| path.as_os_str() != "-");
                Files::new().reads([key]).writes(file).check()?;
                let axis = self.axis.ok_or_else(|| {
                    Error::input("an answer is for one axis", "add its letter, such as --axis z").column("--axis")
                })?;
                Message::Answer(answer(key, serial, axis, change.on_line(), challenge)?)
            }
        };
        let axis = self.axis.map_or(Ok(0), axis_byte)?;
        if axis != 0 && axis_code(axis) == 0 && !matches!(self.message, LineMessage::Answer { .. }) {
            return Err(Error::input(
                "x, y and z alone have an address on the line",
                "remove --axis: every gyro reads it",
            )
            .column("--axis")
            .value(char::from(axis).to_string()));
        }
        let bytes = frame_bytes(&message, axis)?;
        if self.output.as_os_str() == "-" {
            use std::io::Write as _;
            let mut out = std::io::stdout();
            // Nothing may stay in a buffer whose error nobody sees.
            out.write_all(&bytes).and_then(|()| out.flush()).map_err(|e| Error::io("standard output", "write", &e))?;
        } else {
            write_bytes(&self.output, &bytes)?;
            console.say(format!("wrote {}: {} bytes", self.output.display(), bytes.len()));
        }
        Ok(Outcome::Done)
    }
}

fn axis_byte(axis: char) -> Result<u8> {
    let byte = u8::try_from(axis).ok().filter(u8::is_ascii_graphic);
    byte.ok_or_else(|| {
        Error::input("must be an ASCII letter", "give the axis of the image, such as --axis z")
            .column("--axis")
            .value(axis.to_string())
    })
}

/// A message for the gyro of this axis as bytes of the line.
pub(crate) fn frame_bytes(message: &Message, axis: u8) -> Result<Vec<u8>> {
    let frame =
        message.frame().ok_or_else(|| Error::input("the message does not fit a frame", "shorten the names in it"))?;
    let (bytes, len) = frame.of_axis(axis).bytes();
    Ok(bytes.get(..len).unwrap_or(&[]).to_vec())
}

/// The answer to a challenge, as `sagnac line read` printed it.
fn answer(key: &Path, serial: &str, axis: char, change: Change, challenge: &str) -> Result<[u8; 64]> {
    let bad = |what: &str, name: &'static str, value: &str| {
        Error::input(what, "copy it from the output of `sagnac line read`").column(name).value(value)
    };
    let mut padded = [0; 32];
    match padded.get_mut(..serial.len()) {
        Some(room) => room.copy_from_slice(serial.as_bytes()),
        None => return Err(bad("must have at most 32 bytes", "--serial", serial)),
    }
    let challenge = unhex(challenge).ok_or_else(|| bad("must be 32 hexadecimal digits", "--challenge", challenge))?;
    Ok(private_key(key)?.answer(&padded, axis_byte(axis)?, change as u8, &challenge))
}

fn unhex(text: &str) -> Option<[u8; 16]> {
    let mut bytes = [0; 16];
    if text.len() != 32 || !text.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(bytes)
}
