//! The head of a text log: encoding, `sep=;`, lines above the headers, the headers, a line of units below them.
//!
//! ```text
//! lines ─▶ skip blank lines, comments and a preamble ─▶ headers ─▶ with the units of brackets or of the next line ─▶ headers of Sagnac
//! ```
//!
//! What is not stated in the file and had to be assumed is said in a line each ([`TextHeader::assumed`]). A line is the line of headers if it
//! has one of counts or rates, by its name, by its name and unit, or by the setup's `[columns]`, and a row or a line of units is below it. Where
//! no line has one, the first line counts, and the error is about that. A unit that contradicts its header, or that is not known, is refused.
//!
//! Bytes that are not UTF-8 are read as Windows-1252, which every byte of is a character; UTF-16 is decoded before ([`crate::ingest::bytes::source`]).

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Cursor, Read};

use crate::error::{Error, Result};
use crate::ingest::bytes::foreign;
use crate::ingest::bytes::source::Source;
use crate::ingest::columns::feed::MAX_LINE_BYTES;
use crate::ingest::columns::header::{self, COMPENSATED_STAMP, Layout, Role, role_of};
use crate::ingest::columns::iso::iso_ns;
use crate::ingest::columns::names;
use crate::ingest::columns::number::{is_missing, parse_value};
use crate::ingest::columns::words::{HeaderQuantity, bare};
use crate::ingest::text::blanks::{SingleBlanks, are_between_cells};
use crate::ingest::text::lines::line_without_end;
use crate::setup::Setup;

/// Most blank lines and comments above the headers.
const MAX_LINES_ABOVE: u64 = 100_000;
/// Most other lines above the headers.
const MAX_PREAMBLE: usize = 100;
/// The line of headers and where the rows begin.
pub(crate) struct TextHeader {
    pub(crate) headers: Vec<String>,
    /// The setup's map, with the headers that were recognised.
    pub(crate) columns: BTreeMap<String, String>,
    pub(crate) delimiter: u8,
    /// Lines above the first row.
    pub(crate) lines: u64,
    /// Line of the headers.
    pub(crate) line: u64,
    /// What was assumed, a sentence each.
    pub(crate) assumed: Vec<String>,
}

/// One line as it was read.
pub(crate) struct HeadLine {
    pub(crate) text: String,
    pub(crate) number: u64,
}

/// Reads the head of a text log.
pub(crate) fn read_header(source: &mut Source, setup: &Setup) -> Result<TextHeader> {
    refuse_binary(source)?;
    let mut head = Head::new(source, setup)?;
    let (line, above) = head.header_line()?;
    let delimiter = head.separator.unwrap_or_else(|| delimiter_of(&line.text));
    let mut headers = split(&line.text, delimiter).map_err(|e| e.line(line.number))?;
    fit_to_rows(&mut headers, &head.lines_below(delimiter)?);
    if headers.iter().all(|h| h.parse::<f64>().is_ok()) {
        return Err(Error::input(
            "the first line contains numbers instead of headers",
            format!("put a header line above it. Known headers: {}", header::RECOGNISED),
        )
        .line(line.number));
    }
    let units = head.line_of_units(headers.len(), delimiter)?;
    let row = head.lines_below(delimiter)?.into_iter().next().unwrap_or_default();
    let of_columns = units.as_deref().unwrap_or_default();
    let mut free = headers.iter().zip(of_columns).filter(|(name, _)| !setup.columns.contains_key(*name));
    free.try_for_each(|(name, unit)| refuse_other_unit(name, unit)).map_err(|e| e.line(line.number + 1))?;
    let (columns, read_as) = names::mapped(&headers, of_columns, &row, &setup.columns);
    let (is_latin, separator, lines) = (head.is_latin, head.separator, head.lines);
    let mut assumed = std::mem::take(&mut source.assumed);
    let mut say = |holds: bool, what: String| assumed.extend(holds.then_some(what));
    say(is_latin, "text that is not UTF-8 is read as Windows-1252".to_owned());
    say(
        separator.is_some_and(|byte| byte != b' '),
        format!("its first line names the separator: {}", char::from(delimiter)),
    );
    say(above == 1, "1 line above the headers is not read".to_owned());
    say(above > 1, format!("{above} lines above the headers are not read"));
    say(units.is_some(), "the line below the headers is one of units".to_owned());
    say(!read_as.is_empty(), format!("read as: {}", read_as.join(", ")));
    Ok(TextHeader { headers, columns, delimiter, lines, line: line.number, assumed })
}

