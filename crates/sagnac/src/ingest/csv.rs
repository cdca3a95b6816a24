//! Delimited text: sniffing, header, records.

use std::io::BufRead;

use crate::error::{Error, Result};
use crate::ingest::header::{self, Layout};
use crate::ingest::number::{parse_flag, parse_time_ns, parse_value};
use crate::ingest::source::Source;
use crate::setup::Setup;

/// First words of the comment that `sagnac compensate` puts above its output.
pub const COMPENSATED_STAMP: &str = "# sagnac compensated";

/// One record, parsed but not judged. NaN: missing or not a number.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawRow {
    pub(crate) line: u64,
    /// Not as many fields as the header has.
    pub(crate) ragged: bool,
    /// `None`: no time column, or not a number.
    pub(crate) time_ns: Option<i64>,
    pub(crate) axes: Vec<f64>,
    pub(crate) temperatures_c: Vec<f64>,
    /// Per thermometer: the field holds something other than a number.
    pub(crate) bad_temperature: Vec<bool>,
    pub(crate) reference_dps: f64,
    pub(crate) valid: bool,
    pub(crate) aux: Vec<f64>,
    /// The fields as text, kept only where the log is written out again.
    pub(crate) fields: csv::ByteRecord,
}

/// Reader of one log.
pub(crate) struct CsvRows {
    pub(crate) layout: Layout,
    pub(crate) delimiter: u8,
    name: String,
    reader: csv::Reader<Box<dyn BufRead>>,
    decimal_comma: bool,
    lines_before: u64,
    record: csv::ByteRecord,
    keep_fields: bool,
}

impl CsvRows {
    pub(crate) fn new(source: Source, setup: &Setup, keep_fields: bool) -> Result<Self> {
        let name = source.name.clone();
        Self::open(source, setup, keep_fields).map_err(|e| e.file(name))
    }

    fn open(mut source: Source, setup: &Setup, keep_fields: bool) -> Result<Self> {
        let (header, lines_before) = read_header(&mut source)?;
        let delimiter = delimiter_of(&header);
        let headers = split_header(&header, delimiter)?;
        if headers.iter().all(|h| h.parse::<f64>().is_ok()) {
            return Err(Error::input("the first line holds numbers, not headers")
                .line(lines_before)
                .help(format!("put a line of headers above it; recognised: {}", header::RECOGNISED)));
        }
        let layout = Layout::new(headers, &setup.columns, setup.axis).map_err(|e| e.line(lines_before))?;
        let name = source.name.clone();
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            .comment(Some(b'#'))
            // A stray quote must not swallow the lines after it; quoted fields are unquoted one by one.
            .quoting(false)
            .from_reader(source.reader);
        let decimal_comma = delimiter != b',';
        Ok(Self {
            layout,
            delimiter,
            name,
            reader,
            decimal_comma,
            lines_before,
            record: csv::ByteRecord::new(),
            keep_fields,
        })
    }

    /// The next record into `row`; false at the end.
    pub(crate) fn read(&mut self, row: &mut RawRow) -> Result<bool> {
        match self.reader.read_byte_record(&mut self.record) {
            Ok(false) => return Ok(false),
            Ok(true) => {}
            Err(e) => {
                let at = e.position().map_or(self.lines_before, |p| p.line() + self.lines_before);
                return Err(Error::input(format!("cannot read on: {}", read_cause(&e))).file(&self.name).line(at));
            }
        }
        row.line = self.record.position().map_or(0, csv::Position::line) + self.lines_before;
        self.parse(row);
        Ok(true)
    }

    fn parse(&self, row: &mut RawRow) {
        let field = |index: usize| unquoted(self.record.get(index).unwrap_or(b""));
        let value = |index: usize| parse_value(field(index), self.decimal_comma).unwrap_or(f64::NAN);
        row.ragged = self.record.len() != self.layout.headers.len();
        row.time_ns = self.layout.time.and_then(|(i, places)| parse_time_ns(field(i), places, self.decimal_comma));
        row.axes.clear();
        row.axes.extend(self.layout.axes.iter().map(|(i, _, unit)| value(*i) * unit.unwrap_or(1.0)));
        row.temperatures_c.clear();
        row.temperatures_c.extend(self.layout.temperatures.iter().map(|(i, _, zero)| value(*i) - zero));
        row.bad_temperature.clear();
        let fields = self.layout.temperatures.iter().map(|(i, ..)| field(*i));
        row.bad_temperature.extend(fields.zip(&row.temperatures_c).map(|(f, t)| t.is_nan() && !f.is_empty()));
        row.reference_dps = self.layout.reference.map_or(f64::NAN, value);
        row.valid = self.layout.valid.is_none_or(|i| parse_flag(field(i)).unwrap_or(false));
        row.aux.clear();
        row.aux.extend(self.layout.aux.iter().map(|(i, _)| value(*i)));
        if self.keep_fields {
            row.fields.clone_from(&self.record);
        }
    }
}

/// A field without the quotes around it.
pub(crate) fn unquoted(field: &[u8]) -> &[u8] {
    let trimmed = field.trim_ascii();
    trimmed.strip_prefix(b"\"").and_then(|f| f.strip_suffix(b"\"")).unwrap_or(trimmed)
}

/// Skips blank lines and comments; the header line and its number. Finds our own stamp.
fn read_header(source: &mut Source) -> Result<(String, u64)> {
    let mut lines = 0;
    loop {
        let mut line = Vec::new();
        let n = source.reader.read_until(b'\n', &mut line).map_err(|e| Error::io(&source.name, "read", &e))?;
        if n == 0 {
            return Err(Error::input("no header: the file is empty").help("a log begins with a line of column headers"));
        }
        lines += 1;
        let text = String::from_utf8(line).map_err(|_| Error::input("the header is not UTF-8").line(lines))?;
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.starts_with(COMPENSATED_STAMP) {
            return Err(header::already_compensated().line(lines));
        }
        if !text.is_empty() && !text.starts_with('#') {
            return Ok((text.to_owned(), lines));
        }
    }
}

/// Tab, else semicolon, else comma.
fn delimiter_of(header: &str) -> u8 {
    [b'\t', b';'].into_iter().find(|d| header.as_bytes().contains(d)).unwrap_or(b',')
}

fn split_header(line: &str, delimiter: u8) -> Result<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter).from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    reader.read_record(&mut record).map_err(|e| Error::input(format!("cannot read the header: {e}")))?;
    Ok(record.iter().map(|h| h.trim().to_owned()).collect())
}

/// The plain cause of a CSV error, without the reader's own wrapping.
fn read_cause(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Io(e) => e.to_string(),
        _ => error.to_string(),
    }
}
