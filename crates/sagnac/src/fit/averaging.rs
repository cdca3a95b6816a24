//! Which model of the grid explains the rows with the fewest coefficients; and what selecting it, and a lag that the data do not
//! resolve, add to the uncertainty of the curve.
//!
//! ```text
//! grade of a model at a τ    g = SSR/s² + k·max(5, ln n − 2) + 1.5·j        s² of the largest model, j the order of the rate series;
//!                                                                    2·ln of the τ tried beside it
//! weight                     w ∝ exp(−½·(SSR/s² + 2.5·k))           near Akaike's, so that a term that was nearly selected counts
//! variance at T              Σ w·(var_m(T) + (d_m(T) − d(T))²)      d the selected curve, d_m and var_m those of the others
//! ```
//!
//! after Buckland, Burnham and Augustin (1997): an interval that knows only the selected model holds the truth too rarely, for
//! a term that was nearly selected is in no coefficient. Where one model explains the data alone the sum is its own
//! variance.
//!
//! Over the models of the thermometer of the fit alone.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::calibration::CurveSpread;
use crate::fit::entanglement::{POINTS, temperature};
use crate::fit::folds::columns_of_grid;
use crate::fit::lag::RATE_COLUMNS;
use crate::fit::least_squares::LeastSquares;
use crate::fit::search::CONDITION_MAX;
use crate::fit::slow_noise::Whitening;
use crate::fit::solve::{Factor, RunColumns, RunReducer, Solution};
use crate::model::basis::{BASIS_LEN, chebyshev};
use crate::model::spec::ModelSpec;

/// Price of a coefficient, at least and below ln n.
const LEAST_PRICE: f64 = 5.0;
const PRICE_LESS: f64 = 2.0;
/// What an order of the rate series costs more than one of the bias: beside a curve and a rate term it is one more of many that
/// noise may fit. Without it they were 5 % of all selections.
const RATE_SLOPE_PRICE: f64 = 1.5;
/// Price of a coefficient in the weights (2 is Akaike's): a term that was nearly selected counts.
pub(crate) const WEIGHT_PRICE: f64 = 2.5;
/// Models of less weight are not looked at.
const LEAST_WEIGHT: f64 = 1e-4;

/// What the curve may be in place of the selected one.
pub(crate) struct Rival {
    /// A model, or words for a curve that is none.
    pub(crate) name: String,
    /// −2·ln of its weight.
    pub(crate) criterion: f64,
    /// Value, °/h, and variance at every temperature of a spread, less those at the reference.
    pub(crate) curve: Vec<(f64, f64)>,
}

/// A model at a τ of the grid, fitted to the whitened rows.
struct Graded {
    /// Index among the specs.
    spec: usize,
    /// What its coefficients cost in the grade, and in the weight.
    price: f64,
    weight_price: f64,
    solution: Solution,
}

/// Every model at every τ, and the variance of a row.
pub(crate) struct Grades {
    all: Vec<Graded>,
    pub(crate) variance: f64,
}

impl Grades {
    /// Of some specs the one of the least grade at its best τ.
    pub(crate) fn best(&self, of: &[usize]) -> Option<usize> {
        let graded = self.all.iter().filter(|graded| of.contains(&graded.spec));
        let grade = |graded: &Graded| graded.solution.ssr / self.variance + graded.price;
        graded.min_by(|a, b| grade(a).total_cmp(&grade(b))).map(|graded| graded.spec)
    }

    /// The least grade for a variance of a row.
    pub(crate) fn least(&self, variance: f64) -> f64 {
        self.all.iter().map(|graded| graded.solution.ssr / variance + graded.price).fold(f64::INFINITY, f64::min)
    }
}

/// What a coefficient costs: Δχ² = 5, 2.2 of its standard errors, and growing with the logarithm of the windows, so that the
/// selection is consistent.
pub(crate) fn price(windows: f64) -> f64 {
    (windows.ln() - PRICE_LESS).max(LEAST_PRICE)
}

/// Whitened rows of the series over one thermometer: shared levels, b₁…b₈, c₀…c₃, e₁… and y, at every τ; what a run has for itself is
/// projected out.
pub(crate) struct Series<'a> {
    specs: &'a [ModelSpec],
    factors: Vec<Factor>,
    /// Levels in the factors, and those projected out.
    levels: usize,
    of_runs: usize,
    rows: f64,
}

impl<'a> Series<'a> {
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
        let (levels, of_runs) = (columns.shared.len(), problem.levels.len() - columns.shared.len());
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
    Series::new(problem, whitening, specs, taus_s, &columns)?.grades(&levels)
}