/// A text log has no zero byte, and no other control characters where it is not UTF-8.
pub(crate) fn refuse_binary(source: &mut Source) -> Result<()> {
    let start = source.reader.fill_buf().map_err(|e| Error::io(&source.name, "read", &e))?;
    if let Some(refusal) = foreign::refusal(start, source.plain_file.as_deref()) {
        return Err(refusal);
    }
    let start = &start[..start.len().min(4096)];
    let is_utf8 = std::str::from_utf8(start).err().is_none_or(|e| e.error_len().is_none());
    let odd = |byte: &u8| byte.is_ascii_control() && !matches!(byte, b'\t' | b'\r' | b'\n');
    if start.contains(&0) || (!is_utf8 && start.iter().any(odd)) {
        return Err(Error::input(
            "the file contains binary data in an unknown format",
            "convert it to CSV (comma, tab or semicolon), Parquet, Arrow or ULog",
        ));
    }
    Ok(())
}

pub(crate) struct Head<'a> {
    source: &'a mut Source,
    setup: &'a Setup,
    lines: u64,
    is_latin: bool,
    /// The one that the first line names, or blanks.
    pub(crate) separator: Option<u8>,
}

impl<'a> Head<'a> {
    /// Sees whether blanks separate the cells, and reads each run of them as one.
    pub(crate) fn new(source: &'a mut Source, setup: &'a Setup) -> Result<Self> {
        let start = source.reader.fill_buf().map_err(|e| Error::io(&source.name, "read", &e))?;
        let separator = are_between_cells(&text_of(start)).then_some(b' ');
        if separator.is_some() {
            let reader = std::mem::replace(&mut source.reader, Box::new(std::io::empty()));
            source.reader = Box::new(BufReader::new(SingleBlanks::new(reader)));
            source.assumed.push("blanks separate its columns".to_owned());
        }
        Ok(Self { source, setup, lines: 0, is_latin: false, separator })
    }
}

