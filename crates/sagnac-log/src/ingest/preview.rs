//! The head of a log and its first rows as they stand, for whoever has to find out what its columns are.
//!
//! Formats of columns state their names. In text the line of headers is the first line of words whose next rows have as many cells, most of them numbers, dates or missing values. No
//! column has to be known by name.

use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::{Opened, Purpose};
use crate::ingest::columns::iso::iso_ns;
use crate::ingest::columns::number::{is_missing, parse_value};
use crate::ingest::columns::raw::RawRows;
use crate::ingest::formats::Format;
use crate::ingest::pieces::Pieces;
use crate::ingest::text::head::{Head, comment_of, delimiter_of, fit_to_rows, is_unit, is_value, refuse_binary, split};
use crate::setup::Setup;
use sagnac_units::s_from_ns;

/// Lines that are looked at, and bytes of them.
const MOST_LINES: usize = 1000;
const MOST_BYTES: usize = 4 << 20;
/// Rows that must follow a line of headers, where there are so many.
const ROWS_BELOW: usize = 3;

/// A log's columns with their first values.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Line of the headers, from 1.
    pub header_line: u64,
    /// Lines above it that are neither blank nor comments.
    pub above: usize,
    /// What separates the cells of a row; a comma for binary formats.
    pub delimiter: u8,
    /// The columns in their order.
    pub columns: Vec<SampleColumn>,
    /// What had to be assumed to read the text.
    pub assumed: Vec<String>,
}

/// One column.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleColumn {
    /// As the log has it.
    pub header: String,
    /// From the line of units, if there is one.
    pub unit: Option<String>,
    /// Its cells in the first rows, without blanks around them.
    pub cells: Vec<String>,
}

impl SampleColumn {
    /// Its numbers, with points or commas; missing values are left out.
    pub fn numbers(&self) -> Vec<f64> {
        let has_comma = self.cells.iter().any(|cell| cell.contains(','));
        self.cells.iter().filter_map(|cell| parse_value(cell.as_bytes(), has_comma)).collect()
    }

    /// Rows from one value to the next, the median: a stretch without values is not how often they come. `None` for fewer than two values.
    pub fn rows_apart(&self) -> Option<usize> {
        let known: Vec<usize> = self.known().map(|(row, _)| row).collect();
        let mut apart: Vec<usize> = known.windows(2).map(|pair| pair[1] - pair[0]).collect();
        apart.sort_unstable();
        apart.get(apart.len() / 2).copied()
    }

    /// Its dates, s since 1970; missing values are left out.
    pub fn dates_s(&self) -> Vec<f64> {
        self.cells.iter().filter_map(|cell| iso_ns(cell)).map(s_from_ns).collect()
    }

    /// True where its cells are dates.
    pub fn is_dates(&self) -> bool {
        let mut known = self.known().peekable();
        known.peek().is_some() && known.all(|(_, cell)| iso_ns(cell).is_some())
    }

    /// Rows and cells that are not missing.
    fn known(&self) -> impl Iterator<Item = (usize, &String)> {
        self.cells.iter().enumerate().filter(|(_, cell)| !cell.is_empty() && !is_missing(cell.as_bytes()))
    }
}

/// Looks at the head of a log.
///
/// # Errors
/// No log, no readable file, or no table in its first lines.
pub fn sample(path: &Path) -> Result<Sample> {
    sampled(Source::open(path, None)?).map_err(|e| e.file(path.display().to_string()))
}

/// The same of a reader, with a name for messages.
///
/// # Errors
/// As [`sample`].
pub fn sample_reader(name: &str, reader: Box<dyn Read + Send>) -> Result<Sample> {
    sampled(Source::from_reader(name.to_owned(), reader)?).map_err(|e| e.file(name))
}

fn sampled(source: Source) -> Result<Sample> {
    let setup = Setup::default();
    if Format::of(&source.start).magic.is_empty() {
        sampled_text(source, &setup)
    } else {
        sampled_columns(source, &setup)
    }
}

