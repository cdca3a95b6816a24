//! Angle random walk and quantization from short-τ Allan deviations, window by window.
//!
//! The overlapping Allan variance at octave τ = m·τ0, summed within each analysis window, so that an excluded
//! window has no effect; N and Q by the fit of [`crate::laws::terms`] with only those two. Without the Q term a ring laser's
//! quantization would read as 2.7 times its ARW.
//!
//! Behind a low-pass filter N is that of the τ at which the five laws hold ([`crate::laws::law_range`]), and Q is zero: nothing shows it.
//!
//! Fails on a record with a strong signal at τ ≤ τ_w/4: the signal counts as noise.
//! Memory: 2·m_max + 4096 phases, and three numbers per octave and window.

use crate::difference::{Deviation, Difference, Running};
use crate::freedom::{Stretches, edf_white_fm};
use crate::laws::terms::{AllanTerm, Point, fit_terms};
use crate::model::{Model, RawPoint};
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;

/// Points with fewer equivalent degrees of freedom are not used.
const MIN_EDF: f64 = 8.0;
/// Largest number of phases in memory.
const MAX_HELD: usize = 1 << 18;

/// Phases that are passed on together.
const TOGETHER: usize = 64;

/// N and Q of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseTerms {
    /// Angle random walk, arcsec/√s.
    pub n_arcsec_rt_s: f64,
    /// Quantization, arcsec.
    pub q_arcsec: f64,
}

impl NoiseTerms {
    /// Angle random walk in °/√h.
    pub fn n_deg_rt_h(&self) -> f64 {
        self.n_arcsec_rt_s / ARCSEC_RT_S_PER_DEG_RT_H
    }

    /// σ of the mean rate over `tau_s` that this noise alone makes, °/h: √(N²/τ + 2Q²/τ²).
    pub fn floor_dph(&self, tau_s: f64) -> f64 {
        (self.n_arcsec_rt_s.powi(2) / tau_s + 2.0 * self.q_arcsec.powi(2) / tau_s.powi(2)).sqrt()
    }
}

/// Sums of squared second differences, one entry per octave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShortTauSums {
    /// Σ (second difference)², arcsec².
    pub squares: Vec<f64>,
    /// How many of them.
    pub numbers: Vec<f64>,
    /// Their equivalent degrees of freedom.
    pub edf: Vec<f64>,
}

