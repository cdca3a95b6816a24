//! A model whose lags are still open: what does not depend on them is reduced once.
//!
//! ```text
//! rows of a block:  [ F | V(τ) | y ] = Q·R      F: levels and terms without a lag, V: rate columns of all its inputs
//! once:             F = Q₁·R₁₁,  y' = y − Q₁Q₁ᵀy
//! at a τ:           R₁₂ = Q₁ᵀV,  V' = V − Q₁R₁₂,  [V' | y'] = Q₂·R₂₂
//! ```
//!
//! by modified Gram–Schmidt, every projection twice (Giraud, Langou and Rozložník 2005: then Q₁ is orthogonal to working precision). A τ
//! costs rows × |F| × |V| instead of rows × (|F| + |V|)², and V' of an input at a τ of the grid serves every combination with the lags of
//! other inputs. The factors are those of [`crate::noise_model::factor`] up to rounding.
//!
//! Q₁ takes a number per row and column: above [`MOST_VALUES`] nothing is prepared, and the rows are reduced again at each τ.

use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::{Rates, TermColumn};
use crate::noise_model::factor::{Factor, RunColumns};
use nalgebra::DMatrix;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, RwLock};

/// Most numbers in Q₁: 32 MB. As many again are kept for V'.
const MOST_VALUES: usize = 4 << 20;
/// A column whose part beyond the columns before it is a smaller fraction of it is nothing but rounding.
const ROUNDING: f64 = 1e-14;

/// Rows that are one block each, and what is projected out of every run.
pub(crate) struct Blocks {
    pub(crate) rows: Vec<Range<usize>>,
    /// The own columns of a run are projected out of its rows; the shared ones stay.
    pub(crate) columns: RunColumns,
    /// Every run is about its own weighted mean.
    pub(crate) is_centred: bool,
}

/// A model with its fixed columns reduced.
pub(crate) struct PreparedModel<'a> {
    problem: &'a LeastSquares<'a>,
    terms: Vec<TermColumn>,
    taus_s: &'a [f64],
    split: Blocks,
    /// Places of the fixed columns and of the rate columns in a row of shared levels, terms and y.
    fixed: Vec<usize>,
    varying: Vec<usize>,
    /// Per run: an orthonormal basis of what is projected out of it.
    of_runs: Vec<Vec<Vec<f64>>>,
    bases: Vec<Basis>,
    y: Beyond,
    known: RwLock<KnownLags>,
    /// Per input the last τ that is not of the grid: while the lag of one input is refined, the others stay.
    last: RwLock<LastLags>,
}

/// By input and bits of τ.
type KnownLags = HashMap<(usize, u64), Arc<[Beyond]>>;

/// By input: bits of τ, columns.
type LastLags = HashMap<usize, (u64, Arc<[Beyond]>)>;

/// Q₁ of a block and R₁₁, column by column.
struct Basis {
    q: Vec<Vec<f64>>,
    r: Vec<Vec<f64>>,
}

/// What of a column is beyond the fixed ones, and per block its part within them.
struct Beyond {
    rest: Vec<f64>,
    within: Vec<Vec<f64>>,
}

impl Blocks {
    /// All rows as one.
    pub(crate) fn of_all(problem: &LeastSquares<'_>) -> Self {
        Self { rows: std::iter::once(0..problem.len()).collect(), columns: problem.run_columns(), is_centred: false }
    }
}

impl<'a> PreparedModel<'a> {
    /// Reduces what does not depend on a lag; `None` for too many rows.
    pub(crate) fn new(
        problem: &'a LeastSquares<'a>,
        terms: &[TermColumn],
        taus_s: &'a [f64],
        split: Blocks,
    ) -> Option<Self> {
        let shared = split.columns.shared.len();
        let (varying, of_terms): (Vec<usize>, Vec<usize>) =
            (0..terms.len()).map(|term| shared + term).partition(|place| terms[place - shared].form.times_rate);
        let fixed: Vec<usize> = (0..shared).chain(of_terms).collect();
        if (fixed.len() + varying.len() + 1).saturating_mul(problem.len()) > MOST_VALUES {
            return None;
        }
        let y = Beyond { rest: Vec::new(), within: Vec::new() };
        let (terms, known) = (terms.to_vec(), RwLock::default());
        let (of_runs, bases) = (Vec::new(), Vec::new());
        let mut it =
            Self { problem, terms, taus_s, split, fixed, varying, of_runs, bases, y, known, last: RwLock::default() };
        it.of_runs = it.bases_of_runs();
        it.bases = it.reduced();
        it.y = it.beyond(it.column(|row| problem.y[row]));
        Some(it)
    }

