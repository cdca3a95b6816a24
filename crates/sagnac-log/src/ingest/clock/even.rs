//! Even rows behind shared, rounded or late stamps.
//!
//! ```text
//! t[k] = t[k−1] + Δt                          within a packet
//! t[k] = t[k−1] + Δt + e/16                   at a new stamp s, e = s − (t[k−1] + Δt), |e| below the scatter of the stamps
//! t[k] = t[k−1] + Δt·(1 + round(e/Δt))        beyond it: rows were lost
//! ```
//!
//! Fails where more rows are lost at once than the scatter of the stamps spans: they are then missing a little later.

use crate::ingest::columns::raw::RawRows;

/// Part of the distance to a stamp by which a row is moved towards it, for stamps that scatter by a row.
const GAIN: f64 = 1.0 / 16.0;
/// A packet of so many times its usual rows has doubled ones.
const FULLEST: f64 = 1.5;

/// How the stamps of even rows scatter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EvenStamps {
    /// Interval of a row, ns.
    pub(crate) interval_ns: f64,
    /// Rows of a stamp.
    pub(crate) rows_of_stamp: f64,
    /// Rows that the first stamp lacks.
    pub(crate) missing_of_first: f64,
    /// Largest distance of a stamp from its row, ns.
    pub(crate) scatter_ns: f64,
}

impl EvenStamps {
    /// Of rows with a stamp each.
    pub(crate) fn of_rows(interval_ns: f64, scatter_ns: f64) -> Self {
        Self { interval_ns, rows_of_stamp: 1.0, missing_of_first: 0.0, scatter_ns }
    }
}

/// Gives even times to rows, piece by piece.
#[derive(Debug)]
pub(crate) struct EvenClock {
    stamps: EvenStamps,
    /// Stamp at hand and its rows so far.
    stamp: Option<(i64, f64)>,
    /// First stamp, ns; the time of the last row since then, ns.
    origin_ns: i64,
    last_ns: f64,
    /// Rows since then, lost ones included.
    rows: f64,
}

impl EvenClock {
    pub(crate) fn new(stamps: EvenStamps) -> Self {
        Self { stamps, stamp: None, origin_ns: 0, last_ns: 0.0, rows: 0.0 }
    }

    /// Replaces the stamps of a piece. A row that the clock has no place for gets the time of the one before it.
    pub(crate) fn replace(&mut self, rows: &mut RawRows) {
        for at in 0..rows.len() {
            if let Some(stamp) = rows.sound_time(at) {
                rows.time_ns[at] = self.time_of(stamp);
            }
        }
    }

    /// Intervals from the first of some stamps to the last, and how many stamps lie off them: of rows lost or doubled.
    pub(crate) fn rows_to_the_last(mut self, stamps: &[i64]) -> (f64, u32) {
        let mut off = 0;
        for stamp in stamps {
            let before = self.rows;
            self.time_of(*stamp);
            off += u32::from(self.rows - before != 1.0);
        }
        (self.rows, off)
    }

    /// Begins again: the stamps restart.
    pub(crate) fn restart(&mut self) {
        *self = Self::new(EvenStamps { missing_of_first: 0.0, ..self.stamps });
    }

    fn time_of(&mut self, stamp: i64) -> i64 {
        let EvenStamps { interval_ns, rows_of_stamp, missing_of_first, scatter_ns } = self.stamps;
        let next_ns = self.last_ns + interval_ns;
        let (time_ns, rows) = match &mut self.stamp {
            None => {
                self.origin_ns = stamp;
                self.stamp = Some((stamp, 1.0));
                (missing_of_first * interval_ns, 0.0)
            }
            Some((at_hand, rows)) if *at_hand == stamp => {
                *rows += 1.0;
                if *rows > FULLEST * rows_of_stamp + 1.0 { (self.last_ns, 0.0) } else { (next_ns, 1.0) }
            }
            Some(at_hand) => {
                *at_hand = (stamp, 1.0);
                let away_ns = stamp.saturating_sub(self.origin_ns) as f64 - next_ns;
                if away_ns.abs() <= scatter_ns {
                    (next_ns + GAIN * away_ns * (interval_ns / scatter_ns).min(1.0), 1.0)
                } else if away_ns > 0.0 {
                    let lost = (away_ns / interval_ns).round();
                    (next_ns + interval_ns * lost, 1.0 + lost)
                } else {
                    (self.last_ns, 0.0)
                }
            }
        };
        self.last_ns = time_ns;
        self.rows += rows;
        self.origin_ns.saturating_add(self.last_ns.round() as i64)
    }
}
