//! Full overlap at any τ, from phases in memory.
//!
//! The outer loop runs over blocks of ends and the inner one over the differences, so that a block stays in the processor's
//! cache. Threads share the blocks, and the sums are added in order: the result is bit-identical for any number of threads.

use crate::difference::{Difference, SquareSum};
use rayon::prelude::*;

/// Ends per block: 64 KiB.
const BLOCK: usize = 8192;

/// Phases of one unbroken stretch: the running sum of its angles, each minus `offset` (their mean or near it, so that no
/// digits are lost; it cancels in the differences). One more than the angles.
pub fn phases(angles: &[f64], offset: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(angles.len() + 1);
    let mut phase = 0.0;
    out.push(phase);
    for angle in angles {
        phase += angle - offset;
        out.push(phase);
    }
    out
}

/// Sums of the differences over one stretch, in the order of `wanted`. A phase that is missing is NaN; differences that
/// need it do not count.
///
/// ```
/// use sagnac_noise::{Deviation, Difference, overlapping, phases};
///
/// // The ten-point set of NBS Monograph 140; its overlapping Allan deviation at 2 τ0 by NIST SP 1065, table 31.
/// let rates = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
/// let difference = Difference { deviation: Deviation::Allan, m: 2 };
/// let sums = overlapping(&phases(&rates, 0.0), &[difference]);
/// let deviation = sums[0].variance(Deviation::Allan, 2.0).unwrap().sqrt();
/// assert_eq!(format!("{deviation:.5}"), "85.95287");
/// ```
pub fn overlapping(phases: &[f64], wanted: &[Difference]) -> Vec<SquareSum> {
    let holes = phases.iter().any(|phase| phase.is_nan());
    let starts: Vec<usize> = (0..phases.len()).step_by(BLOCK).collect();
    let blocks: Vec<Vec<SquareSum>> = starts
        .par_iter()
        .map(|start| {
            let end = (start + BLOCK).min(phases.len());
            let one = |difference: &Difference| {
                let from = difference.span().max(*start);
                match (from < end, holes) {
                    (false, _) => SquareSum::default(),
                    (true, false) => difference.sum(phases, from, end),
                    (true, true) => difference.sum_of_known(phases, from, end),
                }
            };
            wanted.iter().map(one).collect()
        })
        .collect();
    let mut sums = vec![SquareSum::default(); wanted.len()];
    for block in blocks {
        sums.iter_mut().zip(block).for_each(|(sum, part)| sum.merge(part));
    }
    sums
}