impl ShortTauSums {
    /// Adds the sums of another window.
    pub fn merge(&mut self, other: &Self) {
        let pairs =
            [(&mut self.squares, &other.squares), (&mut self.numbers, &other.numbers), (&mut self.edf, &other.edf)];
        for (mine, theirs) in pairs {
            mine.resize(mine.len().max(theirs.len()), 0.0);
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
    }

    /// σ² in (°/h)² that carry enough degrees of freedom.
    fn points(&self, tau0_s: f64) -> Vec<Point> {
        let rows = self.squares.iter().zip(&self.numbers).zip(&self.edf).enumerate();
        let rows = rows.filter(|(_, ((_, number), edf))| **number > 0.0 && **edf >= MIN_EDF);
        rows.map(|(octave, ((squares, number), edf))| {
            let tau_s = tau0_s * 2.0_f64.powi(octave as i32);
            Point { tau_s, variance: squares / (2.0 * tau_s * tau_s * number), edf: *edf }
        })
        .collect()
    }

    /// N and Q of windows of so many rows each; `None` from fewer than two usable τ, without any noise, or where a filter leaves no τ
    /// at which the laws hold.
    pub fn fit(&self, tau0_s: f64, rows: impl Iterator<Item = u64>) -> Option<NoiseTerms> {
        let points = self.points(tau0_s);
        if points.len() < 2 {
            return None;
        }
        match behind_a_filter(&points, tau0_s, rows) {
            Filter::None => {}
            Filter::Below(n_arcsec_rt_s) => return Some(NoiseTerms { n_arcsec_rt_s, q_arcsec: 0.0 }),
            Filter::Everywhere => return None,
        }
        let fitted = fit_terms(&points, &[AllanTerm::Quantization, AllanTerm::AngleRandomWalk])?;
        let root = |term: AllanTerm| fitted.coefficient(term).sqrt();
        let terms =
            NoiseTerms { n_arcsec_rt_s: root(AllanTerm::AngleRandomWalk), q_arcsec: root(AllanTerm::Quantization) };
        (terms.n_arcsec_rt_s + terms.q_arcsec > 0.0).then_some(terms)
    }
}

/// Which τ of a window a filter shapes.
enum Filter {
    None,
    /// The shortest; the others show this N, arcsec/√s.
    Below(f64),
    Everywhere,
}

/// Windows are short: only a curve that falls below N²/τ by more than chance counts as filtered, and no beat or dither does.
fn behind_a_filter(points: &[Point], tau0_s: f64, rows: impl Iterator<Item = u64>) -> Filter {
    let mut stretches = Stretches::default();
    rows.for_each(|rows| stretches.add(rows + 1));
    let raw = |p: &Point| RawPoint { m: (p.tau_s / tau0_s).round(), variance: p.variance, edf: p.edf, uncertain: 0.0 };
    let raw: Vec<RawPoint> = points.iter().map(raw).collect();
    match Model::new(&raw, tau0_s, &stretches).filtered() {
        None => Filter::None,
        Some(n) if n > 0.0 => Filter::Below(n),
        Some(_) => Filter::Everywhere,
    }
}

/// One-pass estimator for one axis, window by window.
#[derive(Clone, Debug)]
pub struct ShortTau {
    /// At multiples 1, 2, 4 … of τ0.
    running: Running,
    phase: f64,
}

impl ShortTau {
    /// For samples of `tau0_s` seconds and deviations up to `tau_max_s`.
    pub fn new(tau0_s: f64, tau_max_s: f64) -> Self {
        let fits = |m: &usize| *m as f64 * tau0_s <= tau_max_s * (1.0 + 1e-9) && 2 * *m < MAX_HELD;
        let multiples = (0..40).map(|octave| 1_usize << octave).take_while(fits);
        let wanted = multiples.map(|m| Difference { deviation: Deviation::Allan, m });
        Self { running: Running::new(wanted.collect()), phase: 0.0 }
    }

    /// The next samples of the window: angles of one interval each, `arcsec` per unit.
    pub fn push(&mut self, angles: &[f64], arcsec: f64) {
        if self.running.wanted().is_empty() {
            return;
        }
        if self.running.len() == 0 {
            self.running.push(0.0);
        }
        let mut phases = [0.0; TOGETHER];
        for part in angles.chunks(TOGETHER) {
            for (phase, angle) in phases.iter_mut().zip(part) {
                self.phase += angle * arcsec;
                *phase = self.phase;
            }
            // A phase that is not known leaves none behind it that is.
            self.running.extend(&phases[..part.len()], !self.phase.is_nan());
        }
    }

    /// A row of several intervals: a running total with missing rows in between. The phase is known at its end and missing
    /// within it.
    pub fn push_wide(&mut self, intervals: u64, angle: f64, arcsec: f64) {
        if self.running.wanted().is_empty() || intervals == 0 {
            return;
        }
        if self.running.len() == 0 {
            self.running.push(0.0);
        }
        // No difference reaches across more missing phases than the longest one spans.
        let missing = (intervals - 1).min(self.running.longest() as u64);
        (0..missing).for_each(|_| self.running.push(f64::NAN));
        self.phase += angle * arcsec;
        self.running.push(self.phase);
    }

