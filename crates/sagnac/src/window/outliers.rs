//! Windows that are no thermal drift: bumps, steps, start-up.
//!
//! Each window is compared with what its neighbours predict at its own time, so a smooth drift of any
//! size passes, in windows of any length. Five predictions interpolate between a window before and one
//! after (at the ends of a run they extrapolate), and the second closest counts; the scale is robust
//! and has a floor of 10 % of the run's own range, so that a noise-free record is not taken apart at its
//! corners. A step is a change that happens at once, among small ones. One that is taken back is an excursion; one that lasts
//! has no wrong side: it is marked where it happens, and a fit refuses it. Where an auxiliary column jumps with it (the
//! mode, the path-length voltage at a reset) it is no outlier but something to be fitted: there the two sides are laid
//! together before they are judged.
//!
//! A bump that the temperature makes, too, is its drift: at the ends of short soaks both bend.
//!
//! Limits: a bump longer than three windows passes unless it rises and falls like steps; so does a step
//! of less than ten sigma or a quarter of the range, and either where the temperature rate changes by over
//! 0.2 °C/min, because a drift with the rate bends and steps there too.

use crate::window::windows::Windows;
use sagnac_log::ingest::Reason;
use sagnac_units::{DPH_PER_DPS, s_from_ns};

/// Reference rates closer than this part of themselves are one rate.
const SAME_RATE: f64 = 1e-3;
/// σ of the reference rate within a window, as a part of the largest rate, from which on the table changed its rate.
const CHANGE: f64 = 0.02;
const NEIGHBOURS: usize = 5;
/// Runs shorter than this are not judged.
const MIN_WINDOWS: usize = 12;
const BUMP_SIGMAS: f64 = 8.0;
const BUMP_OF_RANGE: f64 = 0.1;
const STEP_SIGMAS: f64 = 10.0;
const STEP_OF_RANGE: f64 = 0.25;
/// An auxiliary column that moves by this part of its range between two windows jumps …
const COLUMN_JUMP: f64 = 0.25;
/// … if that is this many times what it usually moves.
const JUMP_OF_USUAL: f64 = 8.0;
/// A column of which this part of the windows hold a whole number …
const WHOLE: f64 = 0.9;
/// … to within this.
const NEAR_WHOLE: f64 = 1e-9;
/// It happens in this part of the time between the two sides (evenly spaced windows: 1/3).
const STEP_OF_TIME: f64 = 0.45;
/// Nothing is called a step where the temperature rate changes by this much.
const TURN_CPM: f64 = 0.2;
/// A step back differs from the step by no more than this part of it.
const RETURN: f64 = 0.3;
/// A lasting step exceeds what medians of five windows, ten apart, usually differ by: otherwise it is slow noise.
const LASTING: f64 = 8.0;
/// A step within this part of the run, from its start, ends the start-up.
const START_UP: f64 = 0.05;
/// A step exceeds the usual change from window to window by this.
const STEP_OF_CHANGES: f64 = 4.0;
/// A step happens within two windows; a drift does not.
const STEP_AT_ONCE: f64 = 0.7;

/// Windows that look like outliers of an axis, with the reason; nothing is marked.
pub(crate) fn suspected(windows: &Windows, axis: usize) -> Vec<(usize, Reason)> {
    let mut marked = windows.clone();
    (0..windows.runs.len()).for_each(|run| mark_run(&mut marked, run, axis));
    let new = |i: &usize| windows.rows.excluded[*i].is_none();
    (0..windows.len()).filter(new).filter_map(|i| Some((i, marked.rows.excluded[i]?))).collect()
}

/// Marks outliers of every run, as any axis shows them.
pub(crate) fn mark(windows: &mut Windows) {
    for run in 0..windows.runs.len() {
        for axis in 0..windows.shape.axes.len() {
            mark_run(windows, run, axis);
        }
    }
}

fn mark_run(windows: &mut Windows, run: usize, axis: usize) {
    let members: Vec<usize> = (0..windows.len())
        .filter(|i| windows.rows.run[*i] as usize == run && windows.rows.excluded[*i].is_none())
        .collect();
    // On a rate table a change of the rate is no outlier: each stretch of one rate is judged by itself, and a window whose rate is
    // not known not at all.
    let reference = |i: &usize| windows.rows.reference_dps[*i];
    let mut members = members;
    if members.iter().any(|i| reference(i).is_finite()) {
        members.retain(|i| reference(i).is_finite());
    }
    let same_rate = |a: &usize, b: &usize| {
        let (a, b) = (reference(a), reference(b));
        a.is_nan() || (a - b).abs() <= SAME_RATE * a.abs().max(b.abs())
    };
    let stretches: Vec<Vec<usize>> = members.chunk_by(same_rate).map(<[usize]>::to_vec).collect();
    for stretch in stretches.iter().filter(|stretch| stretch.len() >= MIN_WINDOWS) {
        mark_stretch(windows, stretch, axis);
    }
}

