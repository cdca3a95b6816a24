//! How likely noise is that is not white, for many noises on the same rows.
//!
//! ```text
//! y = own·θ_block + shared·θ + n                                n: white + slow noise, each run by itself ([`crate::noise_model`])
//! −2·ln L = ν·ln(rᵀV⁻¹r) + ln|V| + ln|XᵀV⁻¹X|                   ν: rows less columns; r: what the columns do not explain under V
//! ```
//!
//! This restricted likelihood (Patterson and Thompson 1971) depends neither on the basis of the columns, but for a constant, nor on
//! what they add to y. They are made orthonormal once, those that depend on others dropped, and y is what they do not explain. Then
//! products of whitened rows keep enough digits, and a noise costs one pass over the rows.
//!
//! Of more than [`MOST_ROWS`] rows, neighbours are averaged: slow noise is that of the whole test, however short its windows are.
//!
//! Fails where the columns explain all rows: nothing tells one noise from another then.

use crate::noise_model::processes::{NoiseRows, SlowNoise};
use crate::noise_model::whitening::Whitening;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Rows at most; more are averaged.
const MOST_ROWS: usize = 4000;
/// Middles of neighbours are nearer than this many windows.
const NEIGHBOURS_WITHIN: f64 = 1.5;
/// Rows that go into products at a time.
const TOGETHER: usize = 4;
/// A column whose own part is shorter than this fraction of it depends on the others.
const LEAST_OWN: f64 = 1e-9;

/// Rows in the order of time within each run.
pub(crate) struct Rows {
    /// Of each row.
    pub(crate) run: Vec<usize>,
    /// Middle of its window, s.
    pub(crate) middle_s: Vec<f64>,
    /// Length of its window over the nominal one.
    pub(crate) weight: Vec<f64>,
    /// Length of the longest run of any block, s.
    pub(crate) longest_s: f64,
    /// Nominal length of a window, s.
    pub(crate) nominal_s: f64,
}

impl Rows {
    pub(crate) fn view(&self) -> NoiseRows<'_> {
        let Self { run, middle_s, weight, longest_s, nominal_s } = self;
        NoiseRows { run, middle_s, weight, longest_s: *longest_s, nominal_s: *nominal_s }
    }

    /// Rows of which there are so many in all blocks, averaged so that there are [`MOST_ROWS`] in all; and which of them each has for [`mean`].
    pub(crate) fn averaged(rows: NoiseRows<'_>, all: usize) -> (Self, Vec<Range<usize>>) {
        Self::grouped(rows, all.div_ceil(MOST_ROWS))
    }

    /// About so many rows at most, each the mean of neighbours; and which of them each has.
    pub(crate) fn at_most(rows: NoiseRows<'_>, most: usize) -> (Self, Vec<Range<usize>>) {
        Self::grouped(rows, rows.len().div_ceil(most))
    }

    fn grouped(rows: NoiseRows<'_>, at_a_time: usize) -> (Self, Vec<Range<usize>>) {
        let groups = groups(rows, at_a_time);
        let averaged = Self {
            run: groups.iter().map(|group| rows.run[group.start]).collect(),
            middle_s: groups.iter().map(|group| mean(rows.weight, group, |i| rows.middle_s[i])).collect(),
            weight: groups.iter().map(|group| rows.weight[group.clone()].iter().sum()).collect(),
            longest_s: rows.longest_s,
            nominal_s: rows.nominal_s * at_a_time as f64,
        };
        (averaged, groups)
    }
}

/// Groups of so many rows of a run that follow each other; fewer before a gap and at the end.
fn groups(rows: NoiseRows<'_>, at_a_time: usize) -> Vec<Range<usize>> {
    let mut groups: Vec<Range<usize>> = Vec::new();
    for i in 0..rows.len() {
        let follows = |group: &&mut Range<usize>| {
            group.len() < at_a_time
                && rows.run[i - 1] == rows.run[i]
                && rows.middle_s[i] - rows.middle_s[i - 1] < NEIGHBOURS_WITHIN * rows.nominal_s
        };
        match groups.last_mut().filter(follows) {
            Some(group) => group.end = i + 1,
            None => groups.push(i..i + 1),
        }
    }
    groups
}

/// Mean over a group of rows, by their lengths.
pub(crate) fn mean(weight: &[f64], group: &Range<usize>, value: impl Fn(usize) -> f64) -> f64 {
    if group.len() == 1 {
        return value(group.start);
    }
    let sum: f64 = group.clone().map(|i| weight[i] * value(i)).sum();
    sum / weight[group.clone()].iter().sum::<f64>()
}

