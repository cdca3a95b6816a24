//! Periods in the rate of a gyro at rest: a chamber, air conditioning, the alias of a dither, the ramp of a fibre gyro.
//!
//! ```text
//! rows ─▶ sums of b rows, at most 2¹⁶, b a power of two ─▶ trend out, sine window ─▶ P(k) ─▶ lines
//! line at k:  P(k) > t·b(k)      b: power law through the values within a factor of 4 of k on both sides
//!                                t = ln(k^1.5/α)·e^s, s the standard error of ln b; the share of k in α is k^−1.5
//! A² = 4/n·Σ (P − b) over the five k of the line;    in σ²(τ): A²·sin⁴(πfτ)/(πfτ)²
//! ```
//!
//! The background follows any power law, so that flicker and walk make no lines. Sources: a line of
//! the sine window has five k, and Σ P = n·A²/4 of them (Parseval); σ² of a sine is that of NIST SP 1065 §5.
//!
//! Fails for fewer than about 11 periods in the longest stretch, for periods of fewer than 2b rows, and for one whose frequency
//! wanders by more than the width of a line.

use realfft::RealFftPlanner;
use serde::Serialize;

/// Sums of a series at most.
const MOST_SUMS: usize = 1 << 16;
/// Sums of a series at least.
const FEWEST_SUMS: usize = 64;
/// Neighbours of a line that are part of it.
const LINE: usize = 2;
/// A peak is this many times the mean of so many neighbours on both sides, itself included.
const AROUND: usize = 16;
const ABOVE_AROUND: f64 = 3.0;
/// The background begins this far from a line, reaches to this factor of its frequency, and has so many values at least and at most.
const APART: usize = 3;
const REACH: usize = 4;
const FEWEST_NEXT_TO: usize = 4;
const MOST_NEXT_TO: usize = 100;
/// Part of α of the first k; all of them together are 0.8 of it, from k = 6 on.
const FALSE_ALARM: f64 = 0.006;
/// A slow period has few cycles in a record, and a fast one many: the slow ones get most of α.
const SLOW_FIRST: f64 = 1.5;
/// Standard errors of the background that a line must clear.
const SIGMAS: f64 = 1.0;
/// Lines that are named.
const MOST_LINES: usize = 8;
/// Variance of a sum over neighbours, which the window makes alike, over that of independent ones.
const ALIKE: f64 = 1.5;
/// Lowest k of a background: below it the trend was taken out.
const LOWEST: usize = 2;
/// Iterations for the background. A value counts as at most so many times it; the mean of an exponential value capped there is
/// 1 − e^(−4).
const ROUNDS: usize = 12;
const MOST_TIMES: f64 = 4.0;
const OF_CAPPED: f64 = 0.981_684;

/// A period of the rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Period {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the rate, °/h.
    pub amplitude_dph: f64,
}

impl Period {
    /// Its share of σ²(τ), (°/h)².
    pub(crate) fn variance(&self, tau_s: f64) -> f64 {
        let phase = std::f64::consts::PI * self.frequency_hz * tau_s;
        (self.amplitude_dph * phase.sin().powi(2) / phase).powi(2)
    }
}

/// Sums of rows of the longest stretch, in memory that does not grow.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Rows of a sum.
    rows: usize,
    sums: Vec<f64>,
    open: f64,
    open_rows: usize,
    /// The longest stretch that has ended: rows of a sum, and sums.
    longest: (usize, Vec<f64>),
}

impl Default for Series {
    fn default() -> Self {
        Self { rows: 1, sums: Vec::new(), open: 0.0, open_rows: 0, longest: (1, Vec::new()) }
    }
}

impl Series {
    /// The next rows.
    pub(crate) fn push(&mut self, angles: impl Iterator<Item = f64>) {
        for angle in angles {
            self.open += angle;
            self.open_rows += 1;
            if self.open_rows == self.rows {
                self.sums.push(self.open);
                (self.open, self.open_rows) = (0.0, 0);
                if self.sums.len() == MOST_SUMS {
                    self.sums = self.sums.chunks_exact(2).map(|pair| pair[0] + pair[1]).collect();
                    self.rows *= 2;
                }
            }
        }
    }

    /// The next row does not follow.
    pub(crate) fn end_stretch(&mut self) {
        let ended = std::mem::take(self);
        let length = |(rows, sums): &(usize, Vec<f64>)| rows * sums.len();
        let this = (ended.rows, ended.sums);
        self.longest = if length(&this) > length(&ended.longest) { this } else { ended.longest };
    }

    /// The periods, the strongest first. `arcsec` is the size of one unit of the angles.
    pub(crate) fn periods(&self, tau0_s: f64, arcsec: f64) -> Vec<Period> {
        let (rows, sums) = &self.longest;
        let step_s = *rows as f64 * tau0_s;
        let Some(spectrum) = Spectrum::of(sums) else { return Vec::new() };
        let line = |line: Line| {
            let frequency_hz = line.place / (sums.len() as f64 * step_s);
            let phase = std::f64::consts::PI * frequency_hz * step_s;
            let through = phase.sin() / phase;
            Period { frequency_hz, amplitude_dph: line.square.sqrt() * arcsec / step_s / through }
        };
        spectrum.lines().into_iter().map(line).collect()
    }
}

