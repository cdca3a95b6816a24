//! What a quality engineer asks of a fleet: yield, what drifts, which rig is off, which limit is tight, which unit is odd.
//!
//! ```text
//! rig effect     Δ = Σ_lots w·(mean of the rig − mean of the others in that lot)/Σ w,   w = 1/(s²·(1/n + 1/n'))
//! capability     Cpk = (bound − mean)/(3s) of an upper limit, (mean − bound)/(3s) of a lower one; σ(Cpk) = √(1/(9n) + Cpk²/(2(n − 1)))
//! ```
//!
//! (σ of Cpk: Bissell, "How reliable is your capability index?", Applied Statistics 39, 1990.) Values further than 3 σ from the median of
//! their lot count as 3 σ in a rig effect, so that one outlier does not make a rig odd. Rigs are compared in lots that several tested:
//! a rig that tested a lot alone cannot be told from the lot, and is not compared there. The rig that is furthest off is reported first, and
//! the others are compared without it. An effect is reported at a probability of 0.01 of
//! any false one in the whole report (Bonferroni).
//!
//! Fails for a Cpk of values that are not normal: the part that did not meet the limit stands next to it.

use std::collections::BTreeMap;

use sagnac_log::setup::RateUnit;
use statrs::distribution::{ContinuousCDF, Normal};

use super::control::{ControlChart, SIGMA_OF_MAD, median};
use super::result::{Acceptance, AxisResult, UnitOutcome, UnitResult};
use crate::verify::SPECS;

/// Probability of any false rig effect in a report.
const FALSE_ALARM: f64 = 0.01;
/// Units of a rig in a lot, and of the others, that can be compared.
const LEAST_COMPARED: usize = 5;
/// Values beyond so many σ count as so many.
const CLIPPED: f64 = 3.0;
/// A unit is odd beyond so many σ of its chart.
const ODD: f64 = 5.0;
/// Values that differ by less, relative to mean and bound, are equal.
const ROUNDING: f64 = 1e-9;
/// Values that make a capability.
const LEAST_CAPABLE: usize = 20;

/// The state of a fleet.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Quality {
    /// Units by outcome and acceptance: all, then each lot.
    pub yields: Vec<Yield>,
    /// A chart for each quantity.
    pub charts: Vec<Quantity>,
    /// Axes far from all others.
    pub odd: Vec<Odd>,
    /// Rigs that differ from the others.
    pub rigs: Vec<RigEffect>,
    /// Comparisons of rigs that were made.
    pub compared: usize,
    /// Each limit, that which most do not meet first.
    pub capability: Vec<Capability>,
    /// Reasons of refusals and failures, the commonest first.
    pub refusals: Vec<(String, usize)>,
}

/// Units of a lot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Yield {
    /// Lot; empty for all units.
    pub lot: String,
    /// Units.
    pub units: usize,
    /// With a record.
    pub calibrated: usize,
    /// With a retest checked against limits.
    pub judged: usize,
    /// That met them.
    pub met: usize,
}

/// A quantity over the fleet, in order.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Quantity {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Unit and axis of each value.
    pub of: Vec<String>,
    /// The chart.
    pub chart: ControlChart,
}

/// An axis far from all others.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Odd {
    /// Unit and axis.
    pub of: String,
    /// The quantity in which it is furthest.
    pub quantity: String,
    /// How far, σ.
    pub sigmas: f64,
}

/// A rig against the others.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RigEffect {
    /// Rig.
    pub rig: String,
    /// What differs.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// By how much, rig less others, in the quantity's unit.
    pub difference: f64,
    /// σ of that.
    pub sigma: f64,
    /// Axes of the rig that were compared.
    pub axes: usize,
}

/// A limit over the fleet.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Capability {
    /// Its key.
    pub limit: String,
    /// Unit of bound, mean and σ.
    pub unit: String,
    /// The bound.
    pub bound: f64,
    /// Axes that were checked against it.
    pub asked: usize,
    /// Those whose value is known.
    pub n: usize,
    /// Those that did not meet it, or could not be decided.
    pub not_met: usize,
    /// Their mean and σ.
    pub mean: f64,
    /// σ of the values.
    pub sigma: f64,
    /// Cpk and its σ; none of fewer than twenty values, or of equal ones.
    pub cpk: Option<[f64; 2]>,
}

/// A value of an axis.
struct AxisValue<'a> {
    unit: &'a UnitResult,
    axis: &'a AxisResult,
    value: f64,
}

