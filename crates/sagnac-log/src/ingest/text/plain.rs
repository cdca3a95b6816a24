//! Rows of plain decimals, column by column.
//!
//! ```text
//! newlines of a piece ─▶ starts of many rows ─▶ a pass for each column: its field at each start, which then moves behind it ─▶ ends met?
//! ```
//!
//! A pass is a short loop whose state stays in registers. The first row that is not as many plain decimals as the log has columns ends the
//! rows before it; it is read field by field, with the same result (a property test holds it).
//!
//! Saves nothing where every other row has quotes, exponents, or missing fields: after such a row one is tried, then two, and so on. Where
//! every third row is such a one, a log takes a fifth longer than by single rows.

use fearless_simd::{Level, Simd, SimdBase, SimdMask, dispatch, u8x64};

use crate::ingest::columns::number::{Decimal, short_whole};
use crate::ingest::columns::raw::{Faults, RawRows, Slot};
use crate::ingest::text::expected::Expected;

/// Bytes whose newlines are found together.
const WORD: usize = 64;
/// Most rows that are read together: their fields stay in the nearest cache.
const MOST_ROWS: usize = 256;

/// Reads the plain rows of a piece.
#[derive(Clone)]
pub(super) struct PlainRows {
    delimiter: u8,
    /// Per column.
    expected: Vec<Expected>,
    places: Places,
}

/// Places in the piece at hand.
#[derive(Clone)]
struct Places {
    /// Of the next field of each row.
    at: Vec<usize>,
    /// Of the newline of each row.
    ends: Vec<usize>,
    /// Rows to try next.
    rows: usize,
    /// The newlines of the piece, a bit for each byte.
    newlines: Vec<u64>,
    /// The vector instructions of this processor.
    level: Level,
}

impl Places {
    /// Finds the newlines of a piece. Lines of a log are too short for a search that begins again with each.
    fn begin(&mut self, piece: &[u8]) {
        self.newlines.clear();
        let newlines = &mut self.newlines;
        dispatch!(self.level, simd => mark(simd, piece, newlines));
        self.rows = MOST_ROWS;
    }

    /// The lines from `start` on, to the first comment.
    fn find(&mut self, piece: &[u8], start: usize) {
        self.at.clear();
        self.ends.clear();
        let (mut next, mut word) = (start, start / WORD);
        let mut ahead = u64::MAX << (start % WORD);
        while let Some(newlines) = self.newlines.get(word) {
            let mut newlines = newlines & ahead;
            while newlines != 0 {
                if self.ends.len() == self.rows || piece[next] == b'#' {
                    return;
                }
                let end = WORD * word + newlines.trailing_zeros() as usize;
                self.at.push(next);
                self.ends.push(end);
                next = end + 1;
                newlines &= newlines - 1;
            }
            (word, ahead) = (word + 1, u64::MAX);
        }
    }

    /// Rows of which nothing but the end of their line remains.
    fn whole_rows(&self, piece: &[u8]) -> usize {
        let is_whole = |(at, end): (&usize, &usize)| at + usize::from(piece[*at] == b'\r') == *end;
        let mut rows = self.at.iter().zip(&self.ends);
        rows.position(|row| !is_whole(row)).unwrap_or(self.at.len())
    }
}

/// A bit for each byte that is a newline.
#[inline(always)]
fn mark<S: Simd>(simd: S, piece: &[u8], newlines: &mut Vec<u64>) {
    let newline = u8x64::splat(simd, b'\n');
    let (words, rest) = piece.as_chunks::<WORD>();
    newlines.extend(words.iter().map(|word| u8x64::from_slice(simd, word).simd_eq(newline).to_bitmask()));
    let bit = |(place, byte): (usize, &u8)| u64::from(*byte == b'\n') << place;
    newlines.push(rest.iter().enumerate().map(bit).sum());
}

