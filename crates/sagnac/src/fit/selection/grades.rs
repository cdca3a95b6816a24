//! Which model of the grid explains the rows with the fewest coefficients.
//!
//! ```text
//! grade of a model at a τ    g = SSR/s² + k·max(5, ln n − 2) + 1.5·j        s² of the largest model, j the order of the rate series;
//!                                                                    2·ln of the τ tried next to it
//! ```
//!
//! Over the models of the thermometer of the fit alone. Fails where the residual of the largest model is not nearly white: a grade
//! mistakes what no model explains for noise.

use crate::fit::one_model::reduce::{Weighting, reduce};
use crate::fit::problem::lag::RATE_COLUMNS;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::selection::folds::columns_of_grid;
use crate::fit::selection::prices::{RATE_SLOPE_PRICE, WEIGHT_PRICE, price};
use crate::model::basis::BASIS_LEN;
use crate::model::spec::ModelSpec;
use crate::noise_model::factor::{Factor, RunColumns, Solution};
use crate::noise_model::whitening::Whitening;
use rayon::prelude::*;

/// A model at a τ of the grid, fitted to the whitened rows.
pub(crate) struct Graded {
    /// Index among the specs.
    pub(crate) spec: usize,
    /// What its coefficients cost in the grade, and in the weight.
    pub(crate) price: f64,
    pub(crate) weight_price: f64,
    pub(crate) solution: Solution,
}

/// Every model at every τ, and the variance of a row.
pub(crate) struct Grades {
    pub(crate) all: Vec<Graded>,
    pub(crate) variance: f64,
}

impl Grades {
    /// Of some specs the one of the least grade at its best τ.
    pub(crate) fn best(&self, members: &[usize]) -> Option<usize> {
        let graded = self.all.iter().filter(|graded| members.contains(&graded.spec));
        let grade = |graded: &Graded| graded.solution.ssr / self.variance + graded.price;
        graded.min_by(|a, b| grade(a).total_cmp(&grade(b))).map(|graded| graded.spec)
    }

    /// The least grade for a variance of a row.
    pub(crate) fn least(&self, variance: f64) -> f64 {
        self.all.iter().map(|graded| graded.solution.ssr / variance + graded.price).fold(f64::INFINITY, f64::min)
    }
}

/// Whitened rows of the series over one thermometer: shared levels, b₁…b₈, c₀…c₃, e₁… and y, at every τ; what a run has for itself is
/// projected out.
pub(crate) struct WhitenedSeries<'a> {
    specs: &'a [ModelSpec],
    factors: Vec<Factor>,
    /// Levels in the factors, and those projected out.
    levels: usize,
    of_runs: usize,
    rows: f64,
}

impl<'a> WhitenedSeries<'a> {
    /// Of the models and lags that may be graded; `None` without any.
    pub(crate) fn new(
        problem: &LeastSquares<'_>,
        whitening: &Whitening,
        specs: &'a [ModelSpec],
        taus_s: &[f64],
        columns: &RunColumns,
    ) -> Option<Self> {
        let scales = specs.iter().map(|spec| usize::from(spec.thermometer().scale)).max()?;
        let rated = specs.iter().any(is_rated);
        let taus_s = if rated { taus_s } else { taus_s.get(..1)? };
        let factors =
            taus_s.par_iter().map(|tau_s| factor(problem, whitening, *tau_s, rated, scales, columns)).collect();
        let (levels, of_runs) = (columns.shared.len(), problem.levels().len() - columns.shared.len());
        Some(Self { specs, factors, levels, of_runs, rows: problem.len() as f64 })
    }

    /// Grades of all models with some of the shared levels, by their places among these, and all that runs have for themselves.
    pub(crate) fn grades(&self, levels: &[usize]) -> Option<Grades> {
        let solved: Vec<(usize, Solution)> = self
            .specs
            .par_iter()
            .enumerate()
            .flat_map_iter(|(at, spec)| {
                let columns = columns_of_grid(spec, levels, self.levels);
                let taus = if is_rated(spec) { self.factors.len() } else { 1 };
                let solved = self.factors[..taus].iter().filter_map(|factor| factor.solve(&columns));
                solved.map(|solution| (at, solution)).collect::<Vec<_>>()
            })
            .collect();
        let least = solved.iter().map(|(_, solution)| solution.ssr).fold(f64::INFINITY, f64::min);
        let most = self.of_runs + levels.len() + self.specs.iter().map(ModelSpec::coefficients).max()?;
        let variance = least / (self.rows - most as f64).max(1.0);
        let graded = |(spec, solution): (usize, Solution)| {
            let lags = usize::from(is_rated(&self.specs[spec]));
            // A τ of the grid is one of several that a rate term may have.
            let of_tau = if lags > 0 { 2.0 * (self.factors.len() as f64).ln() } else { 0.0 };
            let coefficients = (self.specs[spec].coefficients() - lags) as f64;
            let slopes = f64::from(self.specs[spec].thermometer().rate.unwrap_or(0));
            let price = of_tau + coefficients * price(self.rows) + slopes * RATE_SLOPE_PRICE;
            Graded { spec, price, weight_price: of_tau + coefficients * WEIGHT_PRICE, solution }
        };
        Some(Grades { all: solved.into_iter().map(graded).collect(), variance })
    }

    /// The part of a level's variation beyond some others that the bias series explains, 0 to 1; `None` for one without variation.
    pub(crate) fn explained_by_bias(&self, level: usize, others: &[usize]) -> Option<f64> {
        let factor = self.factors.first()?;
        let whole = factor.regress(level, others)?.ssr;
        let bias: Vec<usize> = others.iter().copied().chain(self.levels..self.levels + BASIS_LEN - 1).collect();
        Some(1.0 - factor.regress(level, &bias)?.ssr / whole).filter(|_| whole > 0.0)
    }
}

fn is_rated(spec: &ModelSpec) -> bool {
    spec.thermometer().rate.is_some()
}

/// Grades models of the series over one thermometer.
pub(crate) fn grade(
    problem: &LeastSquares<'_>,
    whitening: &Whitening,
    specs: &[ModelSpec],
    taus_s: &[f64],
) -> Option<Grades> {
    let columns = problem.run_columns();
    let levels: Vec<usize> = (0..columns.shared.len()).collect();
    WhitenedSeries::new(problem, whitening, specs, taus_s, &columns)?.grades(&levels)
}

/// Shared levels, b₁…b₈, c₀…c₃, e₁… and y of all rows, whitened.
fn factor(
    problem: &LeastSquares<'_>,
    whitening: &Whitening,
    tau_s: f64,
    rated: bool,
    scales: usize,
    columns: &RunColumns,
) -> Factor {
    let rates = if rated { problem.rate_columns(0, tau_s) } else { vec![[0.0; RATE_COLUMNS]; problem.len()].into() };
    let add = |i: usize, row: &mut Vec<f64>| {
        row.extend_from_slice(&problem.inputs[0].basis[i][1..]);
        row.extend_from_slice(&rates[i]);
        row.extend((1..=scales).map(|k| problem.scale_column(0, i, k)));
        row.push(problem.y[i]);
    };
    let further = BASIS_LEN - 1 + RATE_COLUMNS + scales;
    reduce(problem, columns, further, Weighting::Whitened(whitening), None, add).swap_remove(0).finish_shared()
}