impl Quality {
    /// Of results in the order in which the units were tested.
    pub fn of(results: &[UnitResult]) -> Self {
        let quantities = quantities(results);
        let tested = quantities.len().max(1) * rigs(results).len().max(1);
        let mut out = Self {
            yields: yields(results),
            capability: capabilities(results),
            refusals: refusals(results),
            ..Self::default()
        };
        let mut odd: BTreeMap<String, Odd> = BTreeMap::new();
        for (name, (unit, values)) in quantities {
            let (compared, effects) = rig_effects(&name, &unit, &values, FALSE_ALARM / tested as f64);
            out.compared += compared;
            out.rigs.extend(effects);
            let names: Vec<String> = values.iter().map(AxisValue::name).collect();
            let Some(chart) = ControlChart::new(values.iter().map(|value| value.value).collect()) else { continue };
            for (axis_name, value) in names.iter().zip(&chart.values) {
                let sigmas = (value - chart.centre) / chart.sigma;
                let further = odd.get(axis_name).is_none_or(|known| sigmas.abs() > known.sigmas.abs());
                if sigmas.abs() > ODD && further {
                    odd.insert(axis_name.clone(), Odd { of: axis_name.clone(), quantity: name.clone(), sigmas });
                }
            }
            out.charts.push(Quantity { name, unit, of: names, chart });
        }
        out.odd = odd.into_values().collect();
        out.odd.sort_by(|a, b| b.sigmas.abs().total_cmp(&a.sigmas.abs()));
        out
    }
}

impl Quality {
    /// The same with rates in a unit, for people; results keep °/h.
    #[must_use]
    pub fn shown_in(&self, units: RateUnit) -> Self {
        let mut shown = self.clone();
        for quantity in &mut shown.charts {
            let (factor, unit) = units.shown(&quantity.unit);
            quantity.unit = unit;
            quantity.chart.scale(factor);
        }
        for effect in &mut shown.rigs {
            let (factor, unit) = units.shown(&effect.unit);
            effect.unit = unit;
            effect.difference *= factor;
            effect.sigma *= factor;
        }
        for of in &mut shown.capability {
            let (factor, unit) = units.shown(&of.unit);
            of.unit = unit;
            [&mut of.bound, &mut of.mean, &mut of.sigma].into_iter().for_each(|value| *value *= factor);
        }
        shown
    }
}

impl AxisValue<'_> {
    fn name(&self) -> String {
        format!("{} {}", self.unit.unit, self.axis.axis)
    }
}

