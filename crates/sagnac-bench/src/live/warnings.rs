//! What is wrong with a test while it can still be mended.
//!
//! Each rule looks at minutes ([`crate::live::minutes`]) and says what it sees, since when, and what to look at. A warning ends when its rule no
//! longer holds. `docs/how-to/live-bench.md` has each rule with the time in which a simulated fault must raise it.
//!
//! Fails for what leaves no sign in minutes: a lone thermometer that is slowly wrong, an axis whose scale factor was typed wrong.

use std::collections::VecDeque;

use sagnac_units::format::significant;
use serde::Serialize;

use crate::decode::ClockReport;
use crate::live::minutes::{Minute, Value};
use crate::live::pairs::Pairs;
use crate::live::seconds::Columns;

/// Minutes that are looked back.
const HISTORY: usize = 120;
/// A thermometer stands still after so many minutes.
const STILL: usize = 10;
/// Another one has moved by more, °C.
const MOVED_C: f64 = 1.5;
/// The chamber has, °C.
const MOVED_CHAMBER_C: f64 = 10.0;
/// A lone thermometer that changed so often in as many minutes before does not stop by itself.
const LIVELY: u32 = 50;
/// Part of a minute's rows that may be missing.
const MISSING: f64 = 0.05;
/// Minutes in a row that a fault must last.
const LASTS: usize = 2;
/// Variance from row to row above its median by this factor.
const SHAKEN: f64 = 4.0;
/// Minutes that make a median.
const QUIET: usize = 10;
/// The chamber is off its set-point by more, °C, for so many minutes, and does not come nearer by so much a minute.
const OFF_SET_POINT_C: f64 = 3.0;
const FOLLOWS: usize = 10;
const NEARS_CPM: f64 = 0.05;
/// A window of the analysis should not hold more, °C.
const WINDOW_C: f64 = 2.0;
/// Clocks that differ by more, ppm.
const CLOCKS_PPM: f64 = 200.0;
/// Light below this part of its median.
const DIM: f64 = 0.7;
/// An actuator that stands at its extreme for so many minutes.
const AT_LIMIT: usize = 5;
/// Counts that repeat in this part of the rows of so many minutes, and varied before.
const REPEATS: f64 = 0.999;
const STOPPED: usize = 5;
const VARIED: f64 = 0.9;
/// Bits of counters that wrap.
const BITS: [i32; 6] = [8, 15, 16, 24, 31, 32];

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WarningKind {
    /// A thermometer stands still.
    StuckThermometer,
    /// A thermometer departs from the others.
    ThermometerDeparts,
    /// Counts stand still, or at a limit of the counter.
    CountsStandStill,
    /// Rows or counts are missing.
    MissingRows,
    /// A running total is read as counts of a row, or a counter wraps.
    CounterWraps,
    /// The chamber is not at its set temperature.
    ChamberNotFollowing,
    /// The temperature moves too far within a window.
    RampTooFast,
    /// The path-length loop is out of its range.
    PathLength,
    /// The light is out of its range.
    Light,
    /// The gyro's clock and the computer's drift apart.
    ClockDrift,
    /// The gyro is shaken.
    Vibration,
}

/// One warning.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// What is wrong.
    pub kind: WarningKind,
    /// Where: an axis, a thermometer, a column.
    pub place: String,
    /// In words, with what to look at.
    pub words: String,
    /// Since when, s since the first row.
    pub since_s: f64,
    /// Until when; `None` while it holds.
    pub until_s: Option<f64>,
}

/// Most warnings that are kept; the oldest that are over go first.
const MOST_WARNINGS: usize = 200;

/// Looks at minutes.
pub(crate) struct MinuteWatch {
    columns: Columns,
    window_s: f64,
    history: VecDeque<Minute>,
    pairs: Pairs,
    warnings: Vec<Warning>,
    /// Variances from row to row of quiet minutes, per axis.
    quiet: Vec<VecDeque<f64>>,
    /// Rows that repeated, per axis, as a part of those before.
    varied: Vec<bool>,
}

