//! Five simulated terms, seed by seed, against the intervals of the estimates.

mod counted;
mod shaped;

#[path = "../../../sagnac/tests/support/evidence.rs"]
#[expect(dead_code, reason = "`sagnac` alone measures ratios and largest values")]
mod evidence;

use evidence::{Records, evidence};
use sagnac_noise::{AllanTerm, RecordUnit, Taus, TermValue, budget_of_angles};
use sagnac_sim::{NoiseConfig, Resting};

const SEEDS: Records = Records::new(100).few(30);
/// Three days of seconds.
const SECONDS: usize = 1 << 18;

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

/// In how many of the records each term's 95 % interval contains the true value, and in how many it has one.
fn coverage(resting: &Resting) -> [(u32, u32); 5] {
    let truth = truth_of(resting);
    let mut counts = [(0, 0); 5];
    for seed in SEEDS.each().map(|seed| seed + 1) {
        let budget =
            budget_of_angles(&resting.angles(SECONDS, seed), RecordUnit::Angle(1.0), 1.0, &Taus::Octaves).unwrap();
        for (i, term) in AllanTerm::ALL.into_iter().enumerate() {
            if let TermValue::Found { lower: Some(lower), upper: Some(upper), .. } = budget.terms.get(term) {
                counts[i].0 += u32::from((*lower..=*upper).contains(&truth[i]));
                counts[i].1 += 1;
            }
        }
    }
    println!("inside, resolved: {counts:?}");
    counts
}

/// Quantization dominates up to 8 s, angle random walk to 200 s, bias instability above.
/// Measured: inside 96, 95 and 97 of 100.
#[test]
fn quantization_walk_and_instability_lie_in_their_intervals() {
    let noise = NoiseConfig { arw_deg_rt_h: 0.1 / 60.0, bias_instability_dph: 0.0106, ..NoiseConfig::default() };
    let [q, n, b, ..] = coverage(&Resting { noise, q_arcsec: 0.16 });
    let lowest = lowest([q, n, b]);
    evidence("95 % intervals of Q, N and B cover the truth, 2^18 s: lowest of three", lowest, "≥ 0.88", SEEDS);
}

/// Angle random walk dominates up to 100 s, rate random walk to an hour, a ramp above.
/// Measured: inside 93, 97 and 97 of 100.
#[test]
fn rate_random_walk_and_ramp_lie_in_their_intervals() {
    let noise = NoiseConfig {
        arw_deg_rt_h: 0.1 / 60.0,
        rate_random_walk_dph_rt_h: 0.104,
        rate_ramp_dph_h: 0.093,
        ..NoiseConfig::default()
    };
    let [_, n, _, k, r] = coverage(&Resting { noise, q_arcsec: 0.0 });
    let lowest = lowest([n, k, r]);
    evidence("95 % intervals of N, K and R cover the truth, 2^18 s: lowest of three", lowest, "≥ 0.88", SEEDS);
}

/// The lowest coverage of terms that every record resolves.
fn lowest(terms: [(u32, u32); 3]) -> f64 {
    assert!(terms.iter().all(|(_, resolved)| u64::from(*resolved) == SEEDS.count()), "{terms:?}");
    terms.iter().map(|(inside, _)| f64::from(*inside) / SEEDS.count() as f64).fold(1.0, f64::min)
}

/// Terms that can replace each other at the long end of a short record: a resolved term lies in its interval, an unresolved
/// one below its upper bound. The bounds are useful: half of them are within a few times the true value.
#[test]
fn terms_that_trade_lie_in_their_intervals_or_below_their_bounds() {
    let walk = NoiseConfig {
        arw_deg_rt_h: 0.003,
        bias_instability_dph: 0.01,
        rate_random_walk_dph_rt_h: 0.02,
        ..NoiseConfig::default()
    };
    let all_five = NoiseConfig { rate_ramp_dph_h: 0.02, ..walk.clone() };
    let three = check_bounds(&Resting { noise: walk, q_arcsec: 0.0 }, 40_000, [0.0, 1.0, 5.0, 5.0, 0.0]);
    evidence("intervals and upper bounds hold, N, B and K in 40,000 s: lowest of five terms", three, "≥ 0.88", SEEDS);
    let five = check_bounds(&Resting { noise: all_five, q_arcsec: 0.5 }, 40_000, [1.0, 1.0, 5.0, 5.0, 5.0]);
    evidence(
        "intervals and upper bounds hold, all five terms in 40,000 s: lowest of five terms",
        five,
        "≥ 0.88",
        SEEDS,
    );
}

