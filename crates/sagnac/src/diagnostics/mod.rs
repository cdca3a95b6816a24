//! The points that a report draws for each window of a fit or a verification.
//!
//! Nothing here is a result: results are in the record.

pub(crate) mod profile;
pub(crate) mod soaks;

use crate::model::{ActsOn, Form};
use crate::window::Windows;
use sagnac_log::ingest::Reason;
use sagnac_units::s_from_ns;

/// Windows whose temperature moves slower than this are neither heating nor cooling, °C/min.
pub(crate) const STEADY_CPM: f64 = 0.05;

/// Whether a window's temperature rises or falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Leg {
    /// Rises.
    Heating,
    /// Falls.
    Cooling,
    /// Neither.
    Steady,
}

/// One window.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WindowPoint {
    /// Index of the run.
    pub run: usize,
    /// Middle of the window, hours of test: runs follow each other.
    pub hours: f64,
    /// Length, h.
    pub length_h: f64,
    /// Mean temperature, °C; NaN where unknown.
    pub temperature_c: f64,
    /// Its rate from the windows next to it, °C/min; NaN without time or temperature.
    pub rate_cpm: f64,
    /// As logged, about the run's own constant, °/h.
    pub before_dph: f64,
    /// What the fit assigns to inputs other than its thermometer, °/h; 0 without any, and in a verification.
    pub inputs_dph: f64,
    /// As corrected, or minus the fit; NaN where the window was excluded.
    pub after_dph: f64,
    /// Why it is excluded, if it is.
    pub excluded: Option<Reason>,
}

/// A stretch of the hours of test that is one run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RunSpan {
    /// File name.
    pub file: String,
    /// Start and end, hours of test.
    pub hours: [f64; 2],
}

/// The points of one axis.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AxisReportData {
    /// Axis letter.
    pub axis: char,
    /// Every window in order.
    pub points: Vec<WindowPoint>,
    /// Effect of each input alone; empty in a verification.
    pub effects: Vec<Effect>,
}

impl AxisReportData {
    /// σ of the used windows about their run's mean as logged, °/h; `None` where no run has two.
    pub fn logged_sigma_dph(&self) -> Option<f64> {
        let is_used = |point: &&WindowPoint| point.after_dph.is_finite() && point.before_dph.is_finite();
        let used: Vec<&WindowPoint> = self.points.iter().filter(is_used).collect();
        let runs: Vec<&[&WindowPoint]> = used.chunk_by(|a, b| a.run == b.run).collect();
        let square = |run: &&[&WindowPoint]| {
            let mean = run.iter().map(|point| point.before_dph).sum::<f64>() / run.len() as f64;
            run.iter().map(|point| (point.before_dph - mean).powi(2)).sum::<f64>()
        };
        let freedom = used.len() - runs.len();
        (freedom > 0).then(|| (runs.iter().map(square).sum::<f64>() / freedom as f64).sqrt())
    }

    /// That σ over the one on data that the fit did not see; `None` where either is missing, or nothing remains.
    pub fn reduction(&self, unseen_dph: Option<f64>) -> Option<f64> {
        Some(self.logged_sigma_dph()? / unseen_dph.filter(|remaining| *remaining > 0.0)?)
    }
}

/// What of an input an effect is a function of, or what it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectOf {
    /// The drift that its value makes, °/h.
    Value,
    /// The drift that its rate makes, °/h.
    Rate,
    /// The change of the scale factor that its value makes, ppm.
    Scale,
}

impl EffectOf {
    /// Whether a term is part of it.
    pub(crate) fn holds(self, form: Form) -> bool {
        let effect = match (form.acts_on, form.times_rate) {
            (ActsOn::Bias, false) => Self::Value,
            (ActsOn::Bias, true) => Self::Rate,
            (ActsOn::ScaleFactor, _) => Self::Scale,
        };
        self == effect
    }
}

/// Effect of one input, with the residual of the fit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Effect {
    /// Its name.
    pub input: String,
    /// False for the thermometer of the fit.
    pub further: bool,
    /// Its unit is °C; else that of a column.
    pub in_celsius: bool,
    /// What is shown of it.
    pub of: EffectOf,
    /// Value at which it is zero.
    pub reference: f64,
    /// Of each window that shows the effect: the input's value, or its lagged rate per minute.
    pub x: Vec<f64>,
    /// Sum of its terms in the window, °/h or ppm.
    pub fit: Vec<f64>,
    /// The same plus the residual of the fit.
    pub shown: Vec<f64>,
    /// Its terms as a curve (x, °/h or ppm); empty where they are none of x alone.
    pub curve: Vec<[f64; 2]>,
}

/// Everything a report draws.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ReportData {
    /// The runs.
    pub runs: Vec<RunSpan>,
    /// Time was logged: points have hours. Without it they are counted.
    pub timed: bool,
    /// The axes.
    pub axes: Vec<AxisReportData>,
}

/// Runs one after the other, a fiftieth of the whole apart.
pub(crate) fn run_spans(windows: &Windows) -> Vec<RunSpan> {
    let whole: f64 = windows.runs.iter().map(|run| run.length_s() / 3600.0).sum();
    let mut start = 0.0;
    let spans = windows.runs.iter().map(|run| {
        let hours = [start, start + run.length_s() / 3600.0];
        start = hours[1] + whole / 50.0;
        RunSpan { file: sagnac_units::format::file_name(&run.name()), hours }
    });
    spans.collect()
}