    /// Sum of squares of the residuals at these lags and the best coefficients; infinite where there are none.
    pub(crate) fn misfit(&self, lags_s: &[(usize, f64)]) -> f64 {
        let columns: Vec<usize> = (0..self.split.columns.shared.len() + self.terms.len()).collect();
        let whole = Factor::join(self.factors(lags_s).iter());
        whole.and_then(|whole| whole.solve(&columns)).map_or(f64::INFINITY, |solution| solution.ssr)
    }

    /// The factor of each block at these lags: shared levels, terms, y.
    pub(crate) fn factors(&self, lags_s: &[(usize, f64)]) -> Vec<Factor> {
        let moved: Vec<(usize, Arc<[Beyond]>)> =
            lags_s.iter().map(|(input, tau_s)| (*input, self.at_lag(*input, *tau_s))).collect();
        let columns = self.varying_of(&moved);
        (0..self.bases.len()).map(|block| self.factor(block, &columns)).collect()
    }

    /// The columns of the rate terms in their order.
    fn varying_of<'m>(&self, moved: &'m [(usize, Arc<[Beyond]>)]) -> Vec<&'m Beyond> {
        let mut taken: HashMap<usize, usize> = HashMap::new();
        let shared = self.split.columns.shared.len();
        let of_place = |place: &usize| {
            let input = self.terms[place - shared].input;
            let at = taken.entry(input).or_default();
            *at += 1;
            moved.iter().find(|(of, _)| *of == input).and_then(|(_, all)| all.get(*at - 1))
        };
        self.varying.iter().filter_map(of_place).collect()
    }

    fn factor(&self, block: usize, varying: &[&Beyond]) -> Factor {
        let (Basis { r, q }, rows) = (&self.bases[block], self.split.rows[block].clone());
        let width = self.split.columns.shared.len() + self.terms.len() + 1;
        let mut all = DMatrix::zeros(width, width);
        let mut put = |place: usize, top: &[f64]| {
            top.iter().enumerate().for_each(|(at, value)| all[(at, place)] = *value);
        };
        self.fixed.iter().zip(r).for_each(|(place, top)| put(*place, top));
        let behind: Vec<(usize, &Beyond)> =
            self.varying.iter().copied().zip(varying.iter().copied()).chain([(width - 1, &self.y)]).collect();
        behind.iter().for_each(|(place, column)| put(*place, &column.within[block]));
        let below = q.len();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for (place, column) in behind {
            let mut rest = column.rest[rows.clone()].to_vec();
            let top = extend(&mut basis, &mut rest);
            top.iter().enumerate().for_each(|(at, value)| all[(below + at, place)] = *value);
        }
        Factor::of(all)
    }

    /// The rate columns of an input beyond the fixed ones; those of the grid are kept.
    fn at_lag(&self, input: usize, tau_s: f64) -> Arc<[Beyond]> {
        let key = (input, tau_s.to_bits());
        if let Some(columns) = self.known.read().ok().and_then(|known| known.get(&key).map(Arc::clone)) {
            return columns;
        }
        let recent = |last: &LastLags| {
            last.get(&input).filter(|(bits, _)| *bits == key.1).map(|(_, columns)| Arc::clone(columns))
        };
        if let Some(columns) = self.last.read().ok().and_then(|last| recent(&last)) {
            return columns;
        }
        let mut rates: Rates = vec![Arc::default(); self.problem.inputs.len()];
        rates[input] = self.problem.rate_columns(input, tau_s);
        let own = self.terms.iter().filter(|term| term.form.times_rate && term.input == input);
        let columns: Arc<[Beyond]> =
            own.map(|term| self.beyond(self.column(|row| self.problem.regressor(term, row, &rates)))).collect();
        if !self.taus_s.contains(&tau_s) {
            if let Ok(mut last) = self.last.write() {
                last.insert(input, (key.1, Arc::clone(&columns)));
            }
        } else if let Ok(mut known) = self.known.write()
            && (known.len() + 1).saturating_mul(columns.len() * self.problem.len()) <= MOST_VALUES
        {
            known.insert(key, Arc::clone(&columns));
        }
        columns
    }

    /// A column, each row times the root of its weight, without what is projected out of its run.
    fn column(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        let problem = self.problem;
        let mut all: Vec<f64> = (0..problem.len()).map(|row| problem.weight[row].sqrt() * value(row)).collect();
        for (run, basis) in self.of_runs.iter().enumerate().filter(|(_, basis)| !basis.is_empty()) {
            project(basis, &mut all[problem.rows_of(run)]);
        }
        all
    }

    fn bases_of_runs(&self) -> Vec<Vec<Vec<f64>>> {
        let problem = self.problem;
        let basis = |run: usize| {
            let weighted = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
                problem.rows_of(run).map(|row| problem.weight[row].sqrt() * value(row)).collect()
            };
            let mut basis = Vec::new();
            if self.split.is_centred {
                extend(&mut basis, &mut weighted(&|_| 1.0));
            }
            for column in self.split.columns.own.get(run).into_iter().flatten() {
                extend(&mut basis, &mut weighted(&|row| problem.level(row, problem.levels()[*column])));
            }
            basis
        };
        (0..problem.runs.len()).map(basis).collect()
    }

    fn reduced(&self) -> Vec<Basis> {
        let (problem, none) = (self.problem, Rates::new());
        let level = |column: usize| self.column(|row| problem.level(row, problem.levels()[column]));
        let shared = &self.split.columns.shared;
        let fixed: Vec<Vec<f64>> = self
            .fixed
            .iter()
            .map(|place| match shared.get(*place) {
                Some(column) => level(*column),
                None => self.column(|row| problem.regressor(&self.terms[place - shared.len()], row, &none)),
            })
            .collect();
        let of_block = |rows: &Range<usize>| {
            let mut q = Vec::new();
            let r = fixed.iter().map(|values| extend(&mut q, &mut values[rows.clone()].to_vec())).collect();
            Basis { q, r }
        };
        self.split.rows.iter().map(of_block).collect()
    }

    fn beyond(&self, mut values: Vec<f64>) -> Beyond {
        let blocks = self.bases.iter().zip(&self.split.rows);
        let within = blocks.map(|(basis, rows)| project(&basis.q, &mut values[rows.clone()])).collect();
        Beyond { rest: values, within }
    }
}

