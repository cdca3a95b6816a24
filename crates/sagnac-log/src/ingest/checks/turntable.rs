//! The rate of a rate table from a column of the log: rate, angle, or a mark per revolution.
//!
//! * `reference_rate_dps`: used unchanged
//! * `table_angle_deg`: change of the angle over the row divided by its length. An angle that wraps may change by less than
//!   180° in a row.
//! * `table_mark`: 1 in the row in which a revolution was completed, −1 for a backward one, otherwise 0. Between two marks of
//!   the same sign the table made one revolution: 360° over the time between the ends of their rows. Rows wait for the mark
//!   after them. Rows before the first mark, after the last, and between marks of opposite sign have no rate.

use std::collections::VecDeque;

use crate::ingest::checks::batch::Batch;
use crate::ingest::columns::header::TableColumn;
use sagnac_units::s_from_ns;

/// Largest number of pending batches: a revolution of millions of rows has no rate.
const MOST_WAITING: usize = 256;

/// Turns the column into rates, batch by batch.
pub(crate) struct TableRates {
    column: TableColumn,
    /// End and angle of the row before.
    last: Option<(i64, f64)>,
    /// End of the row of the last mark, and its sign.
    mark: Option<(i64, f64)>,
    /// End of the newest row of the marks.
    newest_ns: Option<i64>,
    waiting: VecDeque<Batch>,
    /// Batch and row of the first row that waits for a mark.
    cursor: (usize, usize),
}

impl TableRates {
    pub(crate) fn new(column: TableColumn) -> Self {
        Self { column, last: None, mark: None, newest_ns: None, waiting: VecDeque::new(), cursor: (0, 0) }
    }

    /// True where rows wait for rows that come later.
    pub(crate) fn waits(&self) -> bool {
        self.column == TableColumn::Mark
    }

    /// Turns angles into rates in place.
    pub(crate) fn convert(&mut self, batch: &mut Batch) {
        if self.column != TableColumn::Angle {
            return;
        }
        for row in 0..batch.reference_dps.len() {
            let (start_ns, end_ns, angle) = (batch.start_ns[row], batch.end_ns[row], batch.reference_dps[row]);
            let before = self.last.filter(|(time_ns, _)| *time_ns == start_ns);
            batch.reference_dps[row] = before.map_or(f64::NAN, |(_, before)| {
                let turned = (angle - before + 180.0).rem_euclid(360.0) - 180.0;
                turned / s_from_ns(end_ns - start_ns)
            });
            self.last = angle.is_finite().then_some((end_ns, angle));
        }
    }

    /// Adds a batch of marks.
    pub(crate) fn push(&mut self, batch: Batch) {
        let number = self.waiting.len();
        // Marks, and rows after a gap, in which a mark may have been lost.
        let mut events: Vec<(usize, i64, Option<f64>)> = Vec::new();
        for row in 0..batch.len() {
            if self.newest_ns != Some(batch.start_ns[row]) || !batch.valid.get(row).copied().unwrap_or(true) {
                events.push((row, batch.end_ns[row], None));
            }
            let mark = batch.reference_dps.get(row).filter(|mark| mark.is_finite() && **mark != 0.0);
            events.extend(mark.map(|mark| (row, batch.end_ns[row], Some(*mark))));
            self.newest_ns = Some(batch.end_ns[row]);
        }
        self.waiting.push_back(batch);
        for (row, end_ns, mark) in events {
            let Some(mark) = mark else {
                self.give((number, row), f64::NAN);
                self.mark = None;
                continue;
            };
            let sign = mark.signum();
            let before = self.mark.filter(|(_, before)| *before == sign);
            let rate = before.map_or(f64::NAN, |(before_ns, _)| sign * 360.0 / s_from_ns(end_ns - before_ns));
            self.give((number, row + 1), rate);
            self.mark = Some((end_ns, sign));
        }
        if self.waiting.len() > MOST_WAITING {
            self.end();
        }
    }

