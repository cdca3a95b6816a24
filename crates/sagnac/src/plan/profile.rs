//! Thermal tests as steps for a chamber, and the log that the mean unit of a fleet would have of one.

use std::fmt::Write as _;

use serde::Serialize;

use super::passes::REST_H;
use crate::diagnostics::STEADY_CPM;
use crate::fit::UnitPrior;
use crate::model::COMMON_SPAN;
use crate::model::basis::chebyshev;
use sagnac_log::error::{Error, Result};

/// Rows of a window in the planned log.
const ROWS: f64 = 5.0;
/// Tests of the same length are not told apart below this, h.
const SAME_HOURS: f64 = 1e-9;
/// Where the rest in mid-span is, if the span allows it, °C.
const ROOM_C: f64 = 25.0;

/// What a chamber can do.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Chamber {
    /// Temperature at the start of a test, °C.
    pub start_c: f64,
    /// Rates at which it ramps, °C/min.
    pub rates_cpm: Vec<f64>,
    /// First-order lag of the gyro's block behind the chamber, min.
    pub block_lag_min: f64,
}

impl Chamber {
    /// From room temperature at one rate, with a block that follows at once.
    pub fn new(start_c: f64, rates_cpm: Vec<f64>) -> Self {
        Self { start_c, rates_cpm, block_lag_min: 0.0 }
    }

    pub(super) fn check(&self, [lo, hi]: [f64; 2]) -> Result<()> {
        if !(lo..=hi).contains(&self.start_c) {
            return Err(Error::input(
                format!("the test starts outside the fleet's range of {lo} … {hi} °C"),
                "set --start to a temperature in this range",
            )
            .column("start_c")
            .value(self.start_c.to_string()));
        }
        if self.rates_cpm.is_empty() || self.rates_cpm.iter().any(|rate| !(0.01..=20.0).contains(rate)) {
            return Err(Error::input(
                "must be within 0.01 … 20 °C/min",
                "give the ramp rates of the chamber, such as --ramps 0.5,1",
            )
            .column("rates_cpm"));
        }
        if !(0.0..=240.0).contains(&self.block_lag_min) {
            return Err(Error::input("must be within 0 … 240 min", "give the lag in minutes, such as --block-lag 20")
                .column("block_lag_min"));
        }
        Ok(())
    }
}

/// A step of a test: a ramp, then a soak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ProfileStep {
    /// Temperature at the end of the ramp, °C.
    pub to_c: f64,
    /// Rate of the ramp, °C/min.
    pub rate_cpm: f64,
    /// Soak behind it, min.
    pub soak_min: f64,
}

/// The rest in mid-span, which every test reaches after heating and after cooling: nothing else shows a memory of the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct MidSpanRest {
    at_c: f64,
    /// Shortest soak there, min.
    soak_min: f64,
}

impl MidSpanRest {
    /// At the temperature nearest to [`ROOM_C`] in the middle half of a span, until the block has stood still for [`REST_H`].
    fn of([lo, hi]: [f64; 2], chamber: &Chamber, rate_cpm: f64) -> Self {
        let quarter = (hi - lo) / 4.0;
        let settled_min = chamber.block_lag_min * (rate_cpm / STEADY_CPM).ln().max(0.0);
        Self { at_c: ROOM_C.clamp(lo + quarter, hi - quarter).round(), soak_min: (settled_min + 60.0 * REST_H).round() }
    }

    /// Shortest soak at a temperature, min.
    fn least_min(&self, celsius: f64) -> f64 {
        if celsius == self.at_c { self.soak_min } else { 0.0 }
    }
}

/// The steps of a test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    pub(super) steps: Vec<ProfileStep>,
    rest: MidSpanRest,
}

/// Every test of up to so many hours, the shortest first.
pub(super) fn candidates(
    prior: &UnitPrior,
    chamber: &Chamber,
    soaks_min: &[f64],
    plateaus: &[usize],
    hours_max: f64,
) -> Vec<Profile> {
    // A chamber gets whole degrees.
    let [lo, hi] = prior.span_c.map(f64::round);
    let mut all: Vec<Profile> = Vec::new();
    for rate_cpm in &chamber.rates_cpm {
        let rest = MidSpanRest::of([lo, hi], chamber, *rate_cpm);
        for route in routes([lo, hi], rest.at_c, chamber.start_c) {
            for plateaus in plateaus {
                let one =
                    |soak_min: &f64| Profile::along(chamber.start_c, &route, rest, *rate_cpm, *plateaus, *soak_min);
                all.extend(soaks_min.iter().map(one));
            }
        }
    }
    all.retain(|profile| profile.hours(chamber) <= hours_max);
    all.sort_by(|a, b| a.hours(chamber).total_cmp(&b.hours(chamber)));
    all.dedup_by(|a, b| (a.hours(chamber) - b.hours(chamber)).abs() < SAME_HOURS && a == b);
    all
}