/// The quantities of a fleet by their names, each with its unit and values.
fn quantities(results: &[UnitResult]) -> Vec<(String, (String, Vec<AxisValue<'_>>))> {
    let mut all: Vec<(String, (String, Vec<AxisValue<'_>>))> = Vec::new();
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    for unit in results {
        for axis in &unit.axes {
            for (name, of, value) in values_of(axis) {
                let next = all.len();
                let at = *places.entry(name.clone()).or_insert(next);
                if at == next {
                    all.push((name, (of, Vec::new())));
                }
                if value.is_finite() {
                    all[at].1.1.push(AxisValue { unit, axis, value });
                }
            }
        }
    }
    all
}

/// Name, unit and value of what is watched of an axis.
fn values_of(axis: &AxisResult) -> Vec<(String, String, f64)> {
    let common = axis.common.iter().flat_map(|basis| {
        basis
            .terms
            .iter()
            .zip(&basis.units)
            .zip(&basis.coefficients)
            .map(|((term, unit), value)| (term.clone(), unit.clone(), *value))
    });
    let over = axis
        .residual_dph
        .zip(axis.noise_floor_dph)
        .filter(|(_, floor)| *floor > 0.0)
        .map(|(sigma, floor)| sigma / floor);
    let own = [
        ("rate at T0", "deg/h", axis.mean_offset_dph),
        ("lag", "s", axis.lag_s),
        ("residual over noise floor", "", over),
        ("angle random walk", "deg/rt h", axis.n_deg_rt_h),
        ("quantization", "arcsec", axis.q_arcsec),
        ("bias instability", "deg/h", axis.bias_instability_dph),
        ("rate random walk", "deg/h/sqrt(h)", axis.rate_random_walk_dph_rt_h),
        ("scale factor", "ppm", axis.scale_ppm),
        ("retest after correction", "deg/h", axis.retest_after_dph),
    ];
    let own = own.into_iter().filter_map(|(name, unit, value)| Some((name.to_owned(), unit.to_owned(), value?)));
    common.chain(own).collect()
}

fn rigs(results: &[UnitResult]) -> Vec<&str> {
    let mut all: Vec<&str> = results.iter().map(|unit| unit.rig.as_str()).filter(|rig| !rig.is_empty()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Comparisons that could be made, and the rigs that differ at this probability.
fn rig_effects(name: &str, unit: &str, values: &[AxisValue<'_>], probability: f64) -> (usize, Vec<RigEffect>) {
    let mut by_lot: BTreeMap<&str, Vec<&AxisValue<'_>>> = BTreeMap::new();
    values.iter().for_each(|value| by_lot.entry(&value.unit.lot).or_default().push(value));
    // Of each lot and rig: number and mean of clipped values.
    let mut lots: Vec<BTreeMap<&str, [f64; 2]>> = Vec::new();
    let (mut squares, mut degrees) = (0.0, 0.0);
    for values in by_lot.values() {
        let middle = median(&values.iter().map(|value| value.value).collect::<Vec<_>>());
        let sigma = SIGMA_OF_MAD * median(&values.iter().map(|value| (value.value - middle).abs()).collect::<Vec<_>>());
        let mut groups: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for value in values.iter().filter(|value| !value.unit.rig.is_empty()) {
            let clipped = (value.value - middle).clamp(-CLIPPED * sigma, CLIPPED * sigma);
            groups.entry(&value.unit.rig).or_default().push(clipped);
        }
        let mut lot = BTreeMap::new();
        for (rig, values) in groups {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            squares += values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            degrees += n - 1.0;
            lot.insert(rig, [n, mean]);
        }
        lots.push(lot);
    }
    let variance = squares / degrees;
    let bound = Normal::standard().inverse_cdf(1.0 - probability / 2.0);
    let all = compared_rigs(&lots, variance);
    let (compared, mut effects) = (all.len(), Vec::new());
    let mut rest = all;
    // The furthest first, and then the others without it: they do not differ because of it.
    while let Some(ComparedRig { rig, difference, sigma, axes }) =
        rest.into_iter().max_by(|a, b| a.sigmas().total_cmp(&b.sigmas())).filter(|worst| worst.sigmas() > bound)
    {
        lots.iter_mut().for_each(|lot| {
            lot.remove(rig);
        });
        rest = compared_rigs(&lots, variance);
        let [rig, quantity, unit] = [rig, name, unit].map(str::to_owned);
        effects.push(RigEffect { rig, quantity, unit, difference, sigma, axes });
    }
    (compared, effects)
}

/// A rig next to the others of its lots.
struct ComparedRig<'a> {
    rig: &'a str,
    difference: f64,
    sigma: f64,
    axes: usize,
}

impl ComparedRig<'_> {
    fn sigmas(&self) -> f64 {
        self.difference.abs() / self.sigma
    }
}

/// Every rig that can be compared; `lots` has number and mean of each rig's values.
fn compared_rigs<'a>(lots: &[BTreeMap<&'a str, [f64; 2]>], variance: f64) -> Vec<ComparedRig<'a>> {
    let mut names: Vec<&str> = lots.iter().flat_map(|lot| lot.keys().copied()).collect();
    names.sort_unstable();
    names.dedup();
    let compared = |rig: &'a str| {
        let (mut sum, mut weights, mut axes) = (0.0, 0.0, 0);
        for lot in lots {
            let Some([n, mean]) = lot.get(rig) else { continue };
            let others = lot.iter().filter(|(other, _)| **other != rig).map(|(_, other)| other);
            let [m, total] = others.fold([0.0, 0.0], |[m, total], [n, mean]| [m + n, total + n * mean]);
            if *n < LEAST_COMPARED as f64 || m < LEAST_COMPARED as f64 {
                continue;
            }
            let weight = 1.0 / (variance * (1.0 / n + 1.0 / m));
            sum += weight * (mean - total / m);
            weights += weight;
            axes += *n as usize;
        }
        let is_known = weights > 0.0 && weights.is_finite();
        is_known.then(|| ComparedRig { rig, difference: sum / weights, sigma: weights.sqrt().recip(), axes })
    };
    names.into_iter().filter_map(compared).collect()
}

fn yields(results: &[UnitResult]) -> Vec<Yield> {
    let mut all: BTreeMap<&str, Yield> = BTreeMap::new();
    let mut whole = Yield::default();
    for unit in results {
        let lot = all.entry(&unit.lot).or_insert_with(|| Yield { lot: unit.lot.clone(), ..Yield::default() });
        for group in [&mut whole, lot] {
            group.units += 1;
            group.calibrated += usize::from(unit.outcome == UnitOutcome::Calibrated);
            group.judged += usize::from(unit.acceptance == Acceptance::Met || unit.acceptance.is_bad());
            group.met += usize::from(unit.acceptance == Acceptance::Met);
        }
    }
    let lots = all.into_values().filter(|lot| !lot.lot.is_empty());
    std::iter::once(whole).chain(lots).collect()
}

