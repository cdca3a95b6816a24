//! Cross-validation: every candidate on windows that its fit did not see.
//!
//! With four runs or more one run is held out at a time, otherwise one of twelve contiguous blocks over all runs. The lag
//! filter runs through the held-out rows, and each fold fits τ again. The residual of a held-out block uses the offset of its
//! run; that of a whole run is about its own mean.
//!
//! One R factor per block and τ serves all candidates of the grid: training sets are stacks of the factors of the
//! other blocks, candidates are subsets of columns. A model of several inputs has its own factor per block and set of
//! τ ([`Trial`]). Several lags are optimised in turn, two of one input together, in each fold from the optimum of the whole problem.

use crate::fit::one_model::prepared::{Blocks, PreparedModel};
use crate::fit::one_model::reduce::{InBlocks, Weighting, reduce};
use crate::fit::one_model::two_lags::coarse_pairs;
use crate::fit::problem::lag::RATE_COLUMNS;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::{Rates, TermColumn};
use crate::model::spec::ModelSpec;
use crate::noise_model::factor::{Factor, RunColumns, RunReducer, Solution};
use nalgebra::DVector;
use rayon::prelude::*;
use std::collections::BTreeMap;

const BLOCKS: usize = 12;
const RUNS_TO_LEAVE_ONE_OUT: usize = 4;
const BIAS_COLUMNS: usize = crate::model::basis::BASIS_LEN - 1;

/// How rows are divided, and the columns before the regressors.
struct Division {
    block: Vec<usize>,
    blocks: usize,
    /// Columns before the terms that no run has for itself; none of them where every run is centred instead.
    columns: RunColumns,
    is_centred: bool,
    scheme: &'static str,
}

impl Division {
    fn of(problem: &LeastSquares<'_>) -> Self {
        let (n, runs) = (problem.len(), problem.runs.len());
        if runs >= RUNS_TO_LEAVE_ONE_OUT {
            // On a table the scale factor at T0 and the constant that runs share are learned from the other runs; so are a drift in
            // time and a warm-up.
            let beyond_runs = problem.turning.is_some() || problem.levels().iter().any(|level| level.is_nuisance());
            let columns = if beyond_runs { problem.run_columns() } else { RunColumns::default() };
            return Self {
                block: problem.run.clone(),
                blocks: runs,
                columns,
                is_centred: !beyond_runs,
                scheme: "leave one run out",
            };
        }
        let blocks = BLOCKS.min(n);
        let block = (0..n).map(|i| i * blocks / n).collect();
        let columns = RunColumns { own: Vec::new(), shared: (0..problem.levels().len()).collect() };
        Self { block, blocks, columns, is_centred: false, scheme: "contiguous blocks" }
    }

    /// Levels that the training set of a fold determines, and those that occur in the fold only.
    fn levels_without(&self, problem: &LeastSquares<'_>, fold: usize) -> (Vec<usize>, Vec<usize>) {
        let level_of = |place: usize| problem.levels()[self.columns.shared[place]];
        let is_present = |level: usize, i: usize| problem.level(i, level_of(level)) != 0.0;
        let trained = |level: &usize| (0..problem.len()).any(|i| self.block[i] != fold && is_present(*level, i));
        (0..self.levels()).partition(trained)
    }

    /// The same for [`PreparedModel`].
    fn split(&self) -> Blocks {
        let rows_of = |block: usize| {
            self.block.partition_point(|other| *other < block)..self.block.partition_point(|other| *other <= block)
        };
        let rows = (0..self.blocks).map(rows_of).collect();
        Blocks { rows, columns: self.columns.clone(), is_centred: self.is_centred }
    }

    /// Columns of the factors before the terms.
    fn levels(&self) -> usize {
        self.columns.shared.len()
    }
}

/// How the rows of a problem are divided, and into how many folds.
pub(crate) fn scheme_of(problem: &LeastSquares<'_>) -> (&'static str, usize) {
    let division = Division::of(problem);
    (division.scheme, division.blocks)
}

