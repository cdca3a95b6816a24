//! Units by the names of their logs: `data/{lot}/unit={unit}/run={run}.parquet`.
//!
//! A name in braces stands for a part of a path between its neighbours, within one folder or file name, and so does `*`, which is for
//! nothing. `{unit}` is needed; `{lot}` and `{rig}` are noted; `{use}` is `calibrate` or `verify`; `{run}` gives runs their order.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use sagnac_log::error::{Error, Result};

/// What a log is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Use {
    #[default]
    Calibrate,
    Verify,
}

impl FromStr for Use {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "" | "calibrate" => Ok(Self::Calibrate),
            "verify" => Ok(Self::Verify),
            _ => {
                Err(Error::input("a log is used for `calibrate` or `verify`", "name the folder or the column `use` so")
                    .column("use")
                    .value(text))
            }
        }
    }
}

/// Names that may stand in braces.
const NAMES: [&str; 5] = ["unit", "lot", "rig", "run", "use"];

/// A log and what its path says of it.
#[derive(Clone, Debug, Default)]
pub(super) struct MatchedLog {
    pub(super) unit: String,
    pub(super) lot: String,
    pub(super) rig: String,
    pub(super) of: Use,
    pub(super) log: PathBuf,
}

/// Part of a template.
#[derive(Clone, Debug, PartialEq, Eq)]
enum PatternPart {
    Text(String),
    /// A name, or nothing for `*`.
    Any(Option<&'static str>),
}

/// True for a path with a name in braces.
pub(super) fn is_template(source: &Path) -> bool {
    !source.exists() && source.to_str().is_some_and(|text| text.contains('{'))
}

/// The logs that a template means, in natural order: `logs_of` has those of a pattern with `*` for each name.
///
/// # Errors
/// An unknown name, a template without `{unit}`, no log that matches, two values of a name in one path.
pub(super) fn matches(template: &Path, logs_of: impl FnOnce(&str) -> Result<Vec<PathBuf>>) -> Result<Vec<MatchedLog>> {
    let text = template.to_str().unwrap_or_default();
    let wrong = |what: String| Error::input(what, "write it like data/{lot}/unit={unit}/run={run}.parquet").file(text);
    let folders: Vec<Vec<PatternPart>> =
        text.split('/').map(parts).collect::<std::result::Result<_, _>>().map_err(wrong)?;
    if !folders.iter().flatten().any(|part| *part == PatternPart::Any(Some("unit"))) {
        return Err(wrong("the pattern of logs has no {unit}".to_owned()));
    }
    let as_glob = |part: &PatternPart| match part {
        PatternPart::Text(text) => text.clone(),
        PatternPart::Any(_) => "*".to_owned(),
    };
    let glob: Vec<String> = folders.iter().map(|folder| folder.iter().map(as_glob).collect()).collect();
    let logs = logs_of(&glob.join("/"))?;
    let matched = |log: PathBuf| {
        let text = log.to_str().ok_or_else(|| {
            Error::input("the name is not Unicode", "rename the file").file(log.display().to_string())
        })?;
        let mut values: BTreeMap<&'static str, String> = BTreeMap::new();
        // A pattern may begin with `./`, which the paths that it finds do not show.
        let plain = folders.iter().filter(|folder| **folder != [PatternPart::Text(".".to_owned())]);
        for (folder, name) in plain.zip(text.split('/').filter(|name| *name != ".")) {
            take(folder, name, &mut values)
                .map_err(|what| Error::input(what, "write the pattern like data/{unit}/{use}-*.csv").file(text))?;
        }
        let mut value = |name: &str| values.remove(name).unwrap_or_default();
        let use_of_log = value("use").parse().map_err(|e: Error| e.file(text))?;
        Ok(MatchedLog { unit: value("unit"), lot: value("lot"), rig: value("rig"), of: use_of_log, log: log.clone() })
    };
    logs.into_iter().map(matched).collect()
}

/// The parts of a folder's or file's name.
fn parts(text: &str) -> std::result::Result<Vec<PatternPart>, String> {
    let mut out: Vec<PatternPart> = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find(['{', '*']) {
        let (before, from) = rest.split_at(at);
        if !before.is_empty() {
            out.push(PatternPart::Text(before.to_owned()));
        } else if matches!(out.last(), Some(PatternPart::Any(_))) {
            return Err(format!("two names without a letter between them: {text}"));
        }
        let (name, after) = match from.strip_prefix('{') {
            Some(inner) => {
                let (name, after) = inner.split_once('}').ok_or_else(|| format!("a brace without its end: {text}"))?;
                let known = NAMES.iter().find(|known| **known == name);
                (Some(*known.ok_or_else(|| format!("{{{name}}} is not one of {}", NAMES.join(", ")))?), after)
            }
            None => (None, &from[1..]),
        };
        out.push(PatternPart::Any(name));
        rest = after;
    }
    if !rest.is_empty() {
        out.push(PatternPart::Text(rest.to_owned()));
    }
    Ok(out)
}

/// The values of a name: each ends where the text behind it begins first.
fn take(
    folder: &[PatternPart],
    name: &str,
    values: &mut BTreeMap<&'static str, String>,
) -> std::result::Result<(), String> {
    let mut rest = name;
    for (at, part) in folder.iter().enumerate() {
        match part {
            PatternPart::Text(text) => rest = rest.strip_prefix(text.as_str()).unwrap_or_default(),
            PatternPart::Any(known) => {
                let end = match folder.get(at + 1) {
                    // The last text ends the name: `a.b.csv` of `{unit}.csv` is `a.b`.
                    Some(PatternPart::Text(next)) if at + 2 == folder.len() => rest.len().saturating_sub(next.len()),
                    Some(PatternPart::Text(next)) => rest.find(next.as_str()).unwrap_or(rest.len()),
                    _ => rest.len(),
                };
                let (value, after) = rest.split_at_checked(end).unwrap_or((rest, ""));
                rest = after;
                let Some(known) = known else { continue };
                if values.insert(known, value.to_owned()).is_some_and(|before| before != value) {
                    return Err(format!("two values of {{{known}}} in one path"));
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_between_their_neighbours() {
        let folder = parts("unit={unit},{rig}-x{run}.csv").unwrap();
        let mut values = BTreeMap::new();
        take(&folder, "unit=A-1,r-2-x03.b.csv", &mut values).unwrap();
        let expected = [("unit", "A-1"), ("rig", "r-2"), ("run", "03.b")];
        assert_eq!(values, expected.map(|(name, value)| (name, value.to_owned())).into());
    }

    #[test]
    fn wrong_braces_are_refused() {
        for text in ["{unit", "{unit}{run}", "{gyro}", "{unit}*"] {
            assert!(parts(text).is_err(), "{text}");
        }
        assert_eq!(parts("a*b").unwrap().len(), 3);
    }
}
