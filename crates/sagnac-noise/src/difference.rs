//! Squared differences of the phase: their sums give every deviation of this crate.
//!
//! With the phase `θ[k]` (arcsec, or any unit of angle) at the ends of rows of τ0, and τ = m·τ0:
//!
//! ```text
//! Allan      z[k] = θ[k+2m] − 2θ[k+m] + θ[k]                 σ²(τ) = Σ z² / (2 τ² M)     NIST SP 1065, eq. 11
//! Hadamard   z[k] = θ[k+3m] − 3θ[k+2m] + 3θ[k+m] − θ[k]      σ²(τ) = Σ z² / (6 τ² M)     NIST SP 1065, eq. 19
//! ```
//!
//! over all M values of k (fully overlapping). Sums of separate stretches add up, so a gap causes no error.
//!
//! A missing phase is NaN: only differences whose phases are all known are summed and counted.
//!
//! Squares are summed in sixteen interleaved sums, as vectors of whatever width the processor has: the order of additions, and so every
//! bit of the result, is the same on all.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x8};
use rayon::prelude::*;

use crate::vectors::VECTORS;

/// Independent partial sums, so that the processor can add in parallel: two vectors.
const LANES: usize = 16;
const LANES_OF_VECTOR: usize = LANES / 2;

/// Which difference of the phase is squared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Deviation {
    /// Second differences.
    Allan,
    /// Third differences: blind to a steady ramp of the rate.
    Hadamard,
}

impl Deviation {
    /// Multiples of τ that a difference spans.
    pub fn order(self) -> usize {
        match self {
            Self::Allan => 2,
            Self::Hadamard => 3,
        }
    }

