//! `sagnac export`: a calibration becomes what the target holds.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use sagnac::calibration::UNASSIGNED;
use sagnac::export::{encode, image_bytes};
use sagnac::ingest::{hex, sha256};
use sagnac::write::write_bytes;
use sagnac::{Error, Result};

use crate::console::{Console, Outcome, Ran};
use crate::loading;

/// Write a calibration as a flash image, one file per axis
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac export unit.cal.json --to image -o unit.img        (three axes: unit-x.img, unit-y.img, unit-z.img)")]
pub(crate) struct Args {
    /// Calibration
    calibration: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    to: Target,
    /// Image to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Sequence number of the image
    #[arg(long, default_value_t = 1)]
    sequence: u32,
}

/// What an export writes.
#[derive(Clone, Copy, ValueEnum)]
enum Target {
    /// Flash image (docs/image-format.md)
    Image,
}

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    let Target::Image = args.to;
    let calibration = loading::calibration(&args.calibration)?;
    if calibration.serial == UNASSIGNED {
        return Err(Error::refused(
            "the calibration belongs to no serial number, and an image must belong to one gyro",
        )
        .file(args.calibration.display().to_string())
        .column("serial")
        .help("calibrate again with --serial"));
    }
    let parent = sha256(calibration.to_json()?.as_bytes());
    // All images first: a failure of the second axis leaves the first axis' old file.
    let images: Result<Vec<(PathBuf, Vec<u8>)>> = calibration
        .axes
        .iter()
        .map(|axis| {
            let image = encode(&calibration, axis, parent, args.sequence)?;
            let path =
                if calibration.axes.len() == 1 { args.output.clone() } else { path_of_axis(&args.output, axis.axis) };
            Ok((path, image_bytes(&image)))
        })
        .collect();
    for (path, bytes) in images? {
        write_bytes(&path, &bytes)?;
        console.say(format!("wrote {}: {} bytes, SHA-256 {}", path.display(), bytes.len(), hex(&sha256(&bytes))));
    }
    Ok(Outcome::Done)
}

/// `unit.img` becomes `unit-x.img`.
fn path_of_axis(path: &Path, axis: char) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{axis}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{axis}"),
    };
    path.with_file_name(name)
}
