//! Delimited text: pieces of whole lines, rows.
//!
//! ```text
//! bytes ─TextFeed▶ pieces of whole lines (in order) ─LineParser▶ RawRows (in any order)
//! ```
//!
//! Rows of plain decimals are read column by column; any other (quotes, exponents, decimal commas, missing
//! fields) is read field by field, with the same result. Memory is bounded for any input: a line without end
//! is refused, not collected.

use std::io::{BufRead, Read};

use csv::ByteRecord;
use memchr::{memchr, memrchr};

use crate::error::{Error, Result};
use crate::ingest::columns::feed::{Feed, MAX_LINE_BYTES, Parser, ReadMode};
use crate::ingest::columns::header::Layout;
use crate::ingest::columns::number::{is_missing, parse_flag, parse_time_ns, parse_value};
use crate::ingest::columns::raw::{Faults, NO_TIME, RawRows, Slot};
use crate::ingest::text::plain::PlainRows;

/// Bytes of a piece.
const PIECE_BYTES: usize = 256 << 10;

pub(super) fn line_without_end() -> Error {
    Error::input("a line is longer than 1 MiB, so this is no text table", "give a log as CSV, Parquet, Arrow or ULog")
}

/// Splits a text into pieces of whole lines.
pub(crate) struct TextFeed {
    reader: Box<dyn BufRead + Send>,
    /// The start of a line whose end is not read yet.
    carried: Vec<u8>,
    /// The error that ended the reading, reported after the lines before it.
    failed: Option<Error>,
    line_by_line: bool,
    parser: LineParser,
}

impl TextFeed {
    pub(crate) fn new(reader: Box<dyn BufRead + Send>, layout: &Layout, delimiter: u8, mode: ReadMode) -> Self {
        let (line_by_line, parser) = (mode == ReadMode::LineByLine, LineParser::new(layout, delimiter, mode));
        Self { reader, carried: Vec::new(), failed: None, line_by_line, parser }
    }
}

impl Feed for TextFeed {
    fn next(&mut self, piece: &mut Vec<u8>, _: &mut RawRows) -> Result<bool> {
        piece.clear();
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        piece.append(&mut self.carried);
        loop {
            let before = piece.len();
            let filled = self.fill(piece).map_err(|e| Error::cannot("read", &e));
            match (filled, memrchr(b'\n', &piece[before..])) {
                (Ok(0), _) => {
                    let rest = !piece.is_empty();
                    if rest {
                        piece.push(b'\n');
                    }
                    return Ok(rest);
                }
                (filled, Some(last)) => {
                    self.failed = filled.err();
                    self.carried.extend_from_slice(&piece[before + last + 1..]);
                    piece.truncate(before + last + 1);
                    return Ok(true);
                }
                (Err(error), None) => return Err(error),
                (Ok(_), None) if piece.len() > MAX_LINE_BYTES => return Err(line_without_end()),
                (Ok(_), None) => {}
            }
        }
    }

    fn parser(&self) -> Option<Box<dyn Parser>> {
        Some(Box::new(self.parser.clone()))
    }
}

impl TextFeed {
    fn fill(&mut self, piece: &mut Vec<u8>) -> std::io::Result<usize> {
        let reader = self.reader.by_ref();
        if self.line_by_line {
            return reader.take(MAX_LINE_BYTES as u64).read_until(b'\n', piece);
        }
        piece.reserve(PIECE_BYTES);
        // What was read before an error stays in the piece.
        reader.take(PIECE_BYTES as u64).read_to_end(piece)
    }
}

/// Lines to rows.
#[derive(Clone)]
pub(crate) struct LineParser {
    layout: Layout,
    /// One per column.
    slots: Vec<Slot>,
    delimiter: u8,
    decimal_comma: bool,
    /// None where rows are kept as text.
    plain: Option<PlainRows>,
}

