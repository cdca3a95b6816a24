//! Few gyros under many names: axes that agree within their tests' uncertainty while the others do not.
//!
//! ```text
//! d²ᵢⱼ = |L⁻¹·(β̂ᵢ − β̂ⱼ)|²/2,  V̄ = L·Lᵀ          of one gyro tested twice: χ² of p degrees
//! near: d² ≤ c,   between: c < d² ≤ 2c,   far      c = χ²(0.99)·1, 2, 4, 8, 16: retests of one gyro differ by more than their noise
//! of gyros that differ: E = pairs·P(Σ Λₖ·zₖ² ≤ χ²(0.99)),   Λ: eigenvalues of L⁻¹·S·L⁻ᵀ
//! ```
//!
//! Thirty tests of two gyros say how one gyro repeats, not how thirty scatter. Two signs of it, each refused. Differences of gyros that
//! are all distinct thin out evenly, so that `between` has 0.3 of the pairs that `near` has or more; groups leave it empty. And groups that
//! differ in several directions make more near pairs than a normal population of the same scatter.
//!
//! Of fleets of two to ten gyros under 30 to 40 names 0.8 or more are refused (0.9 of two), and at most 0.02 of fleets of 40 gyros (asserted in the
//! tests); of fleets of 30 with tails of Student's t of three that scatter in one direction it may be 0.07. Three lots that the manifest does not tell are refused as well where they are well apart: three groups say as little of a fourth.
//!
//! Pairs are of one lot: lots differ for good reasons. So a gyro under a name in each of many lots is not found.
//!
//! Fails for groups that happen to be no farther apart than their tests, and for a gyro that is there a few times among many others:
//! neither makes the fleet look much more alike than it is.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::members::Member;
use super::triangle::symmetric;
use sagnac_log::error::{Error, Result};

/// Axes that are compared at most: evenly by their names.
const MOST_COMPARED: usize = 1500;
/// Two tests of one gyro are this near with this probability.
const NEAR: f64 = 0.99;
/// How far `between` reaches, and how often `near` is widened by it.
const WIDER: f64 = 2.0;
const WIDENED: usize = 5;
/// Groups have less than this part of the near pairs between, and more than that part far.
const BETWEEN: f64 = 0.2;
const FAR: f64 = 0.25;
/// Near pairs of an axis from which on they matter.
const PER_AXIS: f64 = 0.5;
/// Axes of a lot, for each parameter, that tell its own scatter.
const LEAST_PER_PARAMETER: usize = 4;
/// More than chance makes by this factor, which tails of Student's t of three do not reach.
const MORE_THAN_CHANCE: f64 = 3.0;
/// Draws for the chance of a near pair, always the same.
const DRAWS: usize = 4000;
const SEED: u64 = 19;

/// Pairs of axes by their distance.
#[derive(Clone, Copy, Debug, Default)]
struct Pairs {
    near: f64,
    between: f64,
    far: f64,
}

/// Refuses a fleet of few gyros under many names.
pub(super) fn refuse(members: &[Member<'_>]) -> Result<()> {
    let Some(points) = whitened(members) else { return Ok(()) };
    let degrees = points.first().map_or(0, |(_, point)| point.len());
    let Some(near) = ChiSquared::new(degrees as f64).ok().map(|law| law.inverse_cdf(NEAR)) else { return Ok(()) };
    let squares = squares(&points);
    let axes = points.len() as f64;
    let at = |nearest: f64| {
        let mut pairs = Pairs::default();
        for square in &squares {
            *match square {
                square if *square <= nearest => &mut pairs.near,
                square if *square <= WIDER * nearest => &mut pairs.between,
                _ => &mut pairs.far,
            } += 1.0;
        }
        pairs
    };
    let matters = |pairs: &Pairs| pairs.near >= PER_AXIS * axes;
    let apart = (0..WIDENED)
        .map(|wider| at(near * WIDER.powi(wider as i32)))
        .find(|pairs| matters(pairs) && pairs.between < BETWEEN * pairs.near && pairs.far > FAR * pairs.near);
    let close = at(near);
    let Some(by_chance) = near_by_chance(&points, near) else { return Ok(()) };
    let crowded = Some(close).filter(|pairs| matters(pairs) && pairs.near > MORE_THAN_CHANCE * by_chance);
    match apart.or(crowded) {
        None => Ok(()),
        Some(pairs) => Err(Error::refused(
            format!(
                "the axes form groups: {} pairs are alike, {} far apart and only {} between",
                pairs.near, pairs.far, pairs.between
            ),
            "give each gyro one name, and each batch its lot: many tests of few gyros do not predict the next one",
        )),
    }
}

/// Axes with their lots where the mean test has unit covariance.
fn whitened<'a>(members: &[Member<'a>]) -> Option<Vec<AxisPoint<'a>>> {
    let p = members.first()?.basis.coefficients.len();
    let mut sorted: Vec<&Member<'a>> = members.iter().collect();
    sorted.sort_by_key(|member| (&member.unit.unit, &member.axis.axis));
    let step = sorted.len().div_ceil(MOST_COMPARED);
    let used: Vec<&Member<'a>> = sorted.into_iter().step_by(step).collect();
    let mean =
        used.iter().map(|member| symmetric(&member.basis.covariance, p)).sum::<DMatrix<f64>>() / used.len() as f64;
    let scale = mean.diagonal().map(f64::sqrt);
    if scale.iter().any(|sigma| !sigma.is_finite() || *sigma <= 0.0) {
        return None;
    }
    let factor = mean.map_with_location(|i, j, value| value / (scale[i] * scale[j])).cholesky()?.unpack();
    let point = |member: &&Member<'a>| {
        let scaled =
            DVector::from_iterator(p, member.basis.coefficients.iter().zip(&scale).map(|(value, s)| value / s));
        Some(((member.unit.lot.as_str(), member.unit.unit.as_str()), factor.solve_lower_triangular(&scaled)?))
    };
    used.iter().map(point).collect()
}

