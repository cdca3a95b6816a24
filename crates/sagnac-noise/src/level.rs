//! How far rows scatter about their median, and whether counts alone show that none is far from it.
//!
//! ```text
//! scale² = ((q₉₅ − q₅) / 3.29)² + step²/6        3.29 σ between these quantiles of a normal distribution; rounding to the smallest step
//! far    = 6·scale                               noise alone exceeds it once in 10⁸ rows
//! ```
//!
//! Most blocks have no row that far, and counts show it without the quantiles: if at least so many rows lie at or below a level as a
//! quantile has below it, the quantile is not above that level ([`Bounds`]). The result is the same.

use fearless_simd::{Select, Simd, SimdBase, dispatch, f64x4};

use crate::vectors::VECTORS;

/// Fewest rows that give a scale.
const FEWEST: usize = 32;
/// Scales from the median to a disturbed row.
const FAR: f64 = 6.0;
/// Fraction of the rows in each tail outside the quantiles that give the scale, and the distance of these quantiles in
/// standard deviations of a normal distribution.
const TAIL: f64 = 0.05;
const TAILS_APART: f64 = 3.29;
/// Rows of a vector.
const LANES: usize = 4;

/// Median and scale of rows.
pub(crate) struct RowLevel {
    low: f64,
    pub(crate) median: f64,
    high: f64,
    /// Distance from the median beyond which a row is disturbed.
    pub(crate) far: f64,
}

impl RowLevel {
    /// `None` for too few rows, and for rows that are all alike.
    pub(crate) fn of(mut rows: Vec<f64>) -> Option<Self> {
        if rows.len() < FEWEST {
            return None;
        }
        let rounding = variance_of_rounding(smallest_step(&rows));
        let mut at = |part: f64| {
            let place = place_of_quantile(rows.len(), part);
            *rows.select_nth_unstable_by(place, f64::total_cmp).1
        };
        let (high, low) = (at(1.0 - TAIL), at(TAIL));
        let spread = (high - low) / TAILS_APART;
        let scale = (spread * spread + rounding).sqrt();
        (scale > 0.0).then(|| Self { low, median: at(0.5), high, far: FAR * scale })
    }
}

/// Smallest step between two rows that follow each other and differ, with the vectors of this processor.
fn smallest_step(rows: &[f64]) -> f64 {
    dispatch!(*VECTORS, simd => step_in_vectors(simd, rows))
}

/// Compiled into its caller, for the processor's own instructions.
#[inline(always)]
fn step_in_vectors<S: Simd>(simd: S, rows: &[f64]) -> f64 {
    let (zero, infinite) = (f64x4::splat(simd, 0.0), f64x4::splat(simd, f64::INFINITY));
    let (from, to) = (&rows[..rows.len().saturating_sub(1)], rows.get(1..).unwrap_or_default());
    let ((from, last_from), (to, last_to)) = (from.as_chunks::<LANES>(), to.as_chunks::<LANES>());
    let mut least = infinite;
    for (from, to) in from.iter().zip(to) {
        let step = (f64x4::from_slice(simd, to) - f64x4::from_slice(simd, from)).abs();
        let step = step.simd_gt(zero).select(step, infinite);
        least = step.simd_lt(least).select(step, least);
    }
    let last = last_from.iter().zip(last_to).map(|(from, to)| (to - from).abs()).filter(|step| *step > 0.0);
    least.as_slice().iter().copied().chain(last).fold(f64::INFINITY, f64::min)
}

/// The smallest step is at least that of rounding; its differences have a variance of step²/6.
fn variance_of_rounding(step: f64) -> f64 {
    if step.is_finite() { step * step / 6.0 } else { 0.0 }
}

/// Where a quantile is in sorted rows.
fn place_of_quantile(rows: usize, part: f64) -> usize {
    ((rows - 1) as f64 * part).round() as usize
}

/// Levels near the quantiles of a block, from which counts bound those of the next.
#[derive(Clone)]
pub(crate) struct Bounds {
    /// Above the low quantile and below the high one.
    tails: [f64; 2],
    /// Below and above the median.
    middle: [f64; 2],
}

impl Bounds {
    /// Distance of a level from its quantile, in the distance between the tails: quantiles of the next block scatter by less.
    const MARGIN: f64 = 0.07;
    /// Share of the threshold that is used: rounding is far less.
    const SHARE: f64 = 0.999;

    pub(crate) fn about(level: &RowLevel) -> Self {
        let margin = Self::MARGIN * (level.high - level.low);
        Self {
            tails: [level.low + margin, level.high - margin],
            middle: [level.median - margin, level.median + margin],
        }
    }

