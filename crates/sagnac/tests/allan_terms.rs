//! Five terms put in, seed by seed; inside their intervals they come out.

use sagnac::allan::{Taus, Term, TermValue, budget_of_angles};
use sagnac_sim::Resting;
use sagnac_sim::scenario::tables::Noise;

const SEEDS: u64 = 100;
/// Three days of seconds.
const SECONDS: usize = 1 << 18;

/// Half a day and a bit.
const SHORT_SECONDS: usize = 40_000;

fn truth_of(resting: &Resting) -> [f64; 5] {
    let noise = &resting.noise;
    [
        resting.q_arcsec,
        noise.arw_deg_rt_h,
        noise.bias_instability_dph,
        noise.rate_random_walk_dph_rt_h,
        noise.rate_ramp_dph_h,
    ]
}

/// In how many of a hundred records each term's 95 % interval holds what was put in, and in how many it has one.
fn coverage(resting: &Resting) -> [(u32, u32); 5] {
    let truth = truth_of(resting);
    let mut counts = [(0, 0); 5];
    for seed in 1..=SEEDS {
        let budget = budget_of_angles(&resting.angles(SECONDS, seed), 1.0, &Taus::Octaves).unwrap();
        for (i, term) in Term::ALL.into_iter().enumerate() {
            if let TermValue::Found { lower: Some(lower), upper: Some(upper), .. } = budget.terms.get(term) {
                counts[i].0 += u32::from((*lower..=*upper).contains(&truth[i]));
                counts[i].1 += 1;
            }
        }
    }
    println!("inside, resolved: {counts:?}");
    counts
}

/// Quantization rules up to 8 s, angle random walk to 200 s, bias instability above.
/// Measured: inside 96, 95 and 96 of 100.
#[test]
fn quantization_walk_and_instability_lie_in_their_intervals() {
    let noise = Noise { arw_deg_rt_h: 0.1 / 60.0, bias_instability_dph: 0.0106, ..Noise::default() };
    let [q, n, b, ..] = coverage(&Resting { noise, q_arcsec: 0.16 });
    for (inside, resolved) in [q, n, b] {
        assert!(inside >= 88 && resolved == 100, "{inside} of {resolved}");
    }
}

/// Angle random walk rules up to 100 s, rate random walk to an hour, a ramp above.
/// Measured: inside 95, 96 and 98 of 100.
#[test]
fn rate_random_walk_and_ramp_lie_in_their_intervals() {
    let noise = Noise {
        arw_deg_rt_h: 0.1 / 60.0,
        rate_random_walk_dph_rt_h: 0.104,
        rate_ramp_dph_h: 0.093,
        ..Noise::default()
    };
    let [_, n, _, k, r] = coverage(&Resting { noise, q_arcsec: 0.0 });
    for (inside, resolved) in [n, k, r] {
        assert!(inside >= 88 && resolved == 100, "{inside} of {resolved}");
    }
}

/// What trades with each other at the long end of a short record: a term that is resolved is so in its interval, and one that
/// is not lies below what the program says it is at most.
#[test]
fn terms_that_trade_lie_in_their_intervals_or_below_their_bounds() {
    let walk =
        Noise { arw_deg_rt_h: 0.003, bias_instability_dph: 0.01, rate_random_walk_dph_rt_h: 0.02, ..Noise::default() };
    let mixes = [
        Resting { noise: walk.clone(), q_arcsec: 0.0 },
        Resting { noise: Noise { rate_ramp_dph_h: 0.02, ..walk }, q_arcsec: 0.5 },
    ];
    for resting in mixes {
        let truth = truth_of(&resting);
        let mut counts = [[0; 3]; 5];
        for seed in 1..=SEEDS {
            let budget = budget_of_angles(&resting.angles(SHORT_SECONDS, seed), 1.0, &Taus::Octaves).unwrap();
            for (i, term) in Term::ALL.into_iter().enumerate() {
                let place = match budget.terms.get(term) {
                    TermValue::Found { lower: Some(lower), upper: Some(upper), .. } => {
                        usize::from(!(*lower..=*upper).contains(&truth[i]))
                    }
                    TermValue::Unresolved { unresolved } if truth[i] <= at_most(unresolved) => 2,
                    _ => 1,
                };
                counts[i][place] += 1;
            }
        }
        println!("inside, outside, below the bound: {counts:?}");
        for (i, [inside, _, below]) in counts.into_iter().enumerate() {
            assert!(inside + below >= 88, "{:?}", Term::ALL[i]);
        }
    }
}

fn at_most(unresolved: &str) -> f64 {
    let (_, from) = unresolved.split_once("at most ").unwrap();
    from.split(' ').next().unwrap().parse().unwrap()
}