    /// Ends the window and returns its sums. The next sample starts a new window.
    pub fn take(&mut self) -> ShortTauSums {
        let phases = self.running.len() as f64;
        let sums = self.running.take();
        self.phase = 0.0;
        let edf = sums.iter().zip(self.running.wanted()).map(|(sum, difference)| match sum.number {
            0.0 => 0.0,
            // Where phases are missing, scaled by the fraction of differences that exist.
            number => {
                edf_white_fm(phases, difference.m as f64).max(0.0) * (number / (phases - difference.span() as f64))
            }
        });
        ShortTauSums {
            edf: edf.collect(),
            squares: sums.iter().map(|sum| sum.squares).collect(),
            numbers: sums.iter().map(|sum| sum.number).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form: phase alternating 0, 1, 0, 1 … has second difference ±2 at m = 1 and 0 at m = 2.
    #[test]
    fn second_differences_are_those_of_the_phase() {
        let mut short = ShortTau::new(1.0, 4.0);
        let angles: Vec<f64> = (0..100).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        short.push(&angles, 1.0);
        let sums = short.take();
        assert!((sums.squares[0] / sums.numbers[0] - 4.0).abs() < 1e-12);
        assert_eq!((sums.squares[1], sums.numbers.as_slice()), (0.0, &[99.0, 97.0, 93.0][..]));
    }

    #[test]
    fn windows_are_apart_and_merge() {
        let mut short = ShortTau::new(1.0, 2.0);
        let mut window = || {
            (0..10).for_each(|k| short.push(&[f64::from(k % 3)], 1.0));
            short.take()
        };
        let (one, two) = (window(), window());
        assert_eq!(one, two);
        let mut both = one.clone();
        both.merge(&two);
        assert_eq!(both.squares[0], 2.0 * one.squares[0]);
    }

    /// A gap longer than the longest difference divides the window: the sums equal those of two windows.
    #[test]
    fn a_long_gap_in_a_total_divides_the_window() {
        let angles: Vec<f64> = (0..200).map(|k| f64::from(k * 7919 % 23)).collect();
        let sums = |intervals: Option<u64>| {
            let mut short = ShortTau::new(1.0, 8.0);
            short.push(&angles[..90], 1.0);
            let mut first = ShortTauSums::default();
            match intervals {
                Some(intervals) => short.push_wide(intervals, 1234.5, 1.0),
                None => first = short.take(),
            }
            short.push(&angles[90..], 1.0);
            first.merge(&short.take());
            first
        };
        let two = sums(None);
        for intervals in [17, 1000, u64::MAX] {
            let one = sums(Some(intervals));
            assert_eq!(one.numbers, two.numbers, "{intervals}");
            let close = one.squares.iter().zip(&two.squares).all(|(a, b)| (a / b - 1.0).abs() < 1e-12);
            assert!(close, "{intervals}");
        }
    }

    #[test]
    fn silence_has_no_floor() {
        let mut short = ShortTau::new(1.0, 25.0);
        short.push(&[4.5; 1000], 1.0);
        assert_eq!(short.take().fit(1.0, std::iter::once(1000)), None);
    }

    /// The result is that of the definition, bit for bit the same for any size of the pieces.
    #[test]
    fn pieces_do_not_matter() {
        let angles: Vec<f64> = (0..20_000).map(|k| f64::from((k * 7919) % 101) / 7.0).collect();
        let sums = |piece: usize| {
            let mut short = ShortTau::new(1.0, 1000.0);
            angles.chunks(piece).for_each(|part| short.push(part, 0.15));
            short.take()
        };
        let whole = sums(angles.len());
        assert_eq!(whole, sums(1));
        assert_eq!(whole, sums(4097));
        let mut phases = vec![0.0];
        angles.iter().for_each(|angle| phases.push(phases[phases.len() - 1] + 0.15 * angle));
        for (octave, squares) in whole.squares.iter().enumerate() {
            let m = 1 << octave;
            let second = (2 * m..phases.len()).map(|k| phases[k] - 2.0 * phases[k - m] + phases[k - 2 * m]);
            let expected: f64 = second.map(|d| d * d).sum();
            assert!((squares / expected - 1.0).abs() < 1e-12, "m {m}");
            assert_eq!(whole.numbers[octave], (phases.len() - 2 * m) as f64);
        }
    }
}
