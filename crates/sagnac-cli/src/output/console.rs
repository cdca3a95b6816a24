//! Output for people and scripts: text, tables, JSON, errors.
//!
//! With `--json` one object goes to standard output and the text for people to standard error.
//! On a terminal, lines wrap by word ([`crate::output::terminal`]), a verdict is in colour unless NO_COLOR is set, and a locale without
//! UTF-8 gets ASCII. A reader that goes away (a closed pipe) ends the printing quietly.

use std::borrow::Cow;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use sagnac::{Error, ErrorKind};
use sagnac_units::format::{printable, printable_json};
use serde::Serialize;

use crate::output::terminal::{MOST_COLUMNS, Tone, ascii, columns_of_errors, columns_of_output, is_utf8, wrapped};

/// How a command that did not fail ended.
pub(crate) enum Outcome {
    Done,
    LimitsNotMet,
    /// Some units of a fleet have no calibration.
    SomeFailed,
}

/// Result of a subcommand.
pub(crate) type Ran = Result<Outcome, Error>;

/// Where the last panic happened. Our code should not panic; a decoder's panic is caught and reported as a bad file.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Stores a panic's place instead of printing it.
pub(crate) fn keep_panics_quiet() {
    std::panic::set_hook(Box::new(|info| {
        if let Ok(mut last) = LAST_PANIC.lock() {
            *last = info.to_string();
        }
    }));
}

/// The message for a panic that reached the top.
pub(crate) fn internal_error() -> Error {
    let place = LAST_PANIC.lock().map(|last| last.clone()).unwrap_or_default();
    Error::defect(place)
}

/// How much is printed for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Loudness {
    /// Errors alone.
    Quiet,
    #[default]
    Brief,
    /// Everything.
    Verbose,
}

/// Where things are printed.
pub(crate) struct Console {
    json: bool,
    loudness: Loudness,
    /// The first write error; a closed pipe is not an error.
    lost: Option<std::io::Error>,
}

#[derive(Serialize)]
struct Complaint<'a> {
    refused: bool,
    reason: &'a str,
    place: ComplaintPlace<'a>,
    help: &'a str,
}

#[derive(Serialize)]
struct ComplaintPlace<'a> {
    file: Option<&'a str>,
    line: Option<u64>,
    column: Option<&'a str>,
    value: Option<&'a str>,
}

/// `-q`, for readers of logs, which have no console.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// True where errors alone are printed.
pub(crate) fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

impl Console {
    pub(crate) fn new(json: bool, loudness: Loudness) -> Self {
        IS_QUIET.store(loudness == Loudness::Quiet, Ordering::Relaxed);
        Self { json, loudness, lost: None }
    }

    /// True where everything is printed.
    pub(crate) fn is_verbose(&self) -> bool {
        self.loudness == Loudness::Verbose
    }

    /// A line for people.
    pub(crate) fn say(&mut self, line: impl AsRef<str>) {
        self.say_lines(line.as_ref(), columns_of_output(), "", Tone::Plain);
    }

    /// A line for people, no wider than so many columns wherever it goes.
    pub(crate) fn say_within(&mut self, line: &str, columns: usize) {
        self.say_lines(line, Some(columns_of_output().map_or(columns, |own| own.min(columns))), "", Tone::Plain);
    }

    /// The same with one of its words in colour on a terminal.
    pub(crate) fn say_marked(&mut self, line: &str, word: &str, tone: Tone) {
        let columns = columns_of_output().map_or(MOST_COLUMNS, |own| own.min(MOST_COLUMNS));
        self.say_lines(line, Some(columns), word, tone);
    }

    fn say_lines(&mut self, line: &str, columns: Option<usize>, word: &str, tone: Tone) {
        if self.json {
            self.note(line);
        } else if self.loudness != Loudness::Quiet {
            let text = wrapped(&printable(line), columns);
            let text = if columns_of_output().is_some() { for_terminal(&text, word, tone) } else { text };
            self.print(&text);
        }
    }