/// Marks windows in which the table's rate changed; `spread_dps` is the σ of the reference rate within each.
pub(crate) fn mark_table_changes(windows: &mut Windows, spread_dps: &[f64]) {
    let rates = windows.rows.reference_dps.iter().filter(|rate| rate.is_finite());
    let largest = rates.fold(0.0_f64, |most, rate| most.max(rate.abs()));
    for (i, spread) in spread_dps.iter().enumerate() {
        if *spread > CHANGE * largest {
            windows.exclude(i, Reason::TableChange);
        }
    }
}

/// True for means of windows of which nine in ten are whole numbers: a mode, a gain; where it changes within a window it is none.
pub(crate) fn holds_whole_numbers(means: impl ExactSizeIterator<Item = f64>) -> bool {
    let count = means.len();
    means.filter(|mean| is_whole(*mean)).count() as f64 >= WHOLE * count as f64
}

/// A mean that is a whole number.
pub(crate) fn is_whole(mean: f64) -> bool {
    (mean - mean.round()).abs() < NEAR_WHOLE
}

/// True behind each window of a stretch at which an auxiliary column jumps: by over a quarter of its range in the stretch, and
/// by far more than it usually moves between two windows.
fn jumps(windows: &Windows, members: &[usize]) -> Vec<bool> {
    let mut jumps = vec![false; members.len()];
    for column in &windows.rows.aux {
        let values: Vec<f64> = members.iter().map(|i| column[*i]).collect();
        let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let each: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let usual = median(each.iter().copied().filter(|m| m.is_finite()).collect());
        // Whole numbers are modes or gains: each change counts.
        let limit = if holds_whole_numbers(values.iter().copied()) {
            NEAR_WHOLE
        } else {
            (COLUMN_JUMP * (hi - lo)).max(JUMP_OF_USUAL * usual)
        };
        let beyond = each.iter().zip(&mut jumps[1..]).filter(|(m, _)| **m >= limit && **m > 0.0);
        beyond.for_each(|(_, jump)| *jump = true);
    }
    jumps
}

fn mark_stretch(windows: &mut Windows, members: &[usize], axis: usize) {
    let levels = Levels::of(windows, axis, members);
    let series = RateSeries::of(windows, axis, members, &levels);
    let scale = robust_scale(&residuals(windows, members, &series));
    let marked = marks_of_steps(&series, (STEP_SIGMAS * scale).max(STEP_OF_RANGE * decile_range(&series.rates)));
    for (member, reason) in members.iter().zip(&marked).filter_map(|(member, mark)| Some((member, (*mark)?))) {
        windows.exclude(*member, reason);
    }
    // A bump is judged against the windows that no step took away.
    let left: Vec<usize> = members.iter().zip(&marked).filter(|(_, mark)| mark.is_none()).map(|(i, _)| *i).collect();
    let series = RateSeries::of(windows, axis, &left, &levels);
    let residuals = series.without_bends(residuals(windows, &left, &series));
    let limit = (BUMP_SIGMAS * robust_scale(&residuals)).max(BUMP_OF_RANGE * decile_range(&series.rates));
    for (i, member) in left.iter().enumerate().filter(|(i, _)| residuals[*i].abs() > limit && !series.turns_near(*i)) {
        windows.exclude(*member, if *member == members[0] && i == 0 { Reason::StartUp } else { Reason::Motion });
    }
}

/// What to take from the rate of each window so that the two sides of a jump of an auxiliary column lie together.
struct Levels(std::collections::BTreeMap<usize, f64>);

