//! What a log is good for, in one pass and without a search for a model.
//!
//! ```text
//! windows ─▶ one trial fit, `bias 1` ── refused ─▶ its reason: noise alone, or nothing
//!                 │ fitted
//!                 └▶ thermometers healthy, windows cover the span, both directions ─▶ calibration, with what to mind
//! ```
//!
//! The trial has the rules of [`crate::fit::calibrate`] for span, windows and excluded stretches, so what they refuse is not called good here.
//! A log is *good for calibration* if the trial is fitted, the windows, not only single readings, cover the least span, and at least half of
//! the rows are used. It is *good for noise* if its counts vary and enough unbroken rows show that; else it is not usable. Rates faster than any
//! gyro are not usable, whatever they show, nor are counts that only jitter.
//!
//! Fails where a log is wrong without a sign: a lone thermometer without noise that stops, a scale factor that was typed wrong, a chamber
//! log that belongs to another test.

mod coverage;
mod thermometers;

pub use coverage::CoverageMap;
pub use thermometers::ThermometerSurvey;

use serde::Serialize;

use crate::calibration::{AxisCalibration, Calibration};
use crate::diagnostics::profile::{TOGETHER, rate_explained, time_explained};
use crate::diagnostics::{Leg, WindowPoint, points, run_spans};
use crate::fit::{FitOptions, Model, READINGS_HOLD, calibrate, readings_do_not_hold};
use crate::verify::{Correction, Unanswered, unanswered};
use crate::window::{RestSpan, Windows, still_text};
use sagnac_log::error::{Error, ErrorKind, Result};
use sagnac_log::ingest::{AngleUnit, Clipped};
use sagnac_log::setup::Setup;
use sagnac_noise::MeasuredNoise;
use sagnac_units::DPH_PER_DPS;
use sagnac_units::format::significant;
use thermometers::thermometers;

/// Model of the trial: a constant for each run, and a slope.
const TRIAL: &str = "bias 1";
/// Readings this part of a window apart, or more, are slow.
const SLOW_PART: f64 = 0.3;
/// Fewer rows in an unbroken stretch show no noise.
const FEWEST_ROWS: u64 = 1000;
/// Fewer windows allow small models only: three for each coefficient.
const FEW_WINDOWS: usize = 30;
/// Fewer windows of a leg are no leg.
const FEWEST_OF_LEG: usize = 5;
/// Fewer windows in an outer third of the span hold that end of the curve badly.
const FEWEST_OF_THIRD: usize = 5;
/// Part of the rows that is missing or excluded from which on it is said, and from which on the log is not good for a calibration.
const MANY_ROWS: f64 = 0.05;
const MOST_ROWS: f64 = 0.5;
/// Faster than any gyro measures, °/h: 4000 °/s.
const MOST_RATE_DPH: f64 = 1.44e7;

/// The best use of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GoodFor {
    /// A calibration over temperature.
    Calibration,
    /// Noise terms alone.
    Noise,
    /// Neither.
    Nothing,
}

impl GoodFor {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibration => "good for calibration",
            Self::Noise => "good for noise only",
            Self::Nothing => "not usable",
        }
    }
}

/// What a log is good for, and what it lacks.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Survey {
    /// The verdict.
    pub good_for: GoodFor,
    /// Why it is not good for more; null for a calibration.
    pub reason: Option<String>,
    /// What to mind.
    pub cautions: Vec<String>,
    /// The longest part at rest, where others move; null where none moves, or all do.
    pub at_rest: Option<RestSpan>,
    /// Every thermometer.
    pub thermometers: Vec<ThermometerSurvey>,
    /// Hours over temperature and rate; null without time or temperature.
    pub coverage: Option<CoverageMap>,
    /// Per axis: angle random walk of the rows, °/√h, and the limits of which the log has no value.
    pub axes: Vec<AxisSurvey>,
}

/// One axis of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisSurvey {
    /// Axis letter.
    pub axis: char,
    /// Angle random walk, °/√h; null where the rows do not show it.
    pub arw_deg_rt_h: Option<f64>,
    /// Its 95 % interval, from zero where it is not resolved; null where the five laws do not describe the rows.
    pub arw_interval_deg_rt_h: Option<[f64; 2]>,
    /// Slope of the trial with its standard error, °/h per °C; null without a trial.
    pub slope_dph_per_c: Option<[f64; 2]>,
    /// Limits of an acceptance that such a log has no value for; null where the log is not good for a calibration.
    pub unanswered: Option<Vec<Unanswered>>,
}