fn capabilities(results: &[UnitResult]) -> Vec<Capability> {
    let mut all: BTreeMap<(&str, u64), Vec<&super::LimitResult>> = BTreeMap::new();
    for limit in results.iter().flat_map(|unit| &unit.axes).flat_map(|axis| &axis.limits) {
        all.entry((&limit.name, limit.bound.to_bits())).or_default().push(limit);
    }
    let capability = |((name, bound), limits): ((&str, u64), Vec<&super::LimitResult>)| {
        let bound = f64::from_bits(bound);
        let values: Vec<f64> = limits.iter().filter_map(|limit| limit.value).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let sigma = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let room = if name.ends_with("_min") { mean - bound } else { bound - mean };
        let cpk = room / (3.0 * sigma);
        let error = (1.0 / (9.0 * n) + cpk.powi(2) / (2.0 * (n - 1.0))).sqrt();
        Capability {
            limit: name.to_owned(),
            unit: SPECS.iter().find(|spec| spec.key == name).map_or("", |spec| spec.unit).to_owned(),
            bound,
            asked: limits.len(),
            n: values.len(),
            not_met: limits.iter().filter(|limit| limit.met == Some(false)).count(),
            mean,
            sigma,
            cpk: (values.len() >= LEAST_CAPABLE && sigma > ROUNDING * (mean.abs() + bound.abs()))
                .then_some([cpk, error]),
        }
    };
    let mut all: Vec<Capability> = all.into_iter().map(capability).collect();
    let tightness = |capability: &Capability| capability.cpk.map_or(f64::INFINITY, |[cpk, _]| cpk);
    all.sort_by(|a, b| b.not_met.cmp(&a.not_met).then_with(|| tightness(a).total_cmp(&tightness(b))));
    all
}

/// Reasons without the numbers in them, so that the same refusal of many units is one.
fn refusals(results: &[UnitResult]) -> Vec<(String, usize)> {
    let mut all: BTreeMap<String, usize> = BTreeMap::new();
    let given = results.iter().flat_map(|unit| unit.refusal.iter().chain(&unit.retest_refusal));
    for refusal in given {
        let mut words = String::new();
        for c in refusal.reason.chars() {
            match c {
                c if c.is_ascii_digit() && words.ends_with('#') => {}
                '.' if words.ends_with('#') => {}
                c if c.is_ascii_digit() => words.push('#'),
                c => words.push(c),
            }
        }
        *all.entry(words).or_default() += 1;
    }
    let mut all: Vec<(String, usize)> = all.into_iter().collect();
    all.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    all
}

#[cfg(test)]
mod tests {
    use super::super::draws::Draws;
    use super::*;
    use crate::fleet::{LimitResult, Refusal};

    const RIGS: [&str; 3] = ["A", "B", "C"];

    /// Units of three lots on three rigs; two quantities that belong together, with the odd value far out.
    fn fleet(draws: &mut Draws, units: usize, by_rig: [f64; 3], rig_of: fn(usize) -> usize) -> Vec<UnitResult> {
        let of = |at: usize, draws: &mut Draws| {
            let (lot, rig) = (at % 3, rig_of(at));
            let far = if draws.uniform() < 0.02 { 8.0 } else { 1.0 };
            let own = draws.normal() * far;
            let axis = AxisResult {
                axis: "z".to_owned(),
                mean_offset_dph: Some(5.0 + lot as f64 + own + by_rig[rig]),
                n_deg_rt_h: Some(0.003 * (1.0 + 0.1 * draws.normal())),
                q_arcsec: Some(0.2 + 0.02 * own + 0.01 * draws.normal()),
                ..AxisResult::default()
            };
            UnitResult {
                unit: format!("RLG-{at}"),
                lot: format!("{lot}"),
                rig: RIGS[rig].to_owned(),
                outcome: UnitOutcome::Calibrated,
                axes: vec![axis],
                ..UnitResult::default()
            }
        };
        (0..units).map(|at| of(at, draws)).collect()
    }

    /// A rig is named without cause in at most one report of a hundred, though lots differ and some units are odd.
    #[test]
    fn rigs_that_are_equal_are_not_named() {
        let mut draws = Draws(21);
        let mut named = 0;
        for _ in 0..600 {
            let quality = Quality::of(&fleet(&mut draws, 180, [0.0; 3], |at| at / 3 % 3));
            assert_eq!(quality.compared, 9);
            named += u32::from(!quality.rigs.is_empty());
        }
        // 0.01 of 600 is 6; 14 would be three standard errors more.
        assert!(named <= 13, "{named} of 600");
    }