/// Rows with their columns: those of this block alone, those of all blocks, and what was measured.
pub(crate) struct Block {
    pub(crate) rows: Rows,
    pub(crate) own: usize,
    pub(crate) columns: DMatrix<f64>,
}

/// Columns that add less than this part of the largest are none of their own.
const LEAST_PART: f64 = 1e-6;

impl Block {
    /// Rows with columns of their own that are no noise, made to stand at right angles; columns that depend on others are left out. `None`
    /// where they have no such form.
    pub(crate) fn at_right_angles(rows: Rows, columns: DMatrix<f64>, measured: impl Fn(usize) -> f64) -> Option<Self> {
        let svd = columns.svd(true, false);
        let least = LEAST_PART * svd.singular_values.max();
        let own = svd.singular_values.iter().filter(|value| **value > least).count();
        let u = svd.u?;
        let columns = DMatrix::from_fn(u.nrows(), own + 1, |i, j| if j < own { u[(i, j)] } else { measured(i) });
        Some(Self { rows, own, columns })
    }

    /// Without some of its columns, counted from one of them.
    fn drop(&mut self, from: usize, columns: &[usize]) {
        let columns: Vec<usize> = columns.iter().map(|column| from + column).collect();
        self.columns = std::mem::take(&mut self.columns).remove_columns_at(&columns);
    }
}

/// Blocks of rows, ready for many noises.
pub(crate) struct RestrictedLikelihood {
    blocks: Vec<Ready>,
    /// Columns of all blocks.
    shared: usize,
    /// Rows less columns.
    pub(crate) degrees: f64,
    /// Nominal length of a row, s.
    pub(crate) nominal_s: f64,
}

/// A block whose columns are orthonormal, row by row.
struct Ready {
    rows: Rows,
    own: usize,
    /// Of a row: its columns and what was measured.
    width: usize,
    values: Vec<f64>,
}

/// What rows make of a noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Misfit {
    /// Weighted sum of squares of what the columns do not explain.
    pub(crate) ssr: f64,
    /// ln|V| + ln|XᵀV⁻¹X|, but for a constant.
    pub(crate) determinants: f64,
}

impl RestrictedLikelihood {
    /// `None` where columns explain all rows.
    pub(crate) fn of(mut blocks: Vec<Block>) -> Option<Self> {
        for block in &mut blocks {
            let dropped = orthonormal(&mut [(&mut block.columns, 0)], block.own);
            block.drop(0, &dropped);
            block.own -= dropped.len();
        }
        let shared = blocks.first().map_or(0, |block| block.columns.ncols() - block.own - 1);
        let mut all: Vec<(&mut DMatrix<f64>, usize)> =
            blocks.iter_mut().map(|block| (&mut block.columns, block.own)).collect();
        let dropped = orthonormal(&mut all, shared);
        blocks.iter_mut().for_each(|block| block.drop(block.own, &dropped));
        let shared = shared - dropped.len();
        let nominal_s = blocks.first()?.rows.nominal_s;
        let rows: usize = blocks.iter().map(|block| block.columns.nrows()).sum();
        let columns = shared + blocks.iter().map(|block| block.own).sum::<usize>();
        let degrees = rows.checked_sub(columns).filter(|degrees| *degrees > 0)? as f64;
        let ready = |Block { rows, own, columns }: Block| Ready {
            rows,
            own,
            width: columns.ncols(),
            values: columns.transpose().as_slice().to_vec(),
        };
        Some(Self { blocks: blocks.into_iter().map(ready).collect(), shared, degrees, nominal_s })
    }

    /// Sum of squares under white noise.
    pub(crate) fn ssr_of_white(&self) -> f64 {
        let of_row = |block: &Ready, row: &[f64], weight: &f64| weight * row[block.width - 1].powi(2);
        let of_block = |block: &Ready| -> f64 {
            block.values.chunks(block.width).zip(&block.rows.weight).map(|(row, w)| of_row(block, row, w)).sum()
        };
        self.blocks.iter().map(of_block).sum()
    }

    /// `None` where this noise makes rows that cannot be solved.
    pub(crate) fn misfit(&self, noise: SlowNoise) -> Option<Misfit> {
        let mut of_all = Products::new(self.shared + 1);
        let mut determinants = 0.0;
        for block in &self.blocks {
            let whitening = Whitening::new(block.rows.view(), noise);
            let mut products = block.products(&whitening);
            determinants += whitening.log_determinant + products.eliminate(block.own)?;
            of_all.add(&products, block.own);
        }
        determinants += of_all.eliminate(self.shared)?;
        let ssr = of_all.last();
        (ssr > 0.0 && ssr.is_finite()).then_some(Misfit { ssr, determinants })
    }