/// Measured: 94 of 100 or more below the bound of K, 91 or more for N; bounds 2 to 2.5 times the truth.
/// Records of minutes and of an hour: white noise of 1 °/h a second and a walk that is just not seen.
#[test]
fn bounds_of_short_records_hold() {
    let cases = [
        (100, 6.0, "intervals and upper bounds hold, N with a hidden K in 100 s: lowest of five terms"),
        (1000, 0.6, "intervals and upper bounds hold, N with a hidden K in 1,000 s: lowest of five terms"),
        (3600, 0.18, "intervals and upper bounds hold, N with a hidden K in 3,600 s: lowest of five terms"),
    ];
    for (seconds, rate_random_walk_dph_rt_h, claim) in cases {
        let noise = NoiseConfig { arw_deg_rt_h: 1.0 / 60.0, rate_random_walk_dph_rt_h, ..NoiseConfig::default() };
        let lowest = check_bounds(&Resting { noise, q_arcsec: 0.0 }, seconds, [0.0, 3.0, 0.0, 10.0, 0.0]);
        evidence(claim, lowest, "≥ 0.88", SEEDS);
    }
}

/// The lowest fraction, over the terms, of the records in which the interval or the bound holds. The median bound of each
/// term is at most `most_times` its true value.
fn check_bounds(resting: &Resting, seconds: usize, most_times: [f64; 5]) -> f64 {
    let truth = truth_of(resting);
    let (mut counts, mut bounds) = ([[0; 3]; 5], [const { Vec::new() }; 5]);
    for seed in SEEDS.each().map(|seed| seed + 1) {
        let budget =
            budget_of_angles(&resting.angles(seconds, seed), RecordUnit::Angle(1.0), 1.0, &Taus::Octaves).unwrap();
        for (i, term) in AllanTerm::ALL.into_iter().enumerate() {
            let place = match budget.terms.get(term) {
                TermValue::Found { lower: Some(lower), upper: Some(upper), value } => {
                    assert!(lower <= value && value <= upper, "{term:?}: {lower} {value} {upper}");
                    usize::from(!(*lower..=*upper).contains(&truth[i]))
                }
                TermValue::Unresolved { unresolved } => {
                    bounds[i].push(at_most(unresolved));
                    if truth[i] <= at_most(unresolved) { 2 } else { 1 }
                }
                other => panic!("{other:?}"),
            };
            counts[i][place] += 1;
        }
    }
    let middle = bounds.map(|mut bounds| {
        bounds.sort_by(f64::total_cmp);
        bounds.get(bounds.len() / 2).copied()
    });
    println!("{seconds} s, true {truth:?}: inside, outside, below the bound {counts:?}; middle bounds {middle:?}");
    for (i, bound) in middle.into_iter().enumerate() {
        if let Some(bound) = bound.filter(|_| truth[i] > 0.0) {
            assert!(bound <= most_times[i] * truth[i], "{:?}: {bound}", AllanTerm::ALL[i]);
        }
    }
    counts.map(|[inside, _, below]| f64::from(inside + below) / SEEDS.count() as f64).into_iter().fold(1.0, f64::min)
}

/// Infinite where the record does not bound it.
fn at_most(unresolved: &str) -> f64 {
    let bound = unresolved.split_once("at most ").and_then(|(_, from)| from.split(' ').next());
    bound.map_or(f64::INFINITY, |bound| bound.parse().unwrap())
}

/// Random numbers of these tests: splitmix64, Box and Muller.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// White noise with a sine of 40 rows: a misfit of the five terms, and still the walk is resolved, and lies in its interval.
#[test]
fn a_sine_hides_no_random_walk() {
    const SINES: Records = Records::new(60).few(30);
    let covered = SINES.each().filter(|seed| {
        let mut dice = Dice(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
        let sine = |row: u32| 1.5 * (std::f64::consts::TAU * f64::from(row) / 40.0).sin();
        let angles: Vec<f64> = (1..=8192).map(|row| dice.normal() + sine(row)).collect();
        let budget = budget_of_angles(&angles, RecordUnit::Angle(1.0), 1.0, &Taus::Octaves).unwrap();
        let TermValue::Found { lower: Some(lower), upper: Some(upper), .. } =
            budget.terms.get(AllanTerm::AngleRandomWalk)
        else {
            return false;
        };
        60.0 * lower <= 1.0 && 1.0 <= 60.0 * upper
    });
    let covered = covered.count() as f64 / SINES.count() as f64;
    evidence("N beside a sine is resolved and lies in its 95 % interval", covered, "≥ 0.88", SINES);
}
