//! Windows of a retest, as logged and as corrected: the same rows, the same bounds, side by side.
//!
//! ```text
//! batch ─┬───────────────▶ raw windows        their outliers decide for both sides
//!        └─▶ Replay ─▶ corrected windows      + the union of the status bits of each window's rows
//! ```
//!
//! Bounds of windows follow from times and temperatures alone, which both sides share.

use crate::verify::Correction;
use crate::verify::replay::{Corrected, Replay};
use crate::window::{SeenLogs, WindowBuilder, Windows};
use sagnac_core::Status;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Batch, LogReader, LogShape, same_shape};
use sagnac_log::setup::{Setup, TestConfig};

use crate::fit::RateTableInput;

/// Both sides of a retest, window by window.
#[derive(Clone, Debug)]
pub(crate) struct PairedWindows {
    /// As logged.
    pub(crate) raw: Windows,
    /// As corrected; axes, bounds and exclusions are those of `raw`.
    pub(crate) corrected: Windows,
    /// Per axis and window: every status bit of its rows.
    pub(crate) status: Vec<Vec<Status>>,
}

impl PairedWindows {
    /// Replays whole logs, each as one run.
    ///
    /// # Errors
    /// What reading and replaying report; logs of different columns or units.
    pub(crate) fn replayed(
        correction: &Correction,
        logs: Vec<LogReader>,
        setup: &Setup,
        keep_outliers: bool,
    ) -> Result<Self> {
        let mut pair: Option<PairBuilder> = None;
        let mut seen = SeenLogs::default();
        for mut log in logs {
            let shape = log.shape().clone();
            let name = log.summary().file;
            let (images, readings) = correction.fit_to(&shape, setup).map_err(|e| e.file(&name))?;
            let mut replay = Replay::new(&images, &shape, readings, &name).map_err(|e| e.file(&name))?;
            let pair = match &mut pair {
                Some(pair) => pair,
                None => pair.insert(PairBuilder::new(&shape, setup)?),
            };
            same_shape(&pair.shape, &shape).map_err(|e| e.file(&name))?;
            while let Some(batch) = log.next_batch()? {
                let corrected = replay.correct(batch)?;
                pair.push(batch, corrected).map_err(|e| e.file(&name))?;
            }
            let summary = log.summary();
            seen.take(&summary)?;
            pair.raw.end_run(summary.clone());
            pair.corrected.end_run(summary);
        }
        let pair = pair.ok_or_else(|| Error::input("no retest log given"))?;
        Ok(pair.finish(keep_outliers))
    }

    /// Leaves out windows of which nothing says how fast the table turned, on both sides.
    ///
    /// # Errors
    /// As [`RateTableInput::of`].
    pub(crate) fn leave_out_unknown(&mut self, test: &TestConfig) -> Result<()> {
        RateTableInput::leave_out_unknown(&mut self.raw, test)?;
        self.corrected.exclude_as(&self.raw);
        Ok(())
    }

    /// Windows that are used, in their order.
    pub(crate) fn used(&self) -> Vec<usize> {
        (0..self.raw.len()).filter(|i| self.raw.rows.excluded[*i].is_none()).collect()
    }
}

struct PairBuilder {
    shape: LogShape,
    raw: WindowBuilder,
    corrected: WindowBuilder,
}

impl PairBuilder {
    fn new(shape: &LogShape, setup: &Setup) -> Result<Self> {
        let without_aux = LogShape { aux: Vec::new(), ..shape.clone() };
        Ok(Self {
            shape: shape.clone(),
            raw: WindowBuilder::new(shape, setup)?.without_tracks(),
            corrected: WindowBuilder::new(&without_aux, setup)?.without_tracks(),
        })
    }

    fn push(&mut self, batch: &Batch, corrected: Corrected) -> Result<()> {
        self.raw.push(batch)?;
        let Corrected { angle, unrounded, status } = corrected;
        let mut side = batch.clone();
        side.angle = angle;
        side.aux.clear();
        // Random walk is estimated before rounding to whole counts: at rest the rounding is a slow saw, which a fit of
        // short τ reads as a walk.
        self.corrected.push_corrected(&side, &unrounded, &status)
    }

    fn finish(self, keep_outliers: bool) -> PairedWindows {
        let raw = if keep_outliers { self.raw.keep_outliers() } else { self.raw }.finish();
        let (mut corrected, status) = self.corrected.keep_outliers().finish_with_status();
        corrected.exclude_as(&raw);
        PairedWindows { raw, corrected, status }
    }
}
