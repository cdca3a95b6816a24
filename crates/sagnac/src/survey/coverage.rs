//! Where a test was: hours over temperature and its rate.

use serde::Serialize;

use crate::diagnostics::{Leg, WindowPoint, points, run_spans};
use crate::window::Windows;

/// Cells over temperature.
const COLUMNS: usize = 40;
/// Cells over the rate; an odd number, so that one is about zero.
const ROWS: usize = 7;
/// Shades of a cell, by the root of its part of the fullest.
const SHADES: [char; 5] = ['·', '░', '▒', '▓', '█'];

/// Hours of test in cells of temperature and its rate.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CoverageMap {
    /// Lowest and highest temperature of a window, °C.
    pub temperature_c: [f64; 2],
    /// Largest rate of a window, °C/min: the rows reach from − to + of it.
    pub rate_cpm: f64,
    /// Hours in which the temperature rises, falls, and does neither.
    pub heating_h: f64,
    /// See `heating_h`.
    pub cooling_h: f64,
    /// See `heating_h`.
    pub steady_h: f64,
    /// Hours, row by row from the highest rate down, over rising temperature.
    #[serde(skip)]
    pub hours: Vec<Vec<f64>>,
    /// Temperature, °C, and rate, °C/min, of each used window in its order.
    #[serde(skip)]
    pub path: Vec<[f64; 2]>,
}

impl CoverageMap {
    /// Of the used windows; `None` without time, or without temperature.
    pub(super) fn of(windows: &Windows, thermometer: usize) -> Option<Self> {
        let all = points(windows, &run_spans(windows), Some(thermometer), |_| 0.0, |_| 0.0);
        let known = |p: &&WindowPoint| p.excluded.is_none() && p.temperature_c.is_finite() && p.rate_cpm.is_finite();
        let used: Vec<&WindowPoint> = all.iter().filter(known).collect();
        let path: Vec<[f64; 2]> = used.iter().map(|p| [p.temperature_c, p.rate_cpm]).collect();
        let lo = path.iter().map(|p| p[0]).reduce(f64::min)?;
        let hi = path.iter().map(|p| p[0]).reduce(f64::max)?;
        let rate_cpm = path.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
        let of_leg = |leg: Leg| used.iter().filter(|p| p.leg() == leg).map(|p| p.length_h).sum();
        let [heating_h, cooling_h, steady_h] = [Leg::Heating, Leg::Cooling, Leg::Steady].map(of_leg);
        let mut hours = vec![vec![0.0; COLUMNS]; ROWS];
        let place = |part: f64, n: usize| ((part * n as f64) as usize).min(n - 1);
        for p in &used {
            let column = if hi > lo { place((p.temperature_c - lo) / (hi - lo), COLUMNS) } else { 0 };
            let row = if rate_cpm > 0.0 { place((rate_cpm - p.rate_cpm) / (2.0 * rate_cpm), ROWS) } else { ROWS / 2 };
            hours[row][column] += p.length_h;
        }
        Some(Self { temperature_c: [lo, hi], rate_cpm, heating_h, cooling_h, steady_h, hours, path })
    }

    /// As a picture in text, a line each: rates down the side, temperatures along the bottom.
    pub fn picture(&self) -> Vec<String> {
        let fullest = self.hours.iter().flatten().copied().fold(0.0, f64::max);
        let shade = |hours: &f64| {
            // The root: a soak would make every ramp look empty.
            let part = if fullest > 0.0 { (hours / fullest).sqrt() } else { 0.0 };
            SHADES[(part * 4.0).ceil() as usize]
        };
        let rate = |row: usize| self.rate_cpm * (1.0 - (2.0 * row as f64 + 1.0) / ROWS as f64);
        let mut lines = vec!["rate, °C/min".to_owned()];
        for (row, cells) in self.hours.iter().enumerate() {
            let rate = if row == ROWS / 2 { 0.0 } else { rate(row) };
            let text = format!("{rate:+.2}").replace('-', "−").replace("+0.00", "0.00");
            lines.push(format!("{text:>8} │{}", cells.iter().map(shade).collect::<String>()));
        }
        let [lo, hi] = self.temperature_c.map(|c| format!("{c:.1}").replace('-', "−"));
        let gap = (COLUMNS + 1).saturating_sub(lo.chars().count() + hi.chars().count());
        lines.push(format!("{:9}{lo}{}{hi} °C", "", " ".repeat(gap)));
        lines
    }
}
