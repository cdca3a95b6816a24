//! Two lags of one input, a fast and a slow one, found together.
//!
//! ```text
//! y = … + Σ cⱼ·mean(Ṫ_fast·Tⱼ) + Σ kⱼ·mean(Ṫ_slow·Tⱼ)        τ_slow ≥ 3·τ_fast
//! ```
//!
//! Found in turn they would creep along the valley in which one lag replaces the other. So all pairs of the grid are tried, then
//! Gauss–Newton steps in both τ, with the coefficients solved for at each (Golub and Pereyra 1973), go to the least misfit.
//!
//! Near each other the two are one lag and its derivative by τ: their coefficients grow without bound and mean nothing. So the
//! least ratio is 3, and a pair is refused unless every pair within Δχ² = 4 of the least misfit keeps more than that ratio.
//! A record with one lag does not: each pair with a slow coefficient of zero fits as well. χ² counts the windows that the
//! residuals' correlation leaves.
//!
//! Fails where a third process lies between two lags: the pair that is found is then a compromise, and its intervals do not say so.

use crate::fit::one_model::design::{Design, FLAT_CHI_SQUARED, LN_TAU_TOLERANCE, Tau, effective_windows, lag_one};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::noise_model::minimum::minimum;
use rayon::prelude::*;

/// Least ratio of the slow lag to the fast one.
pub(crate) const LEAST_RATIO: f64 = 3.0;
/// Places of the grid between the pairs that a held-out trial starts with.
const COARSE: usize = 2;
const MOST_NEWTON_STEPS: usize = 20;
const MOST_HALVINGS: usize = 8;
/// A step changes a lag by this factor at most, as a logarithm.
const MOST_CHANGE: f64 = 0.4;
/// Lags have converged when a step moves neither by more than this fraction.
const CONVERGED: f64 = 1e-5;

/// True for a fast and a slow lag of a permitted ratio.
fn is_apart(fast_s: f64, slow_s: f64) -> bool {
    slow_s >= LEAST_RATIO * fast_s * (1.0 - 1e-9)
}

/// Places on the grid of all pairs far enough apart; the lags begin at `from`.
pub(crate) fn pairs(taus_s: &[f64], from: [usize; 2]) -> Vec<[usize; 2]> {
    let places = 0..taus_s.len();
    let slower = |fast: usize| places.clone().map(move |slow| [fast, slow]);
    let apart =
        |[fast, slow]: &[usize; 2]| *fast >= from[0] && *slow >= from[1] && is_apart(taus_s[*fast], taus_s[*slow]);
    places.clone().flat_map(slower).filter(apart).collect()
}

/// Pairs that a held-out trial tries from one pair: a coarse grid of all, and the neighbours.
pub(crate) fn coarse_pairs(taus_s: &[f64], from: [usize; 2], at: [usize; 2]) -> Vec<[usize; 2]> {
    let is_tried = |pair: &[usize; 2]| {
        let far = |i: usize| pair[i].abs_diff(at[i]);
        far(0).max(far(1)) <= 1 || pair.iter().all(|place| place % COARSE == 0)
    };
    pairs(taus_s, from).into_iter().filter(is_tried).collect()
}

/// The lags of a pair of least misfit.
pub(crate) enum LagPair {
    /// Of the fast and the slow lag, each with whether it is resolved.
    Pair([(f64, bool); 2]),
    /// The data do not separate two lags.
    NotSeparated,
    /// Nothing could be fitted.
    Nothing,
}

/// Finds the pair at places `fast` and `fast + 1` of `taus`; the others stay.
pub(crate) fn find_pair(
    problem: &LeastSquares<'_>,
    terms: &[TermColumn],
    taus: &[Tau],
    fast: usize,
    taus_s: &[f64],
    misfit_at: &MisfitAt<'_>,
) -> LagPair {
    let search = PairSearch { problem, terms, taus, fast, misfit_at };
    let inputs = [taus[fast].input, taus[fast + 1].input];
    let all = pairs(taus_s, inputs.map(|input| problem.tau_from()[input]));
    let misfits = search.misfits(&all, taus_s);
    let best = (0..all.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b]));
    let Some(best) = best.filter(|at| misfits[*at].is_finite()) else { return LagPair::Nothing };
    let lowest = all[best].map(|place| taus_s[place]);
    let most = taus_s.last().copied().unwrap_or(f64::INFINITY);
    let (refined, least) = search.newton(lowest, misfits[best], [taus_s[0], most]);
    let most_near = least * (1.0 + FLAT_CHI_SQUARED / search.degrees(refined));
    let near: Vec<[usize; 2]> =
        all.iter().zip(&misfits).filter(|(_, m)| **m <= most_near).map(|(pair, _)| *pair).collect();
    let ratio = |[fast_s, slow_s]: [f64; 2]| slow_s / fast_s;
    // The grid's own steps: nothing closer can be told apart from the least ratio.
    let step = taus_s.get(1).map_or(1.0, |second| second / taus_s[0]);
    let touches = |pair: [f64; 2]| ratio(pair) < LEAST_RATIO * step;
    if touches(refined) || near.iter().any(|pair| touches(pair.map(|place| taus_s[place]))) {
        return LagPair::NotSeparated;
    }
    let lowest_fast = problem.tau_from()[inputs[0]];
    let is_at_end = |pair: &[usize; 2]| [pair[0] <= lowest_fast, pair[1] + 1 >= taus_s.len()];
    // A slow lag as long as the search goes is a drift in time or a curve.
    if near.iter().any(|pair| is_at_end(pair)[1]) {
        return LagPair::NotSeparated;
    }
    if near.iter().any(|pair| is_at_end(pair)[0]) {
        return search.with_least_fast(&near, &all, &misfits, taus_s);
    }
    LagPair::Pair(refined.map(|tau_s| (tau_s, true)))
}

