//! Sums of the coefficients, their products and their covariances over the axes of a lot. Exact, so that they merge in any order.

use serde::{Deserialize, Serialize};

use super::exact_sum::ExactSum;
use super::members::{Member, residual_ln};
use super::triangle::place;
use crate::fleet::common_basis::CommonBasis;
use crate::fleet::result::AxisResult;

/// Kinds of noise in the sums: N, Q, B and K, then ln r and its square.
pub(super) const NOISES: usize = 6;

/// Sums over the axes of a lot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LotSums {
    /// Axes.
    pub axes: u64,
    /// Σβ̂.
    pub value: Vec<ExactSum>,
    /// Σβ̂β̂ᵀ, the lower triangle.
    pub product: Vec<ExactSum>,
    /// ΣV, the lower triangle.
    pub covariance: Vec<ExactSum>,
    /// Axes whose N and Q are known.
    pub noise_axes: u64,
    /// Σ N², Σ Q² of those, Σ B² and Σ K² of all residuals, Σ ln r and Σ (ln r)².
    pub noise: Vec<ExactSum>,
}

impl LotSums {
    pub(super) fn empty(terms: usize) -> Self {
        let zeros = |n: usize| vec![ExactSum::default(); n];
        let triangle = terms * (terms + 1) / 2;
        Self {
            axes: 0,
            noise_axes: 0,
            value: zeros(terms),
            product: zeros(triangle),
            covariance: zeros(triangle),
            noise: zeros(NOISES),
        }
    }

    pub(super) fn of(members: &[&Member<'_>]) -> Self {
        let terms = members.first().map_or(0, |member| member.basis.coefficients.len());
        let triangle = || (0..terms).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let sum = |value: &dyn Fn(&CommonBasis) -> f64| ExactSum::of(members.iter().map(|member| value(&member.basis)));
        let noise = |value: fn(&AxisResult) -> Option<f64>| {
            ExactSum::of(members.iter().filter_map(|member| Some(value(member.axis)?.powi(2))))
        };
        Self {
            axes: members.len() as u64,
            noise_axes: members.iter().filter(|member| member.axis.n_deg_rt_h.is_some()).count() as u64,
            value: (0..terms).map(|i| sum(&|basis| basis.coefficients[i])).collect(),
            product: triangle().map(|(i, j)| sum(&|basis| basis.coefficients[i] * basis.coefficients[j])).collect(),
            covariance: triangle().map(|(i, j)| sum(&|basis| basis.covariance[place(i, j)])).collect(),
            noise: vec![
                noise(|axis| axis.n_deg_rt_h),
                noise(|axis| axis.q_arcsec),
                noise(|axis| axis.bias_instability_dph),
                noise(|axis| axis.rate_random_walk_dph_rt_h),
                ExactSum::of(members.iter().map(|member| residual_ln(member.axis))),
                ExactSum::of(members.iter().map(|member| residual_ln(member.axis).powi(2))),
            ],
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.axes += other.axes;
        self.noise_axes += other.noise_axes;
        let parts = [
            (&mut self.value, &other.value),
            (&mut self.product, &other.product),
            (&mut self.covariance, &other.covariance),
            (&mut self.noise, &other.noise),
        ];
        for (own, more) in parts {
            own.iter_mut().zip(more).for_each(|(own, more)| own.merge(more));
        }
    }
}

pub(super) fn values(sums: &[ExactSum]) -> Vec<f64> {
    sums.iter().map(ExactSum::value).collect()
}