/// Held-out mean squares, (°/h)², in the order of the candidates; `None` where a fold could not be fitted.
pub(crate) fn cross_validate(problem: &LeastSquares<'_>, candidates: &[ModelSpec], taus_s: &[f64]) -> Vec<Option<f64>> {
    let division = Division::of(problem);
    let scale_orders = candidates.iter().map(|c| usize::from(c.thermometer().scale)).max().unwrap_or(0);
    let with_rate = candidates.iter().any(|c| c.thermometer().rate.is_some());
    // Without a rate term τ does not matter.
    let taus_s = if with_rate { taus_s } else { &taus_s[..1] };
    let factors: Vec<Folds> =
        taus_s.par_iter().map(|tau| block_factors(problem, &division, *tau, with_rate, scale_orders)).collect();
    let folds: Vec<usize> = (0..division.blocks).collect();
    let part = problem.progress.part(format_args!("{} models, each held out", candidates.len()), folds.len());
    let squared = |fold: &usize| {
        let squares = fold_squares(problem, &division, candidates, taus_s, &factors, *fold);
        part.one_more();
        squares
    };
    let squares: Vec<_> = folds.par_iter().map(squared).collect();
    // Added in the order of the folds, independent of the threads.
    let held_out =
        (0..candidates.len()).map(|candidate| squares.iter().map(|fold| fold[candidate]).sum::<Option<f64>>());
    // Weights scale each window to the nominal length, as in the residual σ.
    held_out.map(|sum| sum.map(|sum| sum / problem.len() as f64)).collect()
}

/// Held-out sum of squares of every candidate in one fold; `None` where it could not be fitted.
fn fold_squares(
    problem: &LeastSquares<'_>,
    division: &Division,
    candidates: &[ModelSpec],
    taus_s: &[f64],
    factors: &[Folds],
    fold: usize,
) -> Vec<Option<f64>> {
    let training: Vec<Option<&Factor>> = factors.iter().map(|of_tau| of_tau.without[fold].as_ref()).collect();
    let (known, free) = division.levels_without(problem, fold);
    let squares = candidates.iter().map(|candidate| {
        let columns = columns_of_grid(candidate, &known, division.levels());
        let is_rated = candidate.thermometer().rate.is_some();
        let tau = if is_rated { best_tau(&training[..taus_s.len()], &columns)? } else { 0 };
        let theta = training[tau]?.solve(&columns)?.theta;
        Some(factors[tau].blocks[fold].ssr(&columns, &theta, &free))
    });
    squares.collect()
}

/// The τ of least misfit on the training set.
fn best_tau(training: &[Option<&Factor>], columns: &[usize]) -> Option<usize> {
    let solved = training.iter().enumerate().filter_map(|(i, f)| Some((i, f.as_ref()?.solve(columns)?.ssr)));
    solved.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(i, _)| i)
}

/// Columns of a candidate in the full row: levels, b₁…b₈, c₀…c₃, e₁….
pub(crate) fn columns_of_grid(spec: &ModelSpec, known: &[usize], levels: usize) -> Vec<usize> {
    let bias = levels;
    let rate = bias + BIAS_COLUMNS;
    let scale = rate + RATE_COLUMNS;
    let terms = spec.thermometer();
    let rates = terms.rate.map_or(0, |order| usize::from(order) + 1);
    known
        .iter()
        .copied()
        .chain(bias..bias + usize::from(terms.bias))
        .chain(rate..rate + rates)
        .chain(scale..scale + usize::from(terms.scale))
        .collect()
}

fn block_factors(
    problem: &LeastSquares<'_>,
    division: &Division,
    tau_s: f64,
    with_rate: bool,
    scale_orders: usize,
) -> Folds {
    let rates =
        if with_rate { problem.rate_columns(0, tau_s) } else { vec![[0.0; RATE_COLUMNS]; problem.len()].into() };
    Folds::of(reduced(problem, division, BIAS_COLUMNS + RATE_COLUMNS + scale_orders, |i, row| {
        row.extend_from_slice(&problem.inputs[0].basis[i][1..]);
        row.extend_from_slice(&rates[i]);
        row.extend((1..=scale_orders).map(|k| problem.scale_column(0, i, k)));
    }))
}

