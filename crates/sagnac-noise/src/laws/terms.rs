//! The five terms of a rate noise, fitted to Allan variances with none below zero.
//!
//! ```text
//! σ²(τ) = 3Q²/τ² + N²/τ + (2 ln 2/π)B² + K²τ/3 + R²τ²/2          forms of IEEE Std 647 and 952
//! ```
//!
//! Least squares on σ² with the weight of a point edf/(2σ⁴), σ from the previous model, until convergence. No coefficient is
//! negative: of the 2⁵ sets of terms, the one with the least misfit whose coefficients are all positive. Mostly an exchange of terms finds
//! it; otherwise all sets are tried.
//!
//! Fails for terms whose slopes the record's span of τ does not separate: the intervals of [`super::bootstrap`] show it.

use nalgebra::{SMatrix, SVector};

use crate::freedom::PhaseNoise;

/// Rounds of re-weighting at most.
const MOST_ROUNDS: usize = 100;
/// Weights have settled when no model variance moves by more.
const SETTLED: f64 = 1e-10;
/// Exchanges of terms before all sets are tried.
const MOST_EXCHANGES: usize = 8;
/// Least model variance, as a part of that measured: behind a filter the sum of the terms can fall below zero.
const LEAST_PART: f64 = 1e-3;
/// Tolerance where only the deviance is needed: it is flat at its minimum.
const SETTLED_FOR_DEVIANCE: f64 = 1e-5;

/// A term of the noise model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AllanTerm {
    /// Q, arcsec.
    Quantization,
    /// N, arcsec/√s.
    AngleRandomWalk,
    /// B, °/h.
    BiasInstability,
    /// K, °/h/√s.
    RateRandomWalk,
    /// R, °/h/s.
    RateRamp,
}

impl AllanTerm {
    /// In the order of their slopes.
    pub const ALL: [Self; 5] =
        [Self::Quantization, Self::AngleRandomWalk, Self::BiasInstability, Self::RateRandomWalk, Self::RateRamp];

    /// What a coefficient of 1 (a variance: Q², N², B², K², R²) adds to σ²(τ).
    pub fn variance(self, tau_s: f64) -> f64 {
        match self {
            Self::Quantization => 3.0 / (tau_s * tau_s),
            Self::AngleRandomWalk => 1.0 / tau_s,
            Self::BiasInstability => 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI,
            Self::RateRandomWalk => tau_s / 3.0,
            Self::RateRamp => tau_s * tau_s / 2.0,
        }
    }
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// τ, s.
    pub tau_s: f64,
    /// σ²(τ), (°/h)².
    pub variance: f64,
    /// Its equivalent degrees of freedom, or any weight where they are unknown.
    pub edf: f64,
}

/// Coefficients as variances; zero for a term that was not asked for or not found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FittedTerms([f64; 5]);

impl FittedTerms {
    /// Q², N², B², K² or R², in arcsec and seconds. Behind a filter the first of them may be below zero.
    pub fn coefficient(&self, term: AllanTerm) -> f64 {
        self.0[term as usize]
    }

    /// Q, N, B, K or R, in arcsec and seconds; zero for a coefficient below zero.
    pub fn root(&self, term: AllanTerm) -> f64 {
        self.coefficient(term).max(0.0).sqrt()
    }

    /// σ²(τ) of the model.
    pub fn variance(&self, tau_s: f64) -> f64 {
        self.variance_of(&AllanTerm::ALL.map(|term| term.variance(tau_s)))
    }

    /// The same of what a coefficient of 1 of each term adds.
    fn variance_of(&self, each: &[f64; 5]) -> f64 {
        self.0.iter().zip(each).map(|(coefficient, each)| coefficient * each).sum()
    }

    pub(crate) fn noise(&self) -> PhaseNoise {
        let [q2, n2, b2, k2, r2] = self.0;
        PhaseNoise { q2, n2, b2, k2, r2 }
    }
}

/// Fits `terms` to the points; `None` without a usable point or where all of them are zero.
pub fn fit_terms(points: &[Point], terms: &[AllanTerm]) -> Option<FittedTerms> {
    Laws::PLAIN.fit(points, terms)
}

/// Which coefficients may be below zero.
///
/// Rows that remember each other for a time M (a low-pass filter, rows that repeat a reading) have σ²(τ) = N²/τ − c/τ² for τ > M, to
/// the last digit for every filter: the double integral of a correlation that has ended. Behind a filter the coefficient of 1/τ²
/// has any sign and is no quantization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Laws {
    /// The coefficient of 1/τ² has any sign.
    pub(crate) filtered: bool,
}

