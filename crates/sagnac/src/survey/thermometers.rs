//! Thermometers of a log: range, resolution, noise, and those that do not follow.
//!
//! ```text
//! stands still  another thermometer went away from it by 10 °C while it moved by less than 0.1 °C       (the target's own watch)
//! frozen        one value for n readings in a row, although readings scatter by more than 0.6 steps of the converter
//! ```
//!
//! Readings that jump away and back are rejected when the log is read. Two thermometers show what one alone cannot: a lone one that stops at a plausible value is found only where its own noise is larger than
//! its resolution. In 200 logs with healthy thermometers none is named (`tests/survey.rs`).

use sagnac_core::{MAX_INPUTS, Watch, WatchSpec};
use serde::Serialize;

use crate::fit::thermometer_noise;
use crate::window::{SAME_VALUE, Windows};
use sagnac_units::format::file_name;
use sagnac_units::s_from_ns;

const Q24_PER_C: f64 = 16_777_216.0;
/// The evidence of the watch, °C: docs/how-to/port-a-board.md.
const SHOWS_C: f64 = 10.0;
const STILL_C: f64 = 0.1;
/// Noise in steps of the converter from which on two readings in a row differ at least every second time.
const LIVELY_STEPS: f64 = 0.6;
/// So many equal readings in a row are none of a lively thermometer: 0.5^50 is 1e-15.
const FROZEN_READINGS: usize = 50;

/// One thermometer of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ThermometerSurvey {
    /// Its name; empty for a plain `temperature_c`.
    pub name: String,
    /// Lowest valid reading, °C; null without any.
    pub min_c: Option<f64>,
    /// Highest valid reading, °C; null without any.
    pub max_c: Option<f64>,
    /// σ of a reading, °C, from second differences; null without time.
    pub noise_c: Option<f64>,
    /// Time between two readings, s; null without time.
    pub reading_interval_s: Option<f64>,
    /// Smallest step between two readings, °C; null where it never moves.
    pub resolution_c: Option<f64>,
    /// What is wrong with it; empty for a healthy one.
    pub faults: Vec<String>,
}

/// Every thermometer of the windows.
pub(super) fn thermometers(windows: &Windows) -> Vec<ThermometerSurvey> {
    let still = standing_still(windows);
    let one = |(at, name): (usize, &String)| {
        let extreme =
            |column: &[f64], pick: fn(f64, f64) -> f64| column.iter().copied().filter(|t| t.is_finite()).reduce(pick);
        let readings = ThermometerReadings::of(windows, at);
        let mut faults: Vec<String> =
            still.iter().filter(|(which, _)| *which == at).map(|(_, what)| what.clone()).collect();
        faults.extend(readings.iter().filter_map(ThermometerReadings::frozen));
        ThermometerSurvey {
            name: name.clone(),
            min_c: extreme(&windows.rows.min_c[at], f64::min),
            max_c: extreme(&windows.rows.max_c[at], f64::max),
            noise_c: readings.as_ref().map(|readings| readings.sigma_c),
            reading_interval_s: readings.as_ref().map(|readings| readings.interval_s),
            resolution_c: readings.as_ref().and_then(|readings| readings.step_c),
            faults,
        }
    };
    windows.shape.thermometers.iter().enumerate().map(one).collect()
}

/// The readings of one thermometer, run by run.
struct ThermometerReadings<'a> {
    name: &'a str,
    runs: Vec<Vec<f64>>,
    sigma_c: f64,
    interval_s: f64,
    step_c: Option<f64>,
}

impl<'a> ThermometerReadings<'a> {
    /// `None` without time.
    fn of(windows: &'a Windows, thermometer: usize) -> Option<Self> {
        if !windows.shape.timed {
            return None;
        }
        let (sigma_c, interval_s) = thermometer_noise(windows, thermometer);
        let every = (interval_s / s_from_ns(windows.shape.period_ns)).round().max(1.0) as usize;
        let tracks = windows.runs.iter().filter_map(|run| run.tracks.get(thermometer));
        let runs: Vec<Vec<f64>> = tracks.map(|track| track.iter().copied().step_by(every).collect()).collect();
        let steps = runs.iter().flat_map(|run| run.windows(2)).map(|pair| (pair[1] - pair[0]).abs());
        // Less is the rounding of a decimal fraction.
        let step_c = steps.filter(|step| *step > SAME_VALUE).reduce(f64::min);
        Some(Self { name: &windows.shape.thermometers[thermometer], runs, sigma_c, interval_s, step_c })
    }

    /// One value for longer than its own noise allows.
    fn frozen(&self) -> Option<String> {
        let lively = self.step_c.is_some_and(|step| self.sigma_c > LIVELY_STEPS * step);
        let stretches = self.runs.iter().flat_map(|run| run.chunk_by(|a, b| a == b));
        let longest = stretches.filter(|stretch| stretch[0].is_finite()).max_by_key(|stretch| stretch.len())?;
        let hours = longest.len() as f64 * self.interval_s / 3600.0;
        (lively && longest.len() >= FROZEN_READINGS).then(|| {
            format!(
                "{} is stuck at {:.3} °C for {hours:.2} h, or its readings are missing",
                in_words(self.name),
                longest[0]
            )
        })
    }
}

/// A thermometer's name in a sentence.
fn in_words(name: &str) -> &str {
    if name.is_empty() { "the thermometer" } else { name }
}

/// Thermometers that stand still while another one moves away, with the place, by the watch of the target.
fn standing_still(windows: &Windows) -> Vec<(usize, String)> {
    let names = &windows.shape.thermometers;
    let mut faults: Vec<(usize, String)> = Vec::new();
    for run in &windows.runs {
        let q24 = |celsius: f64| (celsius * Q24_PER_C) as u32;
        let spec = WatchSpec { shows: q24(SHOWS_C), still: q24(STILL_C), command_shows: 0 };
        let mut watch = Watch::<MAX_INPUTS>::new(spec);
        let tracks: Vec<&Vec<f64>> = run.tracks.iter().take(names.len().min(MAX_INPUTS)).collect();
        let length = tracks.iter().map(|track| track.len()).max().unwrap_or(0);
        for at in 0..length {
            let value = |track: &&Vec<f64>| {
                let celsius = track.get(at).copied().filter(|c| c.abs() < 128.0)?;
                Some((celsius * Q24_PER_C) as i32)
            };
            let values: [Option<i32>; MAX_INPUTS] = std::array::from_fn(|place| tracks.get(place).and_then(value));
            let still = watch.update(&values, None);
            for (place, track) in tracks.iter().enumerate().filter(|(place, _)| still >> place & 1 == 1) {
                if !faults.iter().any(|(known, _)| *known == place) {
                    let hours = at as f64 * s_from_ns(windows.shape.period_ns) / 3600.0;
                    let what = format!(
                        "{} is stuck at {:.2} °C while another thermometer moves, first {hours:.2} h after the start of {}",
                        in_words(&names[place]),
                        track[at],
                        file_name(&run.name())
                    );
                    faults.push((place, what));
                }
            }
        }
    }
    faults
}