/// Turns of the temperature with the rest after heating and after cooling, each from an eighth of the span away or more.
fn routes([lo, hi]: [f64; 2], rest_c: f64, start_c: f64) -> Vec<Vec<f64>> {
    let half = |end: f64| f64::midpoint(rest_c, end).round();
    let mut routes = vec![
        vec![half(lo), rest_c, half(hi), rest_c],
        vec![half(hi), rest_c, half(lo), rest_c],
        vec![lo, rest_c, half(hi), rest_c],
        vec![hi, rest_c, half(lo), rest_c],
        vec![lo, rest_c, hi, rest_c],
        vec![hi, rest_c, lo, rest_c],
        vec![lo, rest_c, hi, rest_c, lo],
        vec![hi, rest_c, lo, rest_c, hi],
        vec![lo, rest_c, hi, rest_c, lo, hi],
        vec![hi, rest_c, lo, rest_c, hi, lo],
    ];
    // The start is on one side already.
    let aside_c = (hi - lo) / 8.0;
    if start_c <= rest_c - aside_c {
        routes.extend([vec![rest_c, half(hi), rest_c], vec![rest_c, hi, rest_c], vec![rest_c, hi, rest_c, lo]]);
    } else if start_c >= rest_c + aside_c {
        routes.extend([vec![rest_c, half(lo), rest_c], vec![rest_c, lo, rest_c], vec![rest_c, lo, rest_c, hi]]);
    }
    routes
}

impl Profile {
    /// Along some temperatures, with so many plateaus on the way to each, each with the same soak; that of the rest is no shorter than it must be.
    fn along(start: f64, route: &[f64], rest: MidSpanRest, rate_cpm: f64, plateaus: usize, soak_min: f64) -> Self {
        let mut steps: Vec<ProfileStep> = Vec::new();
        let mut from = start;
        for to in route {
            let parts = plateaus + 1;
            for part in 1..=parts {
                let to_c = (from + (to - from) * part as f64 / parts as f64).round();
                if to_c != steps.last().map_or(start, |step| step.to_c) {
                    let soak_min = soak_min.max(rest.least_min(to_c));
                    steps.push(ProfileStep { to_c, rate_cpm, soak_min });
                }
            }
            from = *to;
        }
        Self { steps, rest }
    }

    /// With a step's soak shortened; `None` where it may not be.
    pub(super) fn shortened(&self, step: usize, by_min: f64) -> Option<Self> {
        let mut shorter = self.clone();
        let step = shorter.steps.get_mut(step)?;
        let least_min = self.rest.least_min(step.to_c);
        if step.soak_min <= least_min {
            return None;
        }
        step.soak_min = (step.soak_min - by_min).max(least_min);
        Some(shorter)
    }

    pub(super) fn hours(&self, chamber: &Chamber) -> f64 {
        let mut from = chamber.start_c;
        let mut minutes = 0.0;
        for step in &self.steps {
            minutes += (step.to_c - from).abs() / step.rate_cpm + step.soak_min;
            from = step.to_c;
        }
        minutes / 60.0
    }

    /// The chamber's temperature after so many minutes.
    fn chamber_c(&self, chamber: &Chamber, minutes: f64) -> f64 {
        let (mut from, mut left) = (chamber.start_c, minutes);
        for step in &self.steps {
            let ramp = (step.to_c - from).abs() / step.rate_cpm;
            if left < ramp {
                return from + (step.to_c - from) * left / ramp;
            }
            left -= ramp;
            if left < step.soak_min {
                return step.to_c;
            }
            left -= step.soak_min;
            from = step.to_c;
        }
        from
    }

    /// The log of the mean unit, without noise: rates, °/h, so many rows a window.
    pub(super) fn log(&self, prior: &UnitPrior, chamber: &Chamber, window_s: f64) -> Vec<u8> {
        let row_s = window_s / ROWS;
        let rows = (self.hours(chamber) * 3600.0 / row_s) as usize;
        let mut unit = MeanUnit::new(prior, chamber.start_c);
        let (mut text, mut block_c) = ("time_s,temperature_c,rate_dph\n".to_owned(), chamber.start_c);
        // A lag of the block, step by step of a second; none is a block that follows at once.
        let follows =
            if chamber.block_lag_min > 0.0 { 1.0 - (-1.0 / (60.0 * chamber.block_lag_min)).exp() } else { 1.0 };
        let seconds = row_s.round().max(1.0) as usize;
        for row in 1..=rows {
            let mut drift = 0.0;
            for second in 0..seconds {
                let now_s = ((row - 1) * seconds + second + 1) as f64;
                block_c += follows * (self.chamber_c(chamber, now_s / 60.0) - block_c);
                drift += unit.drift_dph(block_c);
            }
            let _ = writeln!(text, "{},{block_c},{}", row * seconds, drift / seconds as f64);
        }
        text.into_bytes()
    }
}

