//! How an input moved in the test, by which the target tells a value from a fault.
//!
//! ```text
//! largest step   1.5 times the largest change from one temperature period to the next, at least four of the thermometer's own steps
//! rate           3 times the largest rate over a minute
//! ```
//!
//! The largest of a thermometer is the 99th percentile of all that are not zero: a wrong first sample of the log must not let one pass on the
//! target. A column may hop by itself, rarely: its largest is the maximum. The image widens the step where that does no harm
//! ([`crate::image`]).
//!
//! Fails where the test moves slower than the service: then the target takes a fast ramp for a fault, and says so. A glitch of a column in
//! the logs lets one of the same size pass.

use crate::calibration::{Input, SAMPLED_S};
use crate::window::Windows;
use sagnac_units::s_from_ns;

/// A value may move this many times as far as in the test, and as fast.
const TIMES: f64 = 1.5;
const TIMES_RATE: f64 = 3.0;
/// Steps of a thermometer that are no fault.
const STEPS: f64 = 4.0;
/// Part of the changes, and of the rates, that a thermometer's largest is above.
const MOST: f64 = 0.99;
/// Rates are over this time, s.
const MINUTE_S: f64 = 60.0;
/// A largest step is below this part of the valid range, else it is none.
const MOST_OF_RANGE: f64 = 0.99;

/// The input with the largest step and rate of a column of the tracks (thermometers, then auxiliary columns), where it moved. A step that
/// the setup states stays.
pub(super) fn with_movement(input: Input, windows: &Windows, column: usize, stated: Option<f64>) -> Input {
    let period_s = s_from_ns(windows.shape.period_ns);
    let minute = ((MINUTE_S / period_s).round() as usize).max(1);
    let is_thermometer = column < windows.shape.thermometers.len();
    let tracks = || windows.runs.iter().filter_map(|run| run.tracks.get(column));
    let changes = |apart: usize| -> Vec<f64> {
        let of_track = |track: &Vec<f64>| {
            let apart = apart.min(track.len().saturating_sub(1)).max(1);
            track.windows(apart + 1).map(|part| (part[apart] - part[0]).abs() / apart as f64).collect::<Vec<f64>>()
        };
        tracks().flat_map(of_track).filter(|change| *change > 0.0).collect()
    };
    let (mut steps, mut rates) = (changes(1), changes(minute));
    let own_step = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let [step, per_s] = [&mut steps, &mut rates].map(|all| largest(all, if is_thermometer { MOST } else { 1.0 }));
    let per_s = per_s / period_s;
    if step <= 0.0 || stated == Some(0.0) {
        return input;
    }
    let range = input.valid_range[1] - input.valid_range[0];
    let max_step = stated.unwrap_or((TIMES * step).max(STEPS * own_step)).min(MOST_OF_RANGE * range);
    let of_stated = stated.map_or(f64::INFINITY, |step| step / SAMPLED_S);
    Input { max_step, max_rate_per_s: (TIMES_RATE * per_s).min(of_stated), ..input }
}

/// The value that a part of all is at most; zero without any.
fn largest(all: &mut [f64], part: f64) -> f64 {
    let at = (part * all.len().saturating_sub(1) as f64).round() as usize;
    if all.is_empty() { 0.0 } else { *all.select_nth_unstable_by(at, f64::total_cmp).1 }
}