    /// A thermometer that is off on one rig: named, with its size, and the others are not blamed for it.
    #[test]
    fn a_rig_that_is_off_is_named() {
        let mut draws = Draws(22);
        let (mut caught, mut sizes, mut covered, mut wrong) = (0, 0.0, 0, 0);
        for _ in 0..300 {
            let quality = Quality::of(&fleet(&mut draws, 180, [0.0, 1.0, 0.0], |at| at / 3 % 3));
            let of_b = quality.rigs.iter().find(|effect| effect.rig == "B" && effect.quantity == "rate at T0");
            caught += u32::from(of_b.is_some());
            sizes += of_b.map_or(0.0, |effect| effect.difference);
            covered += u32::from(of_b.is_some_and(|effect| (effect.difference - 1.0).abs() < 1.96 * effect.sigma));
            wrong += quality.rigs.iter().filter(|effect| effect.rig != "B" || effect.quantity != "rate at T0").count();
        }
        assert!(caught >= 290, "{caught} of 300");
        let mean = sizes / f64::from(caught);
        assert!((0.9..1.1).contains(&mean), "{mean}");
        let part = f64::from(covered) / f64::from(caught);
        assert!((0.90..0.99).contains(&part) && wrong <= 6, "{part} {wrong}");
    }

    /// A rig with a lot of its own cannot be told from the lot.
    #[test]
    fn a_rig_with_its_own_lot_is_not_compared() {
        let mut draws = Draws(23);
        let quality = Quality::of(&fleet(&mut draws, 180, [0.0, 3.0, 0.0], |at| at % 3));
        assert_eq!((quality.compared, quality.rigs.len()), (0, 0));
    }

    /// Cpk of normal values: its interval covers the truth, of an upper and a lower limit.
    #[test]
    fn capability_has_an_honest_interval() {
        let mut draws = Draws(24);
        let mut covered = [0; 2];
        for _ in 0..500 {
            let mut units = fleet(&mut draws, 120, [0.0; 3], |_| 0);
            for unit in &mut units {
                let [high, low] = [1.0 + 0.1 * draws.normal(), 30.0 + 4.0 * draws.normal()];
                let limit = |name: &str, bound: f64, value: f64, met| LimitResult {
                    name: name.to_owned(),
                    bound,
                    value: Some(value),
                    met: Some(met),
                };
                unit.axes[0].limits =
                    vec![limit("sigma_max", 1.4, high, high <= 1.4), limit("improvement_min", 14.0, low, low >= 14.0)];
            }
            let quality = Quality::of(&units);
            for (count, (name, truth)) in
                covered.iter_mut().zip([("sigma_max", 4.0 / 3.0), ("improvement_min", 4.0 / 3.0)])
            {
                let found = quality.capability.iter().find(|found| found.limit == name).unwrap();
                let [cpk, sigma] = found.cpk.unwrap();
                *count += u32::from((cpk - truth).abs() < 1.96 * sigma);
            }
        }
        for count in covered {
            assert!((465..=485).contains(&count), "{covered:?} of 500");
        }
    }

    /// Yields by lot, refusals counted without their numbers, outliers first.
    #[test]
    fn what_a_fleet_is_made_of() {
        let mut draws = Draws(25);
        let mut units = fleet(&mut draws, 60, [0.0; 3], |at| at / 3 % 3);
        units[7].axes[0].n_deg_rt_h = Some(0.3);
        for (at, unit) in units.iter_mut().enumerate().take(9) {
            if at < 5 {
                unit.outcome = UnitOutcome::Refused;
                unit.refusal = Some(Refusal { reason: format!("the data span {at}.5 °C"), ..Refusal::default() });
                unit.axes.clear();
            } else {
                unit.acceptance = if at < 7 { Acceptance::NotMet } else { Acceptance::Met };
            }
        }
        let quality = Quality::of(&units);
        let all = &quality.yields[0];
        assert_eq!((all.units, all.calibrated, all.judged, all.met), (60, 55, 4, 2));
        assert_eq!(quality.yields.len(), 4);
        assert_eq!(quality.refusals, [("the data span # °C".to_owned(), 5)]);
        assert_eq!((quality.odd[0].of.as_str(), quality.odd[0].quantity.as_str()), ("RLG-7 z", "angle random walk"));
    }
}