/// The unit whose coefficients are the prior's mean.
struct MeanUnit {
    /// Coefficients of T_n, and those times the lagged rate and the slow one.
    bias: Vec<(usize, f64)>,
    rates: [Vec<(usize, f64)>; 2],
    /// Part of the way that a lag goes in a second, and where it is, °C.
    follows: [f64; 2],
    lagged_c: [f64; 2],
}

impl MeanUnit {
    fn new(prior: &UnitPrior, start_c: f64) -> Self {
        let orders = |start: &str| -> Vec<(usize, f64)> {
            let named = prior.terms.iter().zip(&prior.mean);
            named.filter_map(|(name, value)| Some((name.strip_prefix(start)?.parse().ok()?, *value))).collect()
        };
        let lag = |wanted: &str| prior.terms.iter().position(|name| name == wanted).map_or(1.0, |at| prior.mean[at]);
        let follows = ["lag_s", "slow lag_s"].map(|name| 1.0 - (-1.0 / lag(name).max(1.0)).exp());
        Self { bias: orders("bias "), rates: [orders("rate "), orders("slow rate ")], follows, lagged_c: [start_c; 2] }
    }

    /// After one more second at a temperature of the block.
    fn drift_dph(&mut self, block_c: f64) -> f64 {
        let x = (2.0 * block_c - COMMON_SPAN.lo - COMMON_SPAN.hi) / (COMMON_SPAN.hi - COMMON_SPAN.lo);
        let basis = chebyshev(x);
        let series = |terms: &[(usize, f64)]| -> f64 {
            terms.iter().map(|(n, value)| value * basis.get(*n).copied().unwrap_or(0.0)).sum()
        };
        let mut drift = series(&self.bias);
        for ((lagged, follows), terms) in self.lagged_c.iter_mut().zip(self.follows).zip(&self.rates) {
            let step = follows * (block_c - *lagged);
            *lagged += step;
            drift += 60.0 * step * series(terms);
        }
        drift
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_what_the_chamber_does() {
        let chamber = Chamber::new(20.0, vec![1.0]);
        let rest = MidSpanRest::of([-40.0, 70.0], &chamber, 1.0);
        assert_eq!(rest, MidSpanRest { at_c: 25.0, soak_min: 15.0 });
        let profile = Profile::along(20.0, &[-40.0, 70.0], rest, 1.0, 1, 30.0);
        assert_eq!(profile.steps.iter().map(|step| step.to_c).collect::<Vec<_>>(), [-10.0, -40.0, 15.0, 70.0]);
        assert!((profile.hours(&chamber) - (60.0 + 110.0 + 4.0 * 30.0) / 60.0).abs() < 1e-12);
        for (minutes, celsius) in
            [(0.0, 20.0), (15.0, 5.0), (40.0, -10.0), (75.0, -25.0), (100.0, -40.0), (500.0, 70.0)]
        {
            assert!((profile.chamber_c(&chamber, minutes) - celsius).abs() < 1e-9, "{minutes}");
        }
        let shorter = profile.shortened(1, 40.0).unwrap();
        assert_eq!(shorter.steps[1].soak_min, 0.0);
        assert_eq!(shorter.shortened(1, 5.0), None);
    }

    #[test]
    fn every_test_rests_in_mid_span_after_heating_and_after_cooling() {
        let mut chamber = Chamber { block_lag_min: 20.0, ..Chamber::new(20.0, vec![1.0]) };
        assert_eq!(MidSpanRest::of([-40.0, 70.0], &chamber, 1.0), MidSpanRest { at_c: 25.0, soak_min: 75.0 });
        assert_eq!(MidSpanRest::of([-10.0, 30.0], &chamber, 0.05), MidSpanRest { at_c: 20.0, soak_min: 15.0 });
        for start_c in [-40.0, 0.0, 20.0, 25.0, 50.0, 70.0] {
            chamber.start_c = start_c;
            for route in routes([-40.0, 70.0], 25.0, start_c) {
                let rest = MidSpanRest::of([-40.0, 70.0], &chamber, 1.0);
                let mut profile = Profile::along(start_c, &route, rest, 1.0, 1, 0.0);
                for step in 0..profile.steps.len() {
                    while let Some(shorter) = profile.shortened(step, 25.0) {
                        profile = shorter;
                    }
                }
                let mut from_c = vec![start_c];
                from_c.extend(profile.steps.iter().map(|step| step.to_c));
                let rests = profile.steps.iter().zip(&from_c).filter(|(step, _)| step.soak_min >= 75.0);
                let came: Vec<bool> = rests.map(|(step, from_c)| step.to_c > *from_c).collect();
                assert!(came.contains(&true) && came.contains(&false), "{start_c}, {route:?}: {came:?}");
            }
        }
    }
}