impl AxisSurvey {
    /// Angle random walk with its interval, or its bound, `factor` per °/√h.
    pub fn arw_text(&self, factor: f64) -> String {
        let text = |value: f64| significant(factor * value, 3);
        match (self.arw_deg_rt_h, self.arw_interval_deg_rt_h) {
            (_, Some([0.0, at_most])) => format!("at most {}", text(at_most)),
            (Some(n), Some([lower, upper])) => format!("{} ({} … {})", text(n), text(lower), text(upper)),
            (Some(n), None) => text(n),
            (None, _) => "-".to_owned(),
        }
    }
}

/// Surveys the windows of a log.
///
/// # Errors
/// A setup that does not fit the log.
pub fn survey(windows: &Windows, setup: &Setup) -> Result<Survey> {
    let thermometers = thermometers(windows);
    let main = main_thermometer(windows, setup);
    let coverage = main.and_then(|at| CoverageMap::of(windows, at));
    let span = main.and_then(|at| span_of(windows, at));
    let reference_c = setup.reference_c();
    let outside = span.filter(|[lo, hi]| !(*lo..=*hi).contains(&reference_c));
    // Where the correction is zero is a choice: it does not make a log worse.
    let setup =
        &Setup { reference_c: outside.map(|[lo, hi]| f64::midpoint(lo, hi)).or(setup.reference_c), ..setup.clone() };
    let tried = match trial(windows, setup) {
        Err(error) if error.kind == ErrorKind::Input => return Err(error),
        tried => tried.and_then(|calibration| {
            covered(windows, setup, main).and_then(|()| mostly_used(windows)).map(|()| calibration)
        }),
    };
    let limits = match &tried {
        Ok(calibration) => limits_without_value(windows, setup, calibration)?,
        Err(_) => Vec::new(),
    };
    let measured: Vec<_> = (0..windows.shape.axes.len()).map(|axis| windows.measured_noise(axis)).collect();
    let axis = |(at, letter): (usize, &char)| AxisSurvey {
        axis: *letter,
        arw_deg_rt_h: measured[at].map(|noise| noise.terms.n_deg_rt_h()).filter(|n| *n > 0.0),
        arw_interval_deg_rt_h: measured[at].and_then(|noise| noise.n_deg_rt_h().1),
        slope_dph_per_c: tried.as_ref().ok().and_then(|calibration| slope(calibration.axis(*letter).ok()?)),
        unanswered: limits.iter().find(|(axis, _)| axis == letter).map(|(_, all)| all.clone()),
    };
    let axes: Vec<AxisSurvey> = windows.shape.axes.iter().enumerate().map(axis).collect();
    let (moves, at_rest) = motion(windows);
    let unusable = too_fast(windows).or_else(|| still_text(windows));
    let (good_for, reason) = match (&tried, noise(windows, setup, &measured)) {
        _ if unusable.is_some() => (GoodFor::Nothing, unusable),
        (Ok(_), _) => (GoodFor::Calibration, None),
        _ if moves.is_some() && at_rest.is_none() => (GoodFor::Nothing, moves.clone()),
        (Err(refusal), Ok(())) => (GoodFor::Noise, Some(refusal.what.clone())),
        (Err(refusal), Err(why)) => (GoodFor::Nothing, Some(format!("{why}; {}", refusal.what))),
    };
    let mut cautions: Vec<String> = thermometers.iter().flat_map(|one| one.faults.clone()).collect();
    cautions.extend(windows.runs.iter().flat_map(|run| &run.files).flat_map(|file| file.summary.clock.clone()));
    cautions.extend(clipped(windows, setup));
    cautions.extend(filtered(&windows.shape.axes, &measured));
    cautions.extend(moves.filter(|moves| reason.as_ref() != Some(moves)));
    cautions.extend(rows_missing(windows, MANY_ROWS).filter(|missing| reason.as_ref() != Some(missing)));
    cautions.extend(readings_do_not_hold(windows).then(|| READINGS_HOLD.to_owned()));
    if good_for == GoodFor::Calibration {
        cautions.extend(main.and_then(|at| slow_readings(&thermometers[at], windows)));
        cautions.extend(outside.map(|[lo, hi]| {
            format!("the reference temperature {reference_c} °C lies outside the span {lo:.1} … {hi:.1} °C: give --reference within it")
        }));
        cautions.extend(profile(windows, main));
        cautions.extend(tried.iter().flat_map(loud_thermometers));
    }
    Ok(Survey { good_for, reason, cautions, at_rest, thermometers, coverage, axes })
}

