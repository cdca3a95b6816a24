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
//! Memory: 2·m_max + 4096 phases, and three numbers per octave and window.

use crate::units::ARCSEC_RT_S_PER_DEG_RT_H;

/// Points with fewer equivalent degrees of freedom are not used.
const MIN_EDF: f64 = 8.0;
/// Never are more phases held than this.
const MAX_HELD: usize = 1 << 18;
/// Phases summed up together.
const BLOCK: usize = 4096;
const LANES: usize = 4;

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
    /// Phases θ that are still needed and those that wait, arcsec.
    phases: Vec<f64>,
    /// Phases of this window before the first of `phases`.
    dropped: usize,
    /// Phases of this window that are in the sums.
    summed: usize,
    phase: f64,
    sums: ShortTauSums,
}

impl ShortTau {
    /// For samples of `tau0_s` seconds and deviations up to `tau_max_s`.
    pub fn new(tau0_s: f64, tau_max_s: f64) -> Self {
        let fits = |m: &usize| *m as f64 * tau0_s <= tau_max_s * (1.0 + 1e-9) && 2 * *m < MAX_HELD;
        let multiples: Vec<usize> = (0..40).map(|octave| 1_usize << octave).take_while(fits).collect();
        let sums = Self::no_sums(multiples.len());
        Self { sums, multiples, phases: Vec::new(), dropped: 0, summed: 0, phase: 0.0 }
    }

    fn no_sums(octaves: usize) -> ShortTauSums {
        let zeros = vec![0.0; octaves];
        ShortTauSums { squares: zeros.clone(), numbers: zeros.clone(), edf: zeros }
    }

    /// The next samples of the window: angles of one interval each, `arcsec` per unit.
    pub fn push(&mut self, angles: &[f64], arcsec: f64) {
        if self.multiples.is_empty() {
            return;
        }
        if self.phases.is_empty() {
            self.phases.push(0.0);
        }
        for angle in angles {
            self.phase += angle * arcsec;
            self.phases.push(self.phase);
            // Counted from the start of the window, so that pieces do not matter.
            if self.dropped + self.phases.len() == self.summed + BLOCK {
                self.sum_up();
            }
        }
    }

    /// Takes the waiting phases into the sums and drops what no difference needs any more.
    fn sum_up(&mut self) {
        let end = self.dropped + self.phases.len();
        let slots = self.sums.squares.iter_mut().zip(&mut self.sums.numbers);
        for (m, (squares, number)) in self.multiples.iter().zip(slots) {
            let from = self.summed.max(2 * m);
            if from >= end {
                break;
            }
            let newest = &self.phases[from - self.dropped..];
            let middle = &self.phases[from - m - self.dropped..];
            let oldest = &self.phases[from - 2 * m - self.dropped..];
            *squares += sum_of_squares(newest, middle, oldest);
            *number += (end - from) as f64;
        }
        self.summed = end;
        let needed = 2 * self.multiples.last().copied().unwrap_or(0);
        let old = self.phases.len().saturating_sub(needed);
        self.phases.drain(..old);
        self.dropped += old;
    }

    /// Ends the window: its sums. What comes next does not join what came before.
    pub fn take(&mut self) -> ShortTauSums {
        self.sum_up();
        let phases = self.summed as f64;
        for ((m, edf), number) in self.multiples.iter().zip(&mut self.sums.edf).zip(&self.sums.numbers) {
            if *number > 0.0 {
                *edf = edf_white_fm(phases, *m as f64).max(0.0);
            }
        }
        self.phases.clear();
        (self.dropped, self.summed, self.phase) = (0, 0, 0.0);
        std::mem::replace(&mut self.sums, Self::no_sums(self.multiples.len()))
    }
}

/// Σ (newest − 2·middle + oldest)², in four interleaved sums that a processor can keep apart.
fn sum_of_squares(newest: &[f64], middle: &[f64], oldest: &[f64]) -> f64 {
    let mut lanes = [0.0; LANES];
    let squared = |a: f64, b: f64, c: f64| {
        let difference = a - 2.0 * b + c;
        difference * difference
    };
    let (middle, oldest) = (&middle[..newest.len()], &oldest[..newest.len()]);
    let blocks = newest.chunks_exact(LANES).zip(middle.chunks_exact(LANES)).zip(oldest.chunks_exact(LANES));
    for ((a, b), c) in blocks {
        for lane in 0..LANES {
            lanes[lane] += squared(a[lane], b[lane], c[lane]);
        }
    }
    let rest = newest.len() / LANES * LANES;
    for i in rest..newest.len() {
        lanes[0] += squared(newest[i], middle[i], oldest[i]);
    }
    lanes.iter().sum()
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

    #[test]
    fn silence_has_no_floor() {
        let mut short = ShortTau::new(1.0, 25.0);
        short.push(&[4.5; 1000], 1.0);
        assert_eq!(short.take().fit(1.0), None);
    }

    /// However samples come in pieces: the same bits, those of the definition.
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
