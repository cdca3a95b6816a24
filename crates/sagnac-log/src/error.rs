//! Errors: the cause, its place, and the remedy.
//!
//! Users see two kinds: [`ErrorKind::Input`] (bad usage or a bad file; exit status 2) and
//! [`ErrorKind::Refused`] (the input is fine, but cannot support the answer; exit status 3).

use std::fmt;
use std::io;
use std::path::Path;

/// The kind of an error, and with it the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// Bad usage, an unreadable file, a broken line.
    Input,
    /// The data cannot support the answer.
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
    /// The text in that place.
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

/// An error with a remedy: no error is made without one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct Error {
    /// Input or refusal.
    pub kind: ErrorKind,
    /// The cause, in one sentence.
    pub what: String,
    /// The place of the cause.
    pub place: Box<Place>,
    /// The remedy: one imperative, with a command or key to copy where there is one.
    pub help: String,
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

impl From<io::Error> for Error {
    fn from(error: io::Error) -> Self {
        Self::input(error.to_string(), remedy_of(&error))
    }
}

/// What to do about an error of the file system.
fn remedy_of(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::NotFound => "give the path of an existing file or folder",
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "change the permissions, or use another folder"
        }
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "free space on the disk, or use another one",
        io::ErrorKind::NotADirectory | io::ErrorKind::IsADirectory => "give a file where a file is needed, or a folder",
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput => {
            "copy the file again from its source"
        }
        _ => "copy the file to a local disk, and run the command again",
    }
}

impl Error {
    /// Bad usage or input, with the remedy.
    pub fn input(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Input, what: what.into(), place: Box::default(), help: help.into() }
    }

    /// The data cannot support the answer; with the remedy.
    pub fn refused(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Refused, ..Self::input(what, help) }
    }

    /// A file whose content is broken: "damaged `what`".
    pub fn damaged(what: impl fmt::Display) -> Self {
        Self::input(format!("damaged {what}"), "copy the file again from its source")
    }

    /// A fault of Sagnac that no input should cause.
    pub fn defect(what: impl fmt::Display) -> Self {
        let report = "report it with the command and its files: https://github.com/sagnac/sagnac/issues";
        Self::input(format!("a defect of this program: {what}"), report)
    }

    /// A format that was not compiled in.
    pub fn without(format: &str) -> Self {
        let what = format!("this program was built without {format}");
        Self::input(what, "build it with its default features, or convert the log to CSV")
    }

    /// Invalid TOML; names the line.
    pub fn toml(what: &str, text: &str, error: &toml::de::Error, help: impl Into<String>) -> Self {
        let before = error.span().and_then(|span| text.as_bytes().get(..span.start)).unwrap_or(&[]);
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        Self::input(format!("{what}: {}", error.message().trim()), help).line(line as u64)
    }

    /// A read or write that failed, where the file is named later.
    pub fn cannot(doing: &str, error: &io::Error) -> Self {
        Self::input(format!("cannot {doing}: {error}"), remedy_of(error))
    }

    /// A file that could not be read or written.
    pub fn io(file: impl Into<String>, doing: &str, error: &io::Error) -> Self {
        Self::cannot(doing, error).file(file)
    }

    /// The same for a path.
    pub fn io_path(path: &Path, doing: &str, error: &io::Error) -> Self {
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

    /// Quotes the text in this place, shortened to 40 characters.
    #[must_use]
    pub fn value(mut self, value: impl AsRef<str>) -> Self {
        let value = value.as_ref();
        let short: String = value.chars().take(40).collect();
        self.place.value = Some(if short.len() < value.len() { short + "…" } else { short });
        self
    }

    /// Puts the subject before the cause.
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

    /// Gives a better remedy, where the caller knows one.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }
}