/// The thermometer that a calibration would use.
fn main_thermometer(windows: &Windows, setup: &Setup) -> Option<usize> {
    let names = &windows.shape.thermometers;
    let wanted = setup.use_thermometer.as_deref();
    wanted.and_then(|wanted| names.iter().position(|name| name == wanted)).or((!names.is_empty()).then_some(0))
}

/// Lowest to highest reading of the used windows.
fn span_of(windows: &Windows, thermometer: usize) -> Option<[f64; 2]> {
    let used = |column: &[f64], pick: fn(f64, f64) -> f64| {
        let known =
            column.iter().zip(&windows.rows.excluded).filter(|(c, excluded)| excluded.is_none() && c.is_finite());
        known.map(|(c, _)| *c).reduce(pick)
    };
    let rows = &windows.rows;
    Some([used(&rows.min_c[thermometer], f64::min)?, used(&rows.max_c[thermometer], f64::max)?])
}

fn trial(windows: &Windows, setup: &Setup) -> Result<Calibration> {
    calibrate(windows.clone(), setup, &FitOptions::new(Model::Fixed(TRIAL.parse()?)))
}

/// Readings so far apart that they hold for much of a window: on a ramp the temperature is behind the gyro.
fn slow_readings(thermometer: &ThermometerSurvey, windows: &Windows) -> Option<String> {
    let every_s = thermometer.reading_interval_s?;
    let is_slow = every_s > SLOW_PART * windows.shape.nominal_s && every_s > windows.shape.sample_interval_s;
    is_slow.then(|| {
        format!(
            "the thermometer gives one reading every {every_s:.0} s, half of that late on a ramp: the fit counts the delay as \
             an effect of the temperature rate, different for a faster thermometer"
        )
    })
}

/// The means of the windows must cover the span that a fit needs: a spike is no temperature.
fn covered(windows: &Windows, setup: &Setup, main: Option<usize>) -> Result<()> {
    let least_c = setup.min_span_c();
    let used = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none());
    let means = main.map(|at| used.map(|i| windows.rows.mean_c[at][i]).filter(|c| c.is_finite()).collect::<Vec<f64>>());
    let (lo, hi) =
        means.iter().flatten().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), c| (lo.min(*c), hi.max(*c)));
    if hi - lo >= least_c {
        return Ok(());
    }
    Err(Error::refused(
        format!("single readings span {least_c} °C, and the means of the windows only {:.2} °C", (hi - lo).max(0.0)),
        "test over a wider range, or set a shorter --window",
    ))
}

/// Of a log of which most is excluded, the rest is not the test.
fn mostly_used(windows: &Windows) -> Result<()> {
    let why = rows_missing(windows, MOST_ROWS);
    why.map_or(Ok(()), |why| Err(Error::refused(why, "correct the unit or the limits of the column that they name")))
}

/// An axis whose mean rate no gyro measures.
fn too_fast(windows: &Windows) -> Option<String> {
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    let is_of_rates = windows.shape.unit == AngleUnit::Arcsec;
    let mean = |axis: usize| used.iter().map(|i| windows.rate_dph(axis, *i).abs()).sum::<f64>() / used.len() as f64;
    let axes = windows.shape.axes.iter().enumerate().map(|(at, letter)| (letter, mean(at)));
    let (letter, dph) = axes.filter(|_| is_of_rates).find(|(_, dph)| *dph > MOST_RATE_DPH)?;
    Some(format!(
        "axis {letter} reads {} °/s in the mean, faster than any gyro: its unit is wrong, or it holds codes of a converter",
        significant(dph / DPH_PER_DPS, 3)
    ))
}