impl Levels {
    fn of(windows: &Windows, axis: usize, members: &[usize]) -> Self {
        let rate = |i: usize| windows.rate_dph(axis, i);
        let mut level = 0.0;
        let jumps = jumps(windows, members);
        let mut levels = std::collections::BTreeMap::new();
        for (at, member) in members.iter().enumerate() {
            if jumps[at] {
                // Medians of up to three windows on both sides, not reaching across another jump.
                let before = (at.saturating_sub(3)..at).rev().take_while(|k| *k + 1 == at || !jumps[*k + 1]);
                let before = median(before.map(|k| rate(members[k])).collect());
                let after = (at..members.len().min(at + 3)).take_while(|k| *k == at || !jumps[*k]);
                level += median(after.map(|k| rate(members[k])).collect()) - before;
            }
            levels.insert(*member, level);
        }
        Self(levels)
    }
}

/// Part of the table's rate that an axis sees: +1 or −1 along it, 0 across or without a table.
fn share_of_table(windows: &Windows, axis: usize, members: &[usize]) -> f64 {
    let reference = |i: &usize| windows.rows.reference_dps[*i] * DPH_PER_DPS;
    let known = || members.iter().filter(|i| reference(i).is_finite());
    let products: f64 = known().map(|i| windows.rate_dph(axis, *i) * reference(i)).sum();
    let squares: f64 = known().map(|i| reference(i).powi(2)).sum();
    let share = products / squares;
    if (share.abs() - 1.0).abs() < 0.1 { share.signum() } else { 0.0 }
}

/// Rates of some windows at their middles.
struct RateSeries {
    times_s: Vec<f64>,
    rates: Vec<f64>,
    /// Mean temperature of the first thermometer; NaN without.
    temperatures_c: Vec<f64>,
}

impl RateSeries {
    fn of(windows: &Windows, axis: usize, members: &[usize], levels: &Levels) -> Self {
        let level = |i: &usize| levels.0.get(i).copied().unwrap_or(0.0);
        let share = share_of_table(windows, axis, members);
        let turned = |i: usize| if share == 0.0 { 0.0 } else { share * windows.rows.reference_dps[i] * DPH_PER_DPS };
        let middle = |i: &usize| s_from_ns(windows.rows.start_ns[*i] / 2 + windows.rows.end_ns[*i] / 2);
        Self {
            times_s: members.iter().map(middle).collect(),
            rates: members.iter().map(|i| windows.rate_dph(axis, *i) - turned(*i) - level(i)).collect(),
            temperatures_c: members
                .iter()
                .map(|i| windows.rows.mean_c.first().map_or(f64::NAN, |column| column[*i]))
                .collect(),
        }
    }

    /// The straight line of some values through windows a and b, at window i.
    fn line(&self, values: &[f64], a: usize, b: usize, i: usize) -> f64 {
        let part = (self.times_s[i] - self.times_s[a]) / (self.times_s[b] - self.times_s[a]);
        values[a] + part * (values[b] - values[a])
    }

    /// Residuals less what the temperature's own bends explain of them: at the end of a short soak the drift bends with it.
    fn without_bends(&self, residuals: Vec<f64>) -> Vec<f64> {
        let bends_c: Vec<f64> = (0..residuals.len()).map(|i| self.deviation(&self.temperatures_c, i)).collect();
        let products: f64 = residuals.iter().zip(&bends_c).map(|(residual, bend_c)| residual * bend_c).sum();
        let slope = products / bends_c.iter().map(|bend_c| bend_c * bend_c).sum::<f64>();
        if !slope.is_finite() {
            return residuals;
        }
        let less = |(residual, bend_c): (&f64, &f64)| {
            let rest = residual - slope * bend_c;
            if rest.abs() < residual.abs() { rest } else { *residual }
        };
        residuals.iter().zip(&bends_c).map(less).collect()
    }

    /// How far the value of window `i` lies from what its neighbours say: of five predictions the one that comes second
    /// closest. A bump contradicts them all; a bend of the drift only those that reach across it.
    fn deviation(&self, values: &[f64], i: usize) -> f64 {
        let n = values.len();
        let by = |k: usize| -> Option<f64> {
            match (i.checked_sub(k), i + k < n) {
                (Some(before), true) => Some(self.line(values, before, i + k, i)),
                (None, _) => (i + 2 * k < n).then(|| self.line(values, i + k, i + 2 * k, i)),
                (Some(before), false) => before.checked_sub(k).map(|far| self.line(values, far, before, i)),
            }
        };
        let mut deviations: Vec<f64> = (1..=NEIGHBOURS).filter_map(by).map(|predicted| values[i] - predicted).collect();
        deviations.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        deviations.get(1).or(deviations.first()).copied().unwrap_or(0.0)
    }