    /// A line for people that is never part of the output.
    pub(crate) fn note(&mut self, line: impl AsRef<str>) {
        self.note_lines(line.as_ref(), columns_of_errors());
    }

    /// The same, no wider than so many columns wherever it goes.
    pub(crate) fn note_within(&mut self, line: &str, columns: usize) {
        self.note_lines(line, Some(columns_of_errors().map_or(columns, |own| own.min(columns))));
    }

    fn note_lines(&mut self, line: &str, columns: Option<usize>) {
        if self.loudness == Loudness::Quiet {
            return;
        }
        let text = wrapped(&printable(line), columns);
        let is_warning = text.starts_with("warning");
        let word = if is_warning { "warning" } else { "" };
        let text = if columns_of_errors().is_some() { for_terminal(&text, word, Tone::Open) } else { text };
        let _ = writeln!(std::io::stderr(), "{text}");
    }

    /// The object for scripts, if it was asked for.
    pub(crate) fn object(&mut self, value: &impl Serialize) -> Result<(), Error> {
        if self.json {
            let text =
                serde_json::to_string_pretty(value).map_err(|e| Error::defect(format!("cannot write JSON: {e}")))?;
            self.print(&printable_json(&text));
        }
        Ok(())
    }

    fn print(&mut self, text: &str) {
        let written = writeln!(std::io::stdout(), "{text}");
        if let Err(error) = written.and_then(|()| std::io::stdout().flush())
            && error.kind() != std::io::ErrorKind::BrokenPipe
        {
            self.lost.get_or_insert(error);
        }
    }

    /// The result, or the error if its output could not be written.
    pub(crate) fn ended(&self, ran: Ran) -> Ran {
        match &self.lost {
            Some(error) => ran.and(Err(Error::io("standard output", "write", error))),
            None => ran,
        }
    }

    /// Prints an error; its exit status.
    pub(crate) fn complain(&mut self, error: &Error) -> ExitCode {
        let word = match error.kind {
            ErrorKind::Input => "error",
            ErrorKind::Refused => "refused",
        };
        // Cut as it is shown: an escaped character has several.
        let line = |text: &str| {
            let shown = wrapped(&shortened(&printable(text)), columns_of_errors());
            writeln!(std::io::stderr(), "{shown}")
        };
        let _ = line(&format!("{word}: {error}"));
        let _ = line(&format!("  help: {}", error.help));
        let place = &error.place;
        let _ = self.object(&Complaint {
            refused: error.kind == ErrorKind::Refused,
            reason: &shortened(&error.what),
            place: ComplaintPlace {
                file: place.file.as_deref(),
                line: place.line,
                column: place.column.as_deref(),
                value: place.value.as_deref(),
            },
            help: &shortened(&error.help),
        });
        match error.kind {
            ErrorKind::Input => ExitCode::from(2),
            ErrorKind::Refused => ExitCode::from(3),
        }
    }
}

/// A word in its colour, and ASCII where the locale has no UTF-8.
fn for_terminal(text: &str, word: &str, tone: Tone) -> String {
    let code = match tone {
        Tone::Good => "32",
        Tone::Bad => "31",
        Tone::Open => "33",
        Tone::Plain => "",
    };
    let has_colour = !code.is_empty() && !word.is_empty() && std::env::var_os("NO_COLOR").is_none();
    let text = if is_utf8() { text.to_owned() } else { ascii(text) };
    if has_colour { text.replacen(word, &format!("\u{1b}[1;{code}m{word}\u{1b}[0m"), 1) } else { text }
}

/// A message in a length that a person reads: what a file holds may be quoted in it.
fn shortened(text: &str) -> Cow<'_, str> {
    const MOST_CHARS: usize = 1500;
    match text.char_indices().nth(MOST_CHARS) {
        Some((end, _)) => Cow::Owned(format!("{} … ({} more bytes)", &text[..end], text.len() - end)),
        None => Cow::Borrowed(text),
    }
}
