//! Least squares through triangular factors.
//!
//! A block of rows [A | y] is reduced to its R factor once (Householder QR, chunk by chunk, so memory
//! does not grow with the rows). R replaces the rows in all later steps: stacking
//! factors joins blocks, dropping columns gives a smaller model, and |R·(θ, −1)|² is the residual sum of
//! squares of any θ on that block. [`RunReducer`] does the same where many columns belong to a single run each.

use nalgebra::{DMatrix, DVector};

/// A column whose part orthogonal to the columns before it is shorter than this fraction is treated as dependent.
const RANK_TOLERANCE: f64 = 1e-9;
const CHUNK_ROWS: usize = 512;

/// R factor of a block of rows; the last column is y.
#[derive(Clone, Debug)]
pub(crate) struct Factor(DMatrix<f64>);

/// A solved subset of columns.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) theta: DVector<f64>,
    /// Residual sum of squares (weighted).
    pub(crate) ssr: f64,
    /// R of the chosen columns.
    r: DMatrix<f64>,
}

/// Collects rows into a factor.
pub(crate) struct Reducer {
    width: usize,
    rows: Vec<f64>,
    factor: Option<DMatrix<f64>>,
}

impl Reducer {
    /// For rows of `width` numbers, y included.
    pub(crate) fn new(width: usize) -> Self {
        Self { width, rows: Vec::new(), factor: None }
    }

    pub(crate) fn push(&mut self, row: &[f64]) {
        self.rows.extend_from_slice(row);
        if self.rows.len() >= CHUNK_ROWS * self.width {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let chunk = DMatrix::from_row_slice(self.rows.len() / self.width, self.width, &self.rows);
        self.rows.clear();
        self.factor = Some(match self.factor.take() {
            Some(factor) => triangle(stack(&[&factor, &chunk])),
            None => triangle(chunk),
        });
    }

    pub(crate) fn finish(mut self) -> Factor {
        if !self.rows.is_empty() || self.factor.is_none() {
            self.fold();
        }
        Factor(self.factor.unwrap_or_else(|| DMatrix::zeros(self.width, self.width)))
    }
}

/// Collects rows that come run by run, where some columns are zero in all runs but one. Each run is reduced by itself, its own columns
/// first; what is beyond them joins what the other runs give. Of sixty runs with two columns each this is a hundred times less work than
/// one factor of all columns.
pub(crate) struct RunReducer<'a> {
    columns: &'a RunColumns,
    /// Numbers of a row besides the columns before the terms, y included.
    further: usize,
    run: Option<(usize, Reducer)>,
    /// Rows of R for the own columns of each run.
    own: Vec<(usize, DMatrix<f64>)>,
    shared: Reducer,
}

/// Columns before the terms: those that are zero outside a run, by run, and the others.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RunColumns {
    pub(crate) own: Vec<Vec<usize>>,
    pub(crate) shared: Vec<usize>,
}

impl RunColumns {
    fn count(&self) -> usize {
        self.own.iter().map(Vec::len).sum::<usize>() + self.shared.len()
    }

    pub(crate) fn own_of(&self, run: usize) -> &[usize] {
        self.own.get(run).map_or(&[], Vec::as_slice)
    }

    /// Columns that a row of a run has a number for, in the order of [`RunReducer::push`].
    pub(crate) fn of(&self, run: usize) -> impl Iterator<Item = usize> + '_ {
        self.own_of(run).iter().chain(&self.shared).copied()
    }
}

impl<'a> RunReducer<'a> {
    pub(crate) fn new(columns: &'a RunColumns, further: usize) -> Self {
        let shared = Reducer::new(columns.shared.len() + further);
        Self { columns, further, run: None, own: Vec::new(), shared }
    }

    /// A row: the run's own columns, the shared ones, then the further ones.
    pub(crate) fn push(&mut self, run: usize, row: &[f64]) {
        if self.columns.own_of(run).is_empty() {
            return self.shared.push(row);
        }
        if self.run.as_ref().is_none_or(|(other, _)| *other != run) {
            self.end_run();
        }
        self.run.get_or_insert_with(|| (run, Reducer::new(row.len()))).1.push(row);
    }

    fn end_run(&mut self) {
        let Some((run, rows)) = self.run.take() else { return };
        let own = self.columns.own_of(run).len();
        let Factor(r) = rows.finish();
        let beyond = r.view((own, own), (r.nrows() - own, r.ncols() - own));
        beyond.row_iter().for_each(|row| self.shared.rows.extend(row.iter()));
        if self.shared.rows.len() >= CHUNK_ROWS * self.shared.width {
            self.shared.fold();
        }
        self.own.push((run, r.rows(0, own).into_owned()));
    }

