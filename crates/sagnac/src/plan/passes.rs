//! How often a running test has passed each temperature, up and down, and where it came to rest from.
//!
//! ```text
//! pass      T from 1 °C on one side of a temperature to 1 °C on the other       least over temperatures every 10 °C of the span
//! sweep     from one turn of T to the next; a turn is where T comes back by 10 °C
//! ```
//!
//! A model that fits one sweep says nothing of the next one: what changes from cycle to cycle shows in the second. Means of the residual are
//! therefore made sweep by sweep.
//!
//! Fails for a span below 10 °C, which has no passes, and where temperature comes back by less than 10 °C.

use crate::diagnostics::{Leg, WindowPoint};

/// Temperatures that are passed lie so far from each other; a turn is a way back by so much, °C.
pub(super) const BIN_C: f64 = 10.0;
/// To be on a side of a temperature is to be so far from it, °C.
const ASIDE_C: f64 = 1.0;
/// Shortest rest, h.
pub(super) const REST_H: f64 = 0.25;

/// How often a temperature was passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Passes {
    pub(super) up: u32,
    pub(super) down: u32,
}

impl Passes {
    pub(super) fn all(self) -> u32 {
        self.up + self.down
    }

    /// Of the temperature that was passed least often; `None` for a span that has no passes.
    pub(super) fn least(points: &[WindowPoint], [lo, hi]: [f64; 2]) -> Option<Self> {
        let centres = (0..)
            .map(|step| lo + BIN_C * (f64::from(step) + 0.5))
            .take_while(|centre_c| *centre_c <= hi - BIN_C / 2.0 + 1e-9);
        let counted = |centre_c: f64| {
            let (mut passes, mut was_above, mut last) = (Self::default(), None, None);
            for point in points.iter().filter(|point| is_known(point)) {
                // What was not recorded is not passed.
                if last.is_none_or(|last| !follows(last, point)) {
                    was_above = None;
                }
                last = Some(point);
                if (point.temperature_c - centre_c).abs() < ASIDE_C {
                    continue;
                }
                let is_above = point.temperature_c > centre_c;
                match was_above.replace(is_above) {
                    Some(false) if is_above => passes.up += 1,
                    Some(true) if !is_above => passes.down += 1,
                    _ => {}
                }
            }
            passes
        };
        centres.map(counted).min_by_key(|passes| passes.all())
    }
}

/// The sweep that each window is in.
pub(super) fn sweeps(points: &[WindowPoint]) -> Vec<u32> {
    let (mut sweep, mut is_up, mut extreme_c, mut run) = (0, None, f64::NAN, None);
    let mut sweep_of = |point: &WindowPoint| {
        let now_c = point.temperature_c;
        if !is_known(point) {
            return sweep;
        }
        if run != Some(point.run) {
            sweep += u32::from(run.is_some());
            (run, is_up, extreme_c) = (Some(point.run), None, now_c);
        }
        let moved_c = now_c - extreme_c;
        match is_up {
            Some(true) if moved_c > 0.0 => extreme_c = now_c,
            Some(false) if moved_c < 0.0 => extreme_c = now_c,
            _ if moved_c.abs() >= BIN_C => {
                sweep += u32::from(is_up.is_some());
                (is_up, extreme_c) = (Some(moved_c > 0.0), now_c);
            }
            _ => {}
        }
        sweep
    };
    points.iter().map(&mut sweep_of).collect()
}

/// The test rested near one temperature after it was heated and after it was cooled.
pub(super) fn rested_from_both(points: &[WindowPoint]) -> bool {
    let mut rests: std::collections::BTreeMap<i64, [f64; 2]> = std::collections::BTreeMap::new();
    let (mut came, mut run) = (None, None);
    for point in points.iter().filter(|point| is_known(point)) {
        if run != Some(point.run) {
            (run, came) = (Some(point.run), None);
        }
        match (point.leg(), came) {
            (Leg::Heating, _) => came = Some(0),
            (Leg::Cooling, _) => came = Some(1),
            (Leg::Steady, Some(from)) => {
                rests.entry((point.temperature_c / BIN_C).floor() as i64).or_default()[from] += point.length_h;
            }
            (Leg::Steady, None) => {}
        }
    }
    rests.values().any(|hours| hours.iter().all(|hours| *hours >= REST_H))
}

/// A window of the same run, with at most a quarter of an hour between them.
fn follows(last: &WindowPoint, next: &WindowPoint) -> bool {
    let apart_h = next.hours - last.hours - (next.length_h + last.length_h) / 2.0;
    next.run == last.run && apart_h < 0.25
}

fn is_known(point: &WindowPoint) -> bool {
    point.after_dph.is_finite() && point.temperature_c.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(celsius: &[f64]) -> Vec<WindowPoint> {
        let point = |(at, temperature_c): (usize, &f64)| WindowPoint {
            run: 0,
            hours: at as f64 * 0.1,
            length_h: 0.1,
            temperature_c: *temperature_c,
            rate_cpm: celsius.get(at + 1).map_or(0.0, |next| (next - temperature_c) / 6.0),
            before_dph: 0.0,
            inputs_dph: 0.0,
            after_dph: 0.0,
            excluded: None,
        };
        celsius.iter().enumerate().map(point).collect()
    }

    #[test]
    fn the_least_passed_temperature_counts() {
        // Up, down to the middle, and up again: the lower half was never cooled through.
        let ways = points(&[0.0, 10.0, 20.0, 30.0, 40.0, 30.0, 20.0, 30.0, 40.0]);
        assert_eq!(Passes::least(&ways, [0.0, 40.0]), Some(Passes { up: 1, down: 0 }));
        assert_eq!(Passes::least(&ways, [20.0, 40.0]), Some(Passes { up: 2, down: 1 }));
        assert_eq!(Passes::least(&ways, [20.0, 29.0]), None);
        assert_eq!(sweeps(&ways), [0, 0, 0, 0, 0, 1, 1, 2, 2]);
    }

    #[test]
    fn what_was_not_recorded_is_not_passed() {
        let mut ways = points(&[0.0, 10.0, 20.0, 30.0, 40.0]);
        ways.iter_mut().skip(2).for_each(|point| point.hours += 1.0);
        assert_eq!(Passes::least(&ways, [0.0, 40.0]), Some(Passes::default()));
        assert_eq!(Passes::least(&ways, [20.0, 40.0]), Some(Passes { up: 1, down: 0 }));
    }

    #[test]
    fn a_thermometer_that_flickers_passes_nothing() {
        let rest = points(&[5.0, 5.4, 4.7, 5.2, 4.9, 5.3]);
        assert_eq!(Passes::least(&rest, [0.0, 10.0]), Some(Passes::default()));
        assert_eq!(sweeps(&rest), [0; 6]);
    }

    #[test]
    fn rests_are_told_apart_by_where_they_came_from() {
        let one_way: Vec<f64> = [0.0, 20.0, 40.0].iter().flat_map(|celsius| [*celsius; 5]).collect();
        assert!(!rested_from_both(&points(&one_way)));
        let back: Vec<f64> = [0.0, 20.0, 40.0, 20.0, 0.0].iter().flat_map(|celsius| [*celsius; 5]).collect();
        assert!(rested_from_both(&points(&back)));
    }
}
