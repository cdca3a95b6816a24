//! Order against computation: the paper's open question, answered from held-out residuals and counted instructions.
//!
//! A model is on the frontier if no model of equal or lower cost has a smaller held-out residual. The knee is the cheapest
//! model of the frontier on which no other is justified by its held-out gain ([`crate::fit::selection::criterion`]).

use crate::calibration::{AxisCalibration, Candidate};
use crate::fit::one_model::design::effective_windows;
use crate::fit::selection::criterion::{CvScore, is_undominated};

/// A point of the frontier.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontierPoint<'a> {
    /// The candidate.
    pub candidate: &'a Candidate,
    /// Its held-out σ, °/h.
    pub held_out_dph: f64,
    /// Instructions of its slow update.
    pub instructions: u32,
    /// It is the knee.
    pub knee: bool,
}

/// The frontier of an axis' candidates, cheapest first; empty where nothing was held out.
pub fn frontier(axis: &AxisCalibration) -> Vec<FrontierPoint<'_>> {
    let windows = axis.residual().map_or(0.0, |residual| effective_windows(residual.n, residual.lag1_autocorrelation));
    of_candidates(axis.candidates(), windows)
}

fn of_candidates(candidates: &[Candidate], windows: f64) -> Vec<FrontierPoint<'_>> {
    let priced = |candidate| -> Option<FrontierPoint<'_>> {
        let candidate: &Candidate = candidate;
        Some(FrontierPoint {
            candidate,
            held_out_dph: candidate.held_out_dph?,
            instructions: candidate.slow_update_instructions?,
            knee: false,
        })
    };
    let mut all: Vec<FrontierPoint<'_>> = candidates.iter().filter_map(priced).collect();
    all.sort_by(|a, b| a.instructions.cmp(&b.instructions).then(a.held_out_dph.total_cmp(&b.held_out_dph)));
    let mut frontier: Vec<FrontierPoint<'_>> = Vec::new();
    for point in all {
        if frontier.last().is_none_or(|last| point.held_out_dph < last.held_out_dph) {
            frontier.push(point);
        }
    }
    let score = |point: &FrontierPoint<'_>| CvScore {
        coefficients: point.candidate.coefficients,
        mean_square: point.held_out_dph.powi(2),
    };
    let scores: Vec<CvScore> = frontier.iter().map(score).collect();
    let knee = frontier.iter_mut().find(|point| is_undominated(score(point), &scores, windows));
    if let Some(point) = knee {
        point.knee = true;
    }
    frontier
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frontier_falls_and_the_knee_is_the_cheapest_that_is_good_enough() {
        let candidate = |model: &str, coefficients, instructions, held_out| Candidate {
            model: model.to_owned(),
            coefficients,
            held_out_dph: held_out,
            slow_update_instructions: Some(instructions),
            chosen: false,
        };
        let all = [
            candidate("a", 1, 300, Some(0.040)),
            candidate("b", 3, 400, Some(0.0181)),
            candidate("worse and dearer", 4, 450, Some(0.030)),
            candidate("c", 5, 500, Some(0.0180)),
            candidate("not fitted", 0, 100, None),
        ];
        // Two coefficients more must gain e^(2·ln 200/200) = 1.054 in the mean square; c gains 1.011.
        let found = of_candidates(&all, 200.0);
        let names: Vec<&str> = found.iter().map(|point| point.candidate.model.as_str()).collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert_eq!(found.iter().map(|point| point.knee).collect::<Vec<_>>(), [false, true, false]);
        assert!(of_candidates(&[], 200.0).is_empty());
    }
}