    /// −2·ln L; infinite where there is none.
    pub(crate) fn criterion(&self, noise: SlowNoise) -> f64 {
        self.misfit(noise).map_or(f64::INFINITY, |misfit| self.degrees * misfit.ssr.ln() + misfit.determinants)
    }
}

impl Ready {
    /// Scalar products of the columns of whitened rows.
    fn products(&self, whitening: &Whitening) -> Products {
        let mut out = Products::new(self.width);
        let mut filter = whitening.filter(self.width);
        let mut together = vec![0.0; TOGETHER * self.width];
        for (chunk, rows) in self.values.chunks(TOGETHER * self.width).enumerate() {
            together[..rows.len()].copy_from_slice(rows);
            together[rows.len()..].fill(0.0);
            for (at, row) in together[..rows.len()].chunks_mut(self.width).enumerate() {
                filter.push(TOGETHER * chunk + at, row);
            }
            out.push(&together);
        }
        out
    }
}

/// Scalar products of columns with those from themselves on: the upper triangle, row by row.
struct Products {
    width: usize,
    values: Vec<f64>,
}

impl Products {
    fn new(width: usize) -> Self {
        Self { width, values: vec![0.0; width * width] }
    }

    /// Adds those of [`TOGETHER`] rows.
    fn push(&mut self, rows: &[f64]) {
        let width = self.width;
        let [a, b, c, d] = std::array::from_fn(|at| &rows[at * width..(at + 1) * width]);
        for (i, sums) in self.values.chunks_mut(width).enumerate() {
            let factors = [a[i], b[i], c[i], d[i]];
            let others = a[i..].iter().zip(&b[i..]).zip(c[i..].iter().zip(&d[i..]));
            for (sum, ((a, b), (c, d))) in sums[i..].iter_mut().zip(others) {
                *sum += (factors[0] * a + factors[1] * b) + (factors[2] * c + factors[3] * d);
            }
        }
    }

    /// Projects the first columns out of the others; ln of their determinant.
    fn eliminate(&mut self, count: usize) -> Option<f64> {
        let width = self.width;
        let mut ln_determinant = 0.0;
        for k in 0..count {
            let (above, below) = self.values.split_at_mut((k + 1) * width);
            let pivots = &above[k * width..];
            let pivot = Some(pivots[k]).filter(|pivot| *pivot > 0.0)?;
            ln_determinant += pivot.ln();
            for (i, sums) in (k + 1..width).zip(below.chunks_mut(width)) {
                let part = pivots[i] / pivot;
                sums[i..].iter_mut().zip(&pivots[i..]).for_each(|(sum, pivot)| *sum -= part * pivot);
            }
        }
        Some(ln_determinant)
    }

    /// Adds what others have from this column on.
    fn add(&mut self, others: &Self, from: usize) {
        let rows = others.values.chunks(others.width).skip(from);
        for (sums, row) in self.values.chunks_mut(self.width).zip(rows) {
            sums.iter_mut().zip(&row[from..]).for_each(|(sum, other)| *sum += other);
        }
    }

    fn last(&self) -> f64 {
        self.values[self.values.len() - 1]
    }
}

