//! Rates at the ends of their range: clipped values, and signed numbers of 16 bits that were read as unsigned.
//!
//! ```text
//! clipped   the largest value stands in many rows, and the next one in a third of them at most
//! unsigned  whole numbers of 0 … 65535, which jump by nearly 65536 from row to row
//! ```
//!
//! Fails where a gyro without noise stands on the fastest plateau of a table: its largest value is exact, and looks clipped. A clipped value
//! is a caution, and no refusal.

use crate::error::{Error, Result};

/// Values of 16 bits.
const WORDS: f64 = 65_536.0;
/// A jump of this part of them is no motion.
const JUMP: f64 = 0.9;
/// Fewer rows at the end of a range may be chance.
const FEWEST_ROWS: u64 = 20;
/// The rows at the end are so many times those of the next value.
const PILED: u64 = 3;
/// The next value is nearer than this part of the range: of few values, the last may well be the most frequent.
const NEAR: f64 = 0.05;

/// A value that many rows have, as the largest or the smallest.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipped {
    /// Letter of the axis.
    pub axis: char,
    /// The value, °/h.
    pub rate_dph: f64,
    /// Rows that have it.
    pub rows: u64,
}

/// Watches the rates of a log.
pub(crate) struct FullScale {
    axes: Vec<Range>,
}

/// The range of one axis.
struct Range {
    letter: char,
    /// Of its column, from 1.
    column: usize,
    dph_per_unit: f64,
    top: End,
    /// Of the values with the other sign.
    bottom: End,
    last: f64,
    jumps: u64,
}

/// The largest value and the next one, with their rows.
#[derive(Clone, Copy)]
struct End {
    value: f64,
    rows: u64,
    next: f64,
    next_rows: u64,
}

impl End {
    const NONE: Self = Self { value: f64::NEG_INFINITY, rows: 0, next: f64::NEG_INFINITY, next_rows: 0 };

    #[inline(always)]
    fn push(&mut self, value: f64) {
        // Most values are below both.
        if value < self.next || value.is_nan() {
            return;
        }
        if value > self.value {
            *self = Self { value, rows: 1, next: self.value, next_rows: self.rows };
        } else if value == self.value {
            self.rows += 1;
        } else if value == self.next {
            self.next_rows += 1;
        } else {
            (self.next, self.next_rows) = (value, 1);
        }
    }

    fn is_clipped(&self, range: f64) -> bool {
        let is_near = self.value - self.next < NEAR * range;
        self.rows >= FEWEST_ROWS && self.rows >= PILED * self.next_rows && is_near
    }
}

impl FullScale {
    /// Column, letter and °/h per unit of each axis; those of counts are not watched.
    pub(crate) fn new(axes: &[(usize, char, Option<f64>)]) -> Self {
        let range = |(column, letter, unit): &(usize, char, Option<f64>)| {
            let (top, bottom) = (End::NONE, End::NONE);
            let dph_per_unit = (*unit)?;
            Some(Range { letter: *letter, column: column + 1, dph_per_unit, top, bottom, last: f64::NAN, jumps: 0 })
        };
        Self { axes: axes.iter().filter_map(range).collect() }
    }

    /// The rates of the next rows, °/h.
    pub(crate) fn push(&mut self, rates: &[Vec<f64>]) {
        for (range, rates) in self.axes.iter_mut().zip(rates) {
            let jump = JUMP * WORDS * range.dph_per_unit;
            for rate in rates {
                range.top.push(*rate);
                range.bottom.push(-rate);
                range.jumps += u64::from((rate - range.last).abs() > jump);
                range.last = *rate;
            }
        }
    }

    /// Values that are clipped.
    pub(crate) fn clipped(&self) -> Vec<Clipped> {
        let of = |range: &Range| {
            let span = range.top.value + range.bottom.value;
            let ends = [(range.top, 1.0), (range.bottom, -1.0)].into_iter().filter(|(end, _)| end.is_clipped(span));
            ends.map(|(end, sign)| Clipped { axis: range.letter, rate_dph: sign * end.value, rows: end.rows })
                .collect::<Vec<_>>()
        };
        self.axes.iter().flat_map(of).collect()
    }