impl Head<'_> {
    /// The next line without its end; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> Result<Option<HeadLine>> {
        let mut line = Vec::new();
        let mut limited = self.source.reader.by_ref().take(MAX_LINE_BYTES as u64 + 1);
        let n = limited.read_until(b'\n', &mut line).map_err(|e| Error::io(&self.source.name, "read", &e))?;
        if n == 0 {
            return Ok(None);
        }
        self.lines += 1;
        if n > MAX_LINE_BYTES {
            return Err(line_without_end().line(self.lines));
        }
        let text = String::from_utf8(line).unwrap_or_else(|e| {
            self.is_latin = true;
            encoding_rs::WINDOWS_1252.decode_without_bom_handling(e.as_bytes()).0.into_owned()
        });
        let text = trimmed(text.trim_start_matches('\u{feff}'));
        if text.contains('\r') {
            return Err(Error::input(
                "its lines end in a carriage return alone, like those of old Macs",
                "convert it: tr '\\r' '\\n' < old.csv > new.csv",
            )
            .line(self.lines));
        }
        Ok(Some(HeadLine { text: text.to_owned(), number: self.lines }))
    }

    /// The line of headers, and how many lines above it were neither blank nor comments.
    fn header_line(&mut self) -> Result<(HeadLine, usize)> {
        let mut first: Option<HeadLine> = None;
        let mut above = 0;
        // A line that names counts above something that is no table: a preamble, if headers follow.
        let mut no_table = None;
        loop {
            let Some(line) = self.next()? else {
                if let Some(number) = no_table {
                    return Err(no_row_below(number));
                }
                let empty = || {
                    Error::input(
                        "no header: the file is empty",
                        "write a header line first, such as time_s,temperature_c,counts",
                    )
                };
                return first.map(|line| (line, 0)).ok_or_else(empty);
            };
            if self.lines > MAX_LINES_ABOVE {
                return Err(Error::input(
                    format!("no header in the first {MAX_LINES_ABOVE} lines"),
                    "write a header line first: only blank lines and comments may precede it",
                )
                .line(self.lines));
            }
            if line.text.starts_with(COMPENSATED_STAMP) {
                return Err(header::already_compensated().line(line.number));
            }
            if line.text.starts_with('#') {
                match comment_of(line) {
                    Some(line) if first.is_none() && self.is_header_of_numbers(&line.text)? => {
                        return Ok((line, above));
                    }
                    _ => continue,
                }
            }
            if line.text.is_empty() {
                continue;
            }
            if let Some(separator) = separator_of(&line.text).filter(|_| first.is_none()) {
                self.separator = Some(separator);
                continue;
            }
            let is_header = self.has_an_axis(&line.text);
            if is_header && self.is_above_a_table()? {
                return Ok((line, above));
            }
            above += 1;
            no_table = no_table.or(is_header.then_some(line.number));
            let first = first.get_or_insert(line);
            // Only a table whose first line is no line of headers is searched further.
            if above > MAX_PREAMBLE {
                if let Some(number) = no_table {
                    return Err(no_row_below(number));
                }
                return Ok((HeadLine { text: first.text.clone(), number: first.number }, 0));
            }
        }
    }

    /// Whether a line names counts or rates.
    fn has_an_axis(&self, text: &str) -> bool {
        names_an_axis(text, self.separator.unwrap_or_else(|| delimiter_of(text)), self.setup)
    }

    /// Whether the text of a comment has as many names as the row of numbers below it has cells.
    fn is_header_of_numbers(&mut self, text: &str) -> Result<bool> {
        let delimiter = self.separator.unwrap_or_else(|| delimiter_of(text));
        let columns = split(text, delimiter).unwrap_or_default().len();
        let is_row = |row: &Vec<String>| {
            row.len() == columns && !row[0].starts_with('#') && row.iter().all(|cell| is_value(cell))
        };
        Ok(columns > 1 && self.lines_below(delimiter)?.first().is_some_and(is_row))
    }

    /// Whether the next line is a row or a line of units: it has a digit, a missing value or a unit. The end of the file is a table without rows.
    fn is_above_a_table(&mut self) -> Result<bool> {
        let (bytes, text) = self.raw_line()?;
        let is_table = text.is_empty()
            || text.chars().any(|c| c.is_ascii_digit())
            || split(&text, self.separator.unwrap_or_else(|| delimiter_of(&text)))
                .unwrap_or_default()
                .iter()
                .any(|cell| is_missing(cell.as_bytes()) || is_unit(cell));
        self.put_back(bytes);
        Ok(is_table)
    }

    /// The line below the headers, if it has as many cells, one of them a unit in letters, and none of them has a digit but the unit 1; any other
    /// line is put back.
    fn line_of_units(&mut self, columns: usize, delimiter: u8) -> Result<Option<Vec<String>>> {
        let (bytes, text) = self.raw_line()?;
        let cells = split(&text, delimiter).unwrap_or_default();
        let is_word = |cell: &&String| !cell.is_empty() && !is_missing(cell.as_bytes());
        let has_digit = |cell: &String| cell.chars().any(|c| c.is_ascii_digit());
        let words = cells.iter().filter(is_word).count();
        let is_of_units = cells.iter().any(|cell| is_unit(cell) && !has_digit(cell)) && words * 2 >= columns;
        let is_number = |cell: &String| has_digit(cell) && bare(cell) != "1";
        if cells.len() == columns && is_of_units && !cells.iter().any(is_number) && bytes.ends_with(b"\n") {
            self.lines += 1;
            return Ok(Some(cells));
        }
        self.put_back(bytes);
        Ok(None)
    }

    /// The cells of the next two lines, which are read again; of fewer at the end of the file.
    fn lines_below(&mut self, delimiter: u8) -> Result<Vec<Vec<String>>> {
        let ((mut bytes, first), (more, second)) = (self.raw_line()?, self.raw_line()?);
        bytes.extend(more);
        self.put_back(bytes);
        let lines = [first, second].into_iter().filter(|line| !line.is_empty());
        Ok(lines.map(|line| split(&line, delimiter).unwrap_or_default()).collect())
    }

    /// The bytes of the next line, and its text.
    fn raw_line(&mut self) -> Result<(Vec<u8>, String)> {
        let mut line = Vec::new();
        let mut limited = self.source.reader.by_ref().take(MAX_LINE_BYTES as u64);
        limited.read_until(b'\n', &mut line).map_err(|e| Error::io(&self.source.name, "read", &e))?;
        let text = trimmed(&text_of(&line)).to_owned();
        Ok((line, text))
    }

    /// What was read is read again.
    fn put_back(&mut self, bytes: Vec<u8>) {
        let rest = std::mem::replace(&mut self.source.reader, Box::new(std::io::empty()));
        self.source.reader = Box::new(Cursor::new(bytes).chain(rest));
    }
}

/// Without blanks and the line's end, but with tabs at either end: they separate cells that are empty. A line of nothing else is empty.
fn trimmed(line: &str) -> &str {
    if line.trim().is_empty() { "" } else { line.trim_matches(|c: char| c.is_whitespace() && c != '\t') }
}

/// A comment as the line of headers that it may be; `None` where nothing is behind the mark.
pub(crate) fn comment_of(line: HeadLine) -> Option<HeadLine> {
    let text = line.text.trim_start_matches('#').trim();
    (!text.is_empty()).then(|| HeadLine { text: text.to_owned(), number: line.number })
}

/// Headers as many as the cells of the lines below, where these are of one width and differ by empty cells at the end alone: loggers end
/// rows, or the headers, in a separator.
pub(crate) fn fit_to_rows(names: &mut Vec<String>, rows: &[Vec<String>]) {
    let Some(width) = rows.first().map(Vec::len).filter(|width| rows.iter().all(|row| row.len() == *width)) else {
        return;
    };
    let named = names.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1);
    let is_longer = rows.iter().all(|row| row.iter().skip(names.len()).all(String::is_empty));
    if width >= named && is_longer {
        names.resize(width, String::new());
    }
}

