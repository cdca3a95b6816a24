//! Intervals of the five terms: profiles of the misfit, with thresholds from curves drawn from the fitted model.
//!
//! ```text
//! D(θ) = Σᵢ edfᵢ·[σ²ᵢ/fᵢ(θ) − 1 − ln(σ²ᵢ/fᵢ(θ))]                    deviance of χ² variances; its least is the fit
//! interval of v = Q², N², B², K², R²:    { v : min over the other four of D − D_least ≤ c }
//! c: exceeded by D(v̂) − D_least in one of twenty curves σ²*(τᵢ) = E σ²(τᵢ)·χ²(edfᵢ)/edfᵢ of the fitted model,
//!    the χ² with the correlation of the points (Gaussian copula)
//! ```
//!
//! Terms that can replace each other (B, K and R at the long end of a short record) do so in the profile, so the intervals
//! include the exchange between them. Expectations, edf and correlations come from [`crate::freedom`] for the length, gaps and
//! noise of this record. Points of an overlapping curve are strongly correlated; thresholds for independent points would be
//! too low. For a term that is not resolved, curves are drawn with and without it, and the higher threshold is used. The χ²
//! come from normal values by the cube-root form of Wilson and Hilferty (1931).
//!
//! A term is not resolved if its interval reaches down to a fifth of its value or below. It then has an upper bound only: a
//! larger term would lift the curve above the measured one.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::freedom::{FAR, Record};
use crate::laws::terms::{AllanTerm, FittedTerms, Laws, Point, deviance};

/// Curves drawn.
const DRAWS: usize = 400;
/// Fraction of the curves beyond the threshold.
const BEYOND: f64 = 0.05;
/// The same for a term that was fitted as zero: half of its curves have no misfit.
const BEYOND_AT_ZERO: f64 = 0.025;
/// The least threshold: χ² of one degree of freedom, 95 %.
const LEAST_THRESHOLD: f64 = 3.841;
/// Iterations for a bound, curves drawn for it, and its tolerance.
const BOUND_ROUNDS: usize = 4;
const BOUND_DRAWS: usize = 160;
const BOUND_SETTLED: f64 = 0.02;
/// Lower end over value below which a term is not resolved.
const LEAST_RATIO: f64 = 0.2;
/// Halvings in search of an end, and doublings to enclose it.
const HALVINGS: usize = 20;
const DOUBLINGS: usize = 60;
/// Fixed, so that the same record gives the same intervals.
const SEED: u64 = 0x5a67_6e61_6331_3131;

/// The estimate of one term, as a root (Q, N, B, K or R).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Spread {
    /// 95 % interval.
    Interval {
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A filter hides it.
    Hidden,
    /// Not distinguished from zero.
    Unresolved {
        /// Upper bound; infinite where the curve does not bound it.
        at_most: f64,
    },
}

/// The estimates of all terms.
pub(crate) struct Estimates {
    /// In the order of [`AllanTerm::ALL`].
    pub(crate) spreads: Vec<Spread>,
    /// Terms that are not distinguished from zero although the curve needs one of them: it does not determine which.
    pub(crate) traded: Vec<AllanTerm>,
}

/// Uncertainty of the terms, given a record and its curve. Each point may have additional scatter of its own:
/// `scatter` is 1/edf of it.
pub(crate) struct TermUncertainty<'a> {
    pub(crate) record: &'a Record<'a>,
    pub(crate) measured: &'a [Point],
    pub(crate) multiples: &'a [f64],
    pub(crate) scatter: &'a [f64],
    pub(crate) laws: Laws,
}

