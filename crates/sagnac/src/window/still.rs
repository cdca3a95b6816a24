//! A counter that nothing turns: a gyro in lock-in, a wire that fell off, a total that froze.
//!
//! ```text
//! φ_k     sum of the angles of a run up to window k, less its straight line
//! still   σ(φ) ≤ 0.8·σ(angle of a window)
//! ```
//!
//! The jitter of a phase cancels from window to window: σ(φ) is 0.71 of σ(angle), however long the run. Angle random walk adds up: after
//! n windows σ(φ)² is n/15 of σ(angle)² on average. Slow noise and a drift over temperature add up faster.
//!
//! Fails on runs of fewer than [`FEWEST`] windows, on a jitter that is itself a random walk, and so on logs of rates.

use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::AngleUnit;
use sagnac_units::format::significant;

/// Windows of a run that separate the two: a walk's mean ratio is 6.7 there, and that of a jitter 0.5.
const FEWEST: usize = 100;
/// Between the 0.71 of a jitter, ± 0.04 with so few windows, and a walk.
const STILL: f64 = 0.8;
/// Scatter below this part of the largest angle is the rounding of sums.
const ROUNDING: f64 = 1e-12;

/// The first axis that is still, in words.
pub(crate) fn still_text(windows: &Windows) -> Option<String> {
    let axes = windows.shape.axes.iter().enumerate();
    let (letter, arcsec) = axes.filter_map(|(axis, letter)| Some((letter, still_arcsec(windows, axis)?))).next()?;
    let hours = (0..windows.len()).map(|i| windows.duration_s(i)).sum::<f64>() / 3600.0;
    let [arcsec, hours] = [arcsec, hours].map(|value| significant(value, 2));
    Some(format!(
        "axis {letter} shows nothing but the jitter of its count: in {hours} h its angle leaves a straight line by {arcsec} arcsec (σ)"
    ))
}

/// # Errors
/// An axis that is still: it says nothing of a gyro.
pub(crate) fn refuse_still(windows: &Windows) -> Result<()> {
    let help = "see that the gyro runs and that its counter is connected, or leave the column out";
    still_text(windows).map_or(Ok(()), |text| Err(Error::refused(text, help)))
}

/// σ of the angle of an axis about the straight lines of its runs, arcsec, where that is all it ever moves; `None` where it moves more, or
/// where no run is long enough.
fn still_arcsec(windows: &Windows, axis: usize) -> Option<f64> {
    // A rate that jitters about zero looks like angle random walk.
    if windows.shape.is_turned || windows.shape.unit == AngleUnit::Arcsec {
        return None;
    }
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    let runs = used.chunk_by(|a, b| windows.rows.run[*a] == windows.rows.run[*b]);
    let (mut of_windows, mut of_phase, mut largest) = (Spread::default(), Spread::default(), 0.0_f64);
    for run in runs.filter(|run| run.len() >= FEWEST) {
        let (total, length_s) = run.iter().fold((0.0, 0.0), |(total, length_s), i| {
            (total + windows.rows.angle[axis][*i], length_s + windows.duration_s(*i))
        });
        let about_mean = |i: &usize| windows.rows.angle[axis][*i] - total / length_s * windows.duration_s(*i);
        let angles: Vec<f64> = run.iter().map(about_mean).collect();
        let phases = angles.iter().scan(0.0, |sum, angle| {
            *sum += angle;
            Some(*sum)
        });
        of_phase.add(&about_line(&phases.collect::<Vec<f64>>()));
        of_windows.add(&angles);
        largest = run.iter().fold(largest, |most, i| most.max(windows.rows.angle[axis][*i].abs()));
    }
    let is_still = of_phase.sigma()? <= (STILL * of_windows.sigma()?).max(ROUNDING * largest);
    is_still.then_some(of_phase.sigma()? * windows.shape.unit.arcsec())
}

/// Squares of values and their number.
#[derive(Default)]
struct Spread {
    squares: f64,
    number: f64,
}

impl Spread {
    fn add(&mut self, values: &[f64]) {
        self.squares += values.iter().map(|value| value * value).sum::<f64>();
        self.number += values.len() as f64;
    }

    fn sigma(&self) -> Option<f64> {
        (self.number > 0.0).then(|| (self.squares / self.number).sqrt())
    }
}

/// Values less their straight line by least squares.
fn about_line(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let (mean, middle) = (values.iter().sum::<f64>() / n, (n - 1.0) / 2.0);
    let along: f64 = values.iter().enumerate().map(|(k, value)| (k as f64 - middle) * value).sum();
    let slope = along / (n * (n * n - 1.0) / 12.0);
    values.iter().enumerate().map(|(k, value)| value - mean - slope * (k as f64 - middle)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form: a line is itself; 0, 1, 0, 1 … of n values has the slope 6/(n·(n² − 1))·n/2·1/… → 0, and keeps σ = 1/2.
    #[test]
    fn a_line_has_no_rest() {
        let line: Vec<f64> = (0..50).map(|k| 3.0 - 0.25 * f64::from(k)).collect();
        assert!(about_line(&line).iter().all(|rest| rest.abs() < 1e-12));
        let saw: Vec<f64> = (0..1000).map(|k| f64::from(k % 2)).collect();
        let mut spread = Spread::default();
        spread.add(&about_line(&saw));
        assert!((spread.sigma().unwrap() - 0.5).abs() < 1e-5, "{:?}", spread.sigma());
    }
}
