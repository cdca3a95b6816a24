//! Rows that repeat earlier rows of the same record: a copy has their noise, too, and noise does not come twice.
//!
//! ```text
//! rows ─▶ sums of a quarter of a second or a row ─▶ differences d of neighbouring grains (a second or a row), at four offsets
//! r(L) = Σ d(k)·d(k + L) / √(Σ d(k)²·Σ d(k + L)²)      over the overlap at the lag L
//! a copy: r² > 0.5 at one lag, and at hardly any other
//! ```
//!
//! Differences of neighbouring grains lack what honest rows share: curves over temperature, periods of a chamber, mode hops. A beat of
//! counts repeats at many lags; a copy at one.
//!
//! Fails for copies of fewer than [`FEWEST`] grains, and for rows that were resampled to another clock.

use realfft::RealFftPlanner;

/// A grain of fast rows, s, and its parts.
const GRAIN_S: f64 = 1.0;
const PARTS: usize = 4;
/// Parts at most; more are joined in pairs.
const MOST_PARTS: usize = 1 << 20;
/// Shorter copies are none, nor are shorter lags, in grains.
const FEWEST: usize = 200;
/// r of a copy: R² = 0.5.
const COPY: f64 = 0.707;
/// A beat has more lags than this with half of that.
const MOST_LAGS: usize = 8;
/// Differences beyond this many times the median size are cut: a shock is one row.
const CUT: f64 = 6.0;

/// Rows that are a copy of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Repeat {
    /// Time between a row and its copy, s.
    pub lag_s: f64,
    /// Part of the noise that both share, r².
    pub shared: f64,
}

/// Sums of the rows of a record.
#[derive(Clone, Debug)]
pub struct RepeatWatch {
    rows_of_part: u64,
    parts_of_grain: usize,
    part_s: f64,
    /// NaN across a break.
    parts: Vec<f64>,
    open: f64,
    open_rows: u64,
}

impl RepeatWatch {
    /// Of rows of an interval.
    pub fn new(row_s: f64) -> Self {
        let rows_of_part = ((GRAIN_S / PARTS as f64 / row_s).round() as u64).max(1);
        let parts_of_grain = if rows_of_part > 1 { PARTS } else { 1 };
        let part_s = row_s * rows_of_part as f64;
        Self { rows_of_part, parts_of_grain, part_s, parts: Vec::new(), open: 0.0, open_rows: 0 }
    }

    /// The next row.
    pub fn push(&mut self, angle: f64) {
        self.open += angle;
        self.open_rows += 1;
        if self.open_rows >= self.rows_of_part {
            self.parts.push(self.open);
            (self.open, self.open_rows) = (0.0, 0);
            if self.parts.len() >= MOST_PARTS {
                let pairs: Vec<f64> = self.parts.chunks_exact(2).map(|pair| pair[0] + pair[1]).collect();
                (self.parts, self.rows_of_part) = (pairs, 2 * self.rows_of_part);
                (self.part_s, self.parts_of_grain) = (2.0 * self.part_s, self.parts_of_grain.div_ceil(2));
            }
        }
    }

    /// Rows are missing before the next one.
    pub fn end_stretch(&mut self) {
        (self.open, self.open_rows) = (0.0, 0);
        if self.parts.last().is_some_and(|last| last.is_finite()) {
            self.parts.push(f64::NAN);
        }
    }

    /// The copy, if the record holds one.
    pub fn finish(self) -> Option<Repeat> {
        let base = self.differences(0);
        (0..self.parts_of_grain)
            .filter_map(|offset| self.found(&base, offset))
            .max_by(|a, b| a.shared.total_cmp(&b.shared))
    }

    /// Differences of neighbouring grains from a part on; zero where one is not known.
    fn differences(&self, offset: usize) -> Vec<f64> {
        let grains: Vec<f64> = self.parts[offset.min(self.parts.len())..]
            .chunks_exact(self.parts_of_grain)
            .map(|grain| grain.iter().sum())
            .collect();
        let mut all: Vec<f64> = grains.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut sizes: Vec<f64> = all.iter().map(|d| d.abs()).filter(|size| *size > 0.0).collect();
        sizes.sort_by(f64::total_cmp);
        let most = CUT * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        all.iter_mut().for_each(|d| *d = if d.is_finite() { d.clamp(-most, most) } else { 0.0 });
        all
    }