/// A rule's finding.
type Finding = (WarningKind, String, String);

impl MinuteWatch {
    pub(crate) fn new(columns: Columns, window_s: f64) -> Self {
        let axes = columns.axes.len();
        let own = columns.thermometers.iter().map(|t| !t.is_of_instrument).collect();
        let pairs = Pairs::new(own);
        Self {
            columns,
            window_s,
            history: VecDeque::new(),
            pairs,
            warnings: Vec::new(),
            quiet: vec![VecDeque::new(); axes],
            varied: vec![false; axes],
        }
    }

    /// The next minute.
    pub(crate) fn push(&mut self, minute: Minute, clock: ClockReport) {
        let now_s = minute.t_s + super::minutes::MINUTE_S;
        self.history.push_back(minute);
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
        let mut findings: Vec<Finding> = Vec::new();
        self.thermometers(&mut findings);
        self.rows(&mut findings);
        self.counts(&mut findings);
        self.vibration(&mut findings);
        self.chamber(&mut findings);
        self.loops(&mut findings);
        findings.extend(clocks(clock));
        self.keep(findings, now_s);
    }

    /// All warnings, those that hold first, each newest first.
    pub(crate) fn all(&self) -> Vec<Warning> {
        let mut all = self.warnings.clone();
        all.sort_by(|a, b| {
            (a.until_s.is_some(), b.since_s)
                .partial_cmp(&(b.until_s.is_some(), a.since_s))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        all
    }

    /// Begins what is new and ends what is over.
    fn keep(&mut self, findings: Vec<Finding>, now_s: f64) {
        let holds = |warning: &Warning| {
            findings.iter().any(|(kind, place, _)| *kind == warning.kind && *place == warning.place)
        };
        for warning in self.warnings.iter_mut().filter(|warning| warning.until_s.is_none()) {
            if !holds(warning) {
                warning.until_s = Some(now_s);
            }
        }
        for (kind, place, words) in findings {
            let known = |w: &&mut Warning| w.until_s.is_none() && w.kind == kind && w.place == place;
            if self.warnings.iter_mut().find(known).is_none() {
                self.warnings.push(Warning { kind, place, words, since_s: now_s, until_s: None });
            }
        }
        while self.warnings.len() > MOST_WARNINGS {
            let oldest = self.warnings.iter().position(|warning| warning.until_s.is_some()).unwrap_or(0);
            self.warnings.remove(oldest);
        }
    }

    /// The last minutes, oldest first; `None` before there are so many.
    fn last(&self, minutes: usize) -> Option<Vec<&Minute>> {
        let from = self.history.len().checked_sub(minutes)?;
        Some(self.history.iter().skip(from).collect())
    }

    fn thermometers(&mut self, findings: &mut Vec<Finding>) {
        let names: Vec<String> = self.columns.thermometers.iter().map(|t| t.name.clone()).collect();
        // A chamber that is regulated well stands still in a soak.
        let own = |at: &usize| !self.columns.thermometers[*at].is_of_instrument;
        for (at, name) in names.iter().enumerate().filter(|(at, _)| own(at)) {
            if let Some(moved) = self.stands_still(at) {
                let words = format!("{name} is stuck for {STILL} min{moved}: check its cable and its converter");
                findings.push((WarningKind::StuckThermometer, name.clone(), words));
            }
        }
        let Some(minute) = self.history.back() else { return };
        let means: Vec<f64> = minute.temperatures.iter().map(Value::mean).collect();
        for (at, by_c) in self.pairs.push(&means) {
            let words = format!(
                "{} differs from the other thermometers by {} °C: it drifts, or came off the block",
                names[at],
                significant(by_c, 2)
            );
            findings.push((WarningKind::ThermometerDeparts, names[at].clone(), words));
        }
        let too_fast = |at: usize| {
            let last = self.last(LASTS + 1)?;
            let means: Vec<f64> = last.iter().map(|minute| minute.temperatures[at].mean()).collect();
            let least = means.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(f64::INFINITY, f64::min);
            let in_window = least * self.window_s / super::minutes::MINUTE_S;
            (in_window > WINDOW_C).then(|| significant(in_window, 2))
        };
        let own = |at: &usize| !self.columns.thermometers[*at].is_of_instrument;
        if let Some((at, by)) = (0..names.len()).filter(own).find_map(|at| Some((at, too_fast(at)?))) {
            let words = format!(
                "{} moves by {by} °C within a window of {} s, so windows are divided: ramp more slowly",
                names[at], self.window_s
            );
            findings.push((WarningKind::RampTooFast, names[at].clone(), words));
        }
    }

    /// Why a thermometer that has not changed should have; `None` where it may stand still.
    fn stands_still(&self, at: usize) -> Option<String> {
        let last = self.last(STILL)?;
        let value = |minute: &Minute| minute.temperatures[at];
        let first = value(last.first()?);
        let is_still = last.iter().all(|minute| {
            let value = value(minute);
            value.number > 0
                && value.least.to_bits() == value.most.to_bits()
                && value.last.to_bits() == first.last.to_bits()
        });
        if !is_still {
            return None;
        }
        let still_from = self.history.iter().rposition(|minute| {
            let value = value(minute);
            value.least.to_bits() != first.last.to_bits() || value.most.to_bits() != first.last.to_bits()
        });
        let since = still_from.map_or(0, |from| from + 1);
        let moved = |other: usize| {
            let means = self.history.iter().skip(since).map(|minute| minute.temperatures[other].mean());
            let known = means.filter(|c| c.is_finite());
            let (least, most) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c), b.max(c)));
            most - least
        };
        let is_own = |other: &usize| !self.columns.thermometers[*other].is_of_instrument;
        let others = || (0..self.columns.thermometers.len()).filter(|other| *other != at);
        let has_own = others().any(|other| is_own(&other));
        // A block may lag far behind the air of its chamber: that counts only where no other thermometer is on the block.
        let far = |other: usize| match (has_own, is_own(&other)) {
            (true, true) => MOVED_C,
            (false, false) => MOVED_CHAMBER_C,
            _ => f64::INFINITY,
        };
        if let Some(other) = others().find(|other| moved(*other) > far(*other)) {
            let name = &self.columns.thermometers[other].name;
            return Some(format!(", while {name} moved by {} °C", significant(moved(other), 2)));
        }
        if has_own {
            return None;
        }
        // Alone: it was lively right before.
        let from = still_from?;
        let before =
            self.history.iter().take(from + 1).rev().take(STILL).map(|minute| value(minute).changes).sum::<u32>();
        let first = self.history.iter().take(from + 1).rev().nth(3)?;
        let rate = (first.temperatures[at].mean() - value(self.history.get(from)?).mean()).abs() / 3.0;
        (before >= LIVELY && rate > 0.2).then(|| ", in the middle of a ramp".to_owned())
    }

    fn rows(&self, findings: &mut Vec<Finding>) {
        let Some(last) = self.last(LASTS) else { return };
        let part = |minute: &Minute| f64::from(minute.lost) / f64::from((minute.rows + minute.lost).max(1));
        if last.iter().all(|minute| part(minute) > MISSING) {
            let worst = last.iter().map(|minute| part(minute)).fold(0.0, f64::max);
            let words =
                format!("{} % of the rows are missing: check the line and its speed", significant(100.0 * worst, 2));
            findings.push((WarningKind::MissingRows, "rows".to_owned(), words));
        }
        for (at, axis) in self.columns.axes.iter().enumerate() {
            let part = |minute: &Minute| f64::from(minute.axes[at].steps.missing) / f64::from(minute.rows.max(1));
            if last.iter().all(|minute| part(minute) > MISSING) {
                let worst = last.iter().map(|minute| part(minute)).fold(0.0, f64::max);
                let words =
                    format!("axis {}: {} % of the rows have no counts", axis.letter, significant(100.0 * worst, 2));
                findings.push((WarningKind::MissingRows, axis.letter.to_string(), words));
            }
        }
    }

    fn counts(&mut self, findings: &mut Vec<Finding>) {
        for at in 0..self.columns.axes.len() {
            let letter = self.columns.axes[at].letter;
            let Some(newest) = self.history.back().map(|minute| minute.axes[at]) else { return };
            let repeats =
                |axis: super::minutes::AxisMinute| f64::from(axis.steps.repeats) / f64::from(axis.steps.pairs.max(1));
            let stopped = self.last(STOPPED).is_some_and(|last| {
                last.iter().all(|minute| minute.axes[at].steps.pairs > 0 && repeats(minute.axes[at]) > REPEATS)
            });
            if stopped && self.varied[at] {
                let words = format!(
                    "axis {letter}: the counts are stuck for {STOPPED} min: the counter is at its limit, or has stopped"
                );
                findings.push((WarningKind::CountsStandStill, letter.to_string(), words));
            }
            self.varied[at] |= newest.steps.pairs > 0 && repeats(newest) < VARIED;
            let rises = |minute: &&Minute| {
                minute.axes[at].steps.pairs >= 10 && minute.axes[at].steps.rises + 2 >= minute.axes[at].steps.pairs
            };
            if self.last(LASTS).is_some_and(|last| last.iter().all(rises)) {
                let words = format!(
                    "axis {letter}: the counts rise steadily, like a running total: set counter = \"cumulative\""
                );
                findings.push((WarningKind::CounterWraps, letter.to_string(), words));
                continue;
            }
            let step = newest.steps.largest.abs();
            let wraps = BITS.into_iter().find(|bits| (step / 2_f64.powi(*bits) - 1.0).abs() < 0.02);
            let usual = self.usual_step(at);
            if let Some(bits) = wraps.filter(|_| step > 20.0 * usual) {
                let words = format!(
                    "axis {letter}: the counts step by nearly 2^{bits}, like a wrapping counter: set counter_bits"
                );
                findings.push((WarningKind::CounterWraps, letter.to_string(), words));
            }
        }
    }

    /// The median of the largest steps of the minutes before.
    fn usual_step(&self, at: usize) -> f64 {
        let before = self.history.iter().rev().skip(1);
        median(before.map(|minute| minute.axes[at].steps.largest.abs()).collect()).unwrap_or(f64::INFINITY)
    }

    fn vibration(&mut self, findings: &mut Vec<Finding>) {
        for at in 0..self.columns.axes.len() {
            let usual = median(self.quiet[at].iter().copied().collect()).filter(|_| self.quiet[at].len() >= QUIET);
            let shaken = |minute: &Minute| usual.is_some_and(|usual| minute.axes[at].variance > SHAKEN * usual);
            let newest = self.history.back().is_some_and(&shaken);
            if self.last(LASTS).is_some_and(|last| last.iter().all(|minute| shaken(minute))) {
                let letter = self.columns.axes[at].letter;
                let (is, was) =
                    (self.history.back().map_or(0.0, |minute| minute.axes[at].variance), usual.unwrap_or(f64::NAN));
                let words = format!(
                    "axis {letter}: rows scatter {} times as much as before: the gyro is shaken, or its light or dither fails",
                    significant((is / was).sqrt(), 2)
                );
                findings.push((WarningKind::Vibration, letter.to_string(), words));
            }
            let variance = self.history.back().map_or(f64::NAN, |minute| minute.axes[at].variance);
            // Counts of few bits have minutes without any scatter.
            if !newest && variance > 0.0 {
                self.quiet[at].push_back(variance);
                if self.quiet[at].len() > HISTORY {
                    self.quiet[at].pop_front();
                }
            }
        }
    }

    fn chamber(&self, findings: &mut Vec<Finding>) {
        let is_set_point = |name: &str| name.contains("set_point") || name.contains("setpoint");
        let Some(set_point) = self.columns.numbers.iter().position(|(_, name)| is_set_point(name)) else { return };
        let Some(chamber) = self.columns.thermometers.iter().position(|t| t.is_of_instrument || t.name == "chamber")
        else {
            return;
        };
        let Some(last) = self.last(FOLLOWS) else { return };
        let off: Vec<f64> = last
            .iter()
            .map(|minute| (minute.numbers[set_point].mean() - minute.temperatures[chamber].mean()).abs())
            .collect();
        let nears = off.windows(2).map(|pair| pair[0] - pair[1]).sum::<f64>() / (FOLLOWS - 1) as f64;
        if off.iter().all(|off| *off > OFF_SET_POINT_C) && nears < NEARS_CPM {
            let words = format!(
                "the chamber stays {} °C from its set-point: check its door, its cooling and its limits",
                significant(off.last().copied().unwrap_or(f64::NAN), 2)
            );
            findings.push((WarningKind::ChamberNotFollowing, "chamber".to_owned(), words));
        }
    }

    fn loops(&self, findings: &mut Vec<Finding>) {
        let Some(minute) = self.history.back() else { return };
        for (column, (words, seconds)) in &minute.words {
            let Some((_, name)) = self.columns.words.get(*column).filter(|_| *seconds >= 3) else { continue };
            let kind = match name.as_str() {
                "path_length_status" => WarningKind::PathLength,
                "intensity_status" => WarningKind::Light,
                _ => continue,
            };
            // A loop that acquires or settles says so, and is not out of range.
            let harmless = |word: &str| ["ACQUIRING", "SETTLING", "IGNITING", "RESETTING", "WAS_LOST"].contains(&word);
            if words.split('+').all(harmless) {
                continue;
            }
            let what = if kind == WarningKind::Light { "light" } else { "path length" };
            findings.push((
                kind,
                name.clone(),
                format!("the loop of the {what} reports {words} in {seconds} s of a minute"),
            ));
        }
        for (at, (_, name)) in self.columns.numbers.iter().enumerate() {
            let all = || self.history.iter().map(|minute| minute.numbers[at]).filter(|value| value.number > 0);
            if name.contains("light") || name.contains("intensity") {
                let usual = median(all().map(|value| value.mean()).collect());
                let now = minute.numbers[at].mean();
                if let Some(usual) = usual.filter(|usual| self.history.len() >= QUIET && now < DIM * usual) {
                    let part = significant(100.0 * now / usual, 2);
                    findings.push((WarningKind::Light, name.clone(), format!("{name} fell to {part} % of its start")));
                }
            }
            if name.contains("path_length") {
                let Some(last) = self.last(AT_LIMIT) else { continue };
                let (least, most) =
                    all().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v.least), b.max(v.most)));
                let stands = |limit: f64| {
                    last.iter().all(|minute| {
                        let value = minute.numbers[at];
                        value.number > 1
                            && value.least.to_bits() == limit.to_bits()
                            && value.most.to_bits() == limit.to_bits()
                    })
                };
                if most > least && (stands(least) || stands(most)) {
                    let words = format!("{name} is at its extreme for {AT_LIMIT} min: the loop is at its limit");
                    findings.push((WarningKind::PathLength, name.clone(), words));
                }
            }
        }
    }
}

fn clocks(clock: ClockReport) -> Option<Finding> {
    let ppm = clock.drift_ppm.filter(|ppm| ppm.abs() > CLOCKS_PPM)?;
    let words = format!(
        "the gyro's clock gains {} ppm on the computer's: rates and scale factor have the same error",
        significant(ppm, 2)
    );
    Some((WarningKind::ClockDrift, "clock".to_owned(), words))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
