//! The loop over the rows of a problem: columns × weighting × division → factors.
//!
//! ```text
//! row i = [ levels | further columns | y ]  ─▶  less the means of its run, if centred  ─▶  times √w, or whitened  ─▶  factor of its block
//! ```
//!
//! What a run has for itself is projected out run by run ([`RunReducer`]). Fails where rows do not stand run by run.

use crate::fit::problem::least_squares::LeastSquares;
use crate::noise_model::factor::{RunColumns, RunReducer};
use crate::noise_model::whitening::Whitening;

/// How rows come to be equally sure.
#[derive(Clone, Copy)]
pub(crate) enum Weighting<'a> {
    /// By the lengths of their windows.
    Lengths,
    /// As innovations of their noise.
    Whitened(&'a Whitening),
}

/// Rows in blocks.
#[derive(Clone, Copy)]
pub(crate) struct InBlocks<'a> {
    /// Block of each row.
    pub(crate) block: &'a [usize],
    pub(crate) blocks: usize,
    /// Every run is about its own weighted mean.
    pub(crate) is_centred: bool,
}

/// Reduces all rows, each to the levels of `columns`, then as many further columns as `add` appends, then y, which it appends too.
/// One reducer for each block; one alone without a division.
pub(crate) fn reduce<'c>(
    problem: &LeastSquares<'_>,
    columns: &'c RunColumns,
    further: usize,
    weighting: Weighting<'_>,
    division: Option<InBlocks<'_>>,
    add: impl Fn(usize, &mut Vec<f64>),
) -> Vec<RunReducer<'c>> {
    let fill = |i: usize, row: &mut Vec<f64>| {
        row.clear();
        row.extend(columns.of(problem.run[i]).map(|level| problem.level(i, problem.levels()[level])));
        add(i, row);
    };
    let means = division.filter(|division| division.is_centred).map(|_| means_of_runs(problem, fill));
    // A run begins with a filter that knows nothing, so that its own columns may take the places of those of the run before.
    let mut filter = match weighting {
        Weighting::Lengths => None,
        Weighting::Whitened(whitening) => Some(whitening.filter(problem.levels().len() + further + 1)),
    };
    let blocks = division.map_or(1, |division| division.blocks);
    let mut reducers: Vec<RunReducer<'_>> = (0..blocks).map(|_| RunReducer::new(columns, further + 1)).collect();
    let mut row = Vec::with_capacity(problem.levels().len() + further + 1);
    for i in 0..problem.len() {
        fill(i, &mut row);
        if let Some(means) = &means {
            row.iter_mut().zip(&means[problem.run[i]]).for_each(|(value, mean)| *value -= mean);
        }
        match &mut filter {
            Some(filter) => filter.push(i, &mut row),
            None => {
                let root = problem.weight[i].sqrt();
                row.iter_mut().for_each(|value| *value *= root);
            }
        }
        reducers[division.map_or(0, |division| division.block[i])].push(problem.run[i], &row);
    }
    reducers
}

/// Weighted mean of each column over each run.
fn means_of_runs(problem: &LeastSquares<'_>, fill: impl Fn(usize, &mut Vec<f64>)) -> Vec<Vec<f64>> {
    let (mut means, mut weights) = (vec![Vec::new(); problem.runs.len()], vec![0.0; problem.runs.len()]);
    let mut row = Vec::new();
    for i in 0..problem.len() {
        fill(i, &mut row);
        let (mean, weight) = (&mut means[problem.run[i]], &mut weights[problem.run[i]]);
        mean.resize(row.len(), 0.0);
        *weight += problem.weight[i];
        let share = problem.weight[i] / *weight;
        mean.iter_mut().zip(&row).for_each(|(mean, value): (&mut f64, &f64)| *mean += share * (value - *mean));
    }
    means
}
