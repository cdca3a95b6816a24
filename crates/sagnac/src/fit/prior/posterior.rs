//! What a test and the scatter of a fleet say together of a unit's coefficients.
//!
//! ```text
//! y = levels + X(τ)·β + e                     θ = (β, τ),   M·θ ~ N(μ, Σ) of the fleet,   Σ = L·Lᵀ
//! θ = M⁻¹·(μ + L·z),   z ~ N(0, I)            min |W·(y − levels − X(τ)·β)|²/s² + |z|²,   linear in θ about the last τ
//! Cov θ = M⁻¹·L·(Gᵀ·G/s² + I)⁻¹·Lᵀ·M⁻ᵀ        G: rows of z without the levels, whitened by the slow noise of the test
//! G = U·S·Vᵀ                                  uⱼᵀy: what the test says in direction j, in which units scatter by sⱼ
//! ```
//!
//! A coefficient that the test does not show is the fleet's, with the fleet's σ. Rows are weighted by the noise here, not by
//! their lengths alone: how much of a curve is the unit's and how much the fleet's is a question of noise.

use crate::fit::one_model::design::{Design, FactoredColumns, Tau, lag_one};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::fit::problem::unit_prior::UnitPrior;
use crate::model::common_basis::{SeriesTerm, onto_common};
use crate::noise_model::factor::Factor;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;
use nalgebra::{DMatrix, DVector};
use sagnac_log::error::{Error, Result};

/// Sweeps over the lags at most, and the change of a lag that is none.
const MOST_SWEEPS: usize = 12;
const STILL: f64 = 1e-4;

/// The prior in the parameters of a fit.
pub(crate) struct Known {
    /// θ of the fleet's mean, and M⁻¹·L.
    pub(crate) mean: DVector<f64>,
    pub(crate) root: DMatrix<f64>,
    /// L, on the common basis.
    pub(crate) common_root: DMatrix<f64>,
}

/// The rows of z about some lags.
pub(crate) struct Linear {
    /// Of each z.
    pub(crate) columns: Vec<Vec<f64>>,
    /// What the fleet's mean says of each row.
    pub(crate) expected: Vec<f64>,
}

/// What the rows say at some noise.
pub(crate) struct Solved {
    pub(crate) levels: DVector<f64>,
    pub(crate) z: DVector<f64>,
    /// Of levels and z.
    pub(crate) covariance: DMatrix<f64>,
    /// White variance of a nominal window.
    pub(crate) variance: f64,
    /// S, and Uᵀy.
    pub(crate) singular: DVector<f64>,
    pub(crate) along: DVector<f64>,
    /// V.
    pub(crate) directions: DMatrix<f64>,
}

pub(crate) fn of_other_terms() -> Error {
    Error::input(
        "the prior's parameters do not match its model in this program",
        "make the prior again: sagnac fleet prior FLEET/ -o fleet.prior.json",
    )
}

pub(crate) fn values(taus: &[Tau]) -> Vec<(usize, f64)> {
    taus.iter().map(|tau| (tau.input, tau.value_s)).collect()
}

