//! The short form of a result: a verdict line, a table, at most three notes, and the last lines. It fits 15 lines of 100 columns.
//!
//! ```text
//! IMU-0042: calibrated over -20 … 60 °C     verdict, its first words in colour on a terminal
//! axis  as logged  on unseen data           table
//! warning axis x: …                         notes, warnings first; the others are counted
//! wrote   unit.cal.json                     last lines
//! ```
//!
//! A table of more than three axes, and a note that is longer than the room, take more.

use crate::output::console::Console;
use crate::output::terminal::{MOST_COLUMNS, Tone, wrapped};

/// Lines of the whole.
const MOST_LINES: usize = 15;
/// Notes shown.
const MOST_NOTES: usize = 3;

/// A sentence next to a result.
pub(crate) struct Remark {
    pub(crate) is_warning: bool,
    /// The axes that it is about; empty for the unit.
    pub(crate) axes: Vec<char>,
    pub(crate) text: String,
}

impl Remark {
    /// About the unit.
    pub(crate) fn note(text: impl Into<String>) -> Self {
        Self { is_warning: false, axes: Vec::new(), text: text.into() }
    }

    pub(crate) fn warning(text: impl Into<String>) -> Self {
        Self { is_warning: true, ..Self::note(text) }
    }

    fn line(&self) -> String {
        let word = if self.is_warning { "warning" } else { "note" };
        let axes: Vec<String> = self.axes.iter().map(char::to_string).collect();
        let of_axes = match axes.len() {
            0 => String::new(),
            1 => format!("axis {}: ", axes[0]),
            _ => format!("axes {}: ", axes.join(", ")),
        };
        format!("{word:<8}{of_axes}{}", self.text)
    }
}

/// A result in short.
pub(crate) struct Brief {
    /// The unit, or the file.
    pub(crate) of: String,
    /// Verdict in capitals, or nothing.
    pub(crate) word: &'static str,
    pub(crate) tone: Tone,
    /// The rest of the first line.
    pub(crate) verdict: String,
    /// Lines of a table, and below it.
    pub(crate) body: Vec<String>,
    pub(crate) remarks: Vec<Remark>,
    /// `wrote …`, `next …`.
    pub(crate) last: Vec<String>,
}

impl Brief {
    /// The first line.
    fn say_verdict(&self, console: &mut Console) {
        let Self { of, word, verdict, tone, .. } = self;
        let gap = if word.is_empty() || verdict.is_empty() { "" } else { " - " };
        console.say_marked(&format!("{of}: {word}{gap}{verdict}"), word, *tone);
    }

    /// The last lines.
    fn say_last(&self, console: &mut Console) {
        self.last.iter().for_each(|line| console.say_within(line, MOST_COLUMNS));
    }

    /// The whole; with `--verbose` everything instead of the table and the notes.
    pub(crate) fn say(&self, console: &mut Console, everything: impl FnOnce(&mut Console)) {
        self.say_verdict(console);
        if console.is_verbose() {
            everything(console);
            return self.say_last(console);
        }
        if !self.body.is_empty() {
            console.say("");
            self.body.iter().for_each(|line| console.say_within(line, MOST_COLUMNS));
        }
        let body: usize = self.body.iter().map(|line| wrapped(line, Some(MOST_COLUMNS)).split('\n').count()).sum();
        let room = MOST_LINES.saturating_sub(1 + body + usize::from(body > 0) + self.last.len());
        if !self.remarks.is_empty() && room > 2 {
            console.say("");
        }
        for line in chosen(joined(&self.remarks), room.saturating_sub(1)) {
            console.note_within(&line, MOST_COLUMNS);
        }
        self.say_last(console);
    }
}

/// Remarks with the same words as one; warnings first.
fn joined(remarks: &[Remark]) -> Vec<Remark> {
    let mut out: Vec<Remark> = Vec::new();
    for Remark { is_warning, axes, text } in remarks {
        match out.iter_mut().find(|other| other.text == *text && other.is_warning == *is_warning) {
            Some(other) => other.axes.extend(axes),
            None => out.push(Remark { is_warning: *is_warning, axes: axes.clone(), text: text.clone() }),
        }
    }
    out.sort_by_key(|remark| !remark.is_warning);
    out
}

/// The first remarks, as many as have room, and the number of the others.
fn chosen(remarks: Vec<Remark>, room: usize) -> Vec<String> {
    let lines_of = |line: &str| wrapped(line, Some(MOST_COLUMNS)).lines().count();
    let all: Vec<String> = remarks.iter().map(Remark::line).collect();
    let mut shown: Vec<String> = Vec::new();
    let mut used = 0;
    for line in all.iter().take(MOST_NOTES) {
        let counted = usize::from(shown.len() + 1 < all.len());
        if !shown.is_empty() && used + lines_of(line) + counted > room {
            break;
        }
        used += lines_of(line);
        shown.push(line.clone());
    }
    let more = all.len() - shown.len();
    shown.extend((more > 0).then(|| format!("        {more} more: -v")));
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_note_of_several_axes_is_one_and_more_than_three_are_counted() {
        let of =
            |axis: char, is_warning: bool, text: &str| Remark { is_warning, axes: vec![axis], text: text.to_owned() };
        let all =
            [of('x', false, "a"), of('y', false, "a"), of('z', true, "b"), of('x', false, "c"), of('x', false, "d")];
        let lines = chosen(joined(&all), 10);
        assert_eq!(lines, ["warning axis z: b", "note    axes x, y: a", "note    axis x: c", "        1 more: -v"]);
        assert_eq!(chosen(joined(&all), 2), ["warning axis z: b", "        3 more: -v"]);
    }
}
