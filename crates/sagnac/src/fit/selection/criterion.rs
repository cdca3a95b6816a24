//! The held-out gain that justifies a larger model.
//!
//! ```text
//! M_small/M_large > e^((Δk·ln n + 2·ln m)/n)      Δk ≥ 1
//! M_small/M_large > e^(2/n)                       models of one size
//! ```
//!
//! M are held-out mean squares, Δk the additional coefficients, n the windows (divided by (1 + ρ)/(1 − ρ) for residuals of
//! lag-one autocorrelation ρ) and m the models tried. This is the Bayesian criterion; with m > 1 the extended one (Chen and
//! Chen 2008). Without it the best of twenty useless terms gains 2 % in one record of seven.
//!
//! Where it fails: n does not distinguish windows of one thermal cycle from windows of many. A change between cycles is
//! invisible to any criterion on one record.

use crate::fit::selection::prices::SAME_SIZE;

/// A model that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CvScore {
    /// Coefficients without constants.
    pub(crate) coefficients: usize,
    /// Held-out mean square; infinite where it was not found.
    pub(crate) mean_square: f64,
}

/// Factor by which a model with `more` additional coefficients must improve the mean square, if `tried` models compete.
pub(crate) fn needed_gain(windows: f64, more: usize, tried: usize) -> f64 {
    let n = windows.max(2.0);
    let penalty = if more == 0 { SAME_SIZE } else { more as f64 * n.ln() };
    ((penalty + 2.0 * (tried.max(1) as f64).ln()) / n).exp()
}

/// True where no larger model of `all` is justified against it, and none of at most its size is better by over 2 %.
pub(crate) fn is_undominated(one: CvScore, all: &[CvScore], windows: f64) -> bool {
    let beaten = |other: &CvScore| {
        let more = other.coefficients.saturating_sub(one.coefficients);
        one.mean_square > needed_gain(windows, more, 1) * other.mean_square
    };
    one.mean_square.is_finite() && !all.iter().any(beaten)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(coefficients: usize, mean_square: f64) -> CvScore {
        CvScore { coefficients, mean_square }
    }

    #[test]
    fn more_coefficients_need_a_larger_gain() {
        // ln 200 = 5.298: three more coefficients must gain a factor e^(15.9/200) = 1.0827.
        let all = [held(2, 1.08), held(5, 1.0)];
        assert!(is_undominated(all[0], &all, 200.0) && is_undominated(all[1], &all, 200.0));
        let all = [held(2, 1.09), held(5, 1.0)];
        assert!(!is_undominated(all[0], &all, 200.0));
        // ln 1000 = 6.908: of a thousand windows seven in a thousand are enough for one.
        assert!((needed_gain(1000.0, 1, 1) - 1.006_931_6).abs() < 1e-6);
        assert!((needed_gain(200.0, 1, 20) - ((5.298_317 + 5.991_465) / 200.0_f64).exp()).abs() < 1e-6);
        assert!(!is_undominated(held(3, f64::INFINITY), &[held(3, f64::INFINITY)], 100.0));
    }
}
