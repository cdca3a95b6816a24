//! A sketch of what a log says, whatever its bytes are: a copy with other line ends, columns, or compression has the same.
//!
//! ```text
//! r_i = Σ over the axes of mix(angle of the row, letter)      whole quanta; an angle of a rate log to 12 bits of its mantissa
//! h_i = mix(Σ_k r_{i−k}·B^k), k < n, modulo 2⁶⁴               a rolling hash (Karp and Rabin 1987) of n rows
//! sketch = of n = 64 and of n = 12: the 64 smallest distinct h (Broder 1997), of each its lower 32 bits
//! ```
//!
//! The part of the hashes that two sketches share estimates the part of the stretches of n rows that two logs share. Some rows lost
//! or changed cost the stretches that hold them: short stretches survive where one row in 20 is lost, long ones tell coarse counts
//! apart. The rows themselves cannot be had from the hashes.
//!
//! Where it fails: rows that are resampled, or changed each by itself, make another log. A log of fewer than [`FEWEST`] distinct stretches
//! has no hashes of that length, nor has one that repeats itself in a kept stretch: coarse counts that hardly move are alike in independent
//! tests, too. Of such a log no copy with one row in 64 lost is known. A short part of a long log shares few hashes with it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::ops::Range;

use fearless_simd::{Level, Simd, SimdBase, dispatch, u64x8};

use crate::ingest::checks::batch::Batch;

/// Rows of a stretch, long and short.
const ROWS: [usize; 2] = [64, 12];
/// Hashes kept of each length.
const KEPT: usize = 64;
/// Fewer distinct stretches than this are no sketch.
const FEWEST: usize = 24;
/// Hashes in common that are no chance.
const COMMON: usize = 8;
/// Rows hashed together.
const TOGETHER: usize = 512;
/// Base of the rolling hash.
const BASE: u64 = 0x9e37_79b9_7f4a_7c15;
/// Hexadecimal digits of a kept hash.
const DIGITS: usize = 8;

/// Collects the sketch of a log as it is read.
pub(crate) struct Sketch {
    /// Of each axis: its letter, mixed.
    letters: Vec<u64>,
    /// Σ r_{i−k}·B^k over all rows to the last, behind those of as many rows before it as the longest stretch has; zero before the first row.
    prefixes: Vec<u64>,
    rows: usize,
    stretches: [Stretches; ROWS.len()],
    /// The vector instructions of this processor.
    level: Level,
}

/// The smallest hashes of stretches of one length.
struct Stretches {
    length: usize,
    /// Base to the power of the length.
    far: u64,
    smallest: BTreeSet<u64>,
    /// The largest of them once there are enough.
    largest: u64,
    /// Those of them that came more than once.
    again: BTreeSet<u64>,
}

impl Sketch {
    pub(crate) fn new(letters: Vec<char>) -> Self {
        Self {
            letters: letters.into_iter().map(|letter| mix(u64::from(letter))).collect(),
            prefixes: vec![0; ROWS[0] + 1],
            rows: 0,
            stretches: ROWS.map(Stretches::of),
            level: Level::new(),
        }
    }

    /// The next rows.
    pub(crate) fn push(&mut self, batch: &Batch, whole: bool) {
        let ends = (TOGETHER..batch.len()).step_by(TOGETHER).chain([batch.len()]);
        let mut at = 0;
        for end in ends {
            self.push_part(batch, at..end, whole);
            at = end;
        }
    }