impl Known {
    pub(crate) fn new(
        problem: &LeastSquares<'_>,
        terms: &[TermColumn],
        lags: usize,
        prior: &UnitPrior,
    ) -> Result<Self> {
        let (p, q) = (terms.len(), terms.len() + lags);
        let other = of_other_terms;
        if prior.mean.len() != q || prior.covariance.len() != q * (q + 1) / 2 {
            return Err(other());
        }
        let like = |one: &TermColumn, other: &TermColumn| {
            let key = |term: &TermColumn| (term.input, term.form.acts_on, term.form.times_rate);
            key(one) == key(other)
        };
        let of_series = |term: &TermColumn| {
            let series = terms.iter().position(|other| like(other, term)).filter(|_| problem.is_main(term.input))?;
            Some(SeriesTerm { series, shape: term.form.shape, times_rate: term.form.times_rate })
        };
        let series: Vec<SeriesTerm> = terms.iter().map(of_series).collect::<Option<_>>().ok_or_else(other)?;
        let onto = onto_common(problem.span(), &series).ok_or_else(other)?;
        let mut matrix = DMatrix::identity(q, q);
        matrix.view_mut((0, 0), (p, p)).fill(0.0);
        for (row, weights) in onto.iter().enumerate() {
            weights.iter().for_each(|(own, weight)| matrix[(row, *own)] = *weight);
        }
        let entry = |i: usize, j: usize| prior.covariance[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
        let scale = DVector::from_fn(q, |i, _| entry(i, i).max(0.0).sqrt());
        let scaled = DMatrix::from_fn(q, q, |i, j| entry(i, j) / (scale[i] * scale[j]));
        let root = scaled.cholesky().ok_or_else(|| {
            Error::input(
                "the prior's covariance is not positive",
                "make the prior again from a larger fleet: sagnac fleet prior FLEET/ -o fleet.prior.json",
            )
        })?;
        let common_root = DMatrix::from_diagonal(&scale) * root.unpack();
        let inverse = matrix.try_inverse().ok_or_else(other)?;
        let mean = &inverse * DVector::from_column_slice(&prior.mean);
        Ok(Self { mean, root: inverse * &common_root, common_root })
    }

    pub(crate) fn theta(&self, solved: &Solved) -> DVector<f64> {
        &self.mean + &self.root * &solved.z
    }

    /// Of levels, terms and lags.
    pub(crate) fn covariance_of_theta(&self, levels: usize, solved: &Solved) -> DMatrix<f64> {
        let q = self.mean.len();
        let mut map = DMatrix::identity(levels + q, levels + q);
        map.view_mut((levels, levels), (q, q)).copy_from(&self.root);
        &map * &solved.covariance * map.transpose()
    }
}

impl Linear {
    /// About the lags of `taus` and some coefficients of the terms.
    pub(crate) fn about(
        problem: &LeastSquares<'_>,
        terms: &[TermColumn],
        taus: &[Tau],
        of_terms: &[f64],
        known: &Known,
    ) -> Self {
        let design = Design::new(problem, terms, &values(taus));
        let of_term = |term: &TermColumn| -> Vec<f64> {
            (0..problem.len()).map(|row| problem.regressor(term, row, &design.rates)).collect()
        };
        // A lag that is fixed has no column.
        let free = taus.iter().take(known.mean.len() - terms.len());
        let own: Vec<Vec<f64>> =
            terms.iter().map(of_term).chain(free.map(|tau| design.slope_of_lag(tau, of_terms))).collect();
        let mix = |weights: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let mut sum = vec![0.0; problem.len()];
            for (at, column) in own.iter().enumerate() {
                let weight = weights(at);
                sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
            }
            sum
        };
        let at_mean = |at: usize| known.mean[at] - at.checked_sub(terms.len()).map_or(0.0, |lag| taus[lag].value_s);
        let columns = (0..own.len()).map(|z| mix(&|at| known.root[(at, z)])).collect();
        Self { columns, expected: mix(&at_mean) }
    }

    /// The rows whitened by some noise, reduced.
    pub(crate) fn factor(&self, problem: &LeastSquares<'_>, noise: SlowNoise) -> Factor {
        let whitening = (noise != SlowNoise::default()).then(|| Whitening::new(problem.noise_rows(), noise));
        let mut design = Design::with_rates(problem, &[], Vec::new());
        (design.whitening, design.expected) = (whitening.as_ref(), Some(self.expected.as_slice()));
        design.factor(&self.columns).factor
    }

    /// The best z at some noise, whose white variance is that of the residual where none is given.
    pub(crate) fn solved(
        &self,
        problem: &LeastSquares<'_>,
        (noise, white): (SlowNoise, Option<f64>),
    ) -> Option<Solved> {
        let (levels, q) = (problem.levels().len(), self.columns.len());
        let factor = self.factor(problem, noise);
        let block = factor.beyond(levels);
        let residual = block[(q, q)].powi(2) / (problem.len() - levels - q) as f64;
        let svd = block.view((0, 0), (q, q)).into_owned().svd(true, true);
        let along = svd.u?.transpose() * block.view((0, q), (q, 1)).column(0);
        let at = |variance: f64| -> Option<(DVector<f64>, DMatrix<f64>)> {
            let mut of_prior = DMatrix::zeros(q, levels + q + 1);
            of_prior.view_mut((0, levels), (q, q)).fill_with_identity();
            let both = [factor.scaled(variance.sqrt().recip()), Factor::of(of_prior)];
            let whole = FactoredColumns { factor: Factor::join(both.iter())?, count: levels + q };
            let solution = whole.solve_all()?;
            let covariance = solution.inverse_normal()?;
            Some((solution.theta, covariance))
        };
        let mut variance = white.unwrap_or(residual);
        let (mut theta, mut covariance) = at(variance)?;
        if white.is_none() && noise == SlowNoise::default() {
            // Correlation that the slow noise does not have is a part of the variance, as in the fit without a prior.
            let rho = self.autocorrelation(problem, &theta);
            variance *= (1.0 + rho) / (1.0 - rho);
            (theta, covariance) = at(variance)?;
        }
        Some(Solved {
            levels: theta.rows(0, levels).into_owned(),
            z: theta.rows(levels, q).into_owned(),
            covariance,
            variance,
            singular: svd.singular_values,
            along,
            directions: svd.v_t?.transpose(),
        })
    }