    /// Weights of `θ[k+d·m] … θ[k]`.
    pub(crate) fn weights(self) -> &'static [f64] {
        match self {
            Self::Allan => &[1.0, -2.0, 1.0],
            Self::Hadamard => &[1.0, -3.0, 3.0, -1.0],
        }
    }

    /// Autocorrelation of the weights of the rows in a difference, at lags of 0, m, 2m … in units of m; linear in between.
    fn row_correlation(self) -> &'static [f64] {
        match self {
            Self::Allan => &[2.0, -1.0, 0.0],
            Self::Hadamard => &[6.0, -4.0, 1.0, 0.0],
        }
    }

    /// The same at any lag in rows, relative to lag 0.
    pub(crate) fn row_correlation_at(self, lag: f64, m: f64) -> f64 {
        let nodes = self.row_correlation();
        let (node, part) = ((lag.abs() / m).floor(), (lag.abs() / m).fract());
        let value = |node: usize| nodes.get(node).copied().unwrap_or(0.0);
        let node = node as usize;
        (value(node) + part * (value(node.saturating_add(1)) - value(node))) / nodes[0]
    }

    /// Denominator c of σ²(τ) = Σ z²/(c·τ²·M).
    pub(crate) fn divisor(self) -> f64 {
        match self {
            Self::Allan => 2.0,
            Self::Hadamard => 6.0,
        }
    }

    /// Σ of the squared differences that end at `from..end` of the phases, at a distance of `m`.
    pub(crate) fn squares(self, phases: &[f64], from: usize, end: usize, m: usize) -> f64 {
        self.squares_with(*VECTORS, phases, from..end, m)
    }

    /// The same of Allan's and of Hadamard's differences, in one pass over the phases.
    fn squares_of_both(level: Level, phases: &[f64], ends: Range<usize>, m: usize) -> [f64; 2] {
        let columns = [0, 1, 2, 3].map(|n| &phases[ends.start - n * m..ends.end - n * m]);
        dispatch!(level, simd => sums_of_squares(simd, columns, allan_and_hadamard(simd)))
    }

    /// The same with given vector instructions.
    fn squares_with(self, level: Level, phases: &[f64], ends: Range<usize>, m: usize) -> f64 {
        let before = |n: usize| &phases[ends.start - n * m..ends.end - n * m];
        match self {
            Self::Allan => {
                let columns = [before(0), before(1), before(2)];
                dispatch!(level, simd => sums_of_squares(simd, columns, #[inline(always)] |[a, b, c]| [allan(a, b, c)])[0])
            }
            Self::Hadamard => {
                let columns = [before(0), before(1), before(2), before(3)];
                dispatch!(level, simd => {
                    let three = f64x8::splat(simd, 3.0);
                    sums_of_squares(simd, columns, #[inline(always)] |[a, b, c, d]| [hadamard(three, [a, b, c, d])])[0]
                })
            }
        }
    }
}

#[inline(always)]
fn allan<S: Simd>(a: f64x8<S>, b: f64x8<S>, c: f64x8<S>) -> f64x8<S> {
    a - (b + b) + c
}

#[inline(always)]
fn hadamard<S: Simd>(three: f64x8<S>, [a, b, c, d]: [f64x8<S>; 4]) -> f64x8<S> {
    (a - d) - three * (b - c)
}

/// Both of the same phases.
#[inline(always)]
fn allan_and_hadamard<S: Simd>(simd: S) -> impl Fn([f64x8<S>; 4]) -> [f64x8<S>; 2] {
    let three = f64x8::splat(simd, 3.0);
    #[inline(always)]
    move |[a, b, c, d]| [allan(a, b, c), hadamard(three, [a, b, c, d])]
}

/// Σ f(columns)², of each of K functions.
#[inline(always)]
fn sums_of_squares<S: Simd, const N: usize, const K: usize>(
    simd: S,
    columns: [&[f64]; N],
    f: impl Fn([f64x8<S>; N]) -> [f64x8<S>; K],
) -> [f64; K] {
    let length = columns[0].len();
    let whole = columns.map(|column| column[..length].as_chunks::<LANES>());
    let mut sums = [[f64x8::splat(simd, 0.0); 2]; K];
    for at in 0..length / LANES {
        let values = std::array::from_fn(|column| &whole[column].0[at]);
        add_squares(simd, &mut sums, values, &f);
    }
    // Zeros instead of what is missing to a whole vector add nothing.
    let last = whole.map(|(_, rest)| {
        let mut values = [0.0; LANES];
        values[..rest.len()].copy_from_slice(rest);
        values
    });
    add_squares(simd, &mut sums, last.each_ref(), &f);
    sums.map(|sums| sums.iter().flat_map(|sum| sum.as_slice()).sum())
}

/// Adds f(values)² to the sums. All of this is compiled into its caller, for the processor's own instructions.
#[inline(always)]
fn add_squares<S: Simd, const N: usize, const K: usize>(
    simd: S,
    sums: &mut [[f64x8<S>; 2]; K],
    values: [&[f64; LANES]; N],
    f: &impl Fn([f64x8<S>; N]) -> [f64x8<S>; K],
) {
    for (which, from) in [0, LANES_OF_VECTOR].into_iter().enumerate() {
        let half = |column: usize| f64x8::from_slice(simd, &values[column][from..from + LANES_OF_VECTOR]);
        for (sums, difference) in sums.iter_mut().zip(f(std::array::from_fn(half))) {
            sums[which] += difference * difference;
        }
    }
}

/// Σ z² and M of one τ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SquareSum {
    /// Σ z².
    pub squares: f64,
    /// How many.
    pub number: f64,
}

impl SquareSum {
    /// Adds another sum.
    pub fn merge(&mut self, other: Self) {
        self.squares += other.squares;
        self.number += other.number;
    }

    /// σ²(τ) in (unit of the phase / s)², or `None` without a difference.
    pub fn variance(self, deviation: Deviation, tau_s: f64) -> Option<f64> {
        (self.number > 0.0).then(|| self.squares / (deviation.divisor() * tau_s * tau_s * self.number))
    }
}

/// A difference of the phase: which, and at what distance m.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Difference {
    /// Which.
    pub deviation: Deviation,
    /// τ in rows.
    pub m: usize,
}

impl Difference {
    /// Rows from its oldest phase to its newest.
    pub fn span(self) -> usize {
        self.deviation.order() * self.m
    }

    /// Σ of the squared differences that end at `from..end` of the phases.
    pub(crate) fn sum(self, phases: &[f64], from: usize, end: usize) -> SquareSum {
        SquareSum { squares: self.deviation.squares(phases, from, end, self.m), number: (end - from) as f64 }
    }

    /// The same for phases of which some are missing: differences that need one of these do not count.
    pub(crate) fn sum_of_known(self, phases: &[f64], from: usize, end: usize) -> SquareSum {
        let weights = self.deviation.weights();
        let mut sum = SquareSum::default();
        for newest in from..end {
            let difference: f64 =
                weights.iter().enumerate().map(|(n, weight)| weight * phases[newest - n * self.m]).sum();
            if !difference.is_nan() {
                sum.squares += difference * difference;
                sum.number += 1.0;
            }
        }
        sum
    }
}

/// Phases per block of summation.
const BLOCK: usize = 4096;
/// So many phases or more that begin a stretch are worth all processors: those that were held before the switch to the pyramid.
const AT_ONCE: usize = 32 * BLOCK;
/// Phases that are copied together: glibc copies 2 KiB and more by an instruction that some processors execute several times slower.
const COPIED: usize = 128;

