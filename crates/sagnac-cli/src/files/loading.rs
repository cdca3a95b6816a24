//! Opens the files that the command line names, of any kind.

use std::io::Read;
use std::path::{Path, PathBuf};

use sagnac::calibration::Calibration;
use sagnac::verify::Correction;
use sagnac::{Error, Result};
use sagnac_core::{Image, MAGIC, MAX_SIGNED_LEN, SignatureBlock};
use sagnac_log::ingest::{Logs, ReadMode};
use sagnac_log::read::read_text;
use sagnac_log::setup::Setup;
use sagnac_sim::{Scenario, ScenarioError};
use sagnac_units::format::controls;

use crate::output::progress::open_log;

/// Enough for a magic number or a line of headers.
const FIRST_BYTES: u64 = 1024;

/// What a file is, by its first bytes.
pub(crate) enum FileKind {
    Image,
    Calibration,
    /// Anything else is read as a log.
    Log,
}

/// True for what is read once: standard input, a pipe, a device.
pub(crate) fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-" || std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Looks at the first bytes of a file; `-` and pipes are logs.
pub(crate) fn kind_of(path: &Path) -> Result<FileKind> {
    if is_pipe(path) {
        // Bytes read from a pipe cannot be read again.
        return Ok(FileKind::Log);
    }
    let start = first_bytes(path)?;
    // Some editors put a byte order mark before text.
    let start = start.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&start);
    Ok(match start {
        start if start.starts_with(&MAGIC) => FileKind::Image,
        [b'{', ..] => FileKind::Calibration,
        _ => FileKind::Log,
    })
}

/// The first bytes of a file.
pub(crate) fn first_bytes(path: &Path) -> Result<Vec<u8>> {
    let file = sagnac_log::read::open_input(path).map_err(|e| Error::io_path(path, "open", &e))?;
    if path.is_dir() {
        return Err(Error::input("this is a folder, and a file is needed", "give the name of a file in it")
            .file(path.display().to_string()));
    }
    let mut start = Vec::new();
    file.take(FIRST_BYTES).read_to_end(&mut start).map_err(|e| Error::io_path(path, "read", &e))?;
    Ok(start)
}

/// True for a name that ends so, in any case.
pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Names of formats that this program reads but does not write.
const NOT_WRITTEN: [&str; 6] = ["gz", "zst", "arrow", "feather", "ulg", "xlsx"];

/// Refuses a file name whose extension means another format than the output.
pub(crate) fn check_output_name(path: &Path, formats: &str) -> Result<()> {
    match NOT_WRITTEN.iter().find(|extension| has_extension(path, extension)) {
        Some(extension) => Err(Error::input(
            format!("cannot write .{extension} files"),
            format!("choose another ending. Formats: {formats}"),
        )
        .file(path.display().to_string())),
        None => Ok(()),
    }
}

/// Several logs, each opened when the one before has been read. One that is not there is noticed before the first is read.
pub(crate) fn logs<'a>(paths: &'a [PathBuf], setup: &'a Setup, doing: &'static str) -> Result<Logs<'a>> {
    for path in paths.iter().filter(|path| path.as_os_str() != "-") {
        std::fs::metadata(path).map_err(|e| Error::io_path(path, "open", &e))?;
    }
    Ok(Logs::opened_by(paths.iter().map(move |path| open_log(path, setup, ReadMode::Bulk, doing))))
}

/// An image.
pub(crate) fn image(path: &Path) -> Result<Image> {
    signed_image(path).map(|(image, ..)| image)
}

/// An image, its bytes without a signature, and its signature block if it has one. The signature is not checked.
pub(crate) fn signed_image(path: &Path) -> Result<(Image, Vec<u8>, Option<SignatureBlock>)> {
    let whole = image_bytes_of(path)?;
    let refused = |e: String| {
        Error::input(
            format!("not a usable image: {e}"),
            "export the calibration again: sagnac export unit.cal.json --to image -o DIR/",
        )
        .file(path.display().to_string())
    };
    let (bytes, block) = SignatureBlock::split(&whole).map_err(|e| refused(e.to_string()))?;
    let image = Image::decode(bytes).map_err(|e| refused(e.to_string()))?;
    if image.serial().is_some_and(|serial| serial.contains(controls)) {
        return Err(refused("its serial number has control characters".to_owned()));
    }
    Ok((image, bytes.to_vec(), block))
}

/// The bytes of an image's file, signed or not.
pub(crate) fn image_bytes_of(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = sagnac_log::read::open_input(path).map_err(|e| Error::io_path(path, "open", &e))?;
    file.take(MAX_SIGNED_LEN as u64 + 1).read_to_end(&mut bytes).map_err(|e| Error::io_path(path, "read", &e))?;
    Ok(bytes)
}

/// A calibration.
pub(crate) fn calibration(path: &Path) -> Result<Calibration> {
    Calibration::read(path)
}

/// A calibration or an image.
pub(crate) fn correction(path: &Path) -> Result<Correction> {
    match kind_of(path)? {
        FileKind::Image => image(path).map(Correction::from_image),
        FileKind::Calibration => {
            Correction::from_calibration(calibration(path)?).map_err(|e| e.file(path.display().to_string()))
        }
        _ if is_pipe(path) => {
            Err(Error::input("a correction cannot be read from a pipe", "save it as a file, and give its name")
                .file(path.display().to_string()))
        }
        FileKind::Log => Err(Error::input(
            "this file is neither a calibration nor an image",
            "give the correction first, then the logs: sagnac verify unit.cal.json retest.csv",
        )
        .file(path.display().to_string())),
    }
}

/// A scenario's refusal, with its file and key.
pub(crate) fn scenario_refused(path: &Path, problem: &ScenarioError) -> Error {
    let error = Error::input(
        problem.message.clone(),
        "correct the key: docs/reference/scenario.md lists each with its unit and range",
    )
    .file(path.display().to_string());
    let error = if problem.key.is_empty() { error } else { error.column(problem.key.clone()) };
    problem.line.map_or(error.clone(), |line| error.line(line))
}

/// Reads and checks a scenario.
pub(crate) fn scenario(path: &Path) -> Result<Scenario> {
    let text = read_text(path, "read the scenario", 1 << 20)?;
    let scenario = Scenario::from_toml(&text).map_err(|problem| scenario_refused(path, &problem))?;
    scenario.build().map_err(|problem| scenario_refused(path, &problem))?;
    Ok(scenario)
}
