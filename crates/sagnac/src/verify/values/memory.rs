//! Memory of temperature that does not depend on its rate: friction, mounting stress, a play operator.
//!
//! ```text
//! value    mean at rest after heating, less the mean after cooling at the same temperature; each over the last hour of its soak
//! pairs    soaks of one run within 2 °C of each other (a block lags), one reached from at least 10 °C below, one from as far above; the largest counts
//! ```
//!
//! On ramps, memory and an effect of the temperature rate look alike; at rest only memory is left. So no retest without such a pair can
//! show it. Standard error by the noise of the windows, slow noise too ([`super::noise`]).
//!
//! A soak whose temperature was passed by more than that and come back to has no side.
//!
//! Fails where the play is wider than the way from which a soak is reached, and for memory that a soak of an hour forgets.

use serde::{Deserialize, Serialize};

use crate::diagnostics::{Leg, WindowPoint};
use crate::rate_table::plateaus::level_stretches;
use crate::verify::values::judged_windows::Estimate;
use crate::verify::values::noise::RetestNoise;

/// Fewer windows of a soak show nothing.
const FEWEST: usize = 5;
/// A soak counts by its last hour.
const LAST_H: f64 = 1.0;
/// Soaks within this of each other are at one temperature, °C.
const REACH_C: f64 = 2.0;
/// Least way on which a soak is reached, °C.
const LEAST_WAY_C: f64 = 10.0;

/// Difference of the bias at rest by the side from which its temperature was reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Memory {
    /// After heating less after cooling, °/h.
    pub difference_dph: Estimate,
    /// Temperature of the soaks, °C.
    pub temperature_c: f64,
}

/// The last hour of a soak.
struct Soak {
    run: usize,
    temperature_c: f64,
    after: Leg,
    /// Places of its windows.
    windows: Vec<usize>,
}

/// The largest memory of the judged windows; `None` without a soak from both sides.
pub(crate) fn memory(used: &[&WindowPoint], noise: &RetestNoise) -> Option<Memory> {
    let soaks = soaks(used);
    let heated = soaks.iter().filter(|soak| soak.after == Leg::Heating);
    let pairs = heated.filter_map(|heated| {
        let same =
            |other: &&Soak| other.run == heated.run && (other.temperature_c - heated.temperature_c).abs() <= REACH_C;
        let parts = |after: Leg, sign: f64| {
            let all = soaks.iter().filter(same).filter(move |soak| soak.after == after);
            let windows: Vec<usize> = all.flat_map(|soak| soak.windows.iter().copied()).collect();
            let part = sign / windows.len() as f64;
            (!windows.is_empty()).then(|| windows.into_iter().map(move |at| (at, part)))
        };
        let mut part = vec![0.0; used.len()];
        parts(Leg::Heating, 1.0)?.chain(parts(Leg::Cooling, -1.0)?).for_each(|(at, of)| part[at] = of);
        let value = part.iter().zip(used).map(|(part, point)| part * point.after_dph).sum();
        let difference_dph = Estimate { value, sigma: noise.sigma_dph(&part) };
        Some(Memory { difference_dph, temperature_c: heated.temperature_c })
    });
    pairs.max_by(|a, b| a.difference_dph.value.abs().total_cmp(&b.difference_dph.value.abs()))
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
