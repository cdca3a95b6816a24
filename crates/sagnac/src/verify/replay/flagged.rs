//! Flagged rows that are not like their neighbours: a fault behind `valid` = 0.
//!
//! ```text
//! flagged rows in a row ─▶ their corrected rates, less the mean of the rows of a window before and behind ─▶ off beyond 4 σ
//! mean       σ² = s²/n        s² half the mean square of the differences of neighbouring rows
//! scatter    mean square over s² beyond 1 + 4·√(2/n) + 10/n
//! all of them together, too: many that are a little off
//! ```
//!
//! Rows are of corrected rates, so a temperature that moves is no difference. Fails where slow noise moves the rate by more than
//! 4 σ of white noise during a long flag; on a table that turns, rows are not compared.

use std::collections::VecDeque;

use crate::verify::values::judged_windows::Estimate;
use sagnac_log::ingest::Batch;
use sagnac_log::setup::RateUnit;
use sagnac_units::format::significant;
use sagnac_units::{NS_PER_S, s_from_ns};
use serde::{Deserialize, Serialize};

/// Standard errors beyond which flagged rows differ.
const OFF_SIGMAS: f64 = 4.0;
/// Fewer differences show no noise.
const FEWEST: f64 = 10.0;
/// A few rows scatter more than a normal law of many has it.
const OF_FEW: f64 = 10.0;

/// Flagged rows that differ from their neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct FlaggedOff {
    /// Part of the time of the runs that they make, 0 to 1.
    pub fraction: f64,
    /// Their mean less that of their neighbours, °/h.
    pub difference_dph: Estimate,
    /// Root mean square of their rates about that of their neighbours, °/h.
    pub rms_dph: f64,
}

impl FlaggedOff {
    /// In a sentence, with rates in a unit.
    pub fn words(&self, units: RateUnit) -> String {
        let Estimate { value, sigma } = self.difference_dph;
        let percent = significant(100.0 * self.fraction, 2);
        let mean = units.with_sigma(value, Some(sigma));
        let rms = units.text(self.rms_dph, 2);
        format!(
            "flagged rows, {percent} % of the time, are off their neighbours: by {mean} {} in the mean, {rms} rms",
            units.name()
        )
    }
}

/// Time and angle of some rows.
#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    rows: f64,
    length_ns: i64,
    angle: f64,
    /// Σ of the rates, and of their squares.
    rates: [f64; 2],
}

impl Turned {
    fn add(&mut self, length_ns: i64, angle: f64) {
        let rate = angle / length_ns as f64;
        self.rows += 1.0;
        self.length_ns += length_ns;
        self.angle += angle;
        self.rates = [self.rates[0] + rate, self.rates[1] + rate * rate];
    }

    /// Mean square of the rates about one.
    fn mean_square_about(self, rate: f64) -> f64 {
        let [sum, squares] = self.rates.map(|sum| sum / self.rows);
        (squares - 2.0 * rate * sum + rate * rate).max(0.0)
    }

    /// Angle per ns.
    fn rate(self) -> f64 {
        self.angle / self.length_ns as f64
    }
}

/// Flagged rows next to their neighbours.
#[derive(Clone, Copy, Debug, Default)]
struct Compared {
    length_ns: i64,
    /// Their angle less that of their neighbours' rate, its variance, and Σ of the squares of their rates about it times their length.
    off: f64,
    variance: f64,
    squares: f64,
}

impl Compared {
    fn add(&mut self, other: Self) {
        self.length_ns += other.length_ns;
        self.off += other.off;
        self.variance += other.variance;
        self.squares += other.squares;
    }

    fn is_off(&self) -> bool {
        self.off.powi(2) > OFF_SIGMAS.powi(2) * self.variance
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
    /// All flagged rows that have neighbours, and those that are off.
    all: Compared,
    off: Compared,
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
        let (n, length) = (flagged.rows, flagged.length_ns as f64);
        let of_row = self.squares / self.differences / 2.0;
        let mean_square = flagged.mean_square_about(around.rate());
        let compared = Compared {
            length_ns: flagged.length_ns,
            off: flagged.angle - around.rate() * length,
            variance: of_row * (1.0 / n + 1.0 / around.rows) * length * length,
            squares: mean_square * length,
        };
        let scatters = mean_square > of_row * (1.0 + OFF_SIGMAS * (2.0 / n).sqrt() + OF_FEW / n);
        self.all.add(compared);
        if compared.is_off() || scatters {
            self.off.add(compared);
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
        // Angle per ns to °/h.
        let dph = arcsec * NS_PER_S;
        let of_axis = |axis: AxisRows| {
            let off = if axis.all.is_off() { axis.all } else { axis.off };
            let length = off.length_ns as f64;
            let difference_dph = Estimate { value: off.off / length * dph, sigma: off.variance.sqrt() / length * dph };
            let (fraction, rms_dph) = (s_from_ns(off.length_ns) / length_s, (off.squares / length).sqrt() * dph);
            (off.length_ns > 0).then_some(FlaggedOff { fraction, difference_dph, rms_dph })
        };
        self.axes.into_iter().map(of_axis).collect()
    }
}