/// The differences of one stretch as its phases arrive. Memory: the longest span and 4096 phases.
#[derive(Clone, Debug)]
pub(crate) struct Running {
    wanted: Vec<Difference>,
    /// Places of Allan's and of Hadamard's difference of the same distance, which are summed together; and of all others.
    pairs: Vec<[usize; 2]>,
    alone: Vec<usize>,
    longest: usize,
    /// Phases that are still needed and pending ones.
    phases: Vec<f64>,
    /// Phases of this stretch before the first of `phases`.
    dropped: usize,
    /// Phases of this stretch that are in the sums.
    summed: usize,
    /// Phases of this stretch that are missing.
    holes: usize,
    sums: Vec<SquareSum>,
}

impl Running {
    pub(crate) fn new(wanted: Vec<Difference>) -> Self {
        let sums = vec![SquareSum::default(); wanted.len()];
        let longest = wanted.iter().map(|difference| difference.span()).max().unwrap_or(0);
        // The first of each kind at each distance.
        let mut first = BTreeMap::<usize, [Option<usize>; 2]>::new();
        for (at, of) in wanted.iter().enumerate() {
            first.entry(of.m).or_default()[of.deviation.order() - 2].get_or_insert(at);
        }
        let pairs: Vec<[usize; 2]> =
            first.into_values().filter_map(|[allan, hadamard]| Some([allan?, hadamard?])).collect();
        let in_pairs: BTreeSet<usize> = pairs.iter().flatten().copied().collect();
        let alone = (0..wanted.len()).filter(|at| !in_pairs.contains(at)).collect();
        Self { wanted, pairs, alone, longest, phases: Vec::new(), dropped: 0, summed: 0, holes: 0, sums }
    }

    /// The next phases of the stretch, NaN where they are missing; `all_known` says that none is. Sums are made at fixed places of the
    /// stretch, so that the result does not depend on the pieces.
    pub(crate) fn extend(&mut self, mut phases: &[f64], all_known: bool) {
        if all_known && self.len() == 0 && phases.len() >= AT_ONCE {
            return self.begin(phases);
        }
        while !phases.is_empty() {
            let room = self.summed + BLOCK - self.len();
            let here = phases.split_off(..room.min(phases.len())).unwrap_or_default();
            if !all_known {
                self.holes += here.iter().filter(|phase| phase.is_nan()).count();
            }
            here.chunks(COPIED).for_each(|piece| self.phases.extend_from_slice(piece));
            if here.len() == room {
                self.sum_up();
            }
        }
    }

    /// Phases of this stretch so far.
    pub(crate) fn len(&self) -> usize {
        self.dropped + self.phases.len()
    }

    /// Adds the pending phases to the sums and drops those that no difference needs any more.
    fn sum_up(&mut self) {
        let end = self.len();
        let block = self.sums_of(&self.phases, self.dropped, self.summed..end, self.holes > 0);
        self.merge(block);
        self.summed = end;
        let old = self.phases.len().saturating_sub(self.longest);
        self.phases.drain(..old);
        self.dropped += old;
    }

    /// The first phases of a stretch, all of them known, on all processors: the blocks of [`Self::extend`], added in the same order.
    fn begin(&mut self, phases: &[f64]) {
        let (blocks, rest) = phases.as_chunks::<BLOCK>();
        let of_block = |block: usize| self.sums_of(phases, 0, block * BLOCK..(block + 1) * BLOCK, false);
        let sums: Vec<Vec<SquareSum>> = (0..blocks.len()).into_par_iter().map(of_block).collect();
        sums.into_iter().for_each(|block| self.merge(block));
        self.summed = blocks.len() * BLOCK;
        self.dropped = self.summed.saturating_sub(self.longest);
        self.phases.extend_from_slice(&phases[self.dropped..self.summed]);
        self.extend(rest, true);
    }

    fn merge(&mut self, block: Vec<SquareSum>) {
        self.sums.iter_mut().zip(block).for_each(|(sum, part)| sum.merge(part));
    }

    /// Sums of the differences that end at `ends` of the stretch, in the order of `wanted`. Its phases before the `dropped`-th are not in
    /// `phases`; with `holes` some may be missing.
    fn sums_of(&self, phases: &[f64], dropped: usize, ends: Range<usize>, holes: bool) -> Vec<SquareSum> {
        let mut sums = vec![SquareSum::default(); self.wanted.len()];
        let of_one = |difference: &Difference| {
            let from = ends.start.max(difference.span());
            match (from < ends.end, holes) {
                (false, _) => SquareSum::default(),
                (true, false) => difference.sum(phases, from - dropped, ends.end - dropped),
                (true, true) => difference.sum_of_known(phases, from - dropped, ends.end - dropped),
            }
        };
        for places in &self.pairs {
            let [allan, hadamard] = places.map(|place| &self.wanted[place]);
            if holes || ends.is_empty() || ends.start < hadamard.span() {
                places.iter().for_each(|place| sums[*place] = of_one(&self.wanted[*place]));
                continue;
            }
            let here = ends.start - dropped..ends.end - dropped;
            let number = here.len() as f64;
            let both = Deviation::squares_of_both(*VECTORS, phases, here, allan.m);
            places.iter().zip(both).for_each(|(place, squares)| sums[*place] = SquareSum { squares, number });
        }
        self.alone.iter().for_each(|place| sums[*place] = of_one(&self.wanted[*place]));
        sums
    }

