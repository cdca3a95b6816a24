//! Setup and limits as the package gives them: a file, and keys next to it.

use sagnac::{Error, Limits, Result, Setup};

/// A setup of a file, then keys as JSON: each takes the place of the file's.
pub(crate) fn setup(base: Setup, file: Option<&str>, keys: &str) -> Result<Setup> {
    let base = file.map(Setup::read).transpose()?.unwrap_or(base);
    let broken = |e: serde_json::Error| {
        Error::input(format!("setup: {e}"), "correct the key: docs/reference/cli.md lists all of them")
    };
    let keys: serde_json::Map<String, serde_json::Value> = serde_json::from_str(keys).map_err(broken)?;
    if keys.is_empty() {
        return Ok(base);
    }
    let mut whole = serde_json::to_value(&base).map_err(broken)?;
    if let Some(whole) = whole.as_object_mut() {
        whole.extend(keys);
    }
    let mut setup: Setup = serde_json::from_value(whole).map_err(broken)?;
    setup.memory = base.memory;
    setup.check()?;
    Ok(setup)
}

/// Limits of a file, of a set of the program by its name, or of keys as JSON (`{…}`).
pub(crate) fn limits(text: &str) -> Result<Limits> {
    if !text.starts_with('{') {
        return Limits::named_or_read(text);
    }
    let broken = |e: &dyn std::fmt::Display| {
        Error::input(format!("limits: {e}"), "correct the key: docs/reference/limits.md lists all of them")
    };
    let keys: serde_json::Value = serde_json::from_str(text).map_err(|e| broken(&e))?;
    Limits::parse(&toml::to_string(&keys).map_err(|e| broken(&e))?)
}