impl PlainRows {
    pub(super) fn new(delimiter: u8) -> Self {
        let (at, ends, newlines) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            delimiter,
            expected: Vec::new(),
            places: Places { at, ends, rows: MOST_ROWS, newlines, level: Level::new() },
        }
    }

    /// A piece of a log of so many columns.
    pub(super) fn begin(&mut self, piece: &[u8], columns: usize) {
        self.expected.clear();
        self.expected.resize(columns, Expected::default());
        self.places.begin(piece);
    }

    /// Adds the rows of plain decimals from `start` on, not always all of them; returns their number and where they end.
    pub(super) fn read(&mut self, piece: &[u8], start: usize, slots: &[Slot], into: &mut RawRows) -> (usize, usize) {
        let Self { expected, places, delimiter: skipped_to } = self;
        let skipped_to = *skipped_to;
        places.find(piece, start);
        let (before, last) = (into.len(), slots.len() - 1);
        into.resize(before + places.at.len());
        for (index, (slot, expected)) in slots.iter().zip(expected).enumerate() {
            let delimiter = (index < last).then_some(skipped_to);
            let fields = ColumnFields { piece, at: &mut places.at, delimiter, skipped_to };
            let rows = fields.read(into, before, *slot, expected);
            places.at.truncate(rows);
        }
        let rows = places.whole_rows(piece);
        into.resize(before + rows);
        // As many as there were, twice as many where there may be more, or one where there was none.
        let all = rows == places.ends.len();
        places.rows = if all { 2 * places.rows } else { rows }.clamp(1, MOST_ROWS);
        (rows, rows.checked_sub(1).map_or(start, |last| places.ends[last] + 1))
    }
}

/// The fields of one column.
struct ColumnFields<'a> {
    piece: &'a [u8],
    at: &'a mut [usize],
    /// Behind each of them; `None` in the last column.
    delimiter: Option<u8>,
    /// Ends a field that is not read.
    skipped_to: u8,
}

impl ColumnFields<'_> {
    /// Reads them into rows from `before` on; returns the number of rows before the first that has another field.
    fn read(self, into: &mut RawRows, before: usize, slot: Slot, expected: &mut Expected) -> usize {
        let skipped_to = self.skipped_to;
        // A copy stays in registers.
        let mut next = *expected;
        let rows = match slot {
            Slot::Time(places) => self.each(&mut into.time_ns[before..], |field| match next.time_at(field) {
                Some(found) => Some(found),
                None => {
                    let (decimal, length) = Decimal::read(field)?;
                    let time_ns = decimal.scaled(places)?;
                    next.follow(field, (decimal, length), time_ns);
                    Some((time_ns, length))
                }
            }),
            // Counts have few digits and rarely repeat.
            Slot::Axis(n, _) => self.each(&mut into.axes[n][before..], |field| {
                short_whole(field).or_else(|| {
                    let (decimal, length) = Decimal::read(field)?;
                    Some((decimal.value()?, length))
                })
            }),
            Slot::Temperature(..) | Slot::Reference | Slot::Aux(_) => {
                let values = into.numbers(slot).map_or(&mut [][..], |column| &mut column[before..]);
                self.each(values, |field| match next.value_at(field) {
                    Some(found) => Some(found),
                    None => {
                        let (decimal, length) = Decimal::read(field)?;
                        let value = decimal.value()?;
                        next.repeat(field, length, value);
                        Some((value, length))
                    }
                })
            }
            Slot::Valid => self.each(&mut into.faults[before..], |field| match field.first()? {
                b'1' => Some((Faults::NONE, 1)),
                b'0' => Some((Faults::FLAGGED, 1)),
                _ => None,
            }),
            Slot::Skipped => {
                let ends = |byte: &u8| *byte == skipped_to || *byte == b'\n' || *byte == b'\r';
                let mut nowhere = [(); MOST_ROWS];
                self.each(&mut nowhere, |field| Some(((), field.iter().position(ends)?)))
            }
        };
        *expected = next;
        rows
    }

    /// Reads a field of each row with what is behind it; returns the number of rows before the first that fails.
    #[inline(always)]
    fn each<T>(self, values: &mut [T], mut read: impl FnMut(&[u8]) -> Option<(T, usize)>) -> usize {
        for (row, (at, place)) in self.at.iter_mut().zip(values).enumerate() {
            let Some((value, length)) = self.piece.get(*at..).and_then(&mut read) else { return row };
            *at += length;
            if let Some(delimiter) = self.delimiter {
                if self.piece.get(*at) != Some(&delimiter) {
                    return row;
                }
                *at += 1;
            }
            *place = value;
        }
        self.at.len()
    }
}