/// The terms of white noise of the rate and of the phase.
pub(crate) const WHITE: [AllanTerm; 2] = [AllanTerm::Quantization, AllanTerm::AngleRandomWalk];

impl Laws {
    /// No coefficient is below zero.
    pub(crate) const PLAIN: Self = Self { filtered: false };
    /// Behind a filter.
    pub(crate) const FILTERED: Self = Self { filtered: true };

    /// As [`fit_terms`].
    pub(crate) fn fit(self, points: &[Point], terms: &[AllanTerm]) -> Option<FittedTerms> {
        let usable = usable(points);
        if usable.is_empty() || terms.is_empty() {
            return None;
        }
        self.settled(&usable, terms, FittedTerms::default(), SETTLED)
    }

    /// The least deviance of all five terms.
    pub(crate) fn least_deviance(self, points: &[Point]) -> f64 {
        let fitted = self.settled(&usable(points), &AllanTerm::ALL, FittedTerms::default(), SETTLED_FOR_DEVIANCE);
        fitted.map_or(f64::INFINITY, |fitted| deviance(points, &fitted))
    }

    /// Fits the other four terms with the coefficient of one fixed.
    pub(crate) fn fit_next_to(self, points: &[Point], held: AllanTerm, coefficient: f64) -> FittedTerms {
        let others: Vec<AllanTerm> = AllanTerm::ALL.into_iter().filter(|term| *term != held).collect();
        let mut alone = FittedTerms::default();
        alone.0[held as usize] = coefficient;
        self.settled(&usable(points), &others, alone, SETTLED_FOR_DEVIANCE).unwrap_or(alone)
    }

    /// Re-weighted least squares until convergence; `held` is a fixed part of the model.
    fn settled(self, points: &[Point], terms: &[AllanTerm], held: FittedTerms, enough: f64) -> Option<FittedTerms> {
        let of_any_sign = terms.iter().position(|term| self.filtered && *term == AllanTerm::Quantization);
        let of_any_sign = of_any_sign.map_or(0, |at| 1 << at);
        let rows: Vec<Row> = points.iter().map(|point| Row::of(point, terms, &held)).collect();
        let mut model: Vec<f64> = rows.iter().map(|row| row.variance.max(row.held)).collect();
        let (mut fitted, mut set) = (held, 0);
        for _ in 0..MOST_ROUNDS {
            (fitted, set) = best_set(&rows, &model, terms, &held, Sets { likely: set, of_any_sign })?;
            let mut moved = 0.0_f64;
            for (row, model) in rows.iter().zip(&mut model) {
                let next = fitted.variance_of(&row.each).max(LEAST_PART * row.variance);
                moved = moved.max((next / *model - 1.0).abs());
                *model = next;
            }
            if moved < enough {
                break;
            }
        }
        Some(fitted)
    }
}

fn usable(points: &[Point]) -> Vec<Point> {
    points.iter().copied().filter(|p| p.variance > 0.0 && p.edf > 0.0).collect()
}

/// Deviance of χ² variances from a model: Σ edf·(σ²/f − 1 − ln(σ²/f)); infinite where the model is zero. The fit minimises it.
pub(crate) fn deviance(points: &[Point], fitted: &FittedTerms) -> f64 {
    let part = |p: &Point| {
        let ratio = p.variance / fitted.variance(p.tau_s).max(LEAST_PART * p.variance);
        p.edf * (ratio - 1.0 - ratio.ln())
    };
    points.iter().filter(|p| p.variance > 0.0 && p.edf > 0.0).map(part).sum()
}

/// A point as the fit sees it.
struct Row {
    variance: f64,
    edf: f64,
    /// σ² of the fixed part of the model.
    held: f64,
    /// What a coefficient of 1 of each term adds.
    each: [f64; 5],
    /// The same of the terms that are fitted, in their order; zero beyond the last.
    columns: [f64; 5],
    /// Products of two columns.
    products: [[f64; 5]; 5],
}

impl Row {
    fn of(point: &Point, terms: &[AllanTerm], held: &FittedTerms) -> Self {
        let each = AllanTerm::ALL.map(|term| term.variance(point.tau_s));
        let columns = std::array::from_fn(|i| terms.get(i).map_or(0.0, |term| each[*term as usize]));
        let products = columns.map(|a| columns.map(|b| a * b));
        Self { variance: point.variance, edf: point.edf, held: held.variance_of(&each), each, columns, products }
    }
}