    /// The same, for a window that may lie near an end.
    fn turns_near(&self, i: usize) -> bool {
        i > NEIGHBOURS && i + NEIGHBOURS + 1 < self.rates.len() && self.turns_at(i)
    }

    /// True where the temperature rate changes: there a drift may do what elsewhere only a step does.
    fn turns_at(&self, i: usize) -> bool {
        let rate_cpm = |from: usize, to: usize| {
            60.0 * (self.temperatures_c[to] - self.temperatures_c[from]) / (self.times_s[to] - self.times_s[from])
        };
        (rate_cpm(i + 1, i + NEIGHBOURS) - rate_cpm(i - NEIGHBOURS, i - 1)).abs() > TURN_CPM
    }

    /// Median of the changes between medians of five windows, ten windows apart.
    fn usual_change(&self) -> f64 {
        let medians: Vec<f64> = self.rates.windows(NEIGHBOURS).map(|five| median(five.to_vec())).collect();
        median(medians.windows(2 * NEIGHBOURS + 1).map(|m| (m[2 * NEIGHBOURS] - m[0]).abs()).collect())
    }

    /// The size of a step at window `i`, if there is one: medians of five windows on both sides differ, nearly
    /// all of it happens at i, in little of the time between them, and the changes around are small.
    fn step_at(&self, i: usize, limit: f64) -> Option<f64> {
        if i < NEIGHBOURS || i + NEIGHBOURS >= self.rates.len() {
            return None;
        }
        let (before, after) = (i - NEIGHBOURS..i, i + 1..i + NEIGHBOURS + 1);
        let jump = median(self.rates[after.clone()].to_vec()) - median(self.rates[before.clone()].to_vec());
        let time = median(self.times_s[after].to_vec()) - median(self.times_s[before].to_vec());
        let change = |k: usize| (self.rates[k] - self.rates[k - 1]).abs();
        let around = i + 1 - NEIGHBOURS..i + NEIGHBOURS;
        let usual = median(around.clone().map(change).collect());
        // The largest change over two windows lies at i, so that a step is found once and at its place: in the window
        // that it divides, or else in the first one after it.
        let pair = |k: usize| (self.rates[k + 1] - self.rates[k - 1]).abs();
        let largest = around.map(pair).fold(0.0, f64::max);
        let here = change(i) >= change(i + 1) || pair(i) > 1.1 * pair(i + 1);
        let at_once = (self.rates[i + 1] - self.rates[i - 1]) * jump.signum();
        let is_step = jump.abs() > limit.max(STEP_OF_CHANGES * usual)
            && at_once > STEP_AT_ONCE * jump.abs()
            && self.times_s[i + 1] - self.times_s[i - 1] < STEP_OF_TIME * time
            && here
            && pair(i) >= 0.9 * largest
            && !self.turns_at(i);
        is_step.then_some(jump)
    }
}

/// Each window against its neighbours; a shorter window is noisier and counts for less.
fn residuals(windows: &Windows, members: &[usize], series: &RateSeries) -> Vec<f64> {
    let trust = |i: usize| (windows.duration_s(i) / windows.shape.nominal_s).min(1.0).sqrt();
    members.iter().enumerate().map(|(at, i)| series.deviation(&series.rates, at) * trust(*i)).collect()
}

/// σ of normal values from the median of their sizes.
fn robust_scale(residuals: &[f64]) -> f64 {
    1.4826 * median(residuals.iter().map(|r| r.abs()).collect())
}

/// What steps make of the windows: a step that is followed by one back is an excursion, and everything between is marked; before
/// a step near the start of the run the gyro starts up; any other step is a lasting change, of which the window alone is
/// marked, for none of its sides is the wrong one.
fn marks_of_steps(series: &RateSeries, limit: f64) -> Vec<Option<Reason>> {
    let n = series.rates.len();
    let mut marks = vec![None; n];
    let mut steps: Vec<(usize, f64)> = Vec::new();
    for i in 0..n {
        if steps.last().is_none_or(|(last, _)| i >= last + NEIGHBOURS)
            && let Some(jump) = series.step_at(i, limit)
        {
            steps.push((i, jump));
        }
    }
    let mut at = 0;
    while at < steps.len() {
        let (from, jump) = steps[at];
        let is_back = |(_, back): &(usize, f64)| (jump + back).abs() <= limit.max(RETURN * jump.abs());
        match steps[at + 1..].iter().position(is_back) {
            Some(further) => {
                let (to, _) = steps[at + 1 + further];
                marks[from..=to].fill(Some(Reason::Step));
                at += further + 2;
            }
            None if (from as f64) < START_UP * n as f64 => {
                marks[..=from].fill(Some(Reason::StartUp));
                at += 1;
            }
            None => {
                marks[from] = (jump.abs() > LASTING * series.usual_change()).then_some(Reason::LastingStep);
                at += 1;
            }
        }
    }
    marks
}

