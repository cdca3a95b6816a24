//! The regressors of a model at given lags, and what least squares makes of them.
//!
//! ```text
//! y = levels + Σ cⱼ·column_j(lags)        min Σ w·(y − …)²        w: length of a window, or rows whitened by the slow noise
//! ```
//!
//! For given lags the model is linear. Lags are searched for by [`super::solution`], pairs of them by [`crate::fit::one_model::two_lags`].

use crate::fit::one_model::reduce::{Weighting, reduce};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::{Rates, TermColumn};
use crate::noise_model::factor::{Factor, RunColumns, RunReducer, Solution};
use crate::noise_model::likelihood::{Block, RestrictedLikelihood, Rows, mean};
use crate::noise_model::processes::NoiseRows;
use crate::noise_model::whitening::Whitening;
use nalgebra::DMatrix;

/// τ counts as resolved unless misfits within this Δχ² of the least reach an end of the search: two standard errors.
pub(crate) const FLAT_CHI_SQUARED: f64 = 4.0;
/// ln τ is found to within this.
pub(crate) const LN_TAU_TOLERANCE: f64 = 1e-5;

/// τ of the rate terms of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tau {
    /// Place of the input.
    pub(crate) input: usize,
    pub(crate) value_s: f64,
    pub(crate) resolved: bool,
}

/// The regressors of some terms at some lags.
pub(crate) struct Design<'a> {
    pub(crate) problem: &'a LeastSquares<'a>,
    pub(crate) terms: &'a [TermColumn],
    pub(crate) rates: Rates,
    /// Rows become innovations of it; else they are weighted by their lengths.
    pub(crate) whitening: Option<&'a Whitening>,
    /// What is subtracted from y, row by row.
    pub(crate) expected: Option<&'a [f64]>,
}

impl<'a> Design<'a> {
    pub(crate) fn new(problem: &'a LeastSquares<'a>, terms: &'a [TermColumn], taus: &[(usize, f64)]) -> Self {
        Self::with_rates(problem, terms, problem.rates(taus))
    }

    pub(crate) fn with_rates(problem: &'a LeastSquares<'a>, terms: &'a [TermColumn], rates: Rates) -> Self {
        Self { problem, terms, rates, whitening: None, expected: None }
    }

    /// Sum of squares of the residuals at the best coefficients; infinite where there are none.
    pub(crate) fn misfit(&self) -> f64 {
        self.solve_shared(&[]).map_or(f64::INFINITY, |(_, solution)| solution.ssr)
    }

    /// The best coefficients of the terms and of further columns behind them, whatever those of the levels are.
    pub(crate) fn solve_terms(&self, slopes: &[Vec<f64>]) -> Option<Vec<f64>> {
        let (shared, solution) = self.solve_shared(slopes)?;
        Some(solution.theta.iter().copied().skip(shared).collect())
    }

    /// The fit next to the levels that runs do not have for themselves, and how many these are.
    fn solve_shared(&self, slopes: &[Vec<f64>]) -> Option<(usize, Solution)> {
        let columns = self.problem.run_columns();
        let shared = columns.shared.len();
        let all: Vec<usize> = (0..shared + self.terms.len() + slopes.len()).collect();
        Some((shared, self.reducer(&columns, slopes).finish_shared().solve(&all)?))
    }

    /// The best coefficients.
    pub(crate) fn solve(&self) -> Option<Vec<f64>> {
        self.factor(&[]).solve_all().map(|solution| solution.theta.iter().copied().collect())
    }

    /// Residuals, each times the root of its weight.
    pub(crate) fn weighted_residuals(&self, theta: &[f64]) -> Vec<f64> {
        self.residuals(theta).iter().zip(&self.problem.weight).map(|(r, w)| r * w.sqrt()).collect()
    }