impl LineParser {
    pub(crate) fn new(layout: &Layout, delimiter: u8, mode: ReadMode) -> Self {
        Self {
            layout: layout.clone(),
            slots: Slot::of_columns(layout),
            delimiter,
            decimal_comma: delimiter != b',',
            plain: (mode == ReadMode::Bulk).then(|| PlainRows::new(delimiter)),
        }
    }
}

impl Parser for LineParser {
    /// Every row of a piece; it ends in a newline.
    fn parse(&mut self, piece: &[u8], rows: &mut RawRows) {
        rows.reset(&self.layout);
        if let Some(plain) = &mut self.plain {
            plain.begin(piece, self.slots.len());
        }
        let (mut at, mut line) = (0, 0_u32);
        while at < piece.len() {
            // Two gigabytes of empty lines fit into two megabytes of gzip.
            let empty = piece[at..].iter().take_while(|byte| **byte == b'\n').count();
            if empty > 0 {
                (at, line) = (at + empty, line + empty as u32);
                continue;
            }
            if let Some(plain) = &mut self.plain {
                let (plain, end) = plain.read(piece, at, &self.slots, rows);
                if plain > 0 {
                    rows.line.extend(line + 1..=line + plain as u32);
                    line += plain as u32;
                    at = end;
                    continue;
                }
            }
            let rest = &piece[at..];
            line += 1;
            let length = memchr(b'\n', rest).unwrap_or(rest.len());
            let text = &rest[..length];
            let text = text.strip_suffix(b"\r").unwrap_or(text);
            if !text.is_empty() && text[0] != b'#' {
                let fields = self.any_row(text, rows);
                rows.fields.extend(self.plain.is_none().then_some(fields));
                rows.line.push(line);
            }
            at += length + 1;
        }
        rows.finish(&self.slots, u64::from(line));
    }
}

impl LineParser {
    /// Reads any row field by field.
    fn any_row(&self, text: &[u8], rows: &mut RawRows) -> ByteRecord {
        let record = fields_of(text, self.delimiter);
        let mut time_ns = NO_TIME;
        let mut faults = Faults::NONE.with(Faults::RAGGED, record.len() != self.slots.len());
        for (index, slot) in self.slots.iter().enumerate() {
            let field = unquoted(record.get(index).unwrap_or(b""));
            let field = if is_missing(field) { b"" } else { field };
            match *slot {
                Slot::Time(places) => time_ns = parse_time_ns(field, places, self.decimal_comma).unwrap_or(NO_TIME),
                Slot::Valid => faults = faults.with(Faults::FLAGGED, !parse_flag(field).unwrap_or(false)),
                number => {
                    let other = if field.is_empty() { f64::NAN } else { number.bad() };
                    let column = rows.numbers(number).into_iter();
                    column.for_each(|column| column.push(parse_value(field, self.decimal_comma).unwrap_or(other)));
                }
            }
        }
        rows.finish_row(time_ns, faults);
        record
    }
}

/// The fields of one line. A quote can hold a delimiter, but never reaches beyond its line.
pub fn fields_of(text: &[u8], delimiter: u8) -> ByteRecord {
    let quotes = text.iter().filter(|byte| **byte == b'"').count();
    // A stray quote is part of its field, which is then not a number.
    if quotes > 0 && quotes % 2 == 0 {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter).from_reader(text);
        let mut record = ByteRecord::new();
        if matches!(reader.read_byte_record(&mut record), Ok(true)) {
            return record;
        }
    }
    text.split(|byte| *byte == delimiter).collect()
}

