//! Brings temperatures to the time of the counts.
//!
//! A thermometer's sample stamped t holds from t + offset on. Each row therefore takes the newest
//! sample stamped at or before its own time − offset; everything after this stage sees one clock. With
//! a negative offset rows wait until that sample was read.

use std::collections::VecDeque;

use crate::ingest::csv::RawRow;

/// Rows waiting for their temperatures, and temperatures waiting for their rows.
pub(crate) struct Aligner {
    offset_ns: i64,
    pending: VecDeque<RawRow>,
    samples: VecDeque<(i64, Vec<f64>)>,
    newest_ns: i64,
    ended: bool,
}

impl Aligner {
    pub(crate) fn new(offset_ns: i64) -> Self {
        Self { offset_ns, pending: VecDeque::new(), samples: VecDeque::new(), newest_ns: i64::MIN, ended: false }
    }

    /// True without an offset: every row has its own temperatures, and nothing need wait here.
    pub(crate) fn is_straight(&self) -> bool {
        self.offset_ns == 0
    }

    pub(crate) fn push(&mut self, row: RawRow) {
        if let Some(t) = row.time_ns {
            self.newest_ns = self.newest_ns.max(t);
            if self.samples.back().is_none_or(|(last, _)| *last < t) {
                self.samples.push_back((t, row.temperatures_c.clone()));
            }
        }
        self.pending.push_back(row);
    }

    pub(crate) fn end(&mut self) {
        self.ended = true;
    }

    pub(crate) fn ended(&self) -> bool {
        self.ended && self.pending.is_empty()
    }

    /// The next row with its own temperatures, if they are known.
    pub(crate) fn ready(&mut self) -> Option<RawRow> {
        let wanted = self.pending.front()?.time_ns.map(|t| t.saturating_sub(self.offset_ns));
        if wanted.is_some_and(|wanted| self.newest_ns < wanted) && !self.ended {
            return None;
        }
        let mut row = self.pending.pop_front()?;
        if let Some(wanted) = wanted {
            while self.samples.get(1).is_some_and(|(t, _)| *t <= wanted) {
                self.samples.pop_front();
            }
            match self.samples.front().filter(|(t, _)| *t <= wanted) {
                Some((_, temperatures)) => row.temperatures_c.clone_from(temperatures),
                None => row.temperatures_c.fill(f64::NAN),
            }
        }
        Some(row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aligned(offset_s: i64) -> Vec<f64> {
        let mut align = Aligner::new(offset_s * 1_000_000_000);
        let mut out = Vec::new();
        for t in 0..6_i64 {
            align.push(RawRow {
                time_ns: Some(t * 1_000_000_000),
                temperatures_c: vec![t as f64],
                ..RawRow::default()
            });
            out.extend(std::iter::from_fn(|| align.ready()));
        }
        align.end();
        out.extend(std::iter::from_fn(|| align.ready()));
        assert!(align.ended());
        out.iter().map(|row| row.temperatures_c[0]).collect()
    }

    #[test]
    fn temperatures_move_by_the_offset() {
        assert_eq!(aligned(0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(aligned(-2), [2.0, 3.0, 4.0, 5.0, 5.0, 5.0]);
        let late = aligned(2);
        assert!(late[0].is_nan() && late[1].is_nan());
        assert_eq!(late[2..], [0.0, 1.0, 2.0, 3.0]);
    }
}