impl TermUncertainty<'_> {
    /// The distribution of the curve for some noise, and the profile of the measured one with the same degrees of freedom.
    fn under(&self, noise: &FittedTerms) -> (Curves, Profile) {
        let record = Record { noise: noise.noise(), ..*self.record };
        let curves = Curves::new(&record, self.multiples, self.scatter, self.laws);
        let pairs = self.measured.iter().zip(&curves.expected);
        let points: Vec<Point> = pairs.map(|(measured, expected)| Point { edf: expected.edf, ..*measured }).collect();
        let least = self.laws.least_deviance(&points);
        (curves, Profile { points, least, laws: self.laws })
    }

    pub(crate) fn of_terms(&self, fitted: &FittedTerms) -> Estimates {
        let (curves, profile) = self.under(fitted);
        let mut thresholds = thresholds(&curves, fitted, &AllanTerm::ALL, DRAWS);
        let resolved = of_resolved(&profile.spreads(fitted, &thresholds));
        // Where a term is not distinguished from zero, zero may be the truth; near that limit the others scatter more.
        let without = self.laws.fit(&profile.points, &resolved).filter(|_| resolved.len() < AllanTerm::ALL.len());
        if let Some(without) = &without {
            let beside = self::thresholds(&self.under(without).0, without, &AllanTerm::ALL, DRAWS);
            thresholds.iter_mut().zip(beside).for_each(|(mine, theirs)| *mine = mine.max(theirs));
        }
        let mut spreads = profile.spreads(fitted, &thresholds);
        for (term, spread) in AllanTerm::ALL.into_iter().zip(&mut spreads) {
            if let Spread::Unresolved { at_most } = spread {
                *at_most = self.bound(term, *at_most, fitted.coefficient(term));
            }
        }
        let traded = traded(&profile, &spreads, &thresholds);
        Estimates { spreads, traded }
    }

    /// The largest value of a term that fits. The term itself causes long correlations and few degrees of freedom, so threshold
    /// and profile are computed at the bound, until it converges.
    fn bound(&self, term: AllanTerm, mut at_most: f64, fitted: f64) -> f64 {
        for _ in 0..BOUND_ROUNDS {
            let there = self.laws.fit_next_to(self.measured, term, at_most.powi(2));
            let (curves, profile) = self.under(&there);
            let threshold = thresholds(&curves, &there, &[term], BOUND_DRAWS)[0];
            let next = profile.upper(term, fitted, threshold).sqrt();
            let converged = next <= at_most * (1.0 + BOUND_SETTLED);
            at_most = at_most.max(next);
            if converged || !at_most.is_finite() {
                break;
            }
        }
        at_most
    }
}

/// The terms that have an interval.
fn of_resolved(spreads: &[Spread]) -> Vec<AllanTerm> {
    let all = AllanTerm::ALL.into_iter().zip(spreads);
    all.filter(|(_, spread)| !matches!(spread, Spread::Unresolved { .. })).map(|(term, _)| term).collect()
}

/// Unresolved terms of which any one, added to the resolved ones, explains the curve when the resolved ones alone do not.
fn traded(profile: &Profile, spreads: &[Spread], thresholds: &[f64]) -> Vec<AllanTerm> {
    let resolved = of_resolved(spreads);
    let excess = |terms: &[AllanTerm]| {
        profile.laws.fit(&profile.points, terms).map_or(f64::INFINITY, |f| deviance(&profile.points, &f))
            - profile.least
    };
    let highest = thresholds.iter().fold(0.0_f64, |most, threshold| most.max(*threshold));
    if resolved.is_empty() || excess(&resolved) <= highest {
        return Vec::new();
    }
    let explains = |term: &AllanTerm| excess(&[&resolved[..], &[*term]].concat()) <= highest;
    let able: Vec<AllanTerm> =
        AllanTerm::ALL.into_iter().filter(|term| !resolved.contains(term)).filter(explains).collect();
    if able.len() > 1 { able } else { Vec::new() }
}

/// Threshold of each term for D at the truth minus the least D; never less than for one normal value, so that solver
/// tolerance never sets it.
fn thresholds(curves: &Curves, truth: &FittedTerms, terms: &[AllanTerm], draws: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let drawn: Vec<Vec<Point>> = (0..draws).map(|_| curves.draw(&mut rng)).collect();
    let apart: Vec<Vec<f64>> = drawn
        .par_iter()
        .map(|points| {
            let least = curves.laws.least_deviance(points);
            let excess = |term: &AllanTerm| {
                let beside = curves.laws.fit_next_to(points, *term, truth.coefficient(*term));
                (deviance(points, &beside) - least).max(0.0)
            };
            terms.iter().map(excess).collect()
        })
        .collect();
    let threshold = |(place, term): (usize, &AllanTerm)| {
        let mut apart: Vec<f64> = apart.iter().map(|of_draw| of_draw[place]).collect();
        apart.sort_by(f64::total_cmp);
        let beyond = if truth.coefficient(*term) > 0.0 { BEYOND } else { BEYOND_AT_ZERO };
        apart
            .get(((1.0 - beyond) * apart.len() as f64) as usize)
            .map_or(f64::INFINITY, |apart| apart.max(LEAST_THRESHOLD))
    };
    terms.iter().enumerate().map(threshold).collect()
}

/// The least misfit for every value of one term.
struct Profile {
    points: Vec<Point>,
    least: f64,
    laws: Laws,
}

impl Profile {
    fn spreads(&self, fitted: &FittedTerms, thresholds: &[f64]) -> Vec<Spread> {
        let spread = |(term, threshold): (AllanTerm, &f64)| {
            let value = fitted.coefficient(term);
            if self.laws.filtered && term == AllanTerm::Quantization {
                return Spread::Hidden;
            }
            let upper = self.upper(term, value, *threshold).sqrt();
            match self.lower(term, value, *threshold).sqrt() {
                lower if lower > LEAST_RATIO * value.sqrt() => Spread::Interval { lower, upper },
                _ => Spread::Unresolved { at_most: upper },
            }
        };
        AllanTerm::ALL.into_iter().zip(thresholds).map(spread).collect()
    }