/// Factors of the blocks, of all others next to each, and of all.
struct Folds {
    blocks: Vec<Factor>,
    without: Vec<Option<Factor>>,
    whole: Option<Factor>,
}

impl Folds {
    fn of(blocks: Vec<Factor>) -> Self {
        Self { without: Factor::without_each(&blocks), whole: Factor::join(blocks.iter()), blocks }
    }
}

/// Factors of the blocks, of shared levels, `regressors` columns that `add` appends, and y. What a run has for itself is projected out:
/// the offset and drift of a held-out run take their best values.
fn reduced(
    problem: &LeastSquares<'_>,
    division: &Division,
    regressors: usize,
    add: impl Fn(usize, &mut Vec<f64>),
) -> Vec<Factor> {
    let Division { block, blocks, columns, is_centred, .. } = division;
    let in_blocks = InBlocks { block, blocks: *blocks, is_centred: *is_centred };
    let add = |i: usize, row: &mut Vec<f64>| {
        add(i, row);
        row.push(problem.y[i]);
    };
    let reducers = reduce(problem, columns, regressors, Weighting::Lengths, Some(in_blocks), add);
    reducers.into_iter().map(RunReducer::finish_shared).collect()
}

/// Limit on the sweeps over several lags.
const MOST_SWEEPS: usize = 4;

/// One model of any inputs, cross-validated by itself.
pub(crate) struct Trial<'a> {
    problem: &'a LeastSquares<'a>,
    division: Division,
    terms: Vec<TermColumn>,
    /// Inputs whose lag is fitted.
    rated: Vec<usize>,
    taus_s: &'a [f64],
    /// What does not depend on the lags, where there are few enough rows.
    prepared: Option<PreparedModel<'a>>,
    /// Per step term and block: lowest and highest value of its column.
    steps: BTreeMap<usize, Vec<(f64, f64)>>,
    /// Factors of the blocks by the places of the lags in the grid.
    factors: BTreeMap<Vec<usize>, Folds>,
}

impl<'a> Trial<'a> {
    pub(crate) fn new(problem: &'a LeastSquares<'a>, spec: &ModelSpec, taus_s: &'a [f64]) -> Self {
        let (terms, rated) = (problem.terms(spec), problem.rated(spec));
        let division = Division::of(problem);
        let prepared = PreparedModel::new(problem, &terms, taus_s, division.split());
        let steps = terms.iter().enumerate().filter(|(_, term)| term.form.shape.jump().is_some());
        let steps = steps.map(|(at, term)| (at, extremes_of(problem, &division, term))).collect();
        Self { problem, division, terms, rated, taus_s, prepared, steps, factors: BTreeMap::new() }
    }

    /// Held-out mean square, (°/h)²; `None` where a fold could not be fitted.
    pub(crate) fn held_out(mut self) -> Option<f64> {
        // Every fold starts at the optimum of the whole problem.
        let start = self.rated.iter().map(|input| {
            let place = if self.problem.inputs[*input].repeats.is_some() {
                self.taus_s.len() - 1
            } else {
                self.taus_s.len() / 2
            };
            self.problem.tau_from()[*input].max(place)
        });
        let start: Vec<usize> = start.collect();
        let whole: Vec<usize> = self.columns(&(0..self.division.levels()).collect::<Vec<_>>());
        let (start, _) = self.descend(start, None, &whole)?;
        let mut sum = 0.0;
        for fold in 0..self.division.blocks {
            let (known, mut free) = self.division.levels_without(self.problem, fold);
            let (columns, unseen): (Vec<usize>, Vec<usize>) =
                self.columns(&known).into_iter().partition(|column| self.is_seen(*column, fold));
            free.extend(unseen);
            let (best, theta) = self.descend(start.clone(), Some(fold), &columns)?;
            sum += self.folds(&best).blocks[fold].ssr(&columns, &theta, &free);
        }
        Some(sum / self.problem.len() as f64)
    }