fn decile_range(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |part: f64| sorted[((sorted.len() - 1) as f64 * part).round() as usize];
    at(0.9) - at(0.1)
}

/// Median; 0 of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(rates: Vec<f64>) -> RateSeries {
        RateSeries {
            times_s: (0..rates.len()).map(|i| i as f64).collect(),
            temperatures_c: vec![f64::NAN; rates.len()],
            rates,
        }
    }

    /// A drift with a corner and a little deterministic noise.
    fn drift(n: usize) -> Vec<f64> {
        let noise = |i: usize| ((i * 7919) % 101) as f64 / 101.0 - 0.5;
        (0..n).map(|i| 0.01 * (i as f64 - 40.0).max(0.0) + 0.02 * noise(i)).collect()
    }

    #[test]
    fn a_lasting_step_takes_no_side_and_an_excursion_is_marked_whole() {
        for (at, windows) in [(70, 100), (95, 100), (30, 100)] {
            let mut stepped = drift(windows);
            stepped[at..].iter_mut().for_each(|y| *y += 1.0);
            let marks = marks_of_steps(&series(stepped), 0.3);
            let marked: Vec<usize> = (0..windows).filter(|i| marks[*i].is_some()).collect();
            assert!(marked.len() <= 1 && marked.iter().all(|i| i.abs_diff(at) <= 1), "{at}: {marked:?}");
            assert!(marked.iter().all(|i| marks[*i] == Some(Reason::LastingStep)) && (at > 94 || marked.len() == 1));
        }
        let mut bumped = drift(100);
        bumped[50..62].iter_mut().for_each(|y| *y += 1.0);
        let marks = marks_of_steps(&series(bumped), 0.3);
        assert!(marks[..50].iter().chain(&marks[63..]).all(Option::is_none), "{marks:?}");
        assert!(marks[51..62].iter().all(|mark| *mark == Some(Reason::Step)));
        let mut warming = drift(200);
        warming[..8].iter_mut().for_each(|y| *y += 1.0);
        let marks = marks_of_steps(&series(warming), 0.3);
        assert!(marks[..8].iter().all(|mark| *mark == Some(Reason::StartUp)), "{marks:?}");
        assert!(marks[9..].iter().all(Option::is_none));
    }

    /// However a step divides the window in which it happens, it is found.
    #[test]
    fn a_step_within_a_window_is_found() {
        for part in [0.0, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0] {
            let mut stepped = drift(100);
            stepped[70] += part;
            stepped[71..].iter_mut().for_each(|y| *y += 1.0);
            let marks = marks_of_steps(&series(stepped), 0.3);
            let marked: Vec<usize> = (0..100).filter(|i| marks[*i].is_some()).collect();
            assert!(matches!(marked[..], [70 | 71]), "{part}: {marked:?}");
        }
    }

    #[test]
    fn a_drift_is_no_step_however_steep_and_however_unequal_its_windows() {
        assert!(marks_of_steps(&series(drift(200)), 0.05).iter().all(Option::is_none));
        // A sine in windows of unequal length, without any noise.
        let times_s: Vec<f64> = (0..200).map(|i| f64::from(i) + if i % 3 == 0 { 0.45 } else { 0.0 }).collect();
        let rates: Vec<f64> = times_s.iter().map(|t| (t / 9.0).sin()).collect();
        let sine = RateSeries { times_s, temperatures_c: vec![f64::NAN; rates.len()], rates };
        assert!(marks_of_steps(&sine, 0.1).iter().all(Option::is_none));
        let worst = (0..200).map(|i| sine.deviation(&sine.rates, i).abs()).fold(0.0, f64::max);
        assert!(worst < 0.2, "{worst}");
    }

    #[test]
    fn ends_are_judged_by_extrapolation() {
        let line = series((0..20).map(f64::from).collect());
        for i in [0, 1, 10, 19] {
            assert!(line.deviation(&line.rates, i).abs() < 1e-12);
        }
    }
}