/// A field without the quotes around it.
pub fn unquoted(field: &[u8]) -> &[u8] {
    let trimmed = field.trim_ascii();
    trimmed.strip_prefix(b"\"").and_then(|f| f.strip_suffix(b"\"")).unwrap_or(trimmed)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn parser(keep_fields: bool) -> LineParser {
        let headers = ["time_s", "note", "temperature_k", "counts", "valid"].map(str::to_owned).to_vec();
        let layout = Layout::new(headers, &Default::default(), None).unwrap();
        let mode = if keep_fields { ReadMode::BulkWithText } else { ReadMode::Bulk };
        LineParser::new(&layout, b',', mode)
    }

    fn cell() -> impl Strategy<Value = String> {
        prop_oneof![
            6 => (-1e6..1e6_f64, 0_usize..12).prop_map(|(v, places)| format!("{v:.places$}")),
            3 => any::<i64>().prop_map(|v| v.to_string()),
            2 => any::<f64>().prop_map(|v| v.to_string()),
            2 => "[-+0-9.,eE\" ]{0,8}",
            1 => "[a-z#\\r]{0,4}",
        ]
    }

    fn agree(text: &str) -> std::result::Result<(), TestCaseError> {
        let (mut fast, mut slow) = (RawRows::default(), RawRows::default());
        parser(false).parse(text.as_bytes(), &mut fast);
        parser(true).parse(text.as_bytes(), &mut slow);
        let bits = |rows: &RawRows| -> Vec<Vec<u64>> {
            rows.axes.iter().chain(&rows.temperatures_c).map(|c| c.iter().map(|v| v.to_bits()).collect()).collect()
        };
        prop_assert_eq!(bits(&fast), bits(&slow));
        prop_assert_eq!((&fast.time_ns, &fast.faults, &fast.line), (&slow.time_ns, &slow.faults, &slow.line));
        Ok(())
    }

    proptest! {
        /// The one-pass reader and the field-by-field reader give the same rows, bit for bit.
        #[test]
        fn both_readers_of_a_line_agree(lines in prop::collection::vec(prop::collection::vec(cell(), 1..6), 0..20)) {
            agree(&lines.iter().map(|cells| cells.join(",") + "\n").collect::<String>())?;
        }

        /// The same of rows as a logger writes them: even steps, temperatures that repeat, and now and then a line of another kind.
        #[test]
        fn both_readers_agree_on_an_even_log(
            start in 0_u64..3_000_000, places in 0_usize..4, end in prop::sample::select(vec!["\n", "\r\n"]),
            parts in prop::collection::vec((1_u64..300, 1_usize..90, 2700..3200, any::<i16>(), 0_usize..5, cell()), 1..12),
        ) {
            let (mut at, mut text) = (start, String::new());
            for (step, count, centikelvin, counts, kind, odd) in parts {
                for row in 0..count {
                    at += step;
                    let power = 10_u64.pow(places as u32);
                    let point = if places == 0 { String::new() } else { format!(".{:01$}", at % power, places) };
                    let kelvin = f64::from(centikelvin + i32::from(row > 40)) / 10.0;
                    text += &format!("{}{point},n{row},{kelvin:.2},{counts},{}{end}", at / power, u8::from(row != 7));
                }
                text += &match kind {
                    0 => format!("{odd},,{odd},7,1{end}"),
                    1 => format!("# {odd}{end}"),
                    2 => end.to_owned(),
                    3 => format!("{at},#,{odd},7{end}"),
                    _ => String::new(),
                };
            }
            agree(&text)?;
        }

        /// The pieces are the text's bytes in order, each ending in a newline, for any number of bytes per read.
        #[test]
        fn pieces_are_the_text(text in "[ab\\n]{0,200}", line_by_line: bool) {
            let mode = if line_by_line { ReadMode::LineByLine } else { ReadMode::Bulk };
            let layout = Layout::default();
            let mut feed = TextFeed::new(Box::new(std::io::Cursor::new(text.clone())), &layout, b',', mode);
            let (mut all, mut piece) = (Vec::new(), Vec::new());
            while feed.next(&mut piece, &mut RawRows::default()).unwrap() {
                prop_assert_eq!(piece.last(), Some(&b'\n'));
                all.extend_from_slice(&piece);
            }
            let ends = text.is_empty() || text.ends_with('\n');
            prop_assert_eq!(all, (if ends { text } else { text + "\n" }).into_bytes());
        }
    }
}