/// Sets of terms, a bit each in their order.
#[derive(Clone, Copy)]
struct Sets {
    /// Tried first; none for all.
    likely: u32,
    /// In every set, of any sign.
    of_any_sign: u32,
}

/// One round: the set of terms with the least misfit among those without a negative coefficient, and that set.
fn best_set(
    rows: &[Row],
    model: &[f64],
    terms: &[AllanTerm],
    held: &FittedTerms,
    Sets { likely, of_any_sign }: Sets,
) -> Option<(FittedTerms, u32)> {
    let mut sums = [[0.0; 5]; 5];
    let mut right = SVector::<f64, 5>::zeros();
    for (row, model) in rows.iter().zip(model) {
        let weight = row.edf / (2.0 * model * model);
        for (i, (sums, products)) in sums.iter_mut().zip(&row.products).enumerate() {
            // Half of a symmetric matrix.
            (0..=i).for_each(|j| sums[j] += products[j] * weight);
        }
        let excess = weight * (row.variance - row.held);
        right.iter_mut().zip(&row.columns).for_each(|(sum, column)| *sum += column * excess);
    }
    let gram = SMatrix::<f64, 5, 5>::from_fn(|i, j| sums[i.max(j)][i.min(j)]);
    // Scaled to a unit diagonal: columns differ by decades.
    let scale = gram.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let gram = SMatrix::<f64, 5, 5>::from_fn(|i, j| gram[(i, j)] * scale[i] * scale[j]);
    let right = right.component_mul(&scale);
    let all = (1_u32 << terms.len()) - 1;
    let first = if likely > 0 { likely } else { all };
    let best = by_exchange(&gram, &right, first, of_any_sign).or_else(|| {
        let tried = (1..=all).filter(|set| set & of_any_sign == of_any_sign);
        let tried = tried.filter_map(|set| Some((solve_set(&gram, &right, set, of_any_sign)?, set)));
        let tried = tried.filter(|(solved, _)| solved.is_positive);
        // The misfit is a constant minus this gain.
        tried.max_by(|(a, _), (b, _)| a.gain.total_cmp(&b.gain))
    });
    // With a fixed term, the best set may be empty.
    let Some((Solved { solution, .. }, set)) = best else {
        return (held.variance(1.0) > 0.0).then_some((*held, 0));
    };
    let solution = solution.component_mul(&scale);
    let mut fitted = *held;
    terms.iter().zip(solution.iter()).for_each(|(term, value)| fitted.0[*term as usize] = *value);
    Some((fitted, set))
}

/// The best set by exchange: terms that come out negative leave it, and the term that would lower the misfit most enters. It is the best
/// where all are positive and none would (Karush, Kuhn and Tucker), for the misfit is convex. `None` where that is not soon so.
fn by_exchange(
    gram: &SMatrix<f64, 5, 5>,
    right: &SVector<f64, 5>,
    mut set: u32,
    of_any_sign: u32,
) -> Option<(Solved, u32)> {
    for _ in 0..MOST_EXCHANGES {
        let solved = solve_set(gram, right, set, of_any_sign)?;
        if !solved.is_positive {
            let stay = (0..5).filter(|i| set >> i & 1 == 1 && solved.solution[*i] > 0.0);
            set = stay.fold(of_any_sign, |set, i| set | 1 << i);
            continue;
        }
        let gradient = right - gram * solved.solution;
        let outside = (0..5).filter(|i| set >> i & 1 == 0);
        match outside.max_by(|a, b| gradient[*a].total_cmp(&gradient[*b])).filter(|i| gradient[*i] > 0.0) {
            Some(enters) => set |= 1 << enters,
            None => return Some((solved, set)),
        }
    }
    None
}

/// The least squares of one set of terms.
struct Solved {
    solution: SVector<f64, 5>,
    /// Its reduction of the misfit.
    gain: f64,
    /// No coefficient is below zero that may not be.
    is_positive: bool,
}