    /// ∂y/∂τ of a lag at some coefficients of the terms, by central difference over ±1 %.
    pub(crate) fn slope_of_lag(&self, tau: &Tau, of_terms: &[f64]) -> Vec<f64> {
        let step = 0.01 * tau.value_s;
        let own: Vec<(usize, &TermColumn)> =
            self.terms.iter().enumerate().filter(|(_, term)| term.input == tau.input && term.form.times_rate).collect();
        let made_at = |tau_s: f64| -> Vec<f64> {
            let rates = self.problem.rates(&[(tau.input, tau_s)]);
            let of_row =
                |row| own.iter().map(|(at, term)| of_terms[*at] * self.problem.regressor(term, row, &rates)).sum();
            (0..self.problem.len()).map(of_row).collect()
        };
        let (above, below) = (made_at(tau.value_s + step), made_at(tau.value_s - step));
        above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)).collect()
    }

    /// Levels, terms and the ∂y/∂τ of a row.
    pub(crate) fn row(&self, row: usize, slopes: &[Vec<f64>], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.problem.levels().iter().map(|level| self.problem.level(row, *level)));
        out.extend(self.terms.iter().map(|term| self.problem.regressor(term, row, &self.rates)));
        out.extend(slopes.iter().map(|slope| slope[row]));
    }

    /// All rows as a factor, with ∂y/∂τ as last columns if given.
    pub(crate) fn factor(&self, slopes: &[Vec<f64>]) -> FactoredColumns {
        let count = self.problem.levels().len() + self.terms.len() + slopes.len();
        FactoredColumns { factor: self.reducer(&self.problem.run_columns(), slopes).finish(), count }
    }

    /// All rows run by run, with what [`Self::factor`] says.
    fn reducer<'c>(&self, columns: &'c RunColumns, slopes: &[Vec<f64>]) -> RunReducer<'c> {
        let weighting = self.whitening.map_or(Weighting::Lengths, Weighting::Whitened);
        let add = |i: usize, row: &mut Vec<f64>| self.add_to(i, slopes, row);
        reduce(self.problem, columns, self.terms.len() + slopes.len(), weighting, None, add).swap_remove(0)
    }

    /// The rows, not whitened, for many noises; many of them averaged.
    pub(crate) fn likelihood(&self, slopes: &[Vec<f64>]) -> Option<RestrictedLikelihood> {
        let all = self.problem.noise_rows();
        let levels = self.problem.run_columns();
        let by_run = !levels.own.iter().all(Vec::is_empty);
        let mut first = 0;
        let block = |of: &[usize]| {
            let own = first..first + of.len();
            first = own.end;
            let (middle_s, weight) = (&all.middle_s[own.clone()], &all.weight[own.clone()]);
            let (rows, groups) = Rows::averaged(NoiseRows { run: of, middle_s, weight, ..all }, all.len());
            let (mut row, mut of_group, mut values) = (Vec::new(), Vec::new(), Vec::new());
            for group in &groups {
                of_group.clear();
                for i in group.clone() {
                    let i = own.start + i;
                    row.clear();
                    row.extend(levels.of(of[0]).map(|level| self.problem.level(i, self.problem.levels()[level])));
                    self.add_to(i, slopes, &mut row);
                    of_group.extend_from_slice(&row);
                }
                let value = |i: usize, j: usize| of_group[(i - group.start) * row.len() + j];
                values.extend((0..row.len()).map(|j| mean(weight, group, |i| value(i, j))));
            }
            let columns = DMatrix::from_row_slice(groups.len(), row.len(), &values);
            Block { rows, own: levels.own_of(of[0]).len(), columns }
        };
        RestrictedLikelihood::of(all.run.chunk_by(|a, b| a == b || !by_run).map(block).collect())
    }

    /// Appends terms and further columns of a row, then y.
    fn add_to(&self, i: usize, slopes: &[Vec<f64>], row: &mut Vec<f64>) {
        row.extend(self.terms.iter().map(|term| self.problem.regressor(term, i, &self.rates)));
        row.extend(slopes.iter().map(|slope| slope[i]));
        row.push(self.problem.y[i] - self.expected.map_or(0.0, |expected| expected[i]));
    }

    pub(crate) fn residuals(&self, theta: &[f64]) -> Vec<f64> {
        let problem = self.problem;
        let columns = problem.run_columns();
        let (of_levels, of_terms) = theta.split_at(problem.levels().len());
        let model_at = |row: usize| {
            let level = |column: usize| problem.level(row, problem.levels()[column]) * of_levels[column];
            let term = |(term, value): (&TermColumn, &f64)| problem.regressor(term, row, &self.rates) * value;
            columns.of(problem.run[row]).map(level).chain(self.terms.iter().zip(of_terms).map(term)).sum::<f64>()
        };
        (0..problem.len()).map(|row| problem.y[row] - model_at(row)).collect()
    }
}

pub(crate) struct FactoredColumns {
    pub(crate) factor: Factor,
    pub(crate) count: usize,
}

impl FactoredColumns {
    pub(crate) fn solve_all(&self) -> Option<Solution> {
        self.factor.solve(&(0..self.count).collect::<Vec<_>>())
    }
}

pub(crate) fn misfit(problem: &LeastSquares<'_>, terms: &[TermColumn], taus_s: &[(usize, f64)]) -> f64 {
    Design::new(problem, terms, taus_s).misfit()
}

/// Lag-one correlation of neighbouring residuals of a run, with Kendall's (1954) correction for the
/// small-sample bias; within 0 … 0.99.
pub(crate) fn lag_one(problem: &LeastSquares<'_>, scaled: &[f64]) -> f64 {
    let square: f64 = scaled.iter().map(|r| r * r).sum();
    let product: f64 =
        (1..scaled.len()).filter(|i| problem.run[*i] == problem.run[i - 1]).map(|i| scaled[i] * scaled[i - 1]).sum();
    if square == 0.0 {
        return 0.0;
    }
    let raw = product / square;
    (raw + (1.0 + 3.0 * raw.max(0.0)) / scaled.len() as f64).clamp(0.0, 0.99)
}

/// Effective number of windows for residuals of lag-one autocorrelation ρ.
pub(crate) fn effective_windows(windows: usize, rho: f64) -> f64 {
    (windows as f64 * (1.0 - rho) / (1.0 + rho)).max(2.0)
}
