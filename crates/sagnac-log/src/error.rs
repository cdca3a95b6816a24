//! What went wrong, where, and what to do about it.
//!
//! Two kinds reach a user: [`ErrorKind::Input`] (bad usage or a bad file; exit status 2) and
//! [`ErrorKind::Refused`] (the input is fine, but cannot support the answer; exit status 3).

use std::fmt;
use std::path::Path;

/// Which exit status an error has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Bad usage, an unreadable file, a broken line.
    Input,
    /// The data cannot support what was asked.
    Refused,
}

/// A place in the input. Empty fields are not printed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Place {
    /// File name as it was given.
    pub file: Option<String>,
    /// Line, from 1.
    pub line: Option<u64>,
    /// Column or field name.
    pub column: Option<String>,
    /// The text found there.
    pub value: Option<String>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        match (&self.file, self.line) {
            (Some(file), Some(line)) => parts.push(format!("{file}:{line}")),
            (Some(file), None) => parts.push(file.clone()),
            (None, Some(line)) => parts.push(format!("line {line}")),
            (None, None) => {}
        }
        if let Some(column) = &self.column {
            parts.push(format!("`{column}`"));
        }
        if let Some(value) = &self.value {
            parts.push(format!("value {value:?}"));
        }
        f.write_str(&parts.join(", "))
    }
}

/// An error on which a person can act.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct Error {
    /// Input or refusal.
    pub kind: ErrorKind,
    /// What was wrong.
    pub what: String,
    /// Where.
    pub place: Box<Place>,
    /// What to do.
    pub help: Option<String>,
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = self.place.to_string();
        if !place.is_empty() {
            write!(f, "{place}: ")?;
        }
        f.write_str(&self.what)
    }
}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self::input(error.to_string())
    }
}

impl Error {
    /// Bad usage or input.
    pub fn input(what: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Input, what: what.into(), place: Box::default(), help: None }
    }

    /// The data cannot support the answer.
    pub fn refused(what: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Refused, ..Self::input(what) }
    }

    /// What a format needs was not compiled in.
    pub fn without(format: &str) -> Self {
        Self::input(format!("this program was built without {format}"))
            .help("build it with its default features; a log can be converted to CSV")
    }

    /// Invalid TOML; names the line.
    pub fn toml(what: &str, text: &str, error: &toml::de::Error) -> Self {
        let before = error.span().and_then(|span| text.as_bytes().get(..span.start)).unwrap_or(&[]);
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        Self::input(format!("{what}: {}", error.message().trim())).line(line as u64)
    }

    /// A file that could not be read or written.
    pub fn io(file: impl Into<String>, doing: &str, error: &std::io::Error) -> Self {
        Self::input(format!("cannot {doing}: {error}")).file(file)
    }

    /// The same for a path.
    pub fn io_path(path: &Path, doing: &str, error: &std::io::Error) -> Self {
        Self::io(path.display().to_string(), doing, error)
    }

    /// Choices in a list; one without a name is shown by its value.
    pub fn choices(names: &[String]) -> String {
        let shown = names.iter().map(|name| if name.is_empty() { "one without a name" } else { name.as_str() });
        shown.collect::<Vec<_>>().join(", ")
    }

    /// Names the file, unless an inner place already did.
    #[must_use]
    pub fn file(mut self, file: impl Into<String>) -> Self {
        self.place.file.get_or_insert_with(|| file.into());
        self
    }

    /// Names the line.
    #[must_use]
    pub fn line(mut self, line: u64) -> Self {
        self.place.line = Some(line);
        self
    }

    /// Names the column or field.
    #[must_use]
    pub fn column(mut self, column: impl Into<String>) -> Self {
        self.place.column = Some(column.into());
        self
    }

    /// Quotes what was found, shortened to 40 characters.
    #[must_use]
    pub fn value(mut self, value: impl AsRef<str>) -> Self {
        let value = value.as_ref();
        let short: String = value.chars().take(40).collect();
        self.place.value = Some(if short.len() < value.len() { short + "…" } else { short });
        self
    }

    /// Names what it is about before what was wrong.
    #[must_use]
    pub fn of(mut self, subject: &str) -> Self {
        self.what = format!("{subject}: {}", self.what);
        self
    }

    /// The same as a refusal.
    #[must_use]
    pub fn as_refusal(mut self) -> Self {
        self.kind = ErrorKind::Refused;
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}
