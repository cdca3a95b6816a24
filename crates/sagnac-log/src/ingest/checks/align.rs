//! Brings temperatures to the time of the counts.
//!
//! A thermometer sample stamped t is valid from t + offset on. Each row therefore uses the newest
//! sample stamped at or before its own time − offset; all later stages use one clock. With a negative
//! offset, rows wait until that sample has been read.

use std::collections::VecDeque;

use crate::ingest::columns::raw::RawRows;

/// Rows waiting for their temperatures, and temperatures waiting for their rows.
pub(crate) struct Aligner {
    offset_ns: i64,
    pending: VecDeque<RawRows>,
    /// Row of the first pending piece whose temperatures are not known yet.
    cursor: usize,
    samples: VecDeque<(i64, Vec<f64>)>,
    newest_ns: i64,
    ended: bool,
}

impl Aligner {
    pub(crate) fn new(offset_ns: i64) -> Self {
        let (pending, samples) = (VecDeque::new(), VecDeque::new());
        Self { offset_ns, pending, cursor: 0, samples, newest_ns: i64::MIN, ended: false }
    }

    /// True without an offset: every row has its own temperatures, and no row has to wait.
    pub(crate) fn is_straight(&self) -> bool {
        self.offset_ns == 0
    }

    pub(crate) fn push(&mut self, rows: RawRows) {
        for row in 0..rows.len() {
            let Some(t) = rows.sound_time(row) else { continue };
            self.newest_ns = self.newest_ns.max(t);
            if self.samples.back().is_none_or(|(last, _)| *last < t) {
                self.samples.push_back((t, rows.temperatures_c.iter().map(|column| column[row]).collect()));
            }
        }
        self.pending.push_back(rows);
    }

    pub(crate) fn end(&mut self) {
        self.ended = true;
    }

    pub(crate) fn ended(&self) -> bool {
        self.ended && self.pending.is_empty()
    }

    /// The next rows with the temperatures that belong to them, once they are all known.
    pub(crate) fn ready(&mut self) -> Option<RawRows> {
        let rows = self.pending.front_mut()?;
        while self.cursor < rows.len() {
            if let Some(t) = rows.sound_time(self.cursor) {
                let wanted = t.saturating_sub(self.offset_ns);
                if self.newest_ns < wanted && !self.ended {
                    return None;
                }
                while self.samples.get(1).is_some_and(|(t, _)| *t <= wanted) {
                    self.samples.pop_front();
                }
                let sample = self.samples.front().filter(|(t, _)| *t <= wanted);
                for (n, column) in rows.temperatures_c.iter_mut().enumerate() {
                    column[self.cursor] = sample.map_or(f64::NAN, |(_, temperatures)| temperatures[n]);
                }
            }
            self.cursor += 1;
        }
        self.cursor = 0;
        self.pending.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::columns::header::Layout;
    use crate::ingest::columns::raw::Faults;

    fn aligned(offset_s: i64) -> Vec<f64> {
        let mut align = Aligner::new(offset_s * 1_000_000_000);
        let mut out = Vec::new();
        for t in 0..6_i64 {
            let mut rows = RawRows::default();
            rows.reset(&Layout { temperatures: vec![(0, String::new(), 0.0)], ..Layout::default() });
            rows.line.push(1);
            rows.faults.push(Faults::NONE);
            rows.time_ns.push(t * 1_000_000_000);
            rows.temperatures_c[0].push(t as f64);
            align.push(rows);
            out.extend(std::iter::from_fn(|| align.ready()));
        }
        align.end();
        out.extend(std::iter::from_fn(|| align.ready()));
        assert!(align.ended());
        out.iter().map(|rows| rows.temperatures_c[0][0]).collect()
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
