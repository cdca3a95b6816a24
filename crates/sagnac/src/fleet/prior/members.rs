//! The axes that a prior is learned from: of one model, each test once, without odd ones.
//!
//! ```text
//! odd   |β̂ − median of its lot| > 5·MAD as σ        of a lot of fewer than 8 axes: the median of all lots, σ of the lots added
//! ```
//!
//! Fails for a lot whose axes are odd in the majority: the others are named then.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::triangle::place;
use crate::fit::ln_of_residual;
use crate::fleet::common_basis::CommonBasis;
use crate::fleet::control::{SIGMA_OF_MAD, median};
use crate::fleet::result::{AxisResult, UnitResult};

/// Odd is further from the median than so many MAD as σ.
const ODD_MADS: f64 = 5.0;
/// Lots of fewer axes have the median of all.
pub(super) const LEAST_OF_LOT: usize = 8;

/// Axes that are not of the fleet.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NotUsed {
    /// Unit and axis, such as `RLG-7 x`; empty where it is a count.
    pub axis: String,
    /// Why.
    pub reason: String,
    /// How many.
    pub axes: u64,
}

/// An axis that may be used.
pub(super) struct Member<'a> {
    pub(super) unit: &'a UnitResult,
    pub(super) axis: &'a AxisResult,
    pub(super) basis: Cow<'a, CommonBasis>,
}

impl Member<'_> {
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.unit.unit, self.axis.axis)
    }
}

/// The model of most axes; the first by its name among equals.
pub(super) fn most_frequent(members: &[Member<'_>]) -> Option<String> {
    most_frequent_by(members, |member| member.axis.model.clone())
}

pub(super) fn most_frequent_by<T: Ord>(members: &[Member<'_>], key: impl Fn(&Member<'_>) -> T) -> Option<T> {
    let mut counts: BTreeMap<T, usize> = BTreeMap::new();
    members.iter().for_each(|member| *counts.entry(key(member)).or_default() += 1);
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|(value, _)| value)
}

/// Without units whose logs are those of a unit before: one test says once how units scatter.
pub(super) fn copies(members: Vec<Member<'_>>) -> (Vec<Member<'_>>, Vec<NotUsed>) {
    let mut first: BTreeMap<&str, &str> = BTreeMap::new();
    let mut not_used = Vec::new();
    let own = members.into_iter().filter(|member| {
        let unit = member.unit.unit.as_str();
        let others = member.unit.inputs_sha256.iter().map(|input| *first.entry(input).or_insert(unit));
        let other = others.filter(|other| *other != unit).last();
        not_used.extend(other.map(|other| NotUsed {
            axis: member.name(),
            reason: format!("its log is that of {other}"),
            axes: 1,
        }));
        other.is_none()
    });
    (own.collect(), not_used)
}

/// Terms without the lags: of a test that resolves a lag its coefficients are the same, with their own covariance.
pub(super) fn without_lags(basis: &CommonBasis) -> CommonBasis {
    let kept: Vec<usize> = (0..basis.terms.len()).filter(|at| !basis.terms[*at].ends_with("lag_s")).collect();
    let text = |all_texts: &[String]| kept.iter().map(|at| all_texts[*at].clone()).collect();
    let covariance = kept.iter().enumerate().flat_map(|(row, i)| kept[..=row].iter().map(|j| place(*i, *j)));
    CommonBasis {
        terms: text(&basis.terms),
        units: text(&basis.units),
        coefficients: kept.iter().map(|at| basis.coefficients[*at]).collect(),
        covariance: covariance.map(|at| basis.covariance[at]).collect(),
    }
}

/// ln r of a record's residual.
pub(super) fn residual_ln(axis: &AxisResult) -> f64 {
    let correlation = axis.residual_autocorrelation.unwrap_or(0.0);
    ln_of_residual(axis.residual_dph.unwrap_or(1.0), correlation)
}

/// Names of axes that are far from the median of their lot, each with what is odd.
pub(super) fn odd_ones(members: &[Member<'_>]) -> BTreeMap<String, String> {
    let mut out = BTreeMap::new();
    let terms = members.first().map_or(&[][..], |member| &member.basis.terms);
    for (at, term) in terms.iter().enumerate() {
        let value = |member: &Member<'_>| member.basis.coefficients.get(at).copied().unwrap_or(f64::NAN);
        let mut by_lot: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        members.iter().for_each(|member| by_lot.entry(&member.unit.lot).or_default().push(value(member)));
        let middle = |member: &Member<'_>| {
            by_lot.get(member.unit.lot.as_str()).filter(|own| own.len() >= LEAST_OF_LOT).map(|own| median(own))
        };
        let mad = |away: &mut dyn Iterator<Item = f64>| SIGMA_OF_MAD * median(&away.map(f64::abs).collect::<Vec<_>>());
        let sigma = mad(&mut members.iter().filter_map(|member| Some(value(member) - middle(member)?)));
        // Of a small lot: how far it may be from the others is how far lots are from each other, each counted once.
        let medians: Vec<f64> = by_lot.values().map(|own| median(own)).collect();
        let of_all = median(&medians);
        let of_lots = mad(&mut medians.iter().map(|own| own - of_all));
        for member in members {
            let (away, sigma, of) = match middle(member) {
                Some(own) => (value(member) - own, sigma, "of its lot"),
                None => (value(member) - of_all, sigma.hypot(of_lots), "of all lots"),
            };
            if sigma > 0.0 && away.abs() > ODD_MADS * sigma {
                let how = sagnac_units::format::significant(away / sigma, 2);
                out.entry(member.name()).or_insert_with(|| format!("odd: {term} is {how} σ from the median {of}"));
            }
        }
    }
    out
}