    /// False for a step that does not occur in the training set of a fold. It gets its best value in the fold, like the level
    /// of a run that occurs in the fold only.
    fn is_seen(&self, column: usize, fold: usize) -> bool {
        let of_term = column.checked_sub(self.division.levels()).and_then(|term| self.steps.get(&term));
        let Some(blocks) = of_term else { return true };
        let others = blocks.iter().enumerate().filter(|(block, _)| *block != fold).map(|(_, extremes)| *extremes);
        let (lo, hi) = others.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (l, h)| (lo.min(l), hi.max(h)));
        hi > lo
    }

    fn columns(&self, known: &[usize]) -> Vec<usize> {
        let levels = self.division.levels();
        known.iter().copied().chain(levels..levels + self.terms.len()).collect()
    }

    /// The lags of least misfit outside a fold, optimised in turn, and the coefficients there.
    fn descend(
        &mut self,
        mut at: Vec<usize>,
        fold: Option<usize>,
        columns: &[usize],
    ) -> Option<(Vec<usize>, DVector<f64>)> {
        let mut best = self.misfit(&at, fold, columns);
        for _ in 0..MOST_SWEEPS {
            let before = at.clone();
            for lag in 0..at.len() {
                for there in self.steps_of(&at, lag) {
                    let tried = self.misfit(&there, fold, columns);
                    if ssr_of(&tried) < ssr_of(&best) {
                        (at, best) = (there, tried);
                    }
                }
            }
            if at == before || at.len() < 2 {
                break;
            }
        }
        best.map(|solution| (at, solution.theta))
    }

    /// Where a lag, with the slow one of its input if there is one, may be instead.
    fn steps_of(&self, at: &[usize], lag: usize) -> Vec<Vec<usize>> {
        let from = |lag: usize| self.problem.tau_from()[self.rated[lag]];
        let is_slow =
            |lag: usize| self.rated.get(lag).is_some_and(|input| self.problem.inputs[*input].repeats.is_some());
        let with = |places: &[usize]| {
            let mut there = at.to_vec();
            there[lag..lag + places.len()].copy_from_slice(places);
            there
        };
        if is_slow(lag) {
            return Vec::new();
        }
        if is_slow(lag + 1) {
            let pairs = coarse_pairs(self.taus_s, [from(lag), from(lag + 1)], [at[lag], at[lag + 1]]);
            return pairs.iter().map(|pair| with(pair)).collect();
        }
        (from(lag)..self.taus_s.len()).map(|place| with(&[place])).collect()
    }

    fn misfit(&mut self, at: &[usize], fold: Option<usize>, columns: &[usize]) -> Option<Solution> {
        let folds = self.folds(at);
        let training = fold.map_or(&folds.whole, |fold| &folds.without[fold]);
        training.as_ref()?.solve(columns)
    }

    /// Factors of the blocks at these lags, made once.
    fn folds(&mut self, at: &[usize]) -> &Folds {
        if !self.factors.contains_key(at) {
            let lags_s: Vec<(usize, f64)> =
                self.rated.iter().zip(at).map(|(input, tau)| (*input, self.taus_s[*tau])).collect();
            let factors = match &self.prepared {
                Some(prepared) => prepared.factors(&lags_s),
                None => {
                    let rates = self.problem.rates(&lags_s);
                    reduced(self.problem, &self.division, self.terms.len(), |i, row| {
                        row.extend(self.terms.iter().map(|term| self.problem.regressor(term, i, &rates)));
                    })
                }
            };
            self.factors.insert(at.to_vec(), Folds::of(factors));
        }
        &self.factors[at]
    }
}

/// Lowest and highest value of a term's column in each block.
fn extremes_of(problem: &LeastSquares<'_>, division: &Division, term: &TermColumn) -> Vec<(f64, f64)> {
    let mut blocks = vec![(f64::INFINITY, f64::NEG_INFINITY); division.blocks];
    for row in 0..problem.len() {
        let value = problem.regressor(term, row, &Rates::new());
        let (lo, hi) = &mut blocks[division.block[row]];
        (*lo, *hi) = (lo.min(value), hi.max(value));
    }
    blocks
}

fn ssr_of(solution: &Option<Solution>) -> f64 {
    solution.as_ref().map_or(f64::INFINITY, |solution| solution.ssr)
}
