//! Rows that repeat others, of the same record or of another one: a copy has their noise, too, and noise does not come twice.
//!
//! ```text
//! trace ─▶ sums over a grain ─▶ differences d of neighbouring grains, less the mean of five; of the finer trace at eight offsets
//! r(L) = Σ d(k)·d'(k + L) / √(Σ d(k)²·Σ d'(k + L)²)      over the overlap at the lag L
//! a copy: Σ r² > 0.5 over the few lags at which r stands out
//! ```
//!
//! A grain is the longer part of both traces, or four of them where the shorter part is nearly as long: then an offset of half a part
//! costs a tenth of r. Differences of neighbouring grains lack what honest rows share: curves over temperature, periods of a chamber, mode
//! hops. A beat of counts repeats at many lags, a copy at one; a mean of several logs has one for each of them.
//!
//! Fails for copies of fewer than [`FEWEST`] grains, for means of logs that were rounded to counts coarser than their noise, and where two
//! tests have hardly any noise between their counts: they say the same, as a copy does.

use crate::spectrum::trace::{Trace, median_size};
use realfft::RealFftPlanner;

/// Offsets that are tried, of a grain each.
const OFFSETS: usize = 8;
/// Parts of a grain where both traces have parts of nearly the same length.
const JOINED: usize = 4;
/// Shorter copies are none, nor are shorter lags within a record, in grains.
const FEWEST: usize = 100;
/// Σ r² of a copy.
const COPY: f64 = 0.5;
/// r of a lag that stands out, and r·√n: n grains without correlation have less at all lags of a record.
const LOUD: f64 = 0.354;
const LOUD_BY_CHANCE: f64 = 7.0;
/// A beat has more such lags than this.
const MOST_LAGS: usize = 8;
/// Differences beyond this many times the median size are cut: a shock is one row.
const CUT: f64 = 6.0;
/// Differences whose mean is subtracted.
const MEAN_OF: usize = 5;

/// Rows that are a copy of others.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Repeat {
    /// Time from the first of both traces to the copy, s.
    pub lag_s: f64,
    /// Part of the noise that both share, r² summed over the lags.
    pub shared: f64,
}

impl Repeat {
    /// Rows of a record that came before in it.
    pub fn within(trace: &Trace) -> Option<Self> {
        Self::best(trace, trace, true)
    }

    /// Rows of a record that came in another one.
    pub fn of_other(trace: &Trace, other: &Trace) -> Option<Self> {
        Self::best(trace, other, false)
    }

    fn best(trace: &Trace, other: &Trace, is_own: bool) -> Option<Self> {
        let (coarse, fine) = if trace.part_s() >= other.part_s() { (trace, other) } else { (other, trace) };
        let joined = if fine.part_s() > coarse.part_s() / JOINED as f64 { JOINED } else { 1 };
        let grain_s = coarse.part_s() * joined as f64;
        let base = Differences::of(coarse.parts().chunks_exact(joined).map(|parts| parts.iter().sum()).collect());
        let found = |offset: usize| {
            let start_s = grain_s * offset as f64 / OFFSETS as f64;
            let of_fine = Differences::of(sums(fine, start_s, grain_s));
            let lags = Lags::of(&base, &of_fine, is_own)?;
            let (lag, shared) = lags.copy()?;
            Some(Self { lag_s: lag as f64 * grain_s + start_s, shared })
        };
        (0..OFFSETS).filter_map(found).max_by(|a, b| a.shared.total_cmp(&b.shared))
    }
}

/// Sums over grains from a time on; a part that a grain cuts counts by the share in it.
fn sums(trace: &Trace, start_s: f64, grain_s: f64) -> Vec<f64> {
    let parts = trace.parts();
    let whole_s = parts.len() as f64 * trace.part_s();
    let grains = ((whole_s - start_s) / grain_s).floor().max(0.0) as usize;
    let sum = |grain: usize| {
        let [from, to] = [grain, grain + 1].map(|k| (start_s + k as f64 * grain_s) / trace.part_s());
        let first = from.floor() as usize;
        let last = (to.ceil() as usize).min(parts.len());
        let share = |at: usize| (to.min(at as f64 + 1.0) - from.max(at as f64)).max(0.0);
        (first..last).filter(|at| share(*at) > 1e-6).map(|at| share(at) * parts[at]).sum()
    };
    (0..grains).map(sum).collect()
}