    /// The factor of the shared and further columns, the others projected out.
    pub(crate) fn finish_shared(mut self) -> Factor {
        self.end_run();
        self.shared.finish()
    }

    /// The factor of all columns in their own order.
    pub(crate) fn finish(mut self) -> Factor {
        self.end_run();
        let before = self.columns.count();
        let place = |run: usize, at: usize| -> usize {
            self.columns.of(run).nth(at).unwrap_or_else(|| before + at - self.columns.of(run).count())
        };
        let Factor(shared) = self.shared.finish();
        let width = before + self.further;
        let mut all = DMatrix::zeros(width, width);
        let mut at = 0;
        for (run, top) in &self.own {
            for (j, column) in top.column_iter().enumerate() {
                all.view_mut((at, place(*run, j)), (top.nrows(), 1)).copy_from(&column);
            }
            at += top.nrows();
        }
        let shared_at =
            |j: usize| self.columns.shared.get(j).copied().unwrap_or(before + j - self.columns.shared.len());
        for (j, column) in shared.column_iter().enumerate() {
            all.view_mut((at, shared_at(j)), (shared.nrows(), 1)).copy_from(&column);
        }
        Factor(all)
    }
}

impl Factor {
    /// Columns with the scalar products of a block's columns, y last.
    pub(crate) fn of(columns: DMatrix<f64>) -> Self {
        Self(columns)
    }

    /// Every row by a number.
    pub(crate) fn scaled(&self, by: f64) -> Self {
        Self(&self.0 * by)
    }

    /// The factor of the columns behind the first `before`, which are projected out, y last.
    pub(crate) fn beyond(&self, before: usize) -> DMatrix<f64> {
        let r = triangle(self.0.clone());
        r.view((before, before), (r.nrows() - before, r.ncols() - before)).into_owned()
    }

    /// Of each block the factor of all others; `None` where there is no other. Of n blocks with 3n joins of two.
    pub(crate) fn without_each(blocks: &[Self]) -> Vec<Option<Self>> {
        let joined = |all: &Option<Self>, next: &Self| match all {
            Some(all) => Self::join([all, next].into_iter()),
            None => Some(next.clone()),
        };
        let mut after = vec![None];
        for block in blocks.iter().skip(1).rev() {
            let all = joined(&after[after.len() - 1], block);
            after.push(all);
        }
        let mut before: Option<Self> = None;
        let mut out = Vec::with_capacity(blocks.len());
        for (block, after) in blocks.iter().zip(after.into_iter().rev()) {
            out.push(after.as_ref().map_or_else(|| before.clone(), |after| joined(&before, after)));
            before = joined(&before, block);
        }
        out
    }

    /// The factor of several blocks together.
    pub(crate) fn join<'a>(factors: impl Iterator<Item = &'a Self>) -> Option<Self> {
        let all: Vec<&DMatrix<f64>> = factors.map(|factor| &factor.0).collect();
        (!all.is_empty()).then(|| Self(triangle(stack(&all))))
    }

    /// Solves for some columns; `None` when they are not independent.
    pub(crate) fn solve(&self, columns: &[usize]) -> Option<Solution> {
        let p = columns.len();
        let y = self.0.ncols() - 1;
        let with_y: Vec<usize> = columns.iter().copied().chain(std::iter::once(y)).collect();
        let picked = self.0.select_columns(&with_y);
        let lengths: Vec<f64> = (0..p).map(|j| picked.column(j).norm()).collect();
        let r = triangle(picked);
        let independent = (0..p).all(|j| is_independent(r[(j, j)], lengths[j]));
        if !independent {
            return None;
        }
        let (square, right) = (r.view((0, 0), (p, p)).into_owned(), r.view((0, p), (p, 1)).into_owned());
        let theta = square.solve_upper_triangular(&right)?;
        Some(Solution { theta: theta.column(0).into_owned(), ssr: r[(p, p)] * r[(p, p)], r: square })
    }

    /// A column solved for some others; `None` when those are not independent.
    pub(crate) fn regress(&self, column: usize, others: &[usize]) -> Option<Solution> {
        let all: Vec<usize> = others.iter().copied().chain(std::iter::once(column)).collect();
        let of_column = Self(triangle(self.0.select_columns(&all)));
        of_column.solve(&(0..others.len()).collect::<Vec<_>>())
    }

    /// Sum of squares of a column.
    pub(crate) fn norm_squared(&self, column: usize) -> f64 {
        self.0.column(column).norm_squared()
    }

    /// Residual sum of squares of a solution on this block; `free` columns (constants of runs that stand
    /// in this block alone, so at right angles to each other) take their best value here.
    pub(crate) fn ssr(&self, columns: &[usize], theta: &DVector<f64>, free: &[usize]) -> f64 {
        let y = self.0.ncols() - 1;
        let mut residual = self.0.column(y).into_owned();
        for (j, column) in columns.iter().enumerate() {
            residual.axpy(-theta[j], &self.0.column(*column), 1.0);
        }
        for column in free.iter().map(|column| self.0.column(*column)) {
            let share = column.dot(&residual) / column.norm_squared();
            if share.is_finite() {
                residual.axpy(-share, &column, 1.0);
            }
        }
        residual.norm_squared()
    }
}