/// Whether a line names counts or rates.
fn names_an_axis(text: &str, delimiter: u8, setup: &Setup) -> bool {
    let Ok(names) = split(text, delimiter) else { return false };
    names.iter().any(|name| {
        let known = setup.columns.get(name).unwrap_or(name);
        // A wrong unit is a mistake in a line of headers, and is reported as one.
        let word = known.to_ascii_lowercase();
        let axis = matches!(role_of(known), Ok(Role::Counts { .. } | Role::Rate { .. }));
        axis || names::is_axis(name) || word == "rate" || word.starts_with("rate_") || role_of(known).is_err()
    })
}

/// Bytes as text: UTF-8, else Windows-1252.
pub(crate) fn text_of(line: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(line) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => encoding_rs::WINDOWS_1252.decode_without_bom_handling(line).0,
    }
}

/// The columns of a line of headers with more behind it, and what separates them; `None` for a line that names no counts and no rates.
pub(crate) fn layout_of(line: &str, more: &[String], setup: &Setup) -> Result<Option<(Layout, u8)>> {
    let delimiter = delimiter_of(line);
    if !names_an_axis(line, delimiter, setup) {
        return Ok(None);
    }
    let mut headers = split(line, delimiter)?;
    headers.extend(more.iter().cloned());
    let (columns, _) = names::mapped(&headers, &[], &[], &setup.columns);
    Ok(Some((Layout::new(headers, &columns, setup.axis)?, delimiter)))
}

fn no_row_below(header: u64) -> Error {
    Error::input(
        "the line below the headers contains neither a row nor units",
        "write a number or nothing in each cell of a row",
    )
    .line(header + 1)
}

/// The separator of a line `sep=;`, as spreadsheets write it.
pub(crate) fn separator_of(text: &str) -> Option<u8> {
    let rest = text.get(..4).filter(|start| start.eq_ignore_ascii_case("sep=")).and_then(|_| text.get(4..))?;
    match rest.as_bytes() {
        [separator] if !separator.is_ascii_alphanumeric() => Some(*separator),
        _ => None,
    }
}

pub(crate) fn delimiter_of(line: &str) -> u8 {
    [b'\t', b';'].into_iter().find(|d| line.as_bytes().contains(d)).unwrap_or(b',')
}

pub(crate) fn split(line: &str, delimiter: u8) -> Result<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter).from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    reader.read_record(&mut record).map_err(|e| {
        Error::input(
            format!("cannot read the header: {e}"),
            "write a header line of names with one separator, such as time_s,temperature_c,counts",
        )
    })?;
    Ok(record.iter().map(|h| h.trim().to_owned()).collect())
}

/// True for the name of a unit of any quantity.
pub(crate) fn is_unit(cell: &str) -> bool {
    let unit = bare(cell);
    !unit.is_empty()
        && !is_missing(unit.as_bytes())
        && HeaderQuantity::ALL.iter().any(|quantity| quantity.ending_of(&unit).is_some())
}

/// A number, a date, or nothing.
pub(crate) fn is_value(cell: &str) -> bool {
    let bytes = cell.as_bytes();
    cell.is_empty() || is_missing(bytes) || iso_ns(cell).is_some() || parse_value(bytes, cell.contains(',')).is_some()
}

/// The refusal of a unit that contradicts its header, or that no header can state.
fn refuse_other_unit(name: &str, unit: &str) -> Result<()> {
    let lower = name.to_lowercase();
    let mut words = lower.split(['_', ' ', '-']);
    let first = words.next().unwrap_or_default();
    let Some(quantity) = HeaderQuantity::ALL.into_iter().find(|quantity| quantity.word() == first) else {
        return Ok(());
    };
    if bare(unit).is_empty() || is_missing(bare(unit).as_bytes()) {
        return Ok(());
    }
    let is_ending = |word: &&str| !word.is_empty() && quantity.units().iter().any(|(_, ending)| ending == word);
    let (stated, ending) = (words.next().filter(is_ending), quantity.ending_of(unit));
    let refused = |what: &str, help: String| Err(Error::input(what, help).column(name).value(unit));
    match (stated, ending) {
        (Some(stated), ending) if ending != Some(stated) => {
            let what = format!("the header says `{stated}`, and the line of units says otherwise");
            refused(&what, "correct one of the two: the program does not guess".to_owned())
        }
        // What a bare `time` holds is found by its values: dates have no unit.
        (None, None) if quantity != HeaderQuantity::Time => {
            refused("unknown unit", format!("convert the column to one of these: {}", header::RECOGNISED))
        }
        _ => Ok(()),
    }
}