    fn found(&self, base: &[f64], offset: usize) -> Option<Repeat> {
        let other = self.differences(offset);
        let n = base.len().min(other.len());
        if n < 2 * FEWEST {
            return None;
        }
        let products = correlation(&base[..n], &other[..n])?;
        let squares = |of: &[f64]| -> Vec<f64> {
            of.iter()
                .scan(0.0, |sum, d| {
                    *sum += d * d;
                    Some(*sum)
                })
                .collect()
        };
        let (early, late) = (squares(&base[..n]), squares(&other[..n]));
        let r = |lag: usize| {
            let both = early[n - lag - 1] * (late[n - 1] - late[lag - 1]);
            if both > 0.0 { products[lag] / both.sqrt() } else { 0.0 }
        };
        let lags = FEWEST..n - FEWEST;
        let best = lags.clone().max_by(|a, b| r(*a).total_cmp(&r(*b)))?;
        let alike = lags.filter(|lag| lag.abs_diff(best) > 2 && r(*lag).abs() > COPY / 2.0).count();
        let lag_s = (best * self.parts_of_grain + offset) as f64 * self.part_s;
        (r(best) > COPY && alike <= MOST_LAGS).then(|| Repeat { lag_s, shared: r(best).powi(2) })
    }
}

/// Σ a(k)·b(k + L) for each L.
fn correlation(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let length = (2 * a.len()).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(length);
    let spectrum = |values: &[f64]| {
        let mut padded = forward.make_input_vec();
        padded[..values.len()].copy_from_slice(values);
        let mut out = forward.make_output_vec();
        forward.process(&mut padded, &mut out).ok()?;
        Some(out)
    };
    let (of_a, mut product) = (spectrum(a)?, spectrum(b)?);
    product.iter_mut().zip(&of_a).for_each(|(b, a)| *b *= a.conj());
    let backward = planner.plan_fft_inverse(length);
    let mut out = backward.make_output_vec();
    // Rounding may leave the ends of a real spectrum a trace of an imaginary part.
    if let [first, .., last] = product.as_mut_slice() {
        (first.im, last.im) = (0.0, 0.0);
    }
    backward.process(&mut product, &mut out).ok()?;
    out.iter_mut().for_each(|value| *value /= length as f64);
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cheap sequence without correlation.
    fn noise(i: u64) -> f64 {
        let mixed = (i ^ 0x5bd1).wrapping_mul(0x2545_f491_4f6c_dd1d);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / f64::from(1 << 24)
    }

    /// By the definition, term by term.
    #[test]
    fn the_correlation_is_that_of_its_definition() {
        let [a, b]: [Vec<f64>; 2] = [0, 1000].map(|from| (from..from + 50).map(noise).collect());
        let found = correlation(&a, &b).unwrap();
        for lag in 0..50 {
            let wanted: f64 = (0..50 - lag).map(|k| a[k] * b[k + lag]).sum();
            assert!((found[lag] - wanted).abs() < 1e-12, "{lag}");
        }
    }

    #[test]
    fn a_copy_is_found_at_its_lag_and_noise_is_none() {
        for (row_s, rows) in [(5.0, 3000), (0.01, 90_007)] {
            let found = |row: &dyn Fn(u64) -> f64| {
                let mut watch = RepeatWatch::new(row_s);
                (0..2 * rows).for_each(|i| watch.push(row(i)));
                watch.finish()
            };
            let copy = found(&|i| noise(i % rows)).unwrap();
            assert!((copy.lag_s - rows as f64 * row_s).abs() <= 0.25 && copy.shared > 0.6, "{row_s}: {copy:?}");
            assert_eq!(found(&noise), None);
            // A beat of counts.
            assert_eq!(found(&|i| f64::from(u8::from(i % 7 == 0))), None);
        }
    }
}