/// The pair at places `fast` and `fast + 1` of `taus`.
struct PairSearch<'a> {
    problem: &'a LeastSquares<'a>,
    terms: &'a [TermColumn],
    taus: &'a [Tau],
    fast: usize,
    misfit_at: &'a MisfitAt<'a>,
}

/// Misfit of the model at some lags.
type MisfitAt<'a> = dyn Fn(&[(usize, f64)]) -> f64 + Sync + 'a;

impl PairSearch<'_> {
    fn inputs(&self) -> [usize; 2] {
        [self.taus[self.fast].input, self.taus[self.fast + 1].input]
    }

    /// Misfits at pairs of the grid.
    fn misfits(&self, pairs: &[[usize; 2]], taus_s: &[f64]) -> Vec<f64> {
        pairs.par_iter().map(|pair| self.misfit(pair.map(|place| taus_s[place]))).collect()
    }

    fn misfit(&self, pair: [f64; 2]) -> f64 {
        (self.misfit_at)(&self.lags_s(pair))
    }

    /// The lags of all inputs with this pair.
    fn lags_s(&self, [fast_s, slow_s]: [f64; 2]) -> Vec<(usize, f64)> {
        let [fast, slow] = self.inputs();
        let value = |tau: &Tau| match tau.input {
            input if input == fast => fast_s,
            input if input == slow => slow_s,
            _ => tau.value_s,
        };
        self.taus.iter().map(|tau| (tau.input, value(tau))).collect()
    }

    fn design(&self, pair: [f64; 2]) -> Design<'_> {
        Design::new(self.problem, self.terms, &self.lags_s(pair))
    }

    /// Windows less coefficients, as far as the residuals at a pair are independent.
    fn degrees(&self, pair: [f64; 2]) -> f64 {
        let design = self.design(pair);
        let rho = design.solve().map_or(0.0, |theta| lag_one(self.problem, &design.weighted_residuals(&theta)));
        let parameters = self.problem.levels().len() + self.terms.len();
        (effective_windows(self.problem.len(), rho) - parameters as f64).max(1.0)
    }

    /// Gauss–Newton from a pair, with steps halved until the misfit falls; the lags stay apart and between the ends.
    fn newton(&self, mut pair: [f64; 2], mut least: f64, ends: [f64; 2]) -> ([f64; 2], f64) {
        for _ in 0..MOST_NEWTON_STEPS {
            let design = self.design(pair);
            let of_terms = design.solve_terms(&[]);
            let Some(step) = of_terms.and_then(|of_terms| self.step(&design, pair, &of_terms)) else { break };
            let moved = (0..MOST_HALVINGS).map(|n| 0.5_f64.powi(n as i32)).find_map(|part| {
                let to = |i: usize| (pair[i] * (part * step[i]).exp()).clamp(ends[0], ends[1]);
                let [fast_s, slow_s] = [to(0), to(1)];
                let there = [fast_s, slow_s.max(LEAST_RATIO * fast_s)];
                let misfit = self.misfit(there);
                (misfit < least && there[1] <= ends[1]).then_some((there, misfit))
            });
            let Some((there, misfit)) = moved else { break };
            let far = (0..2).map(|i| (there[i] / pair[i]).ln().abs()).fold(0.0, f64::max);
            (pair, least) = (there, misfit);
            if far < CONVERGED {
                break;
            }
        }
        (pair, least)
    }

    /// Changes of ln τ that the linearized model asks for.
    fn step(&self, design: &Design<'_>, pair: [f64; 2], of_terms: &[f64]) -> Option<[f64; 2]> {
        let tau = |i: usize| Tau { input: self.inputs()[i], value_s: pair[i], resolved: true };
        let slopes: Vec<Vec<f64>> = (0..2).map(|i| design.slope_of_lag(&tau(i), of_terms)).collect();
        let solved = design.solve_terms(&slopes)?;
        let change = |i: usize| (solved[solved.len() - 2 + i] / pair[i]).clamp(-MOST_CHANGE, MOST_CHANGE);
        Some([change(0), change(1)])
    }

    /// The least fast lag that fits as well as any, and the slow lag of least misfit next to it.
    fn with_least_fast(&self, near: &[[usize; 2]], all: &[[usize; 2]], misfits: &[f64], taus_s: &[f64]) -> LagPair {
        let Some(fast) = near.iter().map(|pair| pair[0]).min() else { return LagPair::Nothing };
        let with_fast = all.iter().zip(misfits).filter(|(pair, _)| pair[0] == fast);
        let best = with_fast.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(pair, _)| pair[1]);
        match best.filter(|slow| *slow > 0 && slow + 1 < taus_s.len()) {
            None => LagPair::NotSeparated,
            Some(slow) => {
                let fast_s = taus_s[fast];
                let (lo, hi) = (taus_s[slow - 1].max(LEAST_RATIO * fast_s).ln(), taus_s[slow + 1].ln());
                let misfit = |log: f64| self.misfit([fast_s, log.exp()]);
                LagPair::Pair([(fast_s, false), (minimum(lo, hi, LN_TAU_TOLERANCE, misfit).at.exp(), true)])
            }
        }
    }
}
