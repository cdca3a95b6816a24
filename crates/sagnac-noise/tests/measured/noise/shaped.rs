//! Records that the five laws do not describe: filtered, repeated, periodic, moving. What they show is right, and nothing else is said.

use super::Dice;
use super::evidence::{Records, evidence};
use sagnac_noise::{
    AllanTerm, AxisBudget, HELD_PHASES, MOST_ROWS, RecordUnit, RowPlace, Screen, Taus, TermValue, budget_of_angles,
    budget_of_screened, differences,
};
use sagnac_sim::{NoiseConfig, Resting};
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

/// A low-pass filter, or readings that repeat.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Two poles of Butterworth; its −3 dB frequency over that of the rows.
    Butterworth(f64),
    /// One pole with a time constant of so many rows.
    OnePole(f64),
    /// Each reading stands so many times.
    Repeated(usize),
}

impl Shape {
    const ALL: [Self; 7] = [
        Self::Butterworth(0.4),
        Self::Butterworth(0.2),
        Self::Butterworth(0.1),
        Self::Butterworth(0.05),
        Self::Butterworth(0.02),
        Self::OnePole(10.0),
        Self::Repeated(4),
    ];

    /// White noise of N = 1 arcsec/√s behind it, rows of 1 s. The bilinear transform keeps the gain at rest, and so N.
    fn white(self, rows: usize, seed: u64) -> Vec<f64> {
        let mut dice = Dice(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
        match self {
            Self::Butterworth(frequency) => {
                let k = (PI * frequency).tan();
                let scale = 1.0 / (1.0 + k / FRAC_1_SQRT_2 + k * k);
                let (a1, a2) = (2.0 * (k * k - 1.0) * scale, (1.0 - k / FRAC_1_SQRT_2 + k * k) * scale);
                let (mut x, mut y) = ([0.0; 2], [0.0; 2]);
                let mut next = || {
                    let now = dice.normal();
                    let out = k * k * scale * (now + 2.0 * x[0] + x[1]) - a1 * y[0] - a2 * y[1];
                    (x, y) = ([now, x[0]], [out, y[0]]);
                    out
                };
                (0..500).for_each(|_| _ = next());
                (0..rows).map(|_| next()).collect()
            }
            Self::OnePole(time_constant) => {
                let mut y = 0.0;
                let mut next = || {
                    y += (dice.normal() - y) / time_constant;
                    y
                };
                (0..500).for_each(|_| _ = next());
                (0..rows).map(|_| next()).collect()
            }
            Self::Repeated(times) => {
                let readings = rows.div_ceil(times);
                let each: Vec<f64> = (0..readings).map(|_| dice.normal() / (times as f64).sqrt()).collect();
                (0..rows).map(|row| each[row / times]).collect()
            }
        }
    }
}

fn budget(angles: &[f64]) -> AxisBudget {
    budget_of_angles(angles, RecordUnit::Angle(1.0), 1.0, &Taus::Octaves).unwrap()
}

/// N in arcsec/√s with its interval.
fn walk(budget: &AxisBudget) -> Option<[f64; 2]> {
    match budget.terms.get(AllanTerm::AngleRandomWalk) {
        TermValue::Found { lower: Some(lower), upper: Some(upper), .. } => Some([60.0 * lower, 60.0 * upper]),
        _ => None,
    }
}

/// 10,000 rows are 1,000 time constants or more of each filter.
#[test]
fn the_walk_behind_a_filter_is_that_of_the_gyro() {
    const RECORDS: Records = Records::new(100).few(40);
    let (mut inside, mut resolved, mut hz) = (Vec::new(), Vec::new(), Vec::new());
    for shape in Shape::ALL {
        let budgets: Vec<AxisBudget> = RECORDS.each().map(|seed| budget(&shape.white(10_000, seed + 1))).collect();
        let walks: Vec<[f64; 2]> = budgets.iter().filter_map(walk).collect();
        inside.push(walks.iter().filter(|ends| (ends[0]..=ends[1]).contains(&1.0)).count() as f64 / walks.len() as f64);
        resolved.push(walks.len() as f64 / budgets.len() as f64);
        assert!(
            budgets.iter().all(|budget| matches!(budget.terms.q_arcsec, TermValue::Unresolved { .. })),
            "{shape:?}"
        );
        if let Shape::Butterworth(frequency) = shape {
            let found = budgets.iter().filter_map(|budget| budget.law_range?.filter_hz);
            hz.extend(found.filter(|_| frequency < 0.3).map(|hz| hz / frequency));
        }
    }
    println!("inside {inside:?}, resolved {resolved:?}");
    let least = |of: &[f64]| of.iter().copied().fold(1.0, f64::min);
    evidence("95 % intervals of N cover the truth behind a filter: lowest of seven", least(&inside), "≥ 0.87", RECORDS);
    let pooled = resolved.iter().sum::<f64>() / resolved.len() as f64;
    evidence("N is resolved behind a filter, 1,000 time constants: mean of seven", pooled, "≥ 0.90", RECORDS);
    hz.sort_by(f64::total_cmp);
    let [low, middle, high] = [0.1, 0.5, 0.9].map(|part| hz[(part * hz.len() as f64) as usize]);
    println!("frequency named over that of the filter: {low} … {middle} … {high}");
    // Measured on 400 records: 0.84, 1.01, 1.10; the scatter of N² is most of it.
    assert!(low > 0.75 && (0.9..1.1).contains(&middle) && high < 1.2);
}

/// Rates of 1 s from rounded angles, each row lost by itself with some probability: a lost row loses the rounding that it shares with its
/// neighbours. N was 3, 6 and 11 % high, and its interval held in 6, 0 and 0 of 40.
#[test]
fn the_walk_of_rates_with_lost_rows_is_that_of_the_gyro() {
    const RECORDS: Records = Records::new(60).few(20);
    let (n_arcsec_rt_s, count_arcsec) = (0.18, 0.3 * 12.0_f64.sqrt());
    let covers = |lost: f64, seed: u64| {
        let mut dice = Dice((seed + 1).wrapping_mul(0x2545_f491_4f6c_dd1d) ^ lost.to_bits());
        let mut screen = Screen::new(differences(&[1], MOST_ROWS), HELD_PHASES);
        let (mut angle, mut counted) = (0.0, 0.0);
        for line in 0..43_200 {
            angle += 4.5 + n_arcsec_rt_s * dice.normal();
            let total = (angle / count_arcsec).floor() * count_arcsec;
            match dice.uniform() < lost {
                true => screen.lost(1),
                false => screen.row(total - counted, RowPlace { log: 0, line }),
            }
            counted = total;
        }
        let found = budget_of_screened('x', &screen.finish(), 1.0, RecordUnit::Angle(1.0), |_| true, |_| String::new());
        walk(&found).is_some_and(|ends| (ends[0]..=ends[1]).contains(&n_arcsec_rt_s))
    };
    for (lost, claim, wanted) in [
        (
            0.01,
            "95 % interval of N covers the truth, rates of Q = 0.3 arcsec and 1 % of the rows lost singly",
            "≥ 0.80",
        ),
        (
            0.02,
            "95 % interval of N covers the truth, rates of Q = 0.3 arcsec and 2 % of the rows lost singly",
            "≥ 0.80",
        ),
        (
            0.04,
            "95 % interval of N covers the truth, rates of Q = 0.3 arcsec and 4 % of the rows lost singly",
            "≥ 0.60",
        ),
    ] {
        let covered = RECORDS.each().filter(|seed| covers(lost, *seed)).count() as f64 / RECORDS.count() as f64;
        evidence(claim, covered, wanted, RECORDS);
    }
}

/// Twelve hours of seconds: N 0.003 °/√h, B 0.003 °/h.
const TWELVE_HOURS: usize = 43_200;

fn resting(bias_instability_dph: f64, rate_random_walk_dph_rt_h: f64) -> Resting {
    let noise =
        NoiseConfig { arw_deg_rt_h: 0.003, bias_instability_dph, rate_random_walk_dph_rt_h, ..NoiseConfig::default() };
    Resting { noise, q_arcsec: 0.0 }
}

/// A chamber and an air conditioning. The period is found to 3 %, its amplitude to a third.
#[test]
fn a_period_is_found() {
    const RECORDS: Records = Records::new(100).few(20);
    for (period_s, amplitude_dph, b_dph, claim) in [
        (3600.0, 0.01, 0.003, "a period of 1 h and 0.01 °/h is found in 12 h, N 0.003, B 0.003"),
        (60.0, 0.02, 0.0, "a period of 60 s and 0.02 °/h is found in 12 h, N 0.003"),
    ] {
        let found = RECORDS.each().filter(|seed| {
            let mut angles = resting(b_dph, 0.0).angles(TWELVE_HOURS, seed + 1);
            let phase = Dice(seed + 77).uniform();
            for (row, angle) in angles.iter_mut().enumerate() {
                *angle += amplitude_dph * (TAU * (row as f64 / period_s + phase)).sin();
            }
            let budget = budget(&angles);
            let is_it = |hz: f64, dph: f64| {
                (hz * period_s - 1.0).abs() < 0.03 && (2.0 / 3.0..1.5).contains(&(dph / amplitude_dph))
            };
            budget.periods.first().is_some_and(|period| is_it(period.frequency_hz, period.amplitude_dph))
        });
        evidence(claim, found.count() as f64 / RECORDS.count() as f64, "≥ 0.95", RECORDS);
    }
}

#[test]
fn noise_alone_has_no_period() {
    const RECORDS: Records = Records::new(300).few(30);
    let with_period = |b_dph: f64, k_dph_rt_h: f64| {
        let budget = |seed: u64| budget(&resting(b_dph, k_dph_rt_h).angles(TWELVE_HOURS, seed + 1));
        let found = RECORDS.part(3).each().filter(|seed| !budget(*seed).periods.is_empty());
        found.count() as f64
    };
    let found = with_period(0.0, 0.0) + with_period(0.01, 0.0) + with_period(0.0, 0.02);
    let all = 3.0 * RECORDS.part(3).count() as f64;
    evidence("a period is named where there is none: white noise, flicker, walk", found / all, "≤ 0.01", RECORDS);
}

/// Narrow-band motion of 2 Hz, 50,000 °/h rms, rows of 4 ms. No slow term is resolved above the curve: B ≤ min σ/0.664.
#[test]
fn motion_is_no_slow_term() {
    const RECORDS: Records = Records::new(60).few(20);
    let wrong = RECORDS.each().filter(|seed| {
        let mut dice = Dice(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) + 1);
        let (mut x, mut y) = (0.0, 0.0);
        let (sine, cosine) = (TAU * 2.0 * 0.004).sin_cos();
        let angles: Vec<f64> = (0..17_000)
            .map(|_| {
                let kept = 0.995;
                (x, y) = (
                    kept * (cosine * x - sine * y) + 5_000.0 * dice.normal(),
                    kept * (sine * x + cosine * y) + 5_000.0 * dice.normal(),
                );
                (x + 18.0 * dice.normal()) * 0.004
            })
            .collect();
        let budget = budget_of_angles(&angles, RecordUnit::Angle(1.0), 0.004, &Taus::Octaves).unwrap();
        let least_dph = budget.curve.iter().map(|point| point.adev_dph).fold(f64::INFINITY, f64::min);
        let above = |term: AllanTerm| match budget.terms.get(term) {
            TermValue::Found { lower, .. } => {
                lower.is_none_or(|lower| term != AllanTerm::BiasInstability || 0.664 * lower > least_dph)
            }
            TermValue::Unresolved { .. } => false,
        };
        above(AllanTerm::BiasInstability) || above(AllanTerm::RateRandomWalk) || above(AllanTerm::RateRamp)
    });
    evidence(
        "B, K or R is resolved from motion of 2 Hz",
        wrong.count() as f64 / RECORDS.count() as f64,
        "≤ 0.05",
        RECORDS,
    );
}