/// σ that rivals add to a curve, which gives value and variance at a temperature; `None` where there is nothing beside it.
pub(crate) fn spread(
    problem: &LeastSquares<'_>,
    rivals: &[Rival],
    curve: impl Fn(f64) -> (f64, f64),
) -> Option<CurveSpread> {
    let best = rivals.iter().map(|rival| rival.criterion).fold(f64::INFINITY, f64::min);
    let weighted = rivals.iter().map(|rival| ((0.5 * (best - rival.criterion)).exp(), &rival.curve));
    let near: Vec<(f64, &Vec<(f64, f64)>)> = weighted.filter(|(weight, _)| *weight > LEAST_WEIGHT).collect();
    let total: f64 = near.iter().map(|(weight, _)| weight).sum();
    let at = |point: usize| {
        let celsius = temperature(problem, point);
        let (drift_dph, own) = curve(celsius);
        let of = |(weight, curve): &(f64, &Vec<(f64, f64)>)| {
            let (value, variance) = curve[point];
            weight / total * (variance + (value - drift_dph).powi(2))
        };
        let sum: f64 = near.iter().map(of).sum();
        (celsius, (sum - own).max(0.0).sqrt())
    };
    let (temperature_c, sigma_dph): (Vec<f64>, Vec<f64>) = (0..POINTS).map(at).unzip();
    (near.len() > 1 && sigma_dph.iter().all(|sigma| sigma.is_finite()))
        .then_some(CurveSpread { temperature_c, sigma_dph })
}

impl Grades {
    /// The series as rivals, without those of hardly any weight.
    pub(crate) fn rivals(self, problem: &LeastSquares<'_>, specs: &[ModelSpec]) -> Vec<Rival> {
        let (variance, levels) = (self.variance, problem.run_columns().shared.len());
        let criterion = |graded: &Graded| graded.solution.ssr / variance + graded.weight_price;
        let best = self.all.iter().map(criterion).fold(f64::INFINITY, f64::min);
        let rival = |graded: Graded| {
            let criterion = criterion(&graded);
            let near = (0.5 * (best - criterion)).exp() > LEAST_WEIGHT;
            // A model that could not be selected, because its terms explain each other, is no rival.
            let conditioning = if near { graded.solution.conditioning(levels, &[]) } else { None };
            let near = near && conditioning.is_none_or(|found| found.condition <= CONDITION_MAX);
            let normal = near.then(|| graded.solution.inverse_normal()).flatten()?;
            let bias = usize::from(specs[graded.spec].thermometer().bias);
            let curve = of_series(problem, &graded.solution.theta, &normal, levels..levels + bias);
            let name = format!("`{}`", specs[graded.spec]);
            Some(Rival { name, criterion, curve: curve.map(|(value, own)| (value, variance * own)).collect() })
        };
        self.all.into_iter().filter_map(rival).collect()
    }
}

/// The bias series in some columns at every temperature of a spread, less that at the reference: value, and variance in units of s².
fn of_series<'a>(
    problem: &'a LeastSquares<'_>,
    theta: &'a DVector<f64>,
    normal: &'a DMatrix<f64>,
    columns: Range<usize>,
) -> impl Iterator<Item = (f64, f64)> + 'a {
    let span = problem.span();
    let at_reference = chebyshev(span.x(problem.inputs[0].reference));
    (0..POINTS).map(move |point| {
        let here = chebyshev(span.x(temperature(problem, point)));
        let weight = |column: usize| {
            let order = column - columns.start + 1;
            here[order] - at_reference[order]
        };
        let value = columns.clone().map(|column| weight(column) * theta[column]).sum();
        let mut square = 0.0;
        for i in columns.clone() {
            for j in columns.clone() {
                square += weight(i) * weight(j) * normal[(i, j)];
            }
        }
        (value, square)
    })
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
    let further = BASIS_LEN - 1 + RATE_COLUMNS + scales + 1;
    let width = problem.levels.len() + further;
    let (mut reducer, mut filter) = (RunReducer::new(columns, further), whitening.filter(width));
    let mut row = Vec::with_capacity(width);
    for (i, rates) in rates.iter().enumerate() {
        row.clear();
        row.extend(columns.of(problem.run[i]).map(|level| problem.level(i, problem.levels[level])));
        row.extend_from_slice(&problem.inputs[0].basis[i][1..]);
        row.extend_from_slice(rates);
        row.extend((1..=scales).map(|k| problem.scale_column(0, i, k)));
        row.push(problem.y[i]);
        filter.push(i, &mut row);
        reducer.push(problem.run[i], &row);
    }
    reducer.finish_shared()
}