/// Rates at their full scale.
fn clipped(windows: &Windows, setup: &Setup) -> Vec<String> {
    let files = windows.runs.iter().flat_map(|run| &run.files);
    let say = |(file, one): (&str, &Clipped)| {
        let rate = setup.units.unwrap_or_default().text(one.rate_dph, 6);
        format!("axis {}: {} rows of {file} read {rate} exactly, clipped at full scale", one.axis, one.rows)
    };
    files.flat_map(|file| file.summary.clipped.iter().map(|one| (file.summary.file.as_str(), one))).map(say).collect()
}

/// Axes behind a low-pass filter.
fn filtered(axes: &[char], measured: &[Option<MeasuredNoise>]) -> Option<String> {
    let behind = axes.iter().zip(measured).filter_map(|(letter, noise)| Some((letter, noise.as_ref()?.filter_hz?)));
    let all: Vec<String> = behind.map(|(letter, hz)| format!("{letter} at about {} Hz", significant(hz, 2))).collect();
    (!all.is_empty()).then(|| format!("filtered: axis {}; noise is taken from longer times", all.join(", ")))
}

/// Motion in words, with the longest rest next to it.
fn motion(windows: &Windows) -> (Option<String>, Option<RestSpan>) {
    if let Some(rest) = windows.rest.as_ref().filter(|rest| rest.moving_s > 0.0) {
        let percent = significant(100.0 * rest.moving_s / rest.length_s, 2);
        let span =
            rest.longest.clone().filter(|span| span.length_s >= FEWEST_ROWS as f64 * windows.shape.sample_interval_s);
        let longest = span.as_ref().map_or("no rest is long enough for noise terms".to_owned(), |span| {
            format!("the longest rest is {span}, and `sagnac allan --at-rest` uses it")
        });
        return (Some(format!("not at rest: the rows move in {percent} % of the time; {longest}")), span);
    }
    let humps = windows.shape.axes.iter().enumerate().filter_map(|(axis, letter)| Some((letter, windows.hump(axis)?)));
    let highest = humps.filter(|_| windows.rest.is_some()).max_by(|a, b| a.1.times.total_cmp(&b.1.times));
    let says = highest.map(|(letter, hump)| {
        format!(
            "not at rest: the curve of axis {letter} has a hump at τ = {} s, {} times above noise (motion or vibration)",
            significant(hump.tau_s, 2),
            significant(hump.times, 2)
        )
    });
    (says, None)
}

/// Whether the rows show noise.
fn noise(windows: &Windows, setup: &Setup, measured: &[Option<MeasuredNoise>]) -> std::result::Result<(), String> {
    let rows: u64 = windows.runs.iter().flat_map(|run| &run.files).map(|file| file.summary.rows).sum();
    if rows < FEWEST_ROWS {
        return Err(format!("{rows} rows are too few for noise terms: {FEWEST_ROWS} are needed"));
    }
    if !windows.shape.timed && setup.sample_interval_s.is_none() {
        return Err("the rows have no time; give --sample-interval".to_owned());
    }
    // Without a time there is a window for each row.
    let varies = |axis: usize| windows.rows.angle[axis].windows(2).any(|pair| pair[0] != pair[1]);
    let is_shown = |axis: usize| measured[axis].is_some() || !windows.shape.timed && varies(axis);
    let shows = (0..windows.shape.axes.len()).any(is_shown);
    if shows { Ok(()) } else { Err("the counts contain no noise".to_owned()) }
}

/// An end of the span that rests on few windows: a short excursion, or a thermometer that was wrong for some minutes.
fn thin_end(used: &[&WindowPoint]) -> Option<String> {
    let known = || used.iter().map(|p| p.temperature_c).filter(|c| c.is_finite());
    let (lo, hi) = (known().reduce(f64::min)?, known().reduce(f64::max)?);
    let third = (hi - lo) / 3.0;
    let ends = [("lower", lo, lo + third), ("upper", hi - third, hi)];
    ends.into_iter().find_map(|(which, from, to)| {
        let n = known().filter(|c| (from..=to).contains(c)).count();
        let windows = if n == 1 { "1 window covers".to_owned() } else { format!("{n} windows cover") };
        (n < FEWEST_OF_THIRD).then(|| format!("only {windows} the {which} third of the span, {from:.1} … {to:.1} °C"))
    })
}

