//! Tables whose cells blanks separate: whether a text is one, and its bytes with single blanks.
//!
//! ```text
//! no tab, semicolon or comma in a row; rows of as many cells, numbers for the most part, as a line of words above them ─▶ one
//! ```
//!
//! Fails where the headers have blanks in their names: then no line has as many words as the rows, and the log is read as one column.

use std::io::{BufRead, Read, Result};

use crate::ingest::columns::iso::iso_ns;
use crate::ingest::columns::number::parse_value;

/// Rows that show it.
const ROWS: usize = 2;
/// Lines that are looked at.
const MOST_LINES: usize = 200;

/// Whether blanks separate the cells of a table that begins with this text. Its last line may be cut.
pub(crate) fn are_between_cells(start: &str) -> bool {
    let Some((whole, _)) = start.rsplit_once('\n') else { return false };
    let lines: Vec<&str> = whole.lines().filter(|line| !line.trim().is_empty()).take(MOST_LINES).collect();
    let cells = |line: &str| line.trim_start_matches('#').split_whitespace().count();
    let is_row = |line: &&str| {
        let numbers = line.split_whitespace().filter(|cell| is_number(cell)).count();
        !line.starts_with('#') && !line.contains(['\t', ';', ',']) && numbers > 1 && 2 * numbers >= cells(line)
    };
    let Some(first) = lines.iter().position(is_row) else { return false };
    let Some(headers) = first.checked_sub(1).map(|above| lines[above]) else { return false };
    let rows = || lines[first..].iter().take(ROWS);
    let is_alike = |row: &&str| is_row(row) && cells(row) == cells(headers) && iso_ns(row.trim()).is_none();
    rows().count() == ROWS && !headers.contains(['\t', ';', ',']) && rows().all(is_alike)
}

fn is_number(cell: &str) -> bool {
    parse_value(cell.as_bytes(), false).is_some()
}

/// A reader of the same bytes with one blank for each run of them, and none at the ends of lines.
pub(crate) struct SingleBlanks<R> {
    inner: R,
    /// A blank is due before the next byte of the line.
    is_due: bool,
    /// The line has no byte yet.
    is_at_start: bool,
}

impl<R> SingleBlanks<R> {
    pub(crate) fn new(inner: R) -> Self {
        Self { inner, is_due: false, is_at_start: true }
    }
}

impl<R: BufRead> Read for SingleBlanks<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut written = 0;
        // Bytes that are only blanks are not the end.
        while written == 0 && !buffer.is_empty() {
            let bytes = self.inner.fill_buf()?;
            if bytes.is_empty() {
                break;
            }
            let mut read = 0;
            for byte in bytes {
                let is_end = matches!(byte, b'\n' | b'\r');
                let owed = usize::from(self.is_due && !is_end);
                if *byte != b' ' && written + owed + 1 > buffer.len() {
                    // A buffer of one byte takes the blank alone.
                    if written == 0 && owed == 1 {
                        buffer[0] = b' ';
                        (written, self.is_due) = (1, false);
                    }
                    break;
                }
                read += 1;
                if *byte == b' ' {
                    self.is_due = !self.is_at_start;
                    continue;
                }
                if owed == 1 {
                    buffer[written] = b' ';
                    written += 1;
                }
                buffer[written] = *byte;
                written += 1;
                (self.is_due, self.is_at_start) = (false, *byte == b'\n');
            }
            self.inner.consume(read);
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn tables_of_blanks_are_known_and_others_are_not() {
        for table in [
            "# id timestamp gyro_x\n0 1000.0 0.1\n1 1000.1 0.2\n",
            "  time_s   rate_dph \n  1    0.5\n 10    0.7\n 11 ",
            "A gyro, on a table\ntime_s counts\n1 2\n2 3\n3",
            "date clock temp rate_dps\n2024-02-29 12:00:00 24.5 0.1\n2024-02-29 12:00:01 24.5 0.2\n",
        ] {
            assert!(are_between_cells(table), "{table}");
        }
        for other in [
            "",
            "time_s,counts\n1,2\n2,3\n",
            "time_s;a b\n1;2\n2;3\n",
            "Gyro X (deg/s)\n0.5\n0.6\n",
            "a b c\nd e f\ng h i\n",
            "rate_dph\n1 234\n1 235\n",
            "time_s counts\n1 2\n",
            "time_s\tcounts\n1\t2\n2\t3\n",
            "timestamp here\n2024-02-29 12:00:00\n2024-02-29 12:00:01\n",
        ] {
            assert!(!are_between_cells(other), "{other}");
        }
    }

    proptest! {
        /// The cells stay, for any number of bytes per read.
        #[test]
        fn cells_stay_the_same(text in "[ab1 \\n]{0,80}", size in 1_usize..9) {
            let mut reader = SingleBlanks::new(std::io::BufReader::with_capacity(size, text.as_bytes()));
            let (mut all, mut piece) = (Vec::new(), vec![0; size]);
            loop {
                let n = reader.read(&mut piece).unwrap();
                if n == 0 {
                    break;
                }
                all.extend_from_slice(&piece[..n]);
            }
            let line = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
            let wanted: Vec<String> = text.split('\n').map(line).collect();
            prop_assert_eq!(String::from_utf8(all).unwrap(), wanted.join("\n"));
        }
    }
}
