//! The record as a file: JSON in and out.

use std::path::Path;

use sagnac_log::error::{Error, Result};
use sagnac_log::read::read_text;
use sagnac_units::format::one_line;
use serde_json::Value;

use crate::calibration::{Calibration, FORMAT, MINOR_VERSION, VERSION};

/// Longest record: of a thousand logs it has about 2 MB. As many bytes of empty lists take 546 MB to be refused, within the memory budget.
const MOST_BYTES: u64 = 16 << 20;

/// No quantity of a record is beyond this, in any unit: a drift of 10⁵ °/s in °/h is 4·10⁸, a variance its square. Larger numbers are
/// damage, and what is computed from them is no number.
const MOST: f64 = 1e30;
/// Fields that records of earlier programs have and that nothing reads any more.
const RETIRED: [&str; 1] = ["bootstrap"];

impl Calibration {
    /// Reads and checks a record. Fields that this program does not know are ignored in a record of a newer minor version,
    /// and refused in any other.
    ///
    /// # Errors
    /// Not JSON, a missing, unknown or non-finite field, another format or version (field named).
    pub fn parse(text: &str) -> Result<Self> {
        let head: Value = serde_json::from_str(text).map_err(|e| not_json(&e))?;
        if head.get("format").and_then(Value::as_str) != Some(FORMAT) {
            return Err(Error::input(
                "the file is JSON, but not a calibration",
                "give the file that `sagnac calibrate -o` wrote",
            )
            .column("format"));
        }
        if head.get("version").and_then(Value::as_u64) != Some(u64::from(VERSION)) {
            let version = head.get("version").map(ToString::to_string).unwrap_or_default();
            return Err(Error::input(
                format!("this program reads version {VERSION}"),
                "calibrate again from the logs, or use the program that wrote the record",
            )
            .column("version")
            .value(version));
        }
        within_bounds(&head, "")?;
        let is_newer = head.get("minor_version").and_then(Value::as_u64) > Some(u64::from(MINOR_VERSION));
        let mut unknown = None;
        let mut json = serde_json::Deserializer::from_str(text);
        let calibration: Self = serde_ignored::deserialize(&mut json, |path| {
            let path = path.to_string();
            if RETIRED.iter().all(|field| path.rsplit('.').next() != Some(*field)) {
                unknown.get_or_insert(path);
            }
        })
        .map_err(|e| not_json(&e))?;
        if let Some(field) = unknown.filter(|_| !is_newer) {
            return Err(Error::input(
                "this version of the record has no such field",
                "remove the field, or calibrate again with this version",
            )
            .column(field));
        }
        calibration.check()?;
        Ok(calibration)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// As [`Calibration::parse`], with the file named.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = read_text(path, "read", MOST_BYTES)?;
        Self::parse(&text).map_err(|e| e.file(path.display().to_string()))
    }

    /// As JSON, ending in a newline.
    ///
    /// # Errors
    /// A number that JSON cannot hold.
    pub fn to_json(&self) -> Result<String> {
        self.check()?;
        let unwritten = |e: serde_json::Error| Error::defect(format!("cannot write JSON: {e}"));
        let value = serde_json::to_value(self).map_err(unwritten)?;
        // A record that could not be read again is none.
        within_bounds(&value, "")?;
        let mut text = serde_json::to_string_pretty(&value).map_err(unwritten)?;
        text.push('\n');
        Ok(text)
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// As [`Calibration::to_json`], and what the file system says.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        sagnac_log::write::write_bytes(path.as_ref(), self.to_json()?.as_bytes())
    }
}

/// Refuses a number beyond [`MOST`], by its place.
fn within_bounds(value: &Value, place: &str) -> Result<()> {
    let below = |name: &str| if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") };
    match value {
        Value::Number(number) if number.as_f64().is_some_and(|value| value.abs() > MOST) => Err(Error::input(
            "the number is too large for a gyroscope",
            "calibrate again, or copy the file again from its source",
        )
        .column(place)
        .value(number.to_string())),
        // It would write a line of its own where it is shown.
        Value::String(text) if text.contains(['\n', '\r']) => Err(Error::input(
            "texts of a record have no control characters and no line ends",
            "copy the file again from its source",
        )
        .column(place)
        .value(one_line(text))),
        Value::Array(all) => {
            all.iter().enumerate().try_for_each(|(at, value)| within_bounds(value, &below(&at.to_string())))
        }
        Value::Object(all) => all.iter().try_for_each(|(name, value)| within_bounds(value, &below(name))),
        _ => Ok(()),
    }
}

impl std::str::FromStr for Calibration {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text)
    }
}

fn not_json(error: &serde_json::Error) -> Error {
    let text = error.to_string();
    let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
    Error::input(
        format!("not a readable calibration: {what}"),
        "copy the file again from its source, or calibrate again",
    )
    .line(error.line() as u64)
}