    /// `Some` if none of these rows can be disturbed by [`RowLevel`], with what was seen before them: what was seen in the last `keep` of
    /// them, for the rows that follow.
    pub(crate) fn hold(&self, before: Seen, rows: &[f64], keep: usize) -> Option<Seen> {
        let (early, late) = rows.split_at(rows.len().saturating_sub(keep));
        let late = self.see(late);
        let seen = before.and(&self.see(early)).and(&late);
        if seen.rows < FEWEST {
            return None;
        }
        let [low, middle, high] = [TAIL, 0.5, 1.0 - TAIL].map(|part| place_of_quantile(seen.rows, part));
        let bounded =
            seen.low > low && seen.high >= seen.rows - high && seen.below <= middle && seen.above < seen.rows - middle;
        let spread = (self.tails[1] - self.tails[0]) / TAILS_APART;
        let far = Self::SHARE * FAR * (spread * spread + variance_of_rounding(seen.step)).sqrt();
        let holds = bounded && seen.most - self.middle[0] < far && self.middle[1] - seen.least < far;
        holds.then_some(late)
    }

    /// Counts some rows, with the vectors of this processor.
    pub(crate) fn see(&self, rows: &[f64]) -> Seen {
        dispatch!(*VECTORS, simd => self.count(simd, rows))
    }

    /// Compiled into its caller, for the processor's own instructions.
    #[inline(always)]
    fn count<S: Simd>(&self, simd: S, rows: &[f64]) -> Seen {
        let ([low, high], [below, above]) = (self.tails, self.middle);
        let (low, high) = (f64x4::splat(simd, low), f64x4::splat(simd, high));
        let (below, above) = (f64x4::splat(simd, below), f64x4::splat(simd, above));
        let (one, none) = (f64x4::splat(simd, 1.0), f64x4::splat(simd, 0.0));
        let mut counts = [none; 4];
        let (mut least, mut most) = (f64x4::splat(simd, f64::INFINITY), f64x4::splat(simd, f64::NEG_INFINITY));
        let (whole, rest) = rows.as_chunks::<LANES>();
        for row in whole {
            let row = f64x4::from_slice(simd, row);
            counts[0] += row.simd_le(low).select(one, none);
            counts[1] += row.simd_lt(below).select(one, none);
            counts[2] += row.simd_gt(above).select(one, none);
            counts[3] += row.simd_ge(high).select(one, none);
            least = row.simd_lt(least).select(row, least);
            most = row.simd_gt(most).select(row, most);
        }
        let count = |lanes: f64x4<S>| lanes.as_slice().iter().sum::<f64>() as usize;
        let in_rest = |is: &dyn Fn(&f64) -> bool| rest.iter().filter(|row| is(row)).count();
        let all = |lanes: f64x4<S>, of_two: fn(f64, f64) -> f64, from: f64| {
            lanes.as_slice().iter().chain(rest).copied().fold(from, of_two)
        };
        Seen {
            rows: rows.len(),
            low: count(counts[0]) + in_rest(&|row| *row <= self.tails[0]),
            below: count(counts[1]) + in_rest(&|row| *row < self.middle[0]),
            above: count(counts[2]) + in_rest(&|row| *row > self.middle[1]),
            high: count(counts[3]) + in_rest(&|row| *row >= self.tails[1]),
            least: all(least, f64::min, f64::INFINITY),
            most: all(most, f64::max, f64::NEG_INFINITY),
            step: step_in_vectors(simd, rows),
            ends: rows.first().zip(rows.last()).map(|(first, last)| (*first, *last)),
        }
    }
}

/// Rows that were counted: how many lie beyond each level, the outermost, the smallest step between two of them.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    rows: usize,
    low: usize,
    below: usize,
    above: usize,
    high: usize,
    least: f64,
    most: f64,
    step: f64,
    /// The first and the last.
    ends: Option<(f64, f64)>,
}

impl Seen {
    /// With the rows that follow them.
    fn and(self, next: &Self) -> Self {
        let joint = self.ends.zip(next.ends).map_or(0.0, |((_, last), (first, _))| (first - last).abs());
        let joint = if joint > 0.0 { joint } else { f64::INFINITY };
        Self {
            rows: self.rows + next.rows,
            low: self.low + next.low,
            below: self.below + next.below,
            above: self.above + next.above,
            high: self.high + next.high,
            least: self.least.min(next.least),
            most: self.most.max(next.most),
            step: self.step.min(next.step).min(joint),
            ends: self.ends.map_or(next.ends, |(first, last)| Some((first, next.ends.map_or(last, |(_, last)| last)))),
        }
    }
}
