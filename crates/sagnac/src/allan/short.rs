//! Angle random walk and quantization from short-τ Allan deviations, in one pass.
//!
//! Overlapping Allan variance at octave τ = m·τ0 (NIST SP 1065, eq. 11, on phase θ):
//!
//! ```text
//! σ²(τ) = Σ (θ[k+2m] − 2θ[k+m] + θ[k])² / (2 τ² · number)        model: N²/τ + 3Q²/τ²
//! ```
//!
//! fitted by weighted least squares with both terms non-negative; the weight of a point is its
//! equivalent degrees of freedom (white FM, SP 1065 table 5) over twice the model squared. Without
//! the Q term a ring laser's quantization would read as 2.7 times its ARW.
//!
//! Fails on a record with a strong signal at τ ≤ τ_w/4: what is not noise is counted as noise.
//! Memory: 2·m_max + 1 samples, whatever the length of the log.

use serde::{Deserialize, Serialize};

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

/// One-pass estimator for one axis.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ShortTau {
    tau0_s: f64,
    /// Multiples of τ0: 1, 2, 4 …
    multiples: Vec<usize>,
    /// Phase θ of the newest 2·m_max + 1 samples, arcsec.
    #[serde(skip)]
    ring: Vec<f64>,
    #[serde(skip)]
    phase: f64,
    /// Phases seen since the last gap.
    #[serde(skip)]
    seen: usize,
    sums: Vec<f64>,
    numbers: Vec<u64>,
    /// Phases seen in all.
    total: u64,
}

impl ShortTau {
    /// For samples of `tau0_s` seconds and deviations up to `tau_max_s`.
    pub fn new(tau0_s: f64, tau_max_s: f64) -> Self {
        let fits = |m: &usize| *m as f64 * tau0_s <= tau_max_s * (1.0 + 1e-9) && 2 * *m < MAX_RING;
        let multiples: Vec<usize> = (0..40).map(|octave| 1_usize << octave).take_while(fits).collect();
        let longest = multiples.last().copied().unwrap_or(0);
        let ring = vec![0.0; 2 * longest + 1];
        let (sums, numbers) = (vec![0.0; multiples.len()], vec![0; multiples.len()]);
        Self { tau0_s, multiples, ring, phase: 0.0, seen: 0, sums, numbers, total: 0 }
    }

    /// The next sample: angle of one interval, arcsec.
    pub fn push(&mut self, angle_arcsec: f64) {
        if self.multiples.is_empty() || self.ring.is_empty() {
            return;
        }
        if self.seen == 0 {
            self.store(0.0);
        }
        self.phase += angle_arcsec;
        self.store(self.phase);
        self.total += 1;
        let (len, newest) = (self.ring.len(), self.seen - 1);
        for ((m, sum), number) in self.multiples.iter().zip(&mut self.sums).zip(&mut self.numbers) {
            if newest < 2 * m {
                break;
            }
            let at = |back: usize| self.ring[(newest - back) % len];
            let second_difference = at(0) - 2.0 * at(*m) + at(2 * m);
            *sum += second_difference * second_difference;
            *number += 1;
        }
    }

    /// What comes next does not join what came before.
    pub fn gap(&mut self) {
        self.seen = 0;
        self.phase = 0.0;
    }

    fn store(&mut self, phase: f64) {
        let len = self.ring.len();
        self.ring[self.seen % len] = phase;
        self.seen += 1;
    }

    /// Adds what another estimator of the same τ saw (another run).
    pub fn merge(&mut self, other: &Self) {
        if self.multiples != other.multiples {
            return;
        }
        self.total += other.total;
        for (mine, theirs) in self.sums.iter_mut().zip(&other.sums) {
            *mine += theirs;
        }
        for (mine, theirs) in self.numbers.iter_mut().zip(&other.numbers) {
            *mine += theirs;
        }
    }

    /// True when the lists belong together (a table from a file may be damaged).
    pub fn is_sound(&self) -> bool {
        self.sums.len() == self.multiples.len() && self.numbers.len() == self.multiples.len() && self.tau0_s > 0.0
    }

    /// Points (τ in s, σ² in (°/h)², degrees of freedom) that carry enough of them.
    fn points(&self) -> Vec<(f64, f64, f64)> {
        let n = self.total as f64;
        let rows = self.multiples.iter().zip(self.sums.iter().zip(&self.numbers));
        let rows = rows.filter(|(_, (_, number))| **number > 0).map(|(m, (sum, number))| {
            let tau = *m as f64 * self.tau0_s;
            (tau, sum / (2.0 * tau * tau * *number as f64), edf_white_fm(n, *m as f64))
        });
        rows.filter(|(.., edf)| *edf >= MIN_EDF).collect()
    }

    /// N and Q, or `None` from fewer than two usable τ or without any noise.
    pub fn fit(&self) -> Option<NoiseTerms> {
        let points = self.points();
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
        assert!((short.sums[0] / short.numbers[0] as f64 - 4.0).abs() < 1e-12);
        assert_eq!(short.sums[1], 0.0);
        assert_eq!((short.numbers[0], short.numbers[1], short.numbers[2]), (99, 97, 93));
    }

    #[test]
    fn a_gap_separates_and_merge_adds() {
        let mut one = ShortTau::new(1.0, 2.0);
        (0..10).for_each(|k| one.push(f64::from(k % 3)));
        let mut two = one.clone();
        two.gap();
        (0..10).for_each(|k| two.push(f64::from(k % 3)));
        let mut merged = one.clone();
        merged.merge(&one);
        assert_eq!((merged.sums, merged.numbers), (two.sums, two.numbers));
    }

    #[test]
    fn silence_has_no_floor() {
        let mut short = ShortTau::new(1.0, 25.0);
        (0..1000).for_each(|_| short.push(4.5));
        assert_eq!(short.fit(), None);
    }
}