    /// The sums since they were last taken, in the order of `wanted`; the stretch goes on.
    pub(crate) fn take_so_far(&mut self) -> Vec<SquareSum> {
        self.sum_up();
        std::mem::replace(&mut self.sums, vec![SquareSum::default(); self.wanted.len()])
    }

    /// Ends the stretch and returns its sums. The next phase starts a new stretch.
    pub(crate) fn take(&mut self) -> Vec<SquareSum> {
        let sums = self.take_so_far();
        self.phases.clear();
        (self.dropped, self.summed, self.holes) = (0, 0, 0);
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same additions in the same order, one after the other.
    fn one_by_one(deviation: Deviation, phases: &[f64], ends: Range<usize>, m: usize) -> f64 {
        let mut lanes = [0.0; LANES];
        for (at, end) in ends.enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|n| phases.get(end.wrapping_sub(n * m)).copied().unwrap_or(0.0));
            let difference = match deviation {
                Deviation::Allan => a - 2.0 * b + c,
                Deviation::Hadamard => (a - d) - 3.0 * (b - c),
            };
            lanes[at % LANES] += difference * difference;
        }
        lanes.iter().sum()
    }

    /// Every bit is the same with the widest vectors of this processor, with the narrowest, and without any.
    #[test]
    fn sums_do_not_depend_on_the_processor() {
        let mut phase = 0.0;
        let phases: Vec<f64> = (0..1000_u32)
            .map(|k| {
                phase += f64::from(k.wrapping_mul(2_654_435_761) >> 8) / 1e7 - 0.8;
                phase
            })
            .collect();
        for deviation in [Deviation::Allan, Deviation::Hadamard] {
            for m in [1, 7, 64, 300] {
                for length in [0, 1, 15, 16, 17, 90] {
                    let ends = 900..900 + length;
                    let wanted = one_by_one(deviation, &phases, ends.clone(), m).to_bits();
                    for level in [Level::new(), Level::baseline()] {
                        let sum = deviation.squares_with(level, &phases, ends.clone(), m);
                        let both = Deviation::squares_of_both(level, &phases, ends.clone(), m);
                        let of_both = both[deviation.order() - 2];
                        assert_eq!(
                            [sum, of_both].map(f64::to_bits),
                            [wanted; 2],
                            "{deviation:?} {m} {length} {level:?}"
                        );
                    }
                }
            }
        }
    }

    /// A long beginning of a stretch on all processors: the sums of the same phases one by one, to the last bit, and of those that follow.
    #[test]
    fn a_long_beginning_is_summed_as_its_phases_are_one_by_one() {
        let both = |m: usize| [Deviation::Allan, Deviation::Hadamard].map(|deviation| Difference { deviation, m });
        let alone = Difference { deviation: Deviation::Allan, m: 70 };
        let wanted: Vec<Difference> = [1, 2, 64, 512].into_iter().flat_map(both).chain([alone]).collect();
        let mut phase = 0.0;
        let phases: Vec<f64> = (0..(AT_ONCE + 3 * BLOCK) as u32)
            .map(|k| {
                phase += f64::from(k.wrapping_mul(2_654_435_761) >> 8) / 1e7 - 0.8;
                phase
            })
            .collect();
        for (first, second) in [(AT_ONCE, 0), (AT_ONCE + 77, 5000), (AT_ONCE + 3 * BLOCK, 0)] {
            let mut single = Running::new(wanted.clone());
            phases[..first + second].iter().for_each(|phase| single.extend(&[*phase], true));
            let mut at_once = Running::new(wanted.clone());
            at_once.extend(&phases[..first], true);
            at_once.extend(&phases[first..first + second], true);
            assert_eq!((at_once.len(), at_once.phases.len()), (single.len(), single.phases.len()));
            let bits =
                |sums: Vec<SquareSum>| sums.iter().map(|sum| (sum.squares.to_bits(), sum.number)).collect::<Vec<_>>();
            assert_eq!(bits(at_once.take()), bits(single.take()), "{first} {second}");
        }
    }
}
