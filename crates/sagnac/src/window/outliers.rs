//! Windows that are no thermal drift: bumps, steps, start-up.
//!
//! Each window is compared with what its neighbours predict, so a smooth drift of any size passes.
//! The prediction is the median of five symmetric pair means (at the ends of a run, of five linear
//! extrapolations); the scale is robust and has a floor of 5 % of the run's own range, so that a
//! noise-free record is not taken apart at its corners. Limits: a bump longer than five windows that
//! rises slowly passes; so does a step of less than ten sigma.

use crate::ingest::Reason;
use crate::window::Windows;

const NEIGHBOURS: usize = 5;
/// Runs shorter than this are not judged.
const MIN_WINDOWS: usize = 12;
const BUMP_SIGMAS: f64 = 8.0;
const BUMP_OF_RANGE: f64 = 0.05;
const STEP_SIGMAS: f64 = 10.0;
const STEP_OF_RANGE: f64 = 0.1;
/// A step happens within two windows; a drift does not.
const STEP_AT_ONCE: f64 = 0.7;

/// Marks outliers of every run, as the first `axes` axes show them.
pub(crate) fn mark(windows: &mut Windows, axes: usize) {
    for run in 0..windows.runs.len() {
        for axis in 0..axes {
            mark_run(windows, run, axis);
        }
    }
}

fn mark_run(windows: &mut Windows, run: usize, axis: usize) {
    let members: Vec<usize> = (0..windows.len())
        .filter(|i| windows.rows.run[*i] as usize == run && windows.rows.excluded[*i].is_none())
        .collect();
    if members.len() < MIN_WINDOWS {
        return;
    }
    let rates: Vec<f64> = members.iter().map(|i| windows.rate_dph(axis, *i)).collect();
    let scale = robust_scale(&residuals(windows, &members, &rates));
    let kept = keep_one_level(&rates, (STEP_SIGMAS * scale).max(STEP_OF_RANGE * decile_range(&rates)));
    for (member, _) in members.iter().zip(&kept).filter(|(_, kept)| !**kept) {
        windows.exclude(*member, Reason::Step);
    }
    // What is left is one level: a bump stands out from it alone.
    let (left, rates): (Vec<usize>, Vec<f64>) =
        members.iter().zip(&rates).zip(&kept).filter(|(_, kept)| **kept).map(|((i, rate), _)| (*i, *rate)).unzip();
    let residuals = residuals(windows, &left, &rates);
    let limit = (BUMP_SIGMAS * robust_scale(&residuals)).max(BUMP_OF_RANGE * decile_range(&rates));
    for (i, member) in left.iter().enumerate().filter(|(i, _)| residuals[*i].abs() > limit) {
        windows.exclude(*member, if *member == members[0] && i == 0 { Reason::StartUp } else { Reason::Motion });
    }
}

/// Each window against its neighbours; a shorter window is noisier and counts for less.
fn residuals(windows: &Windows, members: &[usize], rates: &[f64]) -> Vec<f64> {
    let trust = |i: usize| (windows.duration_s(i) / windows.shape.nominal_s).min(1.0).sqrt();
    members.iter().enumerate().map(|(at, i)| (rates[at] - predicted(rates, at)) * trust(*i)).collect()
}

/// σ of normal values from the median of their sizes.
fn robust_scale(residuals: &[f64]) -> f64 {
    1.4826 * median(residuals.iter().map(|r| r.abs()).collect())
}

/// What the neighbours of `i` say it should be.
fn predicted(rates: &[f64], i: usize) -> f64 {
    let n = rates.len();
    let by = |k: usize| -> Option<f64> {
        match (i.checked_sub(k), i + k < n) {
            (Some(before), true) => Some((rates[before] + rates[i + k]) / 2.0),
            (None, _) => Some(2.0 * rates.get(i + k)? - rates.get(i + 2 * k)?),
            (Some(before), false) => Some(2.0 * rates[before] - rates[before.checked_sub(k)?]),
        }
    };
    median((1..=NEIGHBOURS).filter_map(by).collect())
}

/// Splits at steps and keeps the level with the most windows.
fn keep_one_level(rates: &[f64], limit: f64) -> Vec<bool> {
    let mut level = vec![0.0; rates.len()];
    let mut offset = 0.0;
    let mut next_allowed = 0;
    for (i, level) in level.iter_mut().enumerate() {
        *level = offset;
        if i >= next_allowed
            && let Some(jump) = step_at(rates, i, limit)
        {
            // The window in which it happens belongs to neither side.
            *level = f64::NAN;
            offset += jump;
            next_allowed = i + NEIGHBOURS;
        }
    }
    let members = |of: f64| level.iter().filter(|l| (**l - of).abs() <= limit).count();
    let best = level.iter().copied().filter(|l| !l.is_nan()).max_by_key(|l| members(*l)).unwrap_or(0.0);
    level.iter().map(|l| (l - best).abs() <= limit).collect()
}

/// The size of a step at window `i`, if there is one.
fn step_at(rates: &[f64], i: usize, limit: f64) -> Option<f64> {
    if i < NEIGHBOURS || i + NEIGHBOURS >= rates.len() {
        return None;
    }
    let before = median(rates[i - NEIGHBOURS..i].to_vec());
    let after = median(rates[i + 1..=i + NEIGHBOURS].to_vec());
    let jump = after - before;
    let at_once = (rates[i + 1] - rates[i - 1]) * jump.signum();
    // The largest single change lies at i, so that a step is found once and at its place.
    let here = (rates[i] - rates[i - 1]).abs();
    let largest = (i + 1 - NEIGHBOURS..i + NEIGHBOURS).map(|k| (rates[k] - rates[k - 1]).abs()).fold(0.0, f64::max);
    (jump.abs() > limit && at_once > STEP_AT_ONCE * jump.abs() && here >= largest).then_some(jump)
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

    /// A drift with a corner and a little deterministic noise.
    fn drift(n: usize) -> Vec<f64> {
        let noise = |i: usize| ((i * 7919) % 101) as f64 / 101.0 - 0.5;
        (0..n).map(|i| 0.01 * (i as f64 - 40.0).max(0.0) + 0.02 * noise(i)).collect()
    }

    #[test]
    fn a_step_keeps_the_longer_side_and_a_bump_both() {
        let mut stepped = drift(100);
        stepped[70..].iter_mut().for_each(|y| *y += 1.0);
        let kept = keep_one_level(&stepped, 0.3);
        assert!(kept[..70].iter().all(|k| *k), "{kept:?}");
        assert!(kept[71..].iter().all(|k| !*k));
        let mut bumped = drift(100);
        bumped[50..62].iter_mut().for_each(|y| *y += 1.0);
        let kept = keep_one_level(&bumped, 0.3);
        assert!(kept[..50].iter().chain(&kept[63..]).all(|k| *k), "{kept:?}");
        assert!(kept[51..62].iter().all(|k| !*k));
    }

    #[test]
    fn a_drift_is_no_step() {
        assert!(keep_one_level(&drift(200), 0.05).iter().all(|k| *k));
    }

    #[test]
    fn ends_are_judged_by_extrapolation() {
        let line: Vec<f64> = (0..20).map(f64::from).collect();
        for i in [0, 1, 10, 19] {
            assert!((predicted(&line, i) - line[i]).abs() < 1e-12);
        }
    }
}