/// Power at each whole number of periods in the series.
struct Spectrum {
    power: Vec<f64>,
    length: usize,
}

/// A line: its place in periods per series, and A².
struct Line {
    place: f64,
    square: f64,
}

impl Spectrum {
    fn of(sums: &[f64]) -> Option<Self> {
        let length = sums.len();
        if length < FEWEST_SUMS {
            return None;
        }
        let middle = (length - 1) as f64 / 2.0;
        let mean = sums.iter().sum::<f64>() / length as f64;
        let at = |i: usize| i as f64 - middle;
        let moment: f64 = sums.iter().enumerate().map(|(i, sum)| at(i) * (sum - mean)).sum();
        let slope = moment / (0..length).map(|i| at(i).powi(2)).sum::<f64>();
        let window = |i: usize| (std::f64::consts::PI * (i as f64 + 0.5) / length as f64).sin();
        let mut values: Vec<f64> =
            sums.iter().enumerate().map(|(i, sum)| window(i) * (sum - mean - slope * at(i))).collect();
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut spectrum = transform.make_output_vec();
        transform.process(&mut values, &mut spectrum).ok()?;
        let weight: f64 = (0..length).map(|i| window(i).powi(2)).sum();
        let power = spectrum.iter().map(|x| x.norm_sqr() / weight).collect();
        Some(Self { power, length })
    }

    fn lines(&self) -> Vec<Line> {
        let peaks = (1..self.power.len() - 1).filter(|k| self.is_peak(*k));
        let mut found: Vec<(f64, usize, f64)> = peaks
            .filter_map(|k| {
                let (background, sigma) = self.background(k)?;
                let threshold = ((k as f64).powf(SLOW_FIRST) / FALSE_ALARM).ln() * (SIGMAS * sigma).exp();
                let ratio = self.power[k] / background;
                (ratio > threshold).then_some((ratio, k, background))
            })
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.into_iter().take(MOST_LINES).filter_map(|(_, k, background)| self.line(k, background)).collect()
    }

    /// The highest of its line, and well above the mean around it: no line is less.
    fn is_peak(&self, k: usize) -> bool {
        let near = |reach: usize| &self.power[k.saturating_sub(reach)..(k + reach + 1).min(self.power.len())];
        let around = near(AROUND);
        near(LINE).iter().all(|other| *other <= self.power[k])
            && self.power[k] > ABOVE_AROUND * around.iter().sum::<f64>() / around.len() as f64
    }

    /// The power next to a line, and the standard error of its logarithm: a power law through the neighbours, by the likelihood of
    /// exponential values. Those far above it count less, for they may be lines too.
    fn background(&self, k: usize) -> Option<(f64, f64)> {
        let lowest = (k / REACH).max(k.saturating_sub(MOST_NEXT_TO)).max(LOWEST);
        let highest = (REACH * k).min(k + MOST_NEXT_TO).min(self.power.len() - 2);
        let left = lowest..(k + 1).saturating_sub(APART);
        if left.len() < FEWEST_NEXT_TO {
            return None;
        }
        let next_to: Vec<(f64, f64)> =
            left.chain(k + APART..highest + 1).map(|j| ((j as f64 / k as f64).ln(), self.power[j])).collect();
        let mean = next_to.iter().map(|(_, power)| power).sum::<f64>() / next_to.len() as f64;
        let (mut level, mut slope) = (mean.ln(), 0.0);
        let mut sigma = f64::INFINITY;
        for _ in 0..ROUNDS {
            let (mut all, mut x1, mut x2, mut g0, mut g1) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (x, power) in &next_to {
                let excess = (power / (level + slope * x).exp()).min(MOST_TIMES) - OF_CAPPED;
                (all, x1, x2) = (all + 1.0, x1 + x, x2 + x * x);
                (g0, g1) = (g0 + excess, g1 + x * excess);
            }
            let determinant = all * x2 - x1 * x1;
            level += ((x2 * g0 - x1 * g1) / determinant).clamp(-1.0, 1.0);
            slope += ((all * g1 - x1 * g0) / determinant).clamp(-1.0, 1.0);
            sigma = (ALIKE * x2 / determinant).sqrt();
        }
        (level.is_finite() && sigma.is_finite()).then(|| (level.exp(), sigma))
    }

    fn line(&self, k: usize, background: f64) -> Option<Line> {
        let near = k.saturating_sub(LINE).max(1)..(k + LINE + 1).min(self.power.len());
        let above = |at: usize| (self.power[at] - background).max(0.0);
        let all: f64 = near.map(above).sum();
        // A parabola through the three highest, in ln P.
        let [low, middle, high] = [k - 1, k, k + 1].map(|at| self.power[at].max(f64::MIN_POSITIVE).ln());
        let aside = (0.5 * (low - high) / (low - 2.0 * middle + high)).clamp(-0.5, 0.5);
        (all > 0.0).then_some(Line { place: k as f64 + aside, square: 4.0 * all / self.length as f64 })
    }
}