    /// So few rows that their prefixes stay in the nearest cache.
    fn push_part(&mut self, batch: &Batch, part: Range<usize>, whole: bool) {
        let (mut prefix, known) = (self.prefixes[ROWS[0]], ROWS[0] + 1);
        self.prefixes.resize(known + part.len(), 0);
        let mut room = [0; TOGETHER];
        let hashes = &mut room[..part.len()];
        for (letter, angles) in self.letters.iter().zip(&batch.angle) {
            hashes
                .iter_mut()
                .zip(&angles[part.clone()])
                .for_each(|(hash, angle)| *hash = bits_of(*angle, whole) ^ letter);
            dispatch!(self.level, simd => mix_all(simd, hashes));
            self.prefixes[known..].iter_mut().zip(&*hashes).for_each(|(sum, hash)| *sum = sum.wrapping_add(*hash));
        }
        for value in &mut self.prefixes[known..] {
            prefix = prefix.wrapping_mul(BASE).wrapping_add(*value);
            *value = prefix;
        }
        for stretches in &mut self.stretches {
            // Nothing before the first whole stretch.
            let skipped = (stretches.length - 1).saturating_sub(self.rows).min(part.len());
            let ends = &self.prefixes[known + skipped..];
            let hashes = &mut hashes[..ends.len()];
            let pairs = ends.iter().zip(&self.prefixes[known + skipped - stretches.length..]);
            let far = stretches.far;
            hashes
                .iter_mut()
                .zip(pairs)
                .for_each(|(hash, (to_last, before))| *hash = to_last.wrapping_sub(before.wrapping_mul(far)));
            dispatch!(self.level, simd => mix_all(simd, hashes));
            stretches.look_at(hashes);
        }
        self.rows += part.len();
        self.prefixes.drain(..part.len());
    }

    /// The sketch as hexadecimal digits; empty where the log says too little.
    pub(crate) fn hex(&self) -> String {
        let kept = self.stretches.iter().filter(|stretches| stretches.tell());
        kept.flat_map(|stretches| &stretches.smallest).fold(String::new(), |mut text, hash| {
            // The smallest differ in their lower half only.
            let _ = write!(text, "{:08x}", hash & 0xffff_ffff);
            text
        })
    }
}

impl Stretches {
    fn of(length: usize) -> Self {
        let far = (0..length).fold(1_u64, |power, _| power.wrapping_mul(BASE));
        Self { length, far, smallest: BTreeSet::new(), largest: u64::MAX, again: BTreeSet::new() }
    }

    /// Keeps the smallest of these.
    fn look_at(&mut self, hashes: &[u64]) {
        for hash in hashes {
            if *hash <= self.largest {
                self.keep(*hash);
            }
        }
    }

    fn keep(&mut self, hash: u64) {
        if !self.smallest.insert(hash) {
            self.again.insert(hash);
        } else if self.smallest.len() > KEPT
            && let Some(evicted) = self.smallest.pop_last()
        {
            self.again.remove(&evicted);
        }
        if self.smallest.len() == KEPT {
            self.largest = self.smallest.last().copied().unwrap_or(u64::MAX);
        }
    }

    /// Enough of them, and none came again.
    fn tell(&self) -> bool {
        self.smallest.len() >= FEWEST && self.again.is_empty()
    }
}

/// The rows of one of these logs are, for a part, those of one of the others.
pub fn share_rows(these: &[&str], those: &[&str]) -> bool {
    let hashes = |all: &[&str]| -> BTreeSet<u32> { all.iter().flat_map(|sketch| hashes_of(sketch)).collect() };
    hashes(these).intersection(&hashes(those)).count() >= COMMON
}

/// Sketches of many logs, to find one whose rows came before without comparing each with each.
#[derive(Clone, Debug, Default)]
pub struct Sketches {
    /// Hash and number of its log.
    hashes: BTreeSet<(u32, u32)>,
}

impl Sketches {
    /// One more log, by its number.
    pub fn add(&mut self, log: u32, sketch: &str) {
        self.hashes.extend(hashes_of(sketch).map(|hash| (hash, log)));
    }

    /// A log that shares rows with this one, as [`share_rows`] has it; the first.
    pub fn twin_of(&self, sketch: &str) -> Option<u32> {
        let mut common: BTreeMap<u32, usize> = BTreeMap::new();
        let distinct: BTreeSet<u32> = hashes_of(sketch).collect();
        for hash in distinct {
            for (_, log) in self.hashes.range((hash, 0)..=(hash, u32::MAX)) {
                *common.entry(*log).or_default() += 1;
            }
        }
        common.into_iter().find(|(_, count)| *count >= COMMON).map(|(log, _)| log)
    }
}

