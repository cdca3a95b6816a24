//! Stretches of rows in which nothing is odd, checked and passed on by column.
//!
//! The result is that of the rows one by one (a property test holds it); only the time differs.

use std::ops::Range;

use super::{MAX_RATE_DPH, PLAIN_CHUNK, RowValidator, is_whole, nearest};
use crate::ingest::checks::batch::Batch;
use crate::ingest::columns::raw::{Faults, MAX_TIME, RawRows};
use sagnac_units::s_from_ns;

/// Bytes of a column that are copied together.
const COPIED_BYTES: usize = 1024;

impl RowValidator {
    /// The end of the rows from `at` on that the state machine would pass unchanged. None in a log with running totals, with
    /// several thermometers (which are compared with each other), or with one and no times.
    pub(super) fn plain_rows(&self, rows: &RawRows, at: usize) -> usize {
        let Some(mut before_ns) = self.plain_clock_ns().filter(|_| self.whole_rows) else { return at };
        let mut end = at;
        while end < rows.len() {
            let next = (end + PLAIN_CHUNK).min(rows.len());
            let Some(last_ns) = self.last_of_plain_times(rows, end..next, before_ns) else { break };
            if !self.is_plain(rows, end..next, end == at) {
                break;
            }
            (before_ns, end) = (last_ns, next);
        }
        end
    }

    /// The end of the row before; a log without times begins at zero.
    fn plain_clock_ns(&self) -> Option<i64> {
        if self.timed { self.clock_ns } else { Some(self.clock_ns.unwrap_or(0)) }
    }

    /// The last of these times, if they rise in steps of at most one and a half intervals.
    fn last_of_plain_times(&self, rows: &RawRows, part: Range<usize>, before_ns: i64) -> Option<i64> {
        if !self.timed {
            return self.nominal_ns.checked_mul(part.len() as i64)?.checked_add(before_ns);
        }
        let times = &rows.time_ns[part];
        let most_ns = self.nominal_ns + self.nominal_ns / 2;
        let mut in_order = before_ns.unsigned_abs() < MAX_TIME && times[times.len() - 1].unsigned_abs() < MAX_TIME;
        let mut last = before_ns;
        for &now in times {
            in_order &= (1..=most_ns).contains(&now.wrapping_sub(last));
            last = now;
        }
        in_order.then_some(last)
    }

    fn is_plain(&self, rows: &RawRows, part: Range<usize>, first: bool) -> bool {
        let sound = rows.faults[part.clone()].iter().fold(true, |all, faults| all & (*faults == Faults::NONE));
        let most = self.most_quanta;
        let usable = |column: &Vec<f64>| match self.quantum {
            // A division costs more than the rest of this.
            Some(1.0) => column[part.clone()].iter().fold(true, |all, counts| all & is_whole(*counts, most)),
            Some(quantum) => {
                column[part.clone()].iter().fold(true, |all, counts| all & is_whole(counts / quantum, most))
            }
            None => column[part.clone()].iter().fold(true, |all, rate| all & (rate.abs() <= MAX_RATE_DPH)),
        };
        if !(sound && rows.axes.iter().all(usable)) {
            return false;
        }
        let (Some(column), Some(thermometer)) = (rows.temperatures_c.first(), self.thermometers.first()) else {
            return true;
        };
        let before_c = if first { thermometer.valid_c() } else { column[part.start - 1] };
        thermometer.are_plain(&column[part], before_c)
    }

    /// Hands over rows that [`Self::plain_rows`] found; a whole piece without a copy.
    pub(super) fn push_plain(&mut self, rows: &mut RawRows, part: Range<usize>, batch: &mut Batch) {
        let Some(clock_ns) = self.plain_clock_ns() else { return };
        let (first, end) = (batch.end_ns.len(), batch.end_ns.len() + part.len());
        batch.line.extend(rows.line[part.clone()].iter().map(|line| rows.lines_before + u64::from(*line)));
        if self.timed {
            hand_over(&mut batch.end_ns, &mut rows.time_ns, &part);
        } else {
            batch.end_ns.extend((1..=part.len() as i64).map(|row| clock_ns + row * self.nominal_ns));
        }
        let Some((last_ns, before_ns)) = batch.end_ns[first..].split_last() else { return };
        batch.start_ns.push(clock_ns);
        append(&mut batch.start_ns, before_ns);
        let (last_ns, before_ns) = (*last_ns, before_ns.last().copied());
        for (angle, column) in batch.angle.iter_mut().zip(&mut rows.axes) {
            hand_over(angle, column, &part);
            let angle = &mut angle[first..];
            match self.quantum {
                Some(1.0) => angle.iter_mut().for_each(|counts| *counts = nearest(*counts)),
                Some(quantum) => angle.iter_mut().for_each(|counts| *counts = nearest(*counts / quantum)),
                None if self.timed => {
                    let rows = batch.end_ns[first..].iter().zip(&batch.start_ns[first..]);
                    angle.iter_mut().zip(rows).for_each(|(rate_dph, (end, start))| *rate_dph *= s_from_ns(end - start));
                }
                None => {
                    let duration_s = s_from_ns(self.nominal_ns);
                    angle.iter_mut().for_each(|rate_dph| *rate_dph *= duration_s);
                }
            }
        }
        let aux = batch.aux.iter_mut().zip(&mut rows.aux);
        let pairs = batch.temperature_c.iter_mut().zip(&mut rows.temperatures_c).chain(aux);
        pairs.for_each(|(mine, theirs)| hand_over(mine, theirs, &part));
        if !rows.reference_dps.is_empty() {
            hand_over(&mut batch.reference_dps, &mut rows.reference_dps, &part);
        }
        batch.valid.resize(end, true);
        batch.fields.extend_from_slice(rows.fields.get(part.clone()).unwrap_or(&[]));
        if let (Some(thermometer), Some(t_c)) =
            (self.thermometers.first_mut(), batch.temperature_c.first().and_then(|column| column.last()))
        {
            thermometer.accept(*t_c, last_ns, before_ns);
        }
        self.clock_ns = Some(last_ns);
        self.rows_read += part.len() as u64;
    }
}

/// Appends this part of a column; takes it over if it is the whole of it and nothing was there.
fn hand_over<T: Copy>(mine: &mut Vec<T>, theirs: &mut Vec<T>, part: &Range<usize>) {
    if mine.is_empty() && part.len() == theirs.len() {
        std::mem::swap(mine, theirs);
    } else {
        append(mine, &theirs[part.clone()]);
    }
}

/// Appends a column in pieces. glibc copies 2 KiB and more by `rep movsb`, which some processors of AMD execute several times slower where
/// both columns lie alike in their pages (glibc bug 30994), as columns of one length do.
fn append<T: Copy>(column: &mut Vec<T>, more: &[T]) {
    column.reserve(more.len());
    more.chunks(COPIED_BYTES / size_of::<T>()).for_each(|piece| column.extend_from_slice(piece));
}
