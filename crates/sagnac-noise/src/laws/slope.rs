//! Has a curve the slope of a term where that term would dominate? Asked of curves that the five terms do not describe.
//!
//! ```text
//! ln(σ²ᵢ/f(τᵢ)) = a + b·ln τᵢ        least squares, weight edfᵢ/2, over the τ where the term makes half of f(τ) or more
//! shown: |b| ≤ 1.96·s_b, from three such τ on        most of the term: min over τ of (upper end of σ²(τ))/(its share for 1)
//! ```
//!
//! Motion of the base bends a curve over decades of τ. The nearest of the five terms then has a value and an interval, and is
//! none: its line crosses the curve. A term is never more than the curve, so the curve still bounds it.
//!
//! Fails where the disturbance has the term's own slope: no curve tells the two apart.

use crate::laws::terms::{AllanTerm, FittedTerms, Point};

/// Standard errors of the slope, 95 %.
const SIGMAS: f64 = 1.96;
/// Fewer τ show no slope.
const FEWEST: usize = 3;
/// Part of the model from which on a term dominates.
const DOMINANT: f64 = 0.5;

/// What the curve does where a term would dominate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Slope {
    /// The slope of the term.
    Shown,
    /// The term dominates at fewer than three τ.
    Nowhere,
    /// Another slope of the deviation than the term's.
    Other {
        /// Slope of the curve, and that of the model.
        found: f64,
        model: f64,
        /// Shortest and longest τ, s.
        taus_s: [f64; 2],
    },
}

/// Judges a term of a model by the points of the curve; their degrees of freedom include what scatter the curve has.
pub(crate) fn slope_of(term: AllanTerm, fitted: &FittedTerms, points: &[Point]) -> Slope {
    let share = |p: &Point| fitted.coefficient(term) * term.variance(p.tau_s) / fitted.variance(p.tau_s);
    let dominated: Vec<&Point> = points.iter().filter(|p| p.variance > 0.0 && share(p) >= DOMINANT).collect();
    let (Some(first), Some(last)) = (dominated.first(), dominated.last()) else { return Slope::Nowhere };
    if dominated.len() < FEWEST {
        return Slope::Nowhere;
    }
    let (off, sigma) = line(&dominated, |p| (p.variance / fitted.variance(p.tau_s)).ln());
    if off.abs() <= SIGMAS * sigma {
        return Slope::Shown;
    }
    let (model, _) = line(&dominated, |p| fitted.variance(p.tau_s).ln());
    // Half of a slope of σ² is that of σ.
    Slope::Other { found: (model + off) / 2.0, model: model / 2.0, taus_s: [first.tau_s, last.tau_s] }
}

/// Slope over ln τ with its standard error.
fn line(points: &[&Point], value: impl Fn(&Point) -> f64) -> (f64, f64) {
    let weight = |p: &Point| p.edf / 2.0;
    let all: f64 = points.iter().map(|p| weight(p)).sum();
    let mean = |value: &dyn Fn(&Point) -> f64| points.iter().map(|p| weight(p) * value(p)).sum::<f64>() / all;
    let (x, y) = (mean(&|p| p.tau_s.ln()), mean(&|p| value(p)));
    let spread: f64 = points.iter().map(|p| weight(p) * (p.tau_s.ln() - x).powi(2)).sum();
    let product: f64 = points.iter().map(|p| weight(p) * (p.tau_s.ln() - x) * (value(p) - y)).sum();
    (product / spread, spread.sqrt().recip())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::terms::fit_terms;

    /// By hand: σ² = τ^−1.5 against N²/τ is off by −0.5 in σ², −0.25 in σ; with the term's own slope nothing is.
    #[test]
    fn a_curve_between_two_slopes_shows_neither() {
        let curve = |power: f64| -> Vec<Point> {
            let taus = (0..16).map(|octave| 0.01 * 2.0_f64.powi(octave));
            taus.map(|tau_s| Point { tau_s, variance: tau_s.powf(power), edf: 20.0 }).collect()
        };
        let white = fit_terms(&curve(-1.0), &[AllanTerm::AngleRandomWalk]).unwrap();
        assert_eq!(slope_of(AllanTerm::AngleRandomWalk, &white, &curve(-1.0)), Slope::Shown);
        let Slope::Other { found, model, taus_s } = slope_of(AllanTerm::AngleRandomWalk, &white, &curve(-1.5)) else {
            panic!("a slope of −0.75 is none of −0.5")
        };
        assert!((found + 0.75).abs() < 1e-9 && (model + 0.5).abs() < 1e-9, "{found} for {model}");
        assert!((taus_s[0] - 0.01).abs() < 1e-9 && (taus_s[1] - 327.68).abs() < 1e-9, "{taus_s:?}");
        assert_eq!(slope_of(AllanTerm::RateRamp, &white, &curve(-1.0)), Slope::Nowhere);
    }
}