/// Makes so many columns orthonormal, from a place on in each block, all blocks together, and subtracts what they explain from all that
/// follow them (modified Gram–Schmidt). Those that depend on the columns before them stay as they are; their places are the result.
fn orthonormal(blocks: &mut [(&mut DMatrix<f64>, usize)], count: usize) -> Vec<usize> {
    let squared = |blocks: &[(&mut DMatrix<f64>, usize)], k: usize| -> f64 {
        blocks.iter().map(|(columns, from)| columns.column(from + k).norm_squared()).sum()
    };
    let whole: Vec<f64> = (0..count).map(|k| squared(blocks, k)).collect();
    let after = blocks.first().map_or(0, |(columns, from)| columns.ncols() - from);
    let mut dependent = Vec::new();
    for (k, whole) in whole.into_iter().enumerate() {
        let own = squared(blocks, k);
        // Without a temperature in some row a column is not a number.
        if !(own > LEAST_OWN.powi(2) * whole && own.is_finite()) {
            dependent.push(k);
            continue;
        }
        let unit: Vec<DVector<f64>> =
            blocks.iter().map(|(columns, from)| columns.column(from + k) / own.sqrt()).collect();
        for ((columns, from), unit) in blocks.iter_mut().zip(&unit) {
            columns.set_column(*from + k, unit);
        }
        for j in k + 1..after {
            let part: f64 =
                blocks.iter().zip(&unit).map(|((columns, from), unit)| columns.column(from + j).dot(unit)).sum();
            for ((columns, from), unit) in blocks.iter_mut().zip(&unit) {
                columns.column_mut(*from + j).axpy(-part, unit, 1.0);
            }
        }
    }
    dependent
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two blocks of 40 rows with a constant each, a slope and a parabola in common; gaps and weights differ.
    fn blocks() -> Vec<Block> {
        let number = |at: usize| ((at * 7919) % 1009) as f64 / 1009.0 - 0.5;
        let block = |of: usize| {
            let middle_s: Vec<f64> = (0..40).map(|i| 100.0 * (i + (i / 17) * 3) as f64).collect();
            let weight = (0..40).map(|i| if i % 9 == 0 { 0.5 } else { 1.0 }).collect();
            let value = |i: usize, j: usize| {
                let t = middle_s[i] / 2000.0 + of as f64;
                [1.0, t, 1.0 + t * t, 3e4 + t + number(40 * of + i)][j]
            };
            let columns = DMatrix::from_fn(40, 4, value);
            Block {
                rows: Rows { run: vec![of; 40], middle_s, weight, longest_s: 5000.0, nominal_s: 100.0 },
                own: 1,
                columns,
            }
        };
        vec![block(0), block(1)]
    }

    /// −2·ln L of all rows at a time, with the covariance of the noise as a matrix.
    fn dense(noise: SlowNoise) -> f64 {
        let blocks = blocks();
        let mut v = DMatrix::zeros(80, 80);
        let mut x = DMatrix::zeros(80, 4);
        let mut y = DVector::zeros(80);
        for (of, Block { rows, columns, .. }) in blocks.iter().enumerate() {
            let identity = DMatrix::identity(40, 40);
            // zᵀVz with z the identity is V.
            v.view_mut((40 * of, 40 * of), (40, 40)).copy_from(&noise.between(rows.view(), &identity));
            x.view_mut((40 * of, of), (40, 1)).copy_from(&columns.column(0));
            x.view_mut((40 * of, 2), (40, 2)).copy_from(&columns.columns(1, 2));
            y.rows_mut(40 * of, 40).copy_from(&columns.column(3));
        }
        let factor = v.cholesky().unwrap();
        let (x, y) = (factor.l().solve_lower_triangular(&x).unwrap(), factor.l().solve_lower_triangular(&y).unwrap());
        let normal = (x.transpose() * &x).cholesky().unwrap();
        let residual = &y - &x * normal.solve(&(x.transpose() * &y));
        let ln_det = |l: DMatrix<f64>| 2.0 * l.diagonal().iter().map(|value| value.ln()).sum::<f64>();
        76.0 * residual.norm_squared().ln() + ln_det(factor.l()) + ln_det(normal.l())
    }

    #[test]
    fn is_that_of_the_whole_covariance_but_for_a_constant() {
        let likelihood = RestrictedLikelihood::of(blocks()).unwrap();
        assert_eq!(likelihood.degrees, 76.0);
        let white = SlowNoise::default();
        let noises = [
            SlowNoise { flicker: 0.2, ..white },
            SlowNoise { walk_per_h: 3.0, ..white },
            SlowNoise { flicker: 1e-3, markov: Some((20.0, 500.0)), ..white },
        ];
        for noise in noises {
            let found = likelihood.criterion(noise) - likelihood.criterion(white);
            let expected = dense(noise) - dense(white);
            assert!((found - expected).abs() < 1e-7, "{noise:?}: {found} {expected}");
        }
    }

    /// A column of another run than the rows have is zero; one that repeats another adds nothing.
    #[test]
    fn columns_that_depend_on_others_are_dropped() {
        let expected = RestrictedLikelihood::of(blocks()).unwrap();
        let with = |block: Block| {
            let columns = block.columns.insert_column(3, 0.0).insert_column(2, 0.0);
            let repeated = columns.column(1) * 2.0;
            let mut block = Block { columns, ..block };
            block.columns.set_column(2, &repeated);
            block
        };
        let found = RestrictedLikelihood::of(blocks().into_iter().map(with).collect()).unwrap();
        assert_eq!((found.degrees, found.shared), (expected.degrees, expected.shared));
        let noise = SlowNoise { flicker: 0.2, ..SlowNoise::default() };
        let of = |likelihood: &RestrictedLikelihood| {
            likelihood.criterion(noise) - likelihood.criterion(SlowNoise::default())
        };
        assert!((of(&found) - of(&expected)).abs() < 1e-9);
    }

    #[test]
    fn columns_that_explain_all_rows_tell_no_noise() {
        let few = |mut block: Block| {
            block.columns = block.columns.rows(0, 2).into_owned();
            block
        };
        assert!(RestrictedLikelihood::of(blocks().into_iter().map(few).collect()).is_none());
    }
}