fn hashes_of(sketch: &str) -> impl Iterator<Item = u32> + '_ {
    let digits = sketch.as_bytes().chunks(DIGITS).filter_map(|digits| std::str::from_utf8(digits).ok());
    digits.filter_map(|digits| u32::from_str_radix(digits, 16).ok())
}

fn bits_of(angle: f64, whole: bool) -> u64 {
    const DROPPED: u32 = 52 - 12;
    // + 0.0: no sign of zero.
    let bits = (angle + 0.0).to_bits();
    if whole { bits } else { bits.wrapping_add(1 << (DROPPED - 1)) >> DROPPED }
}

/// The last steps of SplitMix64.
fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// The same of many values.
#[inline(always)]
fn mix_all<S: Simd>(simd: S, values: &mut [u64]) {
    let splat = |value: u64| u64x8::splat(simd, value);
    let (vectors, rest) = values.as_chunks_mut::<8>();
    for vector in vectors {
        let value = u64x8::from_slice(simd, vector) + splat(0x9e37_79b9_7f4a_7c15);
        let value = (value ^ (value >> 30)) * splat(0xbf58_476d_1ce4_e5b9);
        let value = (value ^ (value >> 27)) * splat(0x94d0_49bb_1331_11eb);
        (value ^ (value >> 31)).store_slice(vector);
    }
    rest.iter_mut().for_each(|value| *value = mix(*value));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sketch(rows: &[f64], pieces: usize) -> String {
        let mut sketch = Sketch::new(vec!['x']);
        for part in rows.chunks(pieces) {
            let batch = Batch { angle: vec![part.to_vec()], end_ns: vec![0; part.len()], ..Batch::default() };
            sketch.push(&batch, true);
        }
        sketch.hex()
    }

    /// Records hold sketches made with other vector instructions, or none.
    #[test]
    fn vectors_mix_as_single_values_do() {
        let values: Vec<u64> = (0..19_u64).map(|n| n.wrapping_mul(BASE) ^ (n << 60)).collect();
        let expected: Vec<u64> = values.iter().map(|value| mix(*value)).collect();
        for level in [Level::baseline(), Level::new()] {
            let mut mixed = values.clone();
            dispatch!(level, simd => mix_all(simd, &mut mixed));
            assert_eq!(mixed, expected);
        }
        // SplitMix64 from the state 0: its first output, as published with the generator (Steele, Lea, Flood 2014; Vigna's splitmix64.c).
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
    }

    #[test]
    fn rows_make_the_sketch_however_they_come() {
        let mut state = 1;
        let rows: Vec<f64> = (0..5000)
            .map(|_| {
                state = mix(state);
                (state % 7) as f64
            })
            .collect();
        let whole = sketch(&rows, 5000);
        assert_eq!(whole.len(), ROWS.len() * KEPT * DIGITS);
        assert_eq!(whole, sketch(&rows, 7));
        let mut without = rows.clone();
        without.remove(2500);
        assert!(share_rows(&[&sketch(&without[3..], 11)], &[&whole]));
        // Evenly lost: no stretch of 64 rows survives, of twelve some do.
        for each in [50, 20] {
            let lost: Vec<f64> =
                rows.iter().enumerate().filter(|(at, _)| at % each != 3).map(|(_, row)| *row).collect();
            assert!(share_rows(&[&sketch(&lost, 11)], &[&whole]), "{each}");
        }
        let other: Vec<f64> = rows.iter().rev().copied().collect();
        assert!(!share_rows(&[&sketch(&other, 11)], &[&whole]));
        let mut all = Sketches::default();
        all.add(0, &sketch(&other, 11));
        assert_eq!(all.twin_of(&whole), None);
        all.add(1, &whole);
        assert_eq!(all.twin_of(&sketch(&without[3..], 11)), Some(1));
        assert_eq!(all.twin_of(""), None);
        assert_eq!(sketch(&vec![4.0; 5000], 100), "", "a counter that stands still says nothing");
        assert_eq!(sketch(&rows[..30], 100), "", "too short");
    }
}