    fn fits(&self, term: AllanTerm, value: f64, threshold: f64) -> bool {
        deviance(&self.points, &self.laws.fit_next_to(&self.points, term, value)) - self.least <= threshold
    }

    /// The smallest value that fits; 0 if the curve also fits without the term.
    fn lower(&self, term: AllanTerm, value: f64, threshold: f64) -> f64 {
        if value <= 0.0 || self.fits(term, 0.0, threshold) {
            return 0.0;
        }
        self.border(term, threshold, value, value * 2.0_f64.powi(-8))
    }

    /// The largest value that fits; infinite if no value is too large.
    fn upper(&self, term: AllanTerm, value: f64, threshold: f64) -> f64 {
        // Without a value the search starts at the term that by itself explains the lowest point of the curve.
        let reach = |p: &Point| p.variance / term.variance(p.tau_s);
        let alone = self.points.iter().map(reach).fold(f64::INFINITY, f64::min);
        let inside = if value > 0.0 { value } else { 0.0 };
        let mut outside = inside.max(1e-6 * alone);
        for _ in 0..DOUBLINGS {
            if !self.fits(term, outside, threshold) {
                return self.border(term, threshold, inside, outside);
            }
            outside *= 2.0;
        }
        f64::INFINITY
    }

    /// The limit between a value that fits and one that does not, to one part in a million.
    fn border(&self, term: AllanTerm, threshold: f64, mut inside: f64, mut outside: f64) -> f64 {
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(inside, outside);
            if self.fits(term, middle, threshold) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        f64::midpoint(inside, outside)
    }
}

/// The distribution of a curve.
struct Curves {
    expected: Vec<Point>,
    /// Turns independent normal values into correlated ones.
    mix: DMatrix<f64>,
    laws: Laws,
}

impl Curves {
    fn new(record: &Record<'_>, multiples: &[f64], scatter: &[f64], laws: Laws) -> Self {
        let expected: Vec<Point> = multiples
            .iter()
            .zip(scatter)
            .map(|(m, scatter)| Point {
                tau_s: m * record.tau0_s,
                variance: record.expected(*m),
                edf: (record.edf(*m).recip() + scatter).recip(),
            })
            .collect();
        let size = multiples.len();
        let mut correlation = DMatrix::<f64>::identity(size, size);
        let sigma = |point: &Point| point.variance * (2.0 / point.edf).sqrt();
        let near = |(i, j): &(usize, usize)| multiples[*i] <= FAR * multiples[*j];
        let pairs: Vec<(usize, usize)> = (0..size).flat_map(|i| (0..i).map(move |j| (i, j))).filter(near).collect();
        let shared = |(i, j): &(usize, usize)| {
            let both = sigma(&expected[*i]) * sigma(&expected[*j]);
            (record.covariance(multiples[*j], multiples[*i]) / both).clamp(-1.0, 1.0)
        };
        let all: Vec<f64> = pairs.par_iter().map(shared).collect();
        for ((i, j), shared) in pairs.into_iter().zip(all) {
            correlation[(i, j)] = shared;
            correlation[(j, i)] = shared;
        }
        // Truncated correlations may leave the matrix slightly indefinite: negative eigenvalues become zero.
        let eigen = correlation.symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let mut mix = eigen.eigenvectors * DMatrix::from_diagonal(&roots);
        for mut row in mix.row_iter_mut() {
            let norm = row.norm();
            if norm > 0.0 {
                row /= norm;
            }
        }
        Self { expected, mix, laws }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<Point> {
        let normal = DVector::from_fn(self.expected.len(), |_, _| normal(rng));
        let mixed = &self.mix * normal;
        let points = self.expected.iter().zip(mixed.iter());
        points.map(|(point, z)| Point { variance: point.variance * chi_square_mean(point.edf, *z), ..*point }).collect()
    }
}

/// χ²/edf at the quantile of the normal value z (Wilson and Hilferty).
fn chi_square_mean(edf: f64, z: f64) -> f64 {
    let spread = 2.0 / (9.0 * edf);
    (1.0 - spread + z * spread.sqrt()).max(0.0).powi(3)
}

/// A normal value (Box and Muller), the same on every machine.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || ((rng.next_u64() >> 11) + 1) as f64 * (1.0 / (1_u64 << 53) as f64);
    libm::sqrt(-2.0 * libm::log(uniform())) * libm::cos(std::f64::consts::TAU * uniform())
}
