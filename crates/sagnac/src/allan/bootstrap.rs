//! Intervals of the five terms by a parametric bootstrap: curves drawn from the fitted model, each fitted again.
//!
//! ```text
//! σ²*(τᵢ) = E σ²(τᵢ) · χ²(edfᵢ)/edfᵢ,    the χ² tied together by the correlation of the points (Gaussian copula)
//! interval of X = Q, N, B, K, R:    [X̂ / q₉₇.₅,  X̂ / q₂.₅],    q quantiles of X*/X̂
//! ```
//!
//! Expectations, edf and correlations are those of [`super::freedom`] for this very record: its length, its gaps, its
//! noise. Points of an overlapping curve are far from independent, and an interval that took them so would be too
//! narrow. The χ² come from normal values by the cube-root form of Wilson and Hilferty (1931). The ratio is used
//! because these are scales: σ² known by few degrees of freedom is skew, its ratio is not a guess of its own.
//!
//! A term that is zero in one draw of forty or more, or known to less than a factor of five, has no interval.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::allan::freedom::{PhaseNoise, Record};
use crate::allan::terms::{FittedTerms, Point, Term, fit_terms};

/// Curves drawn.
const DRAWS: usize = 800;
/// Part of the draws beyond each end of an interval: 95 % in all.
const TAIL: f64 = 0.025;
/// Least X*/X̂ at the lower tail.
const LEAST_RATIO: f64 = 0.2;
/// Points farther apart than this in τ are taken as independent.
const FAR: f64 = 64.0;
/// Fixed, so that the same record gives the same intervals.
const SEED: u64 = 0x5a67_6e61_6331_3131;

/// What the draws say of one term, as a root (Q, N, B, K or R).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Spread {
    /// 95 % interval.
    Interval {
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// Not told from zero.
    Unresolved {
        /// What this record shows of it one time in forty where nothing of it is there.
        by_chance: f64,
    },
}

/// Draws curves of the record and fits each, every point with a scatter of its own besides (of `scatter_edf` degrees of
/// freedom; infinite for none); one spread per term of [`Term::ALL`].
pub(crate) fn spreads(record: &Record<'_>, multiples: &[f64], scatter_edf: f64, fitted: &FittedTerms) -> Vec<Spread> {
    let refits = refits(record, multiples, scatter_edf);
    let first: Vec<Option<Spread>> =
        Term::ALL.iter().map(|term| interval(*term, fitted.root(*term), &refits)).collect();
    if first.iter().all(Option::is_some) {
        return first.into_iter().flatten().collect();
    }
    // What is not told from zero is set to zero, and drawn again: what shows then is chance.
    let mut noise = record.noise;
    let coefficients = [&mut noise.q2, &mut noise.n2, &mut noise.b2, &mut noise.k2, &mut noise.r2];
    coefficients
        .into_iter()
        .zip(&first)
        .filter(|(_, found)| found.is_none())
        .for_each(|(coefficient, _)| *coefficient = 0.0);
    let without = Record { noise, ..*record };
    let chance = if noise == PhaseNoise::default() { refits } else { self::refits(&without, multiples, scatter_edf) };
    let spread = |(term, found): (&Term, Option<Spread>)| {
        found.unwrap_or_else(|| Spread::Unresolved { by_chance: quantile(&roots(*term, &chance), 1.0 - TAIL) })
    };
    Term::ALL.iter().zip(first).map(spread).collect()
}

fn refits(record: &Record<'_>, multiples: &[f64], scatter_edf: f64) -> Vec<FittedTerms> {
    let curves = Curves::new(record, multiples, scatter_edf);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let drawn: Vec<Vec<Point>> = (0..DRAWS).map(|_| curves.draw(&mut rng)).collect();
    let refits = crate::parallel::in_parallel(&drawn, |points| fit_terms(points, &Term::ALL));
    refits.into_iter().flatten().collect()
}

fn roots(term: Term, refits: &[FittedTerms]) -> Vec<f64> {
    let mut roots: Vec<f64> = refits.iter().map(|refit| refit.root(term)).collect();
    roots.sort_by(f64::total_cmp);
    roots
}

fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted.get((part * sorted.len() as f64) as usize).copied().unwrap_or(0.0)
}

fn interval(term: Term, fitted: f64, refits: &[FittedTerms]) -> Option<Spread> {
    let roots = roots(term, refits);
    let (low, high) = (quantile(&roots, TAIL), quantile(&roots, 1.0 - TAIL));
    let known = fitted > 0.0 && low > LEAST_RATIO * fitted;
    known.then(|| Spread::Interval { lower: fitted * fitted / high, upper: fitted * fitted / low })
}

/// The distribution of a curve.
struct Curves {
    expected: Vec<Point>,
    /// Turns independent normal values into correlated ones.
    mix: DMatrix<f64>,
}

impl Curves {
    fn new(record: &Record<'_>, multiples: &[f64], scatter_edf: f64) -> Self {
        let with_scatter = |edf: f64| (1.0 / edf + 1.0 / scatter_edf).recip();
        let expected: Vec<Point> = multiples
            .iter()
            .map(|m| Point {
                tau_s: m * record.tau0_s,
                variance: record.expected(*m),
                edf: with_scatter(record.edf(*m)),
            })
            .collect();
        let size = multiples.len();
        let mut correlation = DMatrix::<f64>::identity(size, size);
        let sigma = |point: &Point| point.variance * (2.0 / point.edf).sqrt();
        for i in 0..size {
            for j in 0..i {
                let (near, far) = (multiples[j], multiples[i]);
                if far <= FAR * near {
                    let both = sigma(&expected[i]) * sigma(&expected[j]);
                    let shared = (record.covariance(near, far) / both).clamp(-1.0, 1.0);
                    correlation[(i, j)] = shared;
                    correlation[(j, i)] = shared;
                }
            }
        }
        // What was cut off far away may leave it a little indefinite: nothing below zero is kept.
        let eigen = correlation.symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let mut mix = eigen.eigenvectors * DMatrix::from_diagonal(&roots);
        for mut row in mix.row_iter_mut() {
            let norm = row.norm();
            if norm > 0.0 {
                row /= norm;
            }
        }
        Self { expected, mix }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<Point> {
        let normal = DVector::from_fn(self.expected.len(), |_, _| normal(rng));
        let mixed = &self.mix * normal;
        let points = self.expected.iter().zip(mixed.iter());
        points.map(|(point, z)| Point { variance: point.variance * chi_square_mean(point.edf, *z), ..*point }).collect()
    }
}

/// χ²/edf at the place of its distribution where a normal value is z (Wilson and Hilferty).
fn chi_square_mean(edf: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * edf);
    (1.0 - spread + z * spread.sqrt()).max(0.0).powi(3)
}

/// A normal value (Box and Muller), the same on every machine.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || ((rng.next_u64() >> 11) + 1) as f64 * (1.0 / (1_u64 << 53) as f64);
    libm::sqrt(-2.0 * libm::log(uniform())) * libm::cos(std::f64::consts::TAU * uniform())
}