/// The first rows of a format of columns, as a text log would have them.
fn sampled_columns(source: Source, setup: &Setup) -> Result<Sample> {
    let Opened { feed, layout, lines_before, assumed, .. } =
        Format::of(&source.start).open(source, setup, Purpose::Preview)?;
    let mut pieces = Pieces::new(feed, lines_before, false);
    let mut columns: Vec<SampleColumn> =
        layout.headers.into_iter().map(|header| SampleColumn { header, unit: None, cells: Vec::new() }).collect();
    let (mut rows, mut read) = (RawRows::default(), 0);
    while read < MOST_LINES && pieces.next(&mut rows)? {
        for fields in rows.fields.iter().take(MOST_LINES - read) {
            let cells = columns.iter_mut().zip(fields);
            cells.for_each(|(column, cell)| column.cells.push(String::from_utf8_lossy(cell).trim().to_owned()));
        }
        read += rows.fields.len();
    }
    Ok(Sample { header_line: lines_before, above: 0, delimiter: b',', columns, assumed })
}

fn sampled_text(mut source: Source, setup: &Setup) -> Result<Sample> {
    refuse_binary(&mut source)?;
    let mut head = Head::new(&mut source, setup)?;
    let mut separator = head.separator;
    let (mut lines, mut comment, mut bytes) = (Vec::new(), None, 0);
    while let Some(line) = head.next()?.filter(|_| lines.len() < MOST_LINES && bytes < MOST_BYTES) {
        bytes += line.text.len();
        match crate::ingest::text::head::separator_of(&line.text).filter(|_| lines.is_empty()) {
            Some(found) => separator = Some(found),
            None if line.text.is_empty() => (),
            None if line.text.starts_with('#') => comment = comment_of(line).filter(|_| lines.is_empty()).or(comment),
            None => lines.push(line),
        }
    }
    // The last comment above the table may be its headers.
    let comments = usize::from(comment.is_some());
    lines.splice(..0, comment);
    let split_at = |at: usize| -> Vec<String> {
        let text = &lines[at].text;
        split(text, separator.unwrap_or_else(|| delimiter_of(text))).unwrap_or_default()
    };
    let names_at = |at: usize| {
        let mut names = split_at(at);
        let below: Vec<Vec<String>> = (at + 1..lines.len()).take(2).map(split_at).collect();
        fit_to_rows(&mut names, &below);
        names
    };
    let is_header = |at: &usize| {
        let names = names_at(*at);
        let words = names.iter().filter(|name| !name.is_empty() && !is_value(name)).count();
        let below = rows_below(&lines.len(), *at, names.len(), &split_at);
        words * 2 > names.len() && !below.is_empty() && below.iter().all(|row| is_row(row, names.len()))
    };
    let Some(at) = (0..lines.len()).find(is_header) else {
        return Err(Error::input(
            "no line of headers with rows of numbers below it",
            "give a text table with a header line",
        ));
    };
    let names = names_at(at);
    let below = (at + 1..lines.len()).map(split_at).collect::<Vec<_>>();
    let units = below.first().filter(|cells| is_units(cells, names.len())).cloned();
    let rows: Vec<Vec<String>> =
        below.into_iter().skip(usize::from(units.is_some())).filter(|row| row.len() == names.len()).collect();
    let column = |(place, header): (usize, String)| SampleColumn {
        header,
        unit: units.as_ref().and_then(|units| units.get(place)).filter(|unit| !unit.is_empty()).cloned(),
        cells: rows.iter().filter_map(|row| row.get(place)).cloned().collect(),
    };
    let columns = names.into_iter().enumerate().map(column).collect();
    let delimiter = separator.unwrap_or_else(|| delimiter_of(&lines[at].text));
    let (header_line, above) = (lines[at].number, at.saturating_sub(comments));
    Ok(Sample { header_line, above, delimiter, columns, assumed: source.assumed })
}

/// The first rows below a line, without a line of units.
fn rows_below(lines: &usize, at: usize, width: usize, split_at: &dyn Fn(usize) -> Vec<String>) -> Vec<Vec<String>> {
    let first = at + 1;
    let skip = usize::from(first < *lines && is_units(&split_at(first), width));
    (first + skip..*lines).take(ROWS_BELOW).map(split_at).collect()
}

fn is_units(cells: &[String], width: usize) -> bool {
    cells.len() == width
        && cells.iter().any(|cell| is_unit(cell))
        && !cells.iter().any(|cell| is_value(cell) && cell.len() > 1)
}

fn is_row(cells: &[String], width: usize) -> bool {
    cells.len() == width && cells.iter().filter(|cell| is_value(cell)).count() * 2 >= width
}