    /// γ/σ of one more column, of which nothing is known before; `None` where the others explain it whole.
    pub(crate) fn added_column(
        &self,
        problem: &LeastSquares<'_>,
        column: Vec<f64>,
        noise: SlowNoise,
        variance: f64,
    ) -> Option<f64> {
        let (levels, q) = (problem.levels().len(), self.columns.len());
        let columns: Vec<Vec<f64>> = self.columns.iter().cloned().chain([column]).collect();
        let more = Self { columns, expected: self.expected.clone() };
        let mut of_prior = DMatrix::zeros(q, levels + q + 2);
        of_prior.view_mut((0, levels), (q, q)).fill_with_identity();
        let both = [more.factor(problem, noise).scaled(variance.sqrt().recip()), Factor::of(of_prior)];
        let whole = FactoredColumns { factor: Factor::join(both.iter())?, count: levels + q + 1 };
        let solution = whole.solve_all()?;
        let covariance = solution.inverse_normal()?;
        let sigma = covariance[(levels + q, levels + q)].sqrt();
        Some(solution.theta[levels + q] / sigma).filter(|in_sigma| in_sigma.is_finite())
    }

    pub(crate) fn autocorrelation(&self, problem: &LeastSquares<'_>, theta: &DVector<f64>) -> f64 {
        let levels = problem.levels().len();
        let residual = |row: usize| {
            let of_levels: f64 =
                problem.levels().iter().zip(theta).map(|(level, value)| problem.level(row, *level) * value).sum();
            let of_z: f64 = self.columns.iter().enumerate().map(|(z, column)| column[row] * theta[levels + z]).sum();
            (problem.y[row] - self.expected[row] - of_levels - of_z) * problem.weight[row].sqrt()
        };
        lag_one(problem, &(0..problem.len()).map(residual).collect::<Vec<_>>())
    }
}

/// The fit at some noise, linear about its own lags.
pub(crate) fn settled(
    problem: &LeastSquares<'_>,
    terms: &[TermColumn],
    taus: &mut [Tau],
    known: &Known,
    noise: (SlowNoise, Option<f64>),
) -> Option<(Linear, Solved)> {
    let p = terms.len();
    let [shortest_s, longest_s] = [problem.period_s(), problem.longest_run_s()];
    let set = |taus: &mut [Tau], theta: &DVector<f64>| {
        let mut moved = false;
        for (tau, value_s) in taus.iter_mut().zip(theta.iter().skip(p)) {
            let value_s = value_s.clamp(shortest_s, longest_s.max(shortest_s));
            moved |= (value_s - tau.value_s).abs() > STILL * value_s;
            tau.value_s = value_s;
        }
        moved
    };
    let mut theta = known.mean.clone();
    set(taus, &theta);
    for sweep in 1.. {
        let linear = Linear::about(problem, terms, taus, &theta.as_slice()[..p], known);
        let solved = linear.solved(problem, noise)?;
        theta = known.theta(&solved);
        if !set(taus, &theta) || sweep == MOST_SWEEPS {
            return Some((linear, solved));
        }
    }
    None
}

/// Directions in which units scatter by this part of the noise or more.
pub(crate) fn shown(solved: &Solved, part: f64) -> Vec<usize> {
    let least = part * solved.variance.sqrt();
    (0..solved.singular.len()).filter(|at| solved.singular[*at] > least).collect()
}
