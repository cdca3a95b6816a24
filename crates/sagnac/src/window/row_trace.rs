//! The noise of the rows of the first axis, by which a copy is recognised: a copy has all axes.
//!
//! Rows that are lost, flagged or not known are missing in it; one that covers several intervals counts for each of them.

use sagnac_log::ingest::{Batch, LogShape};
use sagnac_noise::{FILLED, Trace, TraceWatch};

/// Rows on their way into a [`Trace`].
#[derive(Clone)]
pub(super) struct RowTrace {
    watch: TraceWatch,
    /// Time of the last row of the run, ns.
    end_ns: Option<i64>,
}

impl RowTrace {
    pub(super) fn new(row_s: f64) -> Self {
        Self { watch: TraceWatch::new(row_s), end_ns: None }
    }

    /// The next rows of the run.
    pub(super) fn push(&mut self, batch: &Batch, log: &LogShape) {
        let Some(angle) = batch.angle.first() else { return };
        for (row, value) in angle.iter().enumerate() {
            let (start_ns, end_ns) = (batch.start_ns[row], batch.end_ns[row]);
            self.watch.lose(self.end_ns.map_or(0, |before_ns| log.lost_rows(before_ns, start_ns)));
            self.end_ns = Some(end_ns);
            if row == 0 && batch.is_plain() {
                self.watch.push(angle);
                self.end_ns = batch.end_ns.last().copied();
                return;
            }
            match log.intervals(start_ns, end_ns) {
                rows @ 1..=FILLED if batch.valid[row] && value.is_finite() => {
                    (0..rows).for_each(|_| self.watch.push(&[value / rows as f64]));
                }
                rows => self.watch.lose(rows),
            }
        }
    }

    /// The next row belongs to another time.
    pub(super) fn end_run(&mut self) {
        self.watch.end_run();
        self.end_ns = None;
    }

    pub(super) fn finish(self) -> Trace {
        self.watch.finish()
    }
}