/// How near the columns of a fit are to being combinations of each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Conditioning {
    /// Largest over smallest singular value of the columns at unit length.
    pub(crate) condition: f64,
    /// Per column: by how much the others multiply its variance; `None` for columns that count as one.
    pub(crate) vif: Vec<Option<f64>>,
}

impl Solution {
    /// Of the columns after the first `before`, which are projected out; `None` without any. The columns of `together`
    /// (counted from `before`) count as the space that they span, independent of the basis.
    pub(crate) fn conditioning(&self, before: usize, together: &[usize]) -> Option<Conditioning> {
        let p = self.r.nrows().checked_sub(before).filter(|p| *p > 0)?;
        let mut own = self.r.view((before, before), (p, p)).into_owned();
        own.column_iter_mut().for_each(|mut column| {
            column.normalize_mut();
        });
        let space = own.select_columns(together).qr().q();
        for (column, place) in space.column_iter().zip(together) {
            own.set_column(*place, &column);
        }
        let values = own.clone().singular_values();
        let inverse = own.try_inverse()?;
        let inflation =
            |(at, row): (usize, nalgebra::RowDVector<f64>)| (!together.contains(&at)).then(|| row.norm_squared());
        let vif = inverse.row_iter().map(|row| row.into_owned()).enumerate().map(inflation).collect();
        Some(Conditioning { condition: values.max() / values.min(), vif })
    }

    /// ln |AᵀA| of the solved columns.
    pub(crate) fn log_determinant(&self) -> f64 {
        2.0 * self.r.diagonal().iter().map(|r| r.abs().ln()).sum::<f64>()
    }

    /// (AᵀWA)⁻¹ of the solved columns.
    pub(crate) fn inverse_normal(&self) -> Option<DMatrix<f64>> {
        let p = self.r.nrows();
        let inverse = self.r.solve_upper_triangular(&DMatrix::identity(p, p))?;
        Some(&inverse * inverse.transpose())
    }
}

fn stack(blocks: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let rows = blocks.iter().map(|b| b.nrows()).sum();
    let mut all = DMatrix::zeros(rows, blocks.first().map_or(0, |b| b.ncols()));
    let mut at = 0;
    for block in blocks {
        all.rows_mut(at, block.nrows()).copy_from(block);
        at += block.nrows();
    }
    all
}

/// The square R factor, padded with zero rows where there are fewer rows than columns.
/// A column of some length has a part of its own, this long.
fn is_independent(own: f64, length: f64) -> bool {
    own.abs() > RANK_TOLERANCE * length && length.is_finite()
}