/// Takes the part within an orthonormal basis out of a column; the coefficients of that part.
fn project(basis: &[Vec<f64>], column: &mut [f64]) -> Vec<f64> {
    let mut parts = vec![0.0; basis.len()];
    for _ in 0..2 {
        for (part, direction) in parts.iter_mut().zip(basis) {
            let share = dot(direction, column);
            column.iter_mut().zip(direction).for_each(|(value, along)| *value -= share * along);
            *part += share;
        }
    }
    parts
}

/// Adds a column's own direction to an orthonormal basis; its coefficients. A column without one adds nothing but zeros.
fn extend(basis: &mut Vec<Vec<f64>>, column: &mut [f64]) -> Vec<f64> {
    let whole = dot(column, column).sqrt();
    let mut parts = project(basis, column);
    let norm = dot(column, column).sqrt();
    let is_new = norm > ROUNDING * whole;
    let scale = if is_new { norm.recip() } else { 0.0 };
    basis.push(column.iter().map(|value| scale * value).collect());
    parts.push(if is_new { norm } else { 0.0 });
    parts
}

/// In four sums at a time, which a processor adds together.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 4;
    let (heads, tails) = (a.chunks_exact(LANES).zip(b.chunks_exact(LANES)), a.len() / LANES * LANES);
    let mut sums = [0.0; LANES];
    for (a, b) in heads {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + a[tails..].iter().zip(&b[tails..]).map(|(a, b)| a * b).sum::<f64>()
}