/// Lot and unit of an axis, and its coefficients.
type AxisPoint<'a> = ((&'a str, &'a str), DVector<f64>);

/// Near pairs that chance makes of normal populations: each lot's own, where it has axes enough to tell its scatter, else that within all lots.
fn near_by_chance(points: &[AxisPoint<'_>], near: f64) -> Option<f64> {
    let p = points.first()?.1.len();
    let mut lots: BTreeMap<&str, Vec<&DVector<f64>>> = BTreeMap::new();
    points.iter().for_each(|((lot, _), point)| lots.entry(*lot).or_default().push(point));
    let chance_of = |groups: &[&Vec<&DVector<f64>>]| -> Option<f64> {
        let eigen = SymmetricEigen::new(scatter_about_means(groups, p)?);
        let roots: Vec<f64> = eigen.eigenvalues.iter().map(|value| value.max(0.0)).collect();
        Some(chance(&roots, near))
    };
    let pooled = chance_of(&lots.values().collect::<Vec<_>>())?;
    let of_lot = |lot: &Vec<&DVector<f64>>| {
        let n = lot.len() as f64;
        let own = if lot.len() >= LEAST_PER_PARAMETER * p { chance_of(&[lot]).unwrap_or(pooled) } else { pooled };
        own * n * (n - 1.0) / 2.0
    };
    Some(lots.values().map(of_lot).sum())
}

fn scatter_about_means(groups: &[&Vec<&DVector<f64>>], p: usize) -> Option<DMatrix<f64>> {
    let axes: usize = groups.iter().map(|of_group| of_group.len()).sum();
    let degrees = axes.checked_sub(groups.len()).filter(|degrees| *degrees > 0)?;
    let mut scatter = DMatrix::zeros(p, p);
    for of_group in groups {
        let mean = of_group.iter().copied().sum::<DVector<f64>>() / of_group.len() as f64;
        for point in of_group.iter() {
            let away = *point - &mean;
            scatter += &away * away.transpose();
        }
    }
    Some(scatter / degrees as f64)
}

/// d² of all pairs of different units of one lot.
fn squares(points: &[AxisPoint<'_>]) -> Vec<f64> {
    let mut out = Vec::new();
    for (at, ((lot, unit), point)) in points.iter().enumerate() {
        let others = points[at + 1..].iter().filter(|((other, name), _)| other == lot && name != unit);
        out.extend(others.map(|(_, other)| (point - other).norm_squared() / 2.0));
    }
    out
}

/// Probability that two axes of a normal population are near.
fn chance(roots: &[f64], near: f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let normal = Normal::standard();
    let mut square = |root: &f64| root * normal.inverse_cdf(random.random::<f64>().clamp(1e-12, 1.0 - 1e-12)).powi(2);
    let is_near = |_: &usize| roots.iter().map(&mut square).sum::<f64>() <= near;
    (0..DRAWS).filter(is_near).count() as f64 / DRAWS as f64
}