/// Differences of neighbouring grains, without outliers and slow drift; zero where one is not known.
struct Differences {
    values: Vec<f64>,
    /// Σ d² of those before each, and how many are known.
    squares: Vec<f64>,
    known: Vec<usize>,
}

impl Differences {
    fn of(grains: Vec<f64>) -> Self {
        let mut all: Vec<f64> = grains.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let sizes: Vec<f64> = all.iter().copied().filter(|d| d.is_finite()).collect();
        let most = CUT * median_size(&sizes);
        all.iter_mut().filter(|d| d.is_finite()).for_each(|d| *d = d.clamp(-most, most));
        let values: Vec<f64> = (0..all.len()).map(|k| about_neighbours(&all, k)).collect();
        let (mut squares, mut known) = (vec![0.0], vec![0]);
        for (k, value) in values.iter().enumerate() {
            squares.push(squares[k] + value * value);
            known.push(known[k] + usize::from(*value != 0.0));
        }
        Self { values, squares, known }
    }

    fn len(&self) -> usize {
        self.values.len()
    }
}

fn about_neighbours(all: &[f64], k: usize) -> f64 {
    if !all[k].is_finite() {
        return 0.0;
    }
    let half = MEAN_OF / 2;
    let near = all[k.saturating_sub(half)..all.len().min(k + half + 1)].iter().filter(|d| d.is_finite());
    let (sum, n) = near.fold((0.0, 0.0), |(sum, n), d| (sum + d, n + 1.0));
    all[k] - sum / n
}

/// r over the lags, and the smallest r that stands out.
struct Lags {
    first: isize,
    r: Vec<f64>,
    loud: Vec<f64>,
}

impl Lags {
    fn of(a: &Differences, b: &Differences, is_own: bool) -> Option<Self> {
        let (n, m, fewest) = (a.len() as isize, b.len() as isize, FEWEST as isize);
        let first = if is_own { fewest } else { fewest - n };
        let lags = first..m - fewest;
        if lags.is_empty() {
            return None;
        }
        let products = correlation(&a.values, &b.values)?;
        let (mut r, mut loud) = (Vec::new(), Vec::new());
        for lag in lags {
            // a(k)·b(k + lag) for k of both.
            let [from, to] = [0.max(-lag), n.min(m - lag).max(0)].map(|k| k as usize);
            let [from_b, to_b] = [from, to].map(|k| k.saturating_add_signed(lag));
            if to <= from {
                r.push(0.0);
                loud.push(f64::INFINITY);
                continue;
            }
            let both = (a.squares[to] - a.squares[from]) * (b.squares[to_b] - b.squares[from_b]);
            let known = (a.known[to] - a.known[from]).min(b.known[to_b] - b.known[from_b]);
            let product = products[lag.rem_euclid(products.len() as isize) as usize];
            let is_enough = known >= FEWEST && both > 0.0;
            r.push(if is_enough { product / both.sqrt() } else { 0.0 });
            loud.push((LOUD_BY_CHANCE / (known as f64).sqrt()).max(LOUD));
        }
        Some(Self { first, r, loud })
    }