/// The solution with only the terms of `set`; `None` for an empty one, and where they are not told apart.
fn solve_set(gram: &SMatrix<f64, 5, 5>, right: &SVector<f64, 5>, set: u32, of_any_sign: u32) -> Option<Solved> {
    if set == 0 {
        return None;
    }
    let in_set = |i: usize| set >> i & 1 == 1;
    let masked = SMatrix::<f64, 5, 5>::from_fn(|i, j| match (in_set(i) && in_set(j), i == j) {
        (true, _) => gram[(i, j)],
        (false, true) => 1.0,
        (false, false) => 0.0,
    });
    let masked_right = SVector::<f64, 5>::from_fn(|i, _| if in_set(i) { right[i] } else { 0.0 });
    let solution = masked.cholesky()?.solve(&masked_right);
    let is_positive = (0..5).all(|i| !in_set(i) || of_any_sign >> i & 1 == 1 || solution[i] > 0.0);
    Some(Solved { gain: masked_right.dot(&solution), solution, is_positive })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: [f64; 5] = [0.25, 0.0324, 4e-6, 1e-9, 1e-14];

    fn curve(of: &FittedTerms) -> Vec<Point> {
        let taus = (0..28).map(|octave| 0.01 * 2.0_f64.powi(octave));
        taus.map(|tau_s| Point { tau_s, variance: of.variance(tau_s), edf: 1e8 / tau_s }).collect()
    }

    #[test]
    fn a_curve_of_the_model_gives_its_terms() {
        let truth = FittedTerms(WANTED);
        let fitted = fit_terms(&curve(&truth), &AllanTerm::ALL).unwrap();
        for term in AllanTerm::ALL {
            let ratio = fitted.coefficient(term) / truth.coefficient(term);
            assert!((ratio - 1.0).abs() < 1e-6, "{term:?}: {ratio}");
        }
    }

    /// A term that is absent is fitted as exactly zero, never below.
    #[test]
    fn nothing_is_below_zero() {
        let truth = FittedTerms([0.25, 0.0324, 0.0, 0.0, 0.0]);
        let mut points = curve(&truth);
        points.iter_mut().skip(8).for_each(|p| p.variance *= 0.9);
        let fitted = fit_terms(&points, &AllanTerm::ALL).unwrap();
        assert!(AllanTerm::ALL.iter().all(|term| fitted.coefficient(*term) >= 0.0));
        assert_eq!(
            (fitted.coefficient(AllanTerm::RateRandomWalk), fitted.coefficient(AllanTerm::RateRamp)),
            (0.0, 0.0)
        );
    }

    #[test]
    fn no_points_no_terms() {
        assert_eq!(fit_terms(&[], &AllanTerm::ALL), None);
        let silent = Point { tau_s: 1.0, variance: 0.0, edf: 10.0 };
        assert_eq!(fit_terms(&[silent], &AllanTerm::ALL), None);
    }

    /// What exchange finds is what all sets give: curves of any mixture with scatter, a hundred each for one to five terms.
    #[test]
    fn exchange_finds_the_best_of_all_sets() {
        let mut state = 1_u64;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut found, mut sets) = (0, [0; 5]);
        for case in 0..500 {
            let size = 1 + case % 5;
            let mut truth = FittedTerms::default();
            for value in &mut truth.0 {
                *value = if uniform() < 0.5 { 10.0_f64.powf(8.0 * uniform() - 6.0) } else { 0.0 };
            }
            let mut gram = SMatrix::<f64, 5, 5>::zeros();
            let mut right = SVector::<f64, 5>::zeros();
            for octave in 0..14 {
                let tau_s = f64::from(octave).exp2();
                let columns =
                    SVector::<f64, 5>::from_fn(|i, _| if i < size { AllanTerm::ALL[i].variance(tau_s) } else { 0.0 });
                let variance = (truth.variance(tau_s) + 1e-9) * (0.3 + 1.4 * uniform());
                gram += columns * columns.transpose() / (variance * variance);
                right += columns / variance;
            }
            let scale = gram.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
            let gram = SMatrix::<f64, 5, 5>::from_fn(|i, j| gram[(i, j)] * scale[i] * scale[j]);
            let right = right.component_mul(&scale);
            let all = (1_u32 << size) - 1;
            let best = (1..=all).filter_map(|set| solve_set(&gram, &right, set, 0)).filter(|solved| solved.is_positive);
            let best = best.map(|solved| solved.gain).fold(f64::NEG_INFINITY, f64::max);
            if let Some((solved, set)) = by_exchange(&gram, &right, all, 0) {
                assert!((solved.gain / best - 1.0).abs() < 1e-9, "{case}: {} {best}", solved.gain);
                found += 1;
                sets[set.count_ones() as usize - 1] += 1;
            }
        }
        assert!(found > 450 && sets.iter().filter(|number| **number > 5).count() > 3, "{found} {sets:?}");
    }
}