    /// Gives the pending rows no rate; false if none were pending.
    pub(crate) fn end(&mut self) -> bool {
        self.give((self.waiting.len(), 0), f64::NAN);
        self.mark = None;
        !self.waiting.is_empty()
    }

    /// Gives every pending row before a place its rate.
    fn give(&mut self, until: (usize, usize), rate: f64) {
        let (first, from) = self.cursor;
        for (number, batch) in self.waiting.iter_mut().enumerate().skip(first) {
            let length = batch.len();
            let to = if number < until.0 {
                length
            } else if number == until.0 {
                until.1
            } else {
                0
            };
            let from = if number == first { from } else { 0 };
            batch.reference_dps.resize(length, f64::NAN);
            batch.reference_dps[from.min(to)..to].fill(rate);
        }
        self.cursor = until;
    }

    /// The next batch whose rows are all settled.
    pub(crate) fn ready(&mut self) -> Option<Batch> {
        if self.cursor.0 == 0 {
            return None;
        }
        self.cursor.0 -= 1;
        self.waiting.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn batch(values: &[(i64, f64)]) -> Batch {
        Batch {
            start_ns: values.iter().map(|(end, _)| (end - 1) * S).collect(),
            end_ns: values.iter().map(|(end, _)| end * S).collect(),
            reference_dps: values.iter().map(|(_, value)| *value).collect(),
            valid: vec![true; values.len()],
            ..Batch::default()
        }
    }

    /// A mark may have been lost in a gap between two marks.
    #[test]
    fn marks_do_not_reach_across_a_gap() {
        let mut table = TableRates::new(TableColumn::Mark);
        let mark = |t: i64| (t, if t % 10 == 0 { 1.0 } else { 0.0 });
        table.push(batch(&(1..25).chain(36..61).map(mark).collect::<Vec<_>>()));
        table.end();
        let rates = table.ready().unwrap().reference_dps;
        assert!(rates[10..20].iter().all(|rate| *rate == 36.0), "{rates:?}");
        assert!(rates[20..29].iter().all(|rate| rate.is_nan()), "{rates:?}");
        assert!(rates[29..].iter().all(|rate| *rate == 36.0), "{rates:?}");
    }

    #[test]
    fn an_angle_wraps_and_a_gap_has_no_rate() {
        let mut table = TableRates::new(TableColumn::Angle);
        let mut rows = batch(&[(1, 350.0), (2, 355.0), (3, 0.0), (4, 5.0), (7, 20.0), (8, 10.0)]);
        table.convert(&mut rows);
        assert!(rows.reference_dps[0].is_nan() && rows.reference_dps[4].is_nan());
        assert_eq!(rows.reference_dps[1..4], [5.0, 5.0, 5.0]);
        assert_eq!(rows.reference_dps[5], -10.0);
    }

    /// Marks in rows 2, 5 and 8 (a revolution in 3 s), then one backwards; batches come as they may.
    #[test]
    fn marks_give_the_rate_between_them() {
        let all: Vec<(i64, f64)> = (1..=12)
            .map(|t| {
                (
                    t,
                    match t {
                        2 | 5 | 8 => 1.0,
                        10 => -1.0,
                        _ => 0.0,
                    },
                )
            })
            .collect();
        for piece in [1, 4, 5, 12] {
            let mut table = TableRates::new(TableColumn::Mark);
            let mut rates = Vec::new();
            for part in all.chunks(piece) {
                table.push(batch(part));
                rates.extend(std::iter::from_fn(|| table.ready()).flat_map(|batch| batch.reference_dps));
            }
            table.end();
            rates.extend(std::iter::from_fn(|| table.ready()).flat_map(|batch| batch.reference_dps));
            assert_eq!(rates.len(), 12);
            assert!(rates[..2].iter().chain(&rates[8..]).all(|rate| rate.is_nan()), "{piece}: {rates:?}");
            assert!(rates[2..8].iter().all(|rate| *rate == 120.0), "{piece}: {rates:?}");
        }
    }
}
