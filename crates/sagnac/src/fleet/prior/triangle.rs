//! Symmetric matrices kept as their lower triangle, row after row: entry (i, j ≤ i) stands at i·(i + 1)/2 + j.

use nalgebra::DMatrix;

/// Place of an entry in a lower triangle.
pub(super) fn place(i: usize, j: usize) -> usize {
    let (row, column) = (i.max(j), i.min(j));
    row * (row + 1) / 2 + column
}

pub(super) fn symmetric(lower: &[f64], p: usize) -> DMatrix<f64> {
    DMatrix::from_fn(p, p, |i, j| lower.get(place(i, j)).copied().unwrap_or(f64::NAN))
}

pub(super) fn lower(matrix: &DMatrix<f64>) -> Vec<f64> {
    (0..matrix.nrows()).flat_map(|i| (0..=i).map(move |j| matrix[(i, j)])).collect()
}
