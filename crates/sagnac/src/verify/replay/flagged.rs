//! Flagged rows that are not like their neighbours: a fault behind `valid` = 0.
//!
//! ```text
//! flagged rows in a row ─▶ their mean corrected rate, less that of the rows of a window before and behind ─▶ off beyond 4 σ
//! σ² of a mean of n rows = s²/n        s² half the mean square of the differences of neighbouring rows
//! ```
//!
//! Rows are of corrected rates, so a temperature that moves is no difference. Fails where slow noise moves the rate by more than
//! 4 σ of white noise during a long flag; on a table that turns, rows are not compared.

use std::collections::VecDeque;

use crate::verify::values::judged_windows::Estimate;
use sagnac_log::ingest::Batch;
use sagnac_log::setup::RateUnit;
use sagnac_units::format::significant;
use sagnac_units::s_from_ns;
use serde::{Deserialize, Serialize};

/// Standard errors beyond which flagged rows differ.
const OFF_SIGMAS: f64 = 4.0;
/// Fewer differences show no noise.
const FEWEST: f64 = 20.0;

/// Flagged rows that differ from their neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct FlaggedOff {
    /// Part of the time of the runs that they make, 0 to 1.
    pub fraction: f64,
    /// Their mean less that of their neighbours, °/h.
    pub difference_dph: Estimate,
}

impl FlaggedOff {
    /// In a sentence, with rates in a unit.
    pub fn words(&self, units: RateUnit) -> String {
        let Estimate { value, sigma } = self.difference_dph;
        let percent = significant(100.0 * self.fraction, 2);
        let off = units.with_sigma(value, Some(sigma));
        format!("flagged rows, {percent} % of the time, are {off} {} off their neighbours", units.name())
    }
}

/// Time and angle of some rows.
#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    rows: f64,
    length_ns: i64,
    angle: f64,
}

impl Turned {
    fn add(&mut self, length_ns: i64, angle: f64) {
        self.rows += 1.0;
        self.length_ns += length_ns;
        self.angle += angle;
    }

    /// Angle per ns.
    fn rate(self) -> f64 {
        self.angle / self.length_ns as f64
    }
}

/// The rows of one axis.
#[derive(Clone, Debug, Default)]
struct AxisRows {
    before: VecDeque<(i64, f64)>,
    flagged: Turned,
    behind: Turned,
    last_rate: Option<f64>,
    squares: f64,
    differences: f64,
    /// Flagged rows that were off, and the turn that their neighbours' rate would have made of them.
    off: Turned,
    expected: f64,
    variance: f64,
}

impl AxisRows {
    fn sound(&mut self, window_ns: i64, length_ns: i64, angle: f64) {
        let rate = angle / length_ns as f64;
        if let Some(last) = self.last_rate.replace(rate) {
            self.squares += (rate - last).powi(2);
            self.differences += 1.0;
        }
        self.before.push_back((length_ns, angle));
        if self.flagged.rows > 0.0 {
            self.behind.add(length_ns, angle);
            if self.behind.length_ns < window_ns {
                return;
            }
            self.end_flag();
        }
        while self.before.iter().skip(1).map(|(length_ns, _)| length_ns).sum::<i64>() >= window_ns {
            self.before.pop_front();
        }
    }

    fn flagged(&mut self, length_ns: i64, angle: f64) {
        if self.behind.rows > 0.0 {
            self.end_flag();
        }
        self.last_rate = None;
        self.flagged.add(length_ns, angle);
    }

    /// Compares the flagged rows with their neighbours.
    fn end_flag(&mut self) {
        let (flagged, mut around) = (std::mem::take(&mut self.flagged), std::mem::take(&mut self.behind));
        // The rows behind are the last of `before`, which the flag's own are not.
        let own = self.before.len().saturating_sub(around.rows as usize);
        self.before.iter().take(own).for_each(|(length_ns, angle)| around.add(*length_ns, *angle));
        if flagged.rows == 0.0 || around.rows == 0.0 || self.differences < FEWEST {
            return;
        }
        let difference = flagged.rate() - around.rate();
        let variance = self.squares / self.differences / 2.0 * (1.0 / flagged.rows + 1.0 / around.rows);
        if difference.powi(2) > OFF_SIGMAS.powi(2) * variance {
            self.off.rows += flagged.rows;
            self.off.length_ns += flagged.length_ns;
            self.off.angle += flagged.angle;
            self.expected += around.rate() * flagged.length_ns as f64;
            self.variance += variance * (flagged.length_ns as f64).powi(2);
        }
    }
}

/// Watches the rows of a retest.
#[derive(Clone, Debug)]
pub(crate) struct FlaggedWatch {
    axes: Vec<AxisRows>,
    window_ns: i64,
}

impl FlaggedWatch {
    /// Of so many axes, next to rows of `window_ns`.
    pub(crate) fn new(axes: usize, window_ns: i64) -> Self {
        Self { axes: vec![AxisRows::default(); axes], window_ns }
    }

    /// The next rows, with their corrected angles before they are rounded.
    pub(crate) fn push(&mut self, batch: &Batch, angles: &[Vec<f64>]) {
        for (axis, column) in self.axes.iter_mut().zip(angles) {
            for (row, angle) in column.iter().enumerate().filter(|(_, angle)| angle.is_finite()) {
                let length_ns = batch.end_ns[row] - batch.start_ns[row];
                match batch.valid[row] {
                    _ if length_ns <= 0 => {}
                    true => axis.sound(self.window_ns, length_ns, *angle),
                    false => axis.flagged(length_ns, *angle),
                }
            }
        }
    }

    /// Ends the run: rows of the next one are no neighbours.
    pub(crate) fn end_run(&mut self) {
        for axis in &mut self.axes {
            axis.end_flag();
            axis.before.clear();
            axis.last_rate = None;
        }
    }

    /// Per axis the flagged rows that are off; of runs of `length_s` in all, angles in `arcsec`.
    pub(crate) fn finish(mut self, length_s: f64, arcsec: f64) -> Vec<Option<FlaggedOff>> {
        self.end_run();
        let of_axis = |axis: AxisRows| {
            let off_s = s_from_ns(axis.off.length_ns);
            let difference_dph = Estimate {
                value: (axis.off.angle - axis.expected) * arcsec / off_s,
                sigma: axis.variance.sqrt() * arcsec / off_s,
            };
            (off_s > 0.0).then_some(FlaggedOff { fraction: off_s / length_s, difference_dph })
        };
        self.axes.into_iter().map(of_axis).collect()
    }
}