fn limits_without_value(
    windows: &Windows,
    setup: &Setup,
    calibration: &Calibration,
) -> Result<Vec<(char, Vec<Unanswered>)>> {
    // A slope that no image holds leaves the limits unknown, not the log.
    let Ok(correction) = Correction::from_calibration(calibration.clone()) else { return Ok(Vec::new()) };
    match unanswered(windows, &correction, setup) {
        Err(error) if error.kind == ErrorKind::Input => Err(error),
        asked => Ok(asked.unwrap_or_default()),
    }
}

/// The slope of the trial with its standard error: its only term is a line over the span as −1 … 1.
fn slope(axis: &AxisCalibration) -> Option<[f64; 2]> {
    let term = axis.correction.terms.first()?;
    let [lo, hi] = axis.thermometer().span;
    Some([term.value, term.sigma?].map(|value| value / (0.5 * (hi - lo))))
        .filter(|both| both.iter().all(|value| value.is_finite()))
}

/// Rows that cannot be used, if they are more than a part.
fn rows_missing(windows: &Windows, most_part: f64) -> Option<String> {
    let rows: u64 = windows.runs.iter().flat_map(|run| &run.files).map(|file| file.summary.rows).sum();
    let excluded: u64 = windows.tallies.list().iter().map(|tally| tally.rows).sum();
    // A row may be excluded for itself and with its window.
    let part = excluded.min(rows) as f64 / rows.max(1) as f64;
    let most = windows.tallies.most()?;
    (part > most_part).then(|| {
        format!("{} % of the rows are excluded, most of them as {}", significant(100.0 * part, 2), most.reason.name())
    })
}

/// What the profile of the test does not hold.
fn profile(windows: &Windows, main: Option<usize>) -> Vec<String> {
    let all = points(windows, &run_spans(windows), main, |_| 0.0, |_| 0.0);
    let used: Vec<&WindowPoint> = all.iter().filter(|p| p.excluded.is_none()).collect();
    let mut out = Vec::new();
    if used.len() < FEW_WINDOWS {
        out.push(format!(
            "{} windows allow {} coefficients, the constants of the runs included",
            used.len(),
            used.len() / 3
        ));
    }
    out.extend(thin_end(&used));
    if !windows.shape.timed {
        out.push("the rows have no time, so rate terms are impossible".to_owned());
        return out;
    }
    let count = |leg: Leg| used.iter().filter(|p| p.leg() == leg).count();
    match [Leg::Heating, Leg::Cooling].map(|leg| count(leg) >= FEWEST_OF_LEG) {
        [true, false] => {
            out.push("it heats and never cools: hysteresis and rate terms are not separable from the curve".to_owned())
        }
        [false, true] => {
            out.push("it cools and never heats: hysteresis and rate terms are not separable from the curve".to_owned())
        }
        _ => {}
    }
    if count(Leg::Steady) < FEWEST_OF_LEG {
        out.push("it has no soak: the bias at rest of temperature is extrapolated from ramps".to_owned());
    }
    if rate_explained(&all).is_some_and(|part| part > TOGETHER) {
        out.push("temperature and its rate moved together: the calibration is valid for this profile alone".to_owned());
    }
    if time_explained(&all).is_some_and(|part| part > TOGETHER) {
        out.push("temperature and time moved together: a drift with time becomes a curve over temperature".to_owned());
    }
    out
}

/// Thermometers whose noise would be angle random walk.
fn loud_thermometers(calibration: &Calibration) -> Vec<String> {
    let loud = |axis: &AxisCalibration| {
        let noise = axis.fit.as_ref()?.correction_noise.as_ref()?;
        let increase = noise.increase.filter(|increase| *increase > noise.limit)?;
        Some(format!(
            "axis {}: through the slope alone the noise of the thermometers raises the angle random walk by {} %",
            axis.axis,
            significant(100.0 * increase, 2)
        ))
    };
    calibration.axes.iter().filter_map(loud).collect()
}