fn triangle(rows: DMatrix<f64>) -> DMatrix<f64> {
    let width = rows.ncols();
    let r = if rows.nrows() == 0 { rows } else { rows.qr().unpack_r() };
    if r.nrows() == width { r } else { r.resize_vertically(width, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(rows: &[[f64; 4]]) -> Factor {
        let mut reducer = Reducer::new(4);
        rows.iter().for_each(|row| reducer.push(row));
        reducer.finish()
    }

    /// Closed form: two columns at unit length with scalar product ρ have the condition √((1 + ρ)/(1 − ρ)) and the vif
    /// 1/(1 − ρ²).
    #[test]
    fn nearness_is_that_of_two_columns_at_an_angle() {
        let rows = [[1.0, 1.0, 0.9, 1.0], [1.0, -1.0, -0.9, 2.0], [1.0, 0.0, 0.5, 3.0], [1.0, 0.0, -0.5, 4.0]];
        let solution = factor(&rows).solve(&[0, 1, 2]).unwrap();
        let rho: f64 = 1.8 / (2.0_f64 * 2.12).sqrt();
        let near = solution.conditioning(1, &[]).unwrap();
        assert!((near.condition - ((1.0 + rho) / (1.0 - rho)).sqrt()).abs() < 1e-9);
        assert!(near.vif.iter().flatten().all(|v| (v - 1.0 / (1.0 - rho * rho)).abs() < 1e-9), "{near:?}");
        assert!(solution.conditioning(3, &[]).is_none());
        let as_one = solution.conditioning(1, &[0, 1]).unwrap();
        assert!((as_one.condition - 1.0).abs() < 1e-9 && as_one.vif == [None, None]);
    }

    /// y = 2 + 3x on four exact points, with a third column that repeats the second.
    #[test]
    fn solves_subsets_and_sees_dependence() {
        let rows: Vec<[f64; 4]> = (0..4).map(f64::from).map(|x| [1.0, x, 2.0 * x, 2.0 + 3.0 * x]).collect();
        let all = factor(&rows);
        let line = all.solve(&[0, 1]).unwrap();
        assert!((line.theta[0] - 2.0).abs() < 1e-12 && (line.theta[1] - 3.0).abs() < 1e-12 && line.ssr < 1e-20);
        assert!(all.solve(&[0, 1, 2]).is_none());
        // (AᵀA)⁻¹ of the line 0, 1, 2, 3: [[14, −6], [−6, 4]]/20.
        let inverse = line.inverse_normal().unwrap();
        assert!((inverse[(0, 0)] - 0.7).abs() < 1e-12 && (inverse[(0, 1)] + 0.3).abs() < 1e-12);
        let joined = Factor::join([factor(&rows[..1]), factor(&rows[1..])].iter()).unwrap();
        assert!((joined.solve(&[0, 1]).unwrap().theta[1] - 3.0).abs() < 1e-12);
        assert!((all.ssr(&[0], &DVector::from_element(1, 0.0), &[]) - (4.0 + 25.0 + 64.0 + 121.0)).abs() < 1e-9);
        // About their own mean, 6.5, the same values leave 45.
        assert!((all.ssr(&[], &DVector::zeros(0), &[0]) - 45.0).abs() < 1e-9);
    }

    /// Rows of seven runs with a constant and a slope each, a shared column, a term and y: run by run as in one factor.
    #[test]
    fn runs_by_themselves_give_the_factor_of_all_rows() {
        const RUNS: usize = 7;
        let columns = RunColumns { own: (0..RUNS).map(|run| vec![run, RUNS + 1 + run]).collect(), shared: vec![RUNS] };
        let width = 2 * RUNS + 1 + 2;
        let (mut whole, mut by_run) = (Reducer::new(width), RunReducer::new(&columns, 2));
        let mut shared = RunReducer::new(&columns, 2);
        for i in 0..RUNS * 90 {
            let (run, t) = (i / 90, (i % 90) as f64);
            let noise = |k: usize| ((i * 7919 + k * 104_729) % 1009) as f64 / 1009.0 - 0.5;
            let values = [1.0, t, 1.0 + noise(1), noise(2) + 0.01 * t, 3.0 + 0.1 * t + noise(3)];
            let mut row = vec![0.0; width];
            (row[run], row[RUNS + 1 + run], row[RUNS]) = (values[0], values[1], values[2]);
            row[width - 2..].copy_from_slice(&values[3..]);
            whole.push(&row);
            by_run.push(run, &values);
            shared.push(run, &values);
        }
        let all: Vec<usize> = (0..width - 1).collect();
        let (expected, found) = (whole.finish().solve(&all).unwrap(), by_run.finish().solve(&all).unwrap());
        assert!((&expected.theta - &found.theta).amax() < 1e-11);
        assert!((expected.ssr / found.ssr - 1.0).abs() < 1e-12);
        let (a, b) = (expected.inverse_normal().unwrap(), found.inverse_normal().unwrap());
        assert!((a - b).amax() < 1e-12);
        let projected = shared.finish_shared().solve(&[0, 1]).unwrap();
        assert!((projected.ssr / expected.ssr - 1.0).abs() < 1e-12);
        assert!((projected.theta[0] - expected.theta[RUNS]).abs() < 1e-11);
    }

    #[test]
    fn without_each_is_the_join_of_the_others() {
        let blocks: Vec<Factor> = (0..6)
            .map(|block| {
                let number = |i: usize| ((block * 31 + i * 17) % 13) as f64;
                factor(&[0, 1, 2, 3, 4].map(|row| [0, 1, 2, 3].map(|column| number(4 * row + column * (row + 1)))))
            })
            .collect();
        for (at, without) in Factor::without_each(&blocks).into_iter().enumerate() {
            let others = blocks.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, block)| block);
            let (expected, found) = (Factor::join(others).unwrap(), without.unwrap());
            let [a, b] = [&expected, &found].map(|factor| factor.solve(&[0, 1, 2]).unwrap().ssr);
            assert!((a / b - 1.0).abs() < 1e-12, "{at}: {a} {b}");
        }
        assert!(Factor::without_each(&blocks[..1])[0].is_none());
    }
}
