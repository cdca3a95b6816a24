//! Angle random walk and quantization from short-τ Allan deviations, in one pass.
//!
//! Overlapping Allan variance at octave τ = m·τ0 (NIST SP 1065, eq. 11, on phase θ):
//!
//! ```text
//! σ²(τ) = Σ (θ[k+2m] − 2θ[k+m] + θ[k])² / (2 τ² · number)        model: N²/τ + 3Q²/τ²
//! ```
//!
//! summed within each analysis window, so that a window that is left out leaves no trace; fitted by
//! weighted least squares with both terms non-negative. The weight of a point is its equivalent degrees
//! of freedom (white FM, SP 1065 table 5) over twice the model squared. Without the Q term a ring laser's
//! quantization would read as 2.7 times its ARW.
//!
//! Fails on a record with a strong signal at τ ≤ τ_w/4: what is not noise is counted as noise.
//! Memory: 2·m_max + 1 samples, and three numbers per octave and window.

use crate::units::ARCSEC_RT_S_PER_DEG_RT_H;

/// Points with fewer equivalent degrees of freedom are not used.
const MIN_EDF: f64 = 8.0;
/// The ring never holds more samples than this.
const MAX_RING: usize = 1 << 18;

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
    /// Adds another window's.
    pub fn merge(&mut self, other: &Self) {
        let pairs =
            [(&mut self.squares, &other.squares), (&mut self.numbers, &other.numbers), (&mut self.edf, &other.edf)];
        for (mine, theirs) in pairs {
            mine.resize(mine.len().max(theirs.len()), 0.0);
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
    }

    /// Points (τ in s, σ² in (°/h)², degrees of freedom) that carry enough of them.
    fn points(&self, tau0_s: f64) -> Vec<(f64, f64, f64)> {
        let rows = self.squares.iter().zip(&self.numbers).zip(&self.edf).enumerate();
        let rows = rows.filter(|(_, ((_, number), edf))| **number > 0.0 && **edf >= MIN_EDF);
        rows.map(|(octave, ((squares, number), edf))| {
            let tau = tau0_s * 2.0_f64.powi(octave as i32);
            (tau, squares / (2.0 * tau * tau * number), *edf)
        })
        .collect()
    }

    /// N and Q, or `None` from fewer than two usable τ or without any noise.
    pub fn fit(&self, tau0_s: f64) -> Option<NoiseTerms> {
        let points = self.points(tau0_s);
        if points.len() < 2 {
            return None;
        }
        let mut model: Vec<f64> = points.iter().map(|p| p.1).collect();
        let mut terms = (0.0, 0.0);
        for _ in 0..5 {
            terms = solve_two(&points, &model)?;
            model = points.iter().map(|(tau, ..)| terms.0 / tau + 3.0 * terms.1 / (tau * tau)).collect();
        }
        let (n2, q2) = terms;
        (n2 + q2 > 0.0).then(|| NoiseTerms { n_arcsec_rt_s: n2.sqrt(), q_arcsec: q2.sqrt() })
    }
}

/// One-pass estimator for one axis and one window after the other.
#[derive(Clone, Debug)]
pub struct ShortTau {
    /// Multiples of τ0: 1, 2, 4 …
    multiples: Vec<usize>,
    /// Phase θ of the newest 2·m_max + 1 samples, arcsec.
    ring: Vec<f64>,
    phase: f64,
    /// Phases seen in this window.
    seen: usize,
    sums: ShortTauSums,
}

impl ShortTau {
    /// For samples of `tau0_s` seconds and deviations up to `tau_max_s`.
    pub fn new(tau0_s: f64, tau_max_s: f64) -> Self {
        let fits = |m: &usize| *m as f64 * tau0_s <= tau_max_s * (1.0 + 1e-9) && 2 * *m < MAX_RING;
        let multiples: Vec<usize> = (0..40).map(|octave| 1_usize << octave).take_while(fits).collect();
        let longest = multiples.last().copied().unwrap_or(0);
        let ring = vec![0.0; 2 * longest + 1];
        Self { sums: Self::no_sums(multiples.len()), multiples, ring, phase: 0.0, seen: 0 }
    }