/// The points of one axis; `before` and `after` give a window's rates, °/h.
pub(crate) fn points(
    windows: &Windows,
    spans: &[RunSpan],
    sensor: Option<usize>,
    before: impl Fn(usize) -> f64,
    after: impl Fn(usize) -> f64,
) -> Vec<WindowPoint> {
    let rows = &windows.rows;
    let one = |i: usize| {
        let run = rows.run[i] as usize;
        let origin_ns = windows.runs[run].start_ns;
        let hours = |ns: i64| spans[run].hours[0] + s_from_ns(ns - origin_ns) / 3600.0;
        let (from, to) = (hours(rows.start_ns[i]), hours(rows.end_ns[i]));
        WindowPoint {
            run,
            hours: f64::midpoint(from, to),
            length_h: to - from,
            temperature_c: sensor.map_or(f64::NAN, |sensor| rows.mean_c[sensor][i]),
            rate_cpm: sensor.map_or(f64::NAN, |sensor| rate_cpm(windows, sensor, i)),
            before_dph: before(i),
            inputs_dph: 0.0,
            after_dph: after(i),
            excluded: rows.excluded[i],
        }
    };
    (0..windows.len()).map(one).collect()
}

/// From the mean temperatures of the windows next to it.
fn rate_cpm(windows: &Windows, sensor: usize, i: usize) -> f64 {
    let rows = &windows.rows;
    let beside = |j: usize| (rows.run.get(j) == Some(&rows.run[i])).then_some(j);
    let (from, to) = (i.checked_sub(1).and_then(beside).unwrap_or(i), beside(i + 1).unwrap_or(i));
    let middle_s = |j: usize| s_from_ns(rows.start_ns[j] / 2 + rows.end_ns[j] / 2);
    if !windows.shape.timed {
        return f64::NAN;
    }
    60.0 * (rows.mean_c[sensor][to] - rows.mean_c[sensor][from]) / (middle_s(to) - middle_s(from))
}

/// Hysteresis: mean while heating minus mean while cooling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LegDifference {
    /// The difference, °/h.
    pub(crate) difference_dph: f64,
    /// Its standard error per σ of a window: √(1/n₁ + 1/n₂).
    pub(crate) per_sigma: f64,
}

/// Heating against cooling over the used windows; `None` with fewer than `least` windows of a leg. The one rule for fit and
/// verification, which differ in the standard error of a window.
pub(crate) fn hysteresis_of(
    points: &[WindowPoint],
    least: usize,
    value: impl Fn(&WindowPoint) -> f64,
) -> Option<LegDifference> {
    let mean = |leg: Leg| {
        let used = |p: &&WindowPoint| p.leg() == leg && p.excluded.is_none() && p.after_dph.is_finite();
        let values: Vec<f64> = points.iter().filter(used).map(&value).collect();
        (values.len() >= least).then(|| (values.iter().sum::<f64>() / values.len() as f64, values.len() as f64))
    };
    let ((heating, n_heating), (cooling, n_cooling)) = (mean(Leg::Heating)?, mean(Leg::Cooling)?);
    Some(LegDifference { difference_dph: heating - cooling, per_sigma: (1.0 / n_heating + 1.0 / n_cooling).sqrt() })
}

/// The 5th and the 95th percentile of the temperature rates of used windows, °C/min; `None` without time.
pub(crate) fn ramp_rates_cpm(points: &[WindowPoint]) -> Option<[f64; 2]> {
    let used = points.iter().filter(|p| p.excluded.is_none() && p.rate_cpm.is_finite());
    let mut rates: Vec<f64> = used.map(|p| p.rate_cpm).collect();
    rates.sort_by(f64::total_cmp);
    let last = rates.len().checked_sub(1)?;
    Some([0.05, 0.95].map(|part| rates[(part * last as f64).round() as usize]))
}

/// Part of the variance of temperature between runs from which on their offsets can hold a drift.
const BETWEEN_RUNS: f64 = 0.25;

/// True where the runs differ so much in their mean temperatures that an offset each can hold a drift over temperature.
pub(crate) fn offsets_hide_drift(points: &[WindowPoint]) -> bool {
    let known = || points.iter().filter(|p| p.excluded.is_none() && p.temperature_c.is_finite());
    let runs = points.iter().map(|p| p.run + 1).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); runs];
    known().for_each(|p| sums[p.run] = (sums[p.run].0 + p.temperature_c, sums[p.run].1 + 1.0));
    let (sum, n) = sums.iter().fold((0.0, 0.0), |(sum, n), run| (sum + run.0, n + run.1));
    let mean = sum / n;
    let all: f64 = known().map(|p| (p.temperature_c - mean).powi(2)).sum();
    let between: f64 = sums.iter().filter(|run| run.1 > 0.0).map(|run| run.1 * (run.0 / run.1 - mean).powi(2)).sum();
    between > BETWEEN_RUNS * all
}

/// Part of the rates of a fit that a test reaches, on the side where it reaches less; 1 where the fit itself had no ramps.
pub(crate) fn rate_coverage(fit_cpm: [f64; 2], test_cpm: [f64; 2]) -> f64 {
    let side = |fit: f64, test: f64| if fit.abs() > STEADY_CPM { (test / fit).clamp(0.0, 1.0) } else { 1.0 };
    side(fit_cpm[0], test_cpm[0]).min(side(fit_cpm[1], test_cpm[1]))
}

impl WindowPoint {
    /// Heating, cooling or neither.
    pub fn leg(&self) -> Leg {
        match self.rate_cpm {
            rate if rate > STEADY_CPM => Leg::Heating,
            rate if rate < -STEADY_CPM => Leg::Cooling,
            _ => Leg::Steady,
        }
    }
}
