//! How an input moved in the test, by which the target tells a value from a fault.
//!
//! ```text
//! largest step   1.5 times the largest change from one temperature period to the next, at least four of the thermometer's own steps
//! rate           3 times the largest rate over a minute
//! ```
//!
//! The image widens the step where that does no harm ([`crate::image`]).
//!
//! Fails where the test moves slower than the service: then the target takes a fast ramp for a fault, and says so.

use crate::calibration::{Input, SAMPLED_S};
use crate::window::Windows;
use sagnac_units::s_from_ns;

/// A value may move this many times as far as in the test, and as fast.
const TIMES: f64 = 1.5;
const TIMES_RATE: f64 = 3.0;
/// Steps of a thermometer that are no fault.
const STEPS: f64 = 4.0;
/// Rates are over this time, s.
const MINUTE_S: f64 = 60.0;
/// A largest step is below this part of the valid range, else it is none.
const MOST_OF_RANGE: f64 = 0.99;

/// The input with the largest step and rate of a column of the tracks (thermometers, then auxiliary columns), where it moved. A step that
/// the setup states stays.
pub(super) fn with_movement(input: Input, windows: &Windows, column: usize, stated: Option<f64>) -> Input {
    let period_s = s_from_ns(windows.shape.period_ns);
    let minute = ((MINUTE_S / period_s).round() as usize).max(1);
    let (mut step, mut own_step, mut per_s) = (0.0_f64, f64::INFINITY, 0.0_f64);
    for track in windows.runs.iter().filter_map(|run| run.tracks.get(column)) {
        for pair in track.windows(2) {
            let change = (pair[1] - pair[0]).abs();
            if change > 0.0 {
                (step, own_step) = (step.max(change), own_step.min(change));
            }
        }
        let apart = minute.min(track.len().saturating_sub(1)).max(1);
        let rates = track.windows(apart + 1).map(|part| (part[apart] - part[0]).abs() / (apart as f64 * period_s));
        per_s = rates.filter(|rate| rate.is_finite()).fold(per_s, f64::max);
    }
    if step <= 0.0 || stated == Some(0.0) {
        return input;
    }
    let range = input.valid_range[1] - input.valid_range[0];
    let max_step = stated.unwrap_or((TIMES * step).max(STEPS * own_step)).min(MOST_OF_RANGE * range);
    let of_stated = stated.map_or(f64::INFINITY, |step| step / SAMPLED_S);
    Input { max_step, max_rate_per_s: (TIMES_RATE * per_s).min(of_stated), ..input }
}