    fn no_sums(octaves: usize) -> ShortTauSums {
        let zeros = vec![0.0; octaves];
        ShortTauSums { squares: zeros.clone(), numbers: zeros.clone(), edf: zeros }
    }

    /// The next sample of the window: angle of one interval, arcsec.
    pub fn push(&mut self, angle_arcsec: f64) {
        if self.multiples.is_empty() {
            return;
        }
        if self.seen == 0 {
            self.store(0.0);
        }
        self.phase += angle_arcsec;
        self.store(self.phase);
        let (len, newest) = (self.ring.len(), self.seen - 1);
        let slots = self.sums.squares.iter_mut().zip(&mut self.sums.numbers);
        for (m, (squares, number)) in self.multiples.iter().zip(slots) {
            if newest < 2 * m {
                break;
            }
            let at = |back: usize| self.ring[(newest - back) % len];
            let second_difference = at(0) - 2.0 * at(*m) + at(2 * m);
            *squares += second_difference * second_difference;
            *number += 1.0;
        }
    }

    /// Ends the window: its sums. What comes next does not join what came before.
    pub fn take(&mut self) -> ShortTauSums {
        let phases = self.seen as f64;
        for ((m, edf), number) in self.multiples.iter().zip(&mut self.sums.edf).zip(&self.sums.numbers) {
            if *number > 0.0 {
                *edf = edf_white_fm(phases, *m as f64).max(0.0);
            }
        }
        (self.seen, self.phase) = (0, 0.0);
        std::mem::replace(&mut self.sums, Self::no_sums(self.multiples.len()))
    }

    fn store(&mut self, phase: f64) {
        let len = self.ring.len();
        self.ring[self.seen % len] = phase;
        self.seen += 1;
    }
}

/// Equivalent degrees of freedom of the overlapping Allan variance for white FM, NIST SP 1065
/// table 5: [3(N−1)/(2m) − 2(N−2)/N]·4m²/(4m²+5), N phases.
fn edf_white_fm(n: f64, m: f64) -> f64 {
    (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0)
}

/// (N², Q²) ≥ 0 with weights edf/model².
fn solve_two(points: &[(f64, f64, f64)], model: &[f64]) -> Option<(f64, f64)> {
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((tau, variance, edf), model) in points.iter().zip(model) {
        if *model <= 0.0 {
            return None;
        }
        let w = edf / (model * model);
        let (a, b) = (1.0 / tau, 3.0 / (tau * tau));
        aa += w * a * a;
        ab += w * a * b;
        bb += w * b * b;
        ay += w * a * variance;
        by += w * b * variance;
    }
    let det = aa * bb - ab * ab;
    if det <= 0.0 || !det.is_finite() {
        return None;
    }
    let (n2, q2) = ((ay * bb - by * ab) / det, (by * aa - ay * ab) / det);
    Some(if n2 < 0.0 {
        (0.0, (by / bb).max(0.0))
    } else if q2 < 0.0 {
        ((ay / aa).max(0.0), 0.0)
    } else {
        (n2, q2)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form: phase alternating 0, 1, 0, 1 … has second difference ±2 at m = 1 and 0 at m = 2.
    #[test]
    fn second_differences_are_those_of_the_phase() {
        let mut short = ShortTau::new(1.0, 4.0);
        for k in 0..100 {
            short.push(if k % 2 == 0 { 1.0 } else { -1.0 });
        }
        let sums = short.take();
        assert!((sums.squares[0] / sums.numbers[0] - 4.0).abs() < 1e-12);
        assert_eq!((sums.squares[1], sums.numbers.as_slice()), (0.0, &[99.0, 97.0, 93.0][..]));
    }

    #[test]
    fn windows_are_apart_and_merge() {
        let mut short = ShortTau::new(1.0, 2.0);
        let mut window = || {
            (0..10).for_each(|k| short.push(f64::from(k % 3)));
            short.take()
        };
        let (one, two) = (window(), window());
        assert_eq!(one, two);
        let mut both = one.clone();
        both.merge(&two);
        assert_eq!(both.squares[0], 2.0 * one.squares[0]);
    }

    #[test]
    fn silence_has_no_floor() {
        let mut short = ShortTau::new(1.0, 25.0);
        (0..1000).for_each(|_| short.push(4.5));
        assert_eq!(short.take().fit(1.0), None);
    }
}
