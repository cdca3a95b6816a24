//! Soaks of a test, each with the side from which its temperature was reached: what an effect of the temperature rate and a memory of
//! temperature differ in.
//!
//! ```text
//! soak     steady windows at one temperature; its last hour counts
//! side     heating: the way there began at least 10 °C below; cooling: as far above; none where the way overshot by 2 °C
//! pair     soaks of one run within 2 °C of each other (a block lags), one from each side
//! ```
//!
//! Fails where a block is so slow that nothing of a soak is steady.

use crate::diagnostics::{Leg, WindowPoint};
use crate::window::level_stretches;

/// Fewer windows of a soak show nothing.
const FEWEST: usize = 5;
/// A soak counts by its last hour.
const LAST_H: f64 = 1.0;
/// Soaks within this of each other are at one temperature, °C.
const REACH_C: f64 = 2.0;
/// Least way on which a soak is reached, °C.
const LEAST_WAY_C: f64 = 10.0;

/// The last hour of a soak.
struct Soak {
    run: usize,
    temperature_c: f64,
    after: Leg,
    /// Places of its windows.
    windows: Vec<usize>,
}

/// A temperature soaked from both sides, with the places of the windows of each side.
pub(crate) struct SoakPair {
    pub(crate) temperature_c: f64,
    pub(crate) heated: Vec<usize>,
    pub(crate) cooled: Vec<usize>,
}

impl SoakPair {
    /// The mean after heating less that after cooling, as parts of so many windows.
    pub(crate) fn parts(&self, windows: usize) -> Vec<f64> {
        let mut part = vec![0.0; windows];
        self.heated.iter().for_each(|at| part[*at] += 1.0 / self.heated.len() as f64);
        self.cooled.iter().for_each(|at| part[*at] -= 1.0 / self.cooled.len() as f64);
        part
    }
}

/// The pairs of soaks of some windows.
pub(crate) fn soak_pairs(used: &[&WindowPoint]) -> Vec<SoakPair> {
    let soaks = soaks(used);
    let pair = |heated: &Soak| {
        let same =
            |other: &&Soak| other.run == heated.run && (other.temperature_c - heated.temperature_c).abs() <= REACH_C;
        let of_side = |after: Leg| -> Vec<usize> {
            let all = soaks.iter().filter(same).filter(|soak| soak.after == after);
            all.flat_map(|soak| soak.windows.iter().copied()).collect()
        };
        let (temperature_c, cooled) = (heated.temperature_c, of_side(Leg::Cooling));
        (!cooled.is_empty()).then(|| SoakPair { temperature_c, heated: of_side(Leg::Heating), cooled })
    };
    soaks.iter().filter(|soak| soak.after == Leg::Heating).filter_map(pair).collect()
}

/// Soaks with the side from which they were reached.
fn soaks(used: &[&WindowPoint]) -> Vec<Soak> {
    let is_known = |point: &WindowPoint| point.temperature_c.is_finite() && point.rate_cpm.is_finite();
    let is_steady = |at: &usize| used[*at].leg() == Leg::Steady && is_known(used[*at]);
    let steady: Vec<usize> = (0..used.len()).filter(is_steady).collect();
    let stretches = level_stretches(steady.iter().map(|at| (used[*at].run, used[*at].temperature_c)));
    let soak = |stretch: std::ops::Range<usize>| {
        let all = &steady[stretch];
        let (first, last) = (used[*all.first()?], used[*all.last()?]);
        let windows: Vec<usize> = all.iter().copied().filter(|at| used[*at].hours > last.hours - LAST_H).collect();
        let temperature_c = windows.iter().map(|at| used[*at].temperature_c).sum::<f64>() / windows.len() as f64;
        let before = used[..*all.first()?].iter().rev().take_while(|point| point.run == first.run);
        let after = side(before.map(|point| point.temperature_c - temperature_c))?;
        (windows.len() >= FEWEST).then_some(Soak { run: first.run, temperature_c, after, windows })
    };
    stretches.into_iter().filter_map(soak).collect()
}

/// The side from which a soak was reached, by the distances of the windows before it, the last one first. A way that overshoots turns
/// friction over and has no side.
fn side(mut before_c: impl Iterator<Item = f64>) -> Option<Leg> {
    let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
    let from_c = before_c.find(|away_c| {
        let is_far = away_c.abs() >= LEAST_WAY_C;
        if !is_far {
            (lowest, highest) = (lowest.min(*away_c), highest.max(*away_c));
        }
        is_far
    })?;
    match from_c < 0.0 {
        true => (highest <= REACH_C).then_some(Leg::Heating),
        false => (lowest >= -REACH_C).then_some(Leg::Cooling),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The way to 25 °C, in its order.
    fn reached(way_c: &[f64]) -> Option<Leg> {
        side(way_c.iter().rev().map(|celsius| celsius - 25.0))
    }

    #[test]
    fn a_soak_has_the_side_of_its_last_way() {
        assert_eq!(reached(&[-40.0, 0.0, 20.0, 24.5]), Some(Leg::Heating));
        assert_eq!(reached(&[-40.0, 70.0, 30.0, 26.0]), Some(Leg::Cooling));
        // Through it, and back by less than the way that counts.
        assert_eq!(reached(&[70.0, 40.0, 20.0, 24.0]), None);
        assert_eq!(reached(&[-40.0, 20.0, 31.0, 26.0]), None);
        assert_eq!(reached(&[-40.0, 20.0, 26.5, 25.5]), Some(Leg::Heating));
        assert_eq!(reached(&[20.0, 24.0]), None);
    }
}
