//! The source paper's rig, 500 times: coverage of the intervals, and whether the correction reaches the noise
//! floor on a run that the fit did not see.

use crate::support::evidence::{Records, evidence, ratio};
use crate::support::farthest;
use crate::support::{fit, paper_setup, retest};
use sagnac_sim::{PaperRig, csv_bytes};

const SEEDS: Records = Records::new(500).few(30);

#[test]
fn intervals_cover_the_truth_and_the_correction_reaches_the_floor() {
    let setup = paper_setup();
    let rig = PaperRig::PAPER;
    // Ascending, as `monomial` is.
    let truth = [rig.coefficients[2], rig.coefficients[1], rig.coefficients[0]];
    let mut covered = [0_u32; 3];
    let (mut over_floor, mut improvements) = (Vec::new(), Vec::new());
    for seed in SEEDS.each() {
        let calibration = fit(vec![csv_bytes(rig.run(2 * seed))], &setup, "bias 2").unwrap();
        let axis = &calibration.axes[0];
        let sigmas = axis.monomial.as_ref().unwrap().sigma.as_ref().unwrap();
        // 95 % interval of Student's t; 147 degrees of freedom, reduced for the autocorrelation.
        for (i, hit) in covered.iter_mut().enumerate() {
            *hit += u32::from((axis.monomial.as_ref().unwrap().coefficients[i] - truth[i]).abs() <= 1.976 * sigmas[i]);
        }
        let verification = retest(&calibration, csv_bytes(rig.run(2 * seed + 1)), &setup);
        let proof = &verification.axes[0];
        over_floor.push(proof.after.sigma_dph / proof.noise_floor.as_ref().unwrap().value_dph);
        improvements.push(proof.improvement.unwrap());
    }
    let coverage = covered.map(|n| f64::from(n) / SEEDS.count() as f64);
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let median = |of: &[f64]| {
        let mut sorted = of.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    let claim = "95 % intervals of A, B and C on the paper's rig: coverage farthest from 0.95";
    evidence(claim, farthest(coverage, 0.95), "0.92 … 0.98", SEEDS);
    let claim = "σ after over the noise floor on the paper's rig: mean";
    ratio(claim, &over_floor, mean, ["0.95 … 1.05", "0.9 … 1.1"], SEEDS);
    ratio("improvement of max − min on the paper's rig: median", &improvements, median, ["≥ 7", "≥ 6"], SEEDS);
}
