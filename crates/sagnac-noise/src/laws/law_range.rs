//! From which τ on the five laws hold: below it a low-pass filter, repeated readings, a dither or a beat shape the curve.
//!
//! ```text
//! y = X·β + e        y: σ²(τ)/f(τ) − 1 at neighbouring octaves, f the fitted terms
//!                    X: 1/τ², 1/τ and the slower terms that the fit found, each over f
//!                    e: the errors of an overlapping curve, with their correlation ([`crate::freedom`])
//! described: eᵀC⁻¹e of the generalised fit is below its bound by χ²
//! ```
//!
//! The laws hold from the first octave on whose five describe themselves and whose whole curve is described.
//!
//! Rows that remember each other for a time M follow σ² = N²/τ − c/τ² exactly from τ = M on, so that the coefficient of 1/τ² may
//! have any sign here. One below zero is a filter's: no quantization makes a curve rise slower than N²/τ towards short τ.
//!
//! Fails where fewer than four octaves have eight degrees of freedom: such a curve tells no filter from noise, and counts as
//! unfiltered.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::freedom::Record;
use crate::laws::terms::{AllanTerm, FittedTerms, Point};

/// Octaves that are judged together, and the fewest that can be.
const OCTAVES: usize = 5;
const FEWEST: usize = 4;
/// Degrees of freedom from which on the error of a variance is near normal.
const LEAST_EDF: f64 = 8.0;
/// Part of sound curves that begin an octave late, by either judgement.
const FALSE_ALARM: f64 = 0.002;
/// Standard errors below zero from which on the coefficient of 1/τ² is a filter's.
const BELOW_ZERO: f64 = 3.0;
/// Part of a point's variance that no other point has: a walk makes neighbouring points one to all digits.
const OF_ITS_OWN: f64 = 1e-4;
/// Largest condition of the columns: terms that cannot be told apart count as one.
const LEAST_PIVOT: f64 = 1e-10;

/// A curve next to the fitted laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Agreement {
    /// The laws describe it.
    pub(crate) holds: bool,
    /// The coefficient of 1/τ² is below zero by more than chance, by the shortest octaves.
    pub(crate) below_zero: bool,
    /// Standard error of the coefficient of 1/τ, by the whole curve where it can be judged, else by its head.
    pub(crate) n2_sigma: f64,
}

impl Agreement {
    /// `None` where too few points can be judged.
    /// `uncertain` is 1/edf of each point that no other shares.
    pub(crate) fn of(
        points: &[Point],
        multiples: &[f64],
        uncertain: &[f64],
        fitted: &FittedTerms,
        record: &Record<'_>,
    ) -> Option<Self> {
        let is_judged = |(p, own): &(&Point, &f64)| (p.edf.recip() - *own).recip() >= LEAST_EDF;
        let judged = points.iter().zip(uncertain).take_while(is_judged).count();
        let curve = |octaves: usize| Curve {
            points: &points[..octaves],
            multiples: &multiples[..octaves],
            uncertain: &uncertain[..octaves],
            fitted,
        };
        // The slow terms bend the shortest octaves together; over the whole curve each has its own slope.
        let slow = |tau_s: f64| SLOW.map(|term| fitted.coefficient(term) * term.variance(tau_s)).iter().sum();
        let head = curve(judged.min(OCTAVES)).generalised(record, &[&slow])?;
        let each = SLOW.map(|term| move |tau_s: f64| term.variance(tau_s));
        let whole = curve(judged).generalised(record, &each.each_ref().map(|of| of as &dyn Fn(f64) -> f64));
        Some(Self {
            holds: head.is_chance() && whole.as_ref().is_none_or(Generalised::is_chance),
            below_zero: head.q2 < -BELOW_ZERO * head.q2_sigma,
            n2_sigma: whole.as_ref().map_or(head.n2_sigma, |whole| whole.n2_sigma),
        })
    }
}

/// Terms that are not below zero whatever shapes short τ.
const SLOW: [AllanTerm; 3] = [AllanTerm::BiasInstability, AllanTerm::RateRandomWalk, AllanTerm::RateRamp];

/// A part of a curve with the terms that were fitted to it.
struct Curve<'a> {
    points: &'a [Point],
    multiples: &'a [f64],
    uncertain: &'a [f64],
    fitted: &'a FittedTerms,
}

/// Generalised least squares of a part of a curve.
struct Generalised {
    /// eᵀC⁻¹e.
    rest: f64,
    freedom: usize,
    /// Coefficient of 3/τ², and its standard error.
    q2: f64,
    q2_sigma: f64,
    /// Standard error of that of 1/τ.
    n2_sigma: f64,
}

impl Curve<'_> {
    /// 1/τ² and 1/τ of any sign, and `slow` columns, none of which is below zero.
    fn generalised(&self, record: &Record<'_>, slow: &[&dyn Fn(f64) -> f64]) -> Option<Generalised> {
        let size = self.points.len();
        let model: Vec<f64> = self.points.iter().map(|p| self.fitted.variance(p.tau_s)).collect();
        if size < FEWEST || model.iter().any(|f| f.is_nan() || *f <= 0.0) {
            return None;
        }
        let mut covariance = DMatrix::zeros(size, size);
        for (i, j) in (0..size).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            let shared = record.covariance(self.multiples[j], self.multiples[i]) / (model[i] * model[j]);
            let all = if i == j { shared * (1.0 + OF_ITS_OWN) + 2.0 * self.uncertain[i] } else { shared };
            (covariance[(i, j)], covariance[(j, i)]) = (all, all);
        }
        let errors = covariance.cholesky()?.l();
        // Over the model, whitened, of unit length; and the length before.
        let whitened = |of: &dyn Fn(usize) -> f64| {
            let values = DVector::from_fn(size, |at, _| of(at) / model[at]);
            errors.solve_lower_triangular(&values)
        };
        let column = |of: &dyn Fn(f64) -> f64| {
            let column = whitened(&|at| of(self.points[at].tau_s))?;
            let length = column.norm();
            (length > 0.0).then(|| (column / length, length))
        };
        let y = whitened(&|at| self.points[at].variance)?;
        let quantization = column(&|tau_s| AllanTerm::Quantization.variance(tau_s))?;
        let walk = column(&|tau_s| AllanTerm::AngleRandomWalk.variance(tau_s))?;
        let mut columns = vec![quantization.0, walk.0];
        columns.extend(slow.iter().filter_map(|of| column(of)).map(|(column, _)| column));
        loop {
            let x = DMatrix::from_columns(&columns);
            let factor = (x.transpose() * &x).cholesky()?;
            if factor.l().diagonal().iter().any(|pivot| pivot * pivot < LEAST_PIVOT) {
                return None;
            }
            let beta = factor.solve(&(x.transpose() * &y));
            let below = (2..columns.len()).filter(|at| beta[*at] < 0.0).min_by(|a, b| beta[*a].total_cmp(&beta[*b]));
            if let Some(below) = below {
                columns.remove(below);
                continue;
            }
            let inverse = factor.inverse();
            return Some(Generalised {
                rest: (&y - &x * &beta).norm_squared(),
                freedom: size.saturating_sub(columns.len()),
                q2: beta[0] / quantization.1,
                q2_sigma: inverse[(0, 0)].sqrt() / quantization.1,
                n2_sigma: inverse[(1, 1)].sqrt() / walk.1,
            });
        }
    }
}

impl Generalised {
    fn is_chance(&self) -> bool {
        let chance = ChiSquared::new(self.freedom as f64).map(|chi| chi.inverse_cdf(1.0 - FALSE_ALARM));
        chance.map_or(true, |bound| self.rest <= bound)
    }
}