    /// After all rows. `delimiter` is that of the file.
    pub(crate) fn check(&self, delimiter: u8) -> Result<()> {
        let is_whole = |raw: f64| (raw - raw.round()).abs() < 1e-6;
        let is_unsigned = |range: &&Range| {
            let ends = [-range.bottom.value, range.top.value].map(|rate| rate / range.dph_per_unit);
            range.jumps > 0 && ends[0] > -0.5 && ends[1] < WORDS - 0.5 && ends.into_iter().all(is_whole)
        };
        let Some(range) = self.axes.iter().find(is_unsigned) else { return Ok(()) };
        let (jumps, column) = (range.jumps, range.column);
        let separator = if delimiter == b'\t' { "\\t".to_owned() } else { char::from(delimiter).to_string() };
        Err(Error::input(
            format!(
                "axis {} jumps by nearly 65536 in {jumps} rows: a signed 16-bit number was read as unsigned",
                range.letter
            ),
            format!(
                "mend it: awk -F'{separator}' -v OFS='{separator}' '${column}>32767{{${column}-=65536}}1' old.csv > new.csv"
            ),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, rows: usize) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..rows).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    fn watched(rates: Vec<f64>, dph_per_unit: f64, piece: usize) -> FullScale {
        let mut watch = FullScale::new(&[(2, 'z', Some(dph_per_unit))]);
        rates.chunks(piece).for_each(|part| watch.push(&[part.iter().map(|rate| rate * dph_per_unit).collect()]));
        watch
    }

    #[test]
    fn clipped_rates_are_said_and_others_are_not() {
        for seed in 1..=90 {
            let sigma = 0.5 + seed as f64;
            let rates = |step: f64| -> Vec<f64> {
                noise(seed * 7919, 3000).iter().map(|n| (n * sigma / step).round() * step).collect()
            };
            for step in [1e-6, sigma / 30.0, sigma / 3.0, 2.0 * sigma] {
                assert_eq!(watched(rates(step), 3600.0, 700).clipped(), [], "{seed} {step}");
            }
            // Both ends of a range of 1.5 σ.
            let most = 1.5 * sigma;
            let clipped: Vec<f64> = rates(sigma / 300.0).iter().map(|rate| rate.clamp(-most, most)).collect();
            let found = watched(clipped, 1.0, 64).clipped();
            assert_eq!(found.iter().map(|one| one.rate_dph).collect::<Vec<_>>(), [most, -most], "{seed}");
            assert!(found.iter().all(|one| one.axis == 'z' && one.rows > 100), "{found:?}");
        }
        assert_eq!(watched(vec![5.0; 100], 1.0, 10).clipped(), []);
        assert_eq!(watched(vec![f64::NAN; 100], 1.0, 10).clipped(), []);
    }

    #[test]
    fn a_signed_number_read_as_unsigned_is_refused() {
        for seed in 1..=90 {
            let rows = noise(seed * 104_729, 2000);
            let around = |mean: f64| rows.iter().map(move |n| (mean + 20.0 * n).round()).collect::<Vec<_>>();
            let unsigned: Vec<f64> = around(5.0).iter().map(|code| code.rem_euclid(WORDS)).collect();
            let error = watched(unsigned, 3600.0, 333).check(b';').unwrap_err();
            assert!(error.what.contains("axis z") && error.help.contains("$3>32767{$3-=65536}"), "{error:?}");
            // The same signed, one that is far from zero, and a fast turn there and back.
            let turn: Vec<f64> = rows.iter().map(|n| 2e4 * n + 0.5).collect();
            for sound in [around(5.0), around(30_000.0), turn] {
                assert!(watched(sound, 3600.0, 333).check(b',').is_ok(), "{seed}");
            }
        }
    }
}