    /// The lag of a copy, in grains, and the part of the noise that it shares.
    fn copy(&self) -> Option<(isize, f64)> {
        let (mut peaks, mut last) = (Vec::<f64>::new(), None::<usize>);
        let mut best = (0, 0.0);
        for (at, (r, _)) in self.r.iter().zip(&self.loud).enumerate().filter(|(_, (r, least))| r.abs() > **least) {
            let shared = r.max(0.0).powi(2);
            match peaks.last_mut().filter(|_| last.is_some_and(|last| at - last <= 2)) {
                Some(peak) => *peak = peak.max(shared),
                None => peaks.push(shared),
            }
            last = Some(at);
            if shared > best.1 {
                best = (self.first + at as isize, shared);
            }
        }
        let shared = peaks.iter().sum::<f64>().min(1.0);
        (peaks.len() <= MOST_LAGS && shared > COPY).then_some((best.0, shared))
    }
}

/// Σ a(k)·b(k + L) for each L; negative ones at the end.
fn correlation(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let length = (a.len() + b.len()).next_power_of_two();
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
    use crate::spectrum::trace::TraceWatch;

    /// A cheap sequence without correlation.
    fn noise(i: u64) -> f64 {
        let mixed = (i ^ 0x5bd1).wrapping_mul(0x2545_f491_4f6c_dd1d);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / f64::from(1 << 24)
    }

    fn trace(row_s: f64, rows: impl Iterator<Item = f64>) -> Trace {
        let mut watch = TraceWatch::new(row_s);
        rows.for_each(|row| watch.push(&[row]));
        watch.finish()
    }

    /// By the definition, term by term.
    #[test]
    fn the_correlation_is_that_of_its_definition() {
        let [a, b]: [Vec<f64>; 2] = [(0, 50), (1000, 30)].map(|(from, n)| (from..from + n).map(noise).collect());
        let found = correlation(&a, &b).unwrap();
        for lag in -49..30_isize {
            let product = |k: isize| Some(a.get(k as usize)? * b.get(usize::try_from(k + lag).ok()?)?);
            let wanted: f64 = (0..50).filter_map(product).sum();
            assert!((found[lag.rem_euclid(found.len() as isize) as usize] - wanted).abs() < 1e-12, "{lag}");
        }
    }

    #[test]
    fn a_copy_is_found_at_its_lag_and_noise_is_none() {
        for (row_s, rows) in [(5.0, 3000), (0.01, 90_007)] {
            let found = |row: &dyn Fn(u64) -> f64| Repeat::within(&trace(row_s, (0..2 * rows).map(row)));
            let copy = found(&|i| noise(i % rows)).unwrap();
            assert!((copy.lag_s - rows as f64 * row_s).abs() <= 1.5 * row_s.max(0.1), "{row_s}: {copy:?}");
            assert!(copy.shared > 0.6, "{row_s}: {copy:?}");
            assert_eq!(found(&noise), None);
            // A beat of counts.
            assert_eq!(found(&|i| f64::from(u8::from(i % 7 == 0))), None);
        }
    }

    /// Rows of 1 s in a record's text; the copy in other rows, from another time on, and the mean of two logs.
    #[test]
    fn rows_of_another_record_are_found_in_other_intervals() {
        let rows = 20_000;
        let record = trace(1.0, (0..rows).map(noise));
        let (part_s, text) = record.text().unwrap();
        let record = Trace::of_text(part_s, &text).unwrap();
        for (row_s, from) in [(1.0, 4321), (7.0, 3), (10.0, 4), (60.0, 1)] {
            let each = row_s as u64;
            let sum = |k: u64| (0..each).map(|i| noise(from + each * k + i)).sum::<f64>();
            let copy = Repeat::of_other(&trace(row_s, (0..(rows - from) / each).map(sum)), &record);
            assert!(copy.is_some_and(|copy| copy.shared > 0.6), "{row_s}: {copy:?}");
        }
        let other = Repeat::of_other(&trace(1.0, (rows..2 * rows).map(noise)), &record);
        assert_eq!(other, None);
        let halves = |k: u64| 0.5 * (noise(k) + noise(k + rows / 2));
        let mean = Repeat::of_other(&trace(1.0, (0..rows / 2).map(halves)), &record);
        assert!(mean.is_some_and(|copy| copy.shared > 0.7), "{mean:?}");
    }
}
