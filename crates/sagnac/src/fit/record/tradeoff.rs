//! Order against computation: the paper's open question, answered from held-out residuals and counted instructions.
//!
//! A model is on the frontier if no model of equal or lower cost has a smaller held-out residual. The knee is the cheapest
//! model of the frontier within 2 % of the least held-out mean square: more instructions bring no gain that the data show.

use crate::calibration::Candidate;
use crate::fit::selection::prices::SMALLER_WINS_WITHIN;

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

/// The frontier of some candidates, cheapest first; empty where nothing was held out.
pub fn frontier(candidates: &[Candidate]) -> Vec<FrontierPoint<'_>> {
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
    let least = frontier.last().map_or(0.0, |last| last.held_out_dph);
    let knee = frontier.iter_mut().find(|point| point.held_out_dph.powi(2) <= SMALLER_WINS_WITHIN * least.powi(2));
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
        let candidate = |model: &str, instructions, held_out| Candidate {
            model: model.to_owned(),
            coefficients: 0,
            held_out_dph: held_out,
            slow_update_instructions: Some(instructions),
            chosen: false,
        };
        let all = [
            candidate("a", 300, Some(0.040)),
            candidate("b", 400, Some(0.0181)),
            candidate("worse and dearer", 450, Some(0.030)),
            candidate("c", 500, Some(0.0180)),
            candidate("not fitted", 100, None),
        ];
        let found = frontier(&all);
        let names: Vec<&str> = found.iter().map(|point| point.candidate.model.as_str()).collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert_eq!(found.iter().map(|point| point.knee).collect::<Vec<_>>(), [false, true, false]);
        assert!(frontier(&[]).is_empty());
    }
}
