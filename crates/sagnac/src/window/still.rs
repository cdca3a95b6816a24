//! A counter that nothing turns: a gyro in lock-in, a wire that fell off, a total that froze.
//!
//! ```text
//! φ_k     sum of the angles of 100 windows, and of 2.5 h at least, up to window k, less its straight line
//! still   σ(φ) ≤ 0.8·σ(angle of a window), and all of them together turn by no more than 8 of these; or no row ever differs from the next
//! ```
//!
//! The jitter of a phase cancels from window to window: σ(φ) is 0.71 of σ(angle), however many there are. Angle random walk adds up: after
//! n windows σ(φ)² is n/15 of σ(angle)² on average. Slow noise and a drift over temperature add up faster.
//!
//! Fails where a counter stands for less than 150 windows, on a jitter that is itself a random walk, and so on logs of rates.

use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::AngleUnit;
use sagnac_units::format::significant;

/// Windows of a run that separate the two: a walk's mean ratio is 6.7 there, and that of a jitter 0.5.
const FEWEST: usize = 100;
/// And they last this long, s.
const LEAST_S: f64 = 9000.0;
/// Between the 0.71 of a jitter, ± 0.04 with so few windows, and a walk.
const STILL: f64 = 0.8;
/// Largest angle of all of them, over the jitter of one.
const MOST_TURNED: f64 = 8.0;

/// The first axis that is still, in words.
pub(crate) fn still_text(windows: &Windows) -> Option<String> {
    let axes = windows.shape.axes.iter().enumerate();
    let (letter, still) = axes.filter_map(|(axis, letter)| Some((letter, still(windows, axis)?))).next()?;
    let hours = |from: usize, to: usize| (from..to).map(|i| windows.duration_s(i)).sum::<f64>() / 3600.0;
    let from_h = hours(0, still.first);
    let [arcsec, of_h] = [still.arcsec, hours(still.first, still.last + 1)].map(|value| significant(value, 2));
    let from = if still.first == 0 { String::new() } else { format!(" from {} h on", significant(from_h, 2)) };
    Some(format!(
        "axis {letter} shows nothing but the jitter of its count{from}: in {of_h} h its angle moves by {arcsec} arcsec (σ)"
    ))
}

/// # Errors
/// An axis that is still: it says nothing of a gyro.
pub(crate) fn refuse_still(windows: &Windows) -> Result<()> {
    let help = "see that the gyro runs and that its counter is connected, or leave the column out";
    still_text(windows).map_or(Ok(()), |text| Err(Error::refused(text, help)))
}

/// Windows in which a counter stood.
struct Still {
    first: usize,
    last: usize,
    /// σ of its angle.
    arcsec: f64,
}

/// The first windows in a row whose angle only jitters: [`FEWEST`], and [`LEAST_S`] at least.
fn still(windows: &Windows, axis: usize) -> Option<Still> {
    // A rate that jitters about zero looks like angle random walk.
    if windows.shape.is_turned || windows.shape.unit == AngleUnit::Arcsec {
        return None;
    }
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    let runs = used.chunk_by(|a, b| windows.rows.run[*a] == windows.rows.run[*b]);
    // In short windows the rounding of counts outweighs the noise for longer.
    let count = FEWEST.max((LEAST_S / windows.shape.nominal_s).ceil() as usize);
    runs.flat_map(|run| run.windows(count).step_by(count / 2)).find_map(|part| {
        let angles: Vec<f64> = part.iter().map(|i| windows.rows.angle[axis][*i]).collect();
        let phases: Vec<f64> = angles
            .iter()
            .scan(0.0, |sum, angle| {
                *sum += angle;
                Some(*sum)
            })
            .collect();
        let (of_windows, of_phase) = (sigma(&angles), sigma(&about_line(&phases)));
        // A gyro that counts by an input rate runs, however quiet it is; one that repeats the same count for hours does not.
        let counts_by = phases.last().is_some_and(|total| total.abs() > MOST_TURNED * of_windows);
        let is_frozen =
            part.iter().all(|i| windows.rows.squares[axis][*i].shortest().is_some_and(|(square, _)| square == 0.0));
        let is_still = of_windows == 0.0 && is_frozen || !counts_by && of_phase <= STILL * of_windows;
        let arcsec = of_phase * windows.shape.unit.arcsec();
        is_still.then(|| Still { first: part[0], last: part[count - 1], arcsec })
    })
}

/// σ about the mean.
fn sigma(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt()
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
        assert!((sigma(&about_line(&saw)) - 0.5).abs() < 1e-5);
    }
}
