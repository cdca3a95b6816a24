//! Rest and motion, found in the rows alone.

use crate::support::records::Random;
use crate::support::{reader, windows};
use sagnac::allan::{NoiseBudget, Request, noise_budget};
use sagnac::survey::{GoodFor, Survey, survey};
use sagnac_log::setup::Setup;
use sagnac_noise::{Taus, TermValue};
use std::fmt::Write as _;

const SEEDS: std::ops::Range<u64> = 0..60;
/// N of every record, °/√h.
const N_DEG_RT_H: f64 = 0.3;
const ROWS_HZ: f64 = 50.0;

/// White noise and a flicker of as many walks with a memory as decades, °/h.
struct AtRest {
    walks_dph: [f64; 4],
    flicker_dph: f64,
    walk_dph: f64,
    walk_step_dph: f64,
}

impl AtRest {
    fn new(flicker_dph: f64, walk_step_dph: f64) -> Self {
        Self { walks_dph: [0.0; 4], flicker_dph, walk_dph: 0.0, walk_step_dph }
    }

    fn next(&mut self, random: &mut Random) -> f64 {
        let mut rate = N_DEG_RT_H * 60.0 * ROWS_HZ.sqrt() * random.normal();
        for (decade, walk) in self.walks_dph.iter_mut().enumerate() {
            let keeps = 1.0 - 1.0 / (ROWS_HZ * 10.0_f64.powi(decade as i32));
            *walk = keeps * *walk + self.flicker_dph * (1.0 - keeps * keeps).sqrt() * random.normal();
            rate += *walk;
        }
        self.walk_dph += self.walk_step_dph * random.normal();
        rate + self.walk_dph
    }
}

fn log(rates: impl Iterator<Item = f64>) -> Vec<u8> {
    let mut text = "time_s,rate_dph\n".to_owned();
    rates.enumerate().for_each(|(row, rate)| writeln!(text, "{:.2},{rate:.2}", (row + 1) as f64 / ROWS_HZ).unwrap());
    text.into_bytes()
}

fn surveyed(log: Vec<u8>) -> Survey {
    survey(&windows(vec![log], &Setup::default()), &Setup::default()).unwrap()
}

fn at_rest(log: &[u8]) -> NoiseBudget {
    let again = Some(vec![reader(log.to_vec(), &Setup::default())].into());
    let request = Request { at_rest: true, ..Request::new(Taus::Octaves) };
    noise_budget(vec![reader(log.to_vec(), &Setup::default())], again, &Setup::default(), &request).unwrap()
}

/// A hand, a drive: rates of thousands of °/h whose direction changes within a second, in one to four parts of a record.
#[test]
fn the_longest_rest_is_found_and_used() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rows = 40_000;
        let parts = 1 + random.below(4);
        let each = rows / parts;
        // Motion from the start of each part on, for a tenth to a third of it.
        let moving: Vec<usize> = (0..parts).map(|_| each / 10 + random.below(each / 4)).collect();
        let (size_dph, memory) = (20_000.0 + 100_000.0 * random.uniform(), 0.95);
        let (mut gyro, mut motion) = (AtRest::new(2.0, 0.0), 0.0);
        let rates: Vec<f64> = (0..rows)
            .map(|row| {
                motion = memory * motion + size_dph * 0.3 * random.normal();
                let moves = moving.get(row / each).is_some_and(|length| row % each < *length);
                gyro.next(&mut random) + if moves { motion } else { 0.0 }
            })
            .collect();
        let bytes = log(rates.into_iter());
        let found = surveyed(bytes.clone());
        let longest = moving.iter().map(|length| each - length).max().unwrap();
        let rest = found.at_rest.clone().unwrap_or_else(|| panic!("seed {seed}: {:?}", found.cautions));
        let off_s = rest.length_s - longest as f64 / ROWS_HZ;
        assert!((-4.0..=0.0).contains(&off_s), "seed {seed}: {off_s} s of {rest}");
        assert!(found.cautions.iter().any(|caution| caution.starts_with("not at rest")), "seed {seed}");
        // Without the flag nothing is claimed of the motion.
        let moving = noise_budget(
            vec![reader(bytes.clone(), &Setup::default())],
            None,
            &Setup::default(),
            &Request::new(Taus::Octaves),
        );
        let moving = moving.unwrap();
        assert!(moving.warnings[0].starts_with("not at rest"), "seed {seed}: {:?}", moving.warnings);
        assert!(matches!(moving.axes[0].terms.n_deg_rt_h, TermValue::Unresolved { .. }), "seed {seed}");
        let budget = at_rest(&bytes);
        assert_eq!(budget.at_rest, found.at_rest);
        let used_s = budget.axes[0].rows as f64 / ROWS_HZ;
        assert!((used_s - rest.length_s).abs() < 1e-6, "seed {seed}: {used_s} s");
        match budget.axes[0].terms.n_deg_rt_h {
            TermValue::Found { value, .. } => assert!((value / N_DEG_RT_H - 1.0).abs() < 0.1, "seed {seed}: N {value}"),
            ref other => panic!("seed {seed}: {other:?}"),
        }
    }
}

/// A narrow band of motion from the first row to the last: a hump, and no rest.
#[test]
fn a_record_that_always_moves_is_not_usable() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let (frequency_hz, size_dph) = (0.5 + random.uniform(), 20_000.0 + 60_000.0 * random.uniform());
        let mut gyro = AtRest::new(2.0, 0.0);
        let (mut phase, mut size) = (0.0, 1.0);
        let rates = (0..20_000).map(|_| {
            phase += std::f64::consts::TAU * (frequency_hz / ROWS_HZ + 0.005 * random.normal());
            size += 0.02 * (1.0 - size) + 0.02 * random.normal();
            size_dph * size * f64::sin(phase) + gyro.next(&mut random)
        });
        let found = surveyed(log(rates));
        let reason = found.reason.unwrap_or_default();
        assert!(found.good_for == GoodFor::Nothing && reason.contains("hump"), "seed {seed}: {reason}");
    }
}

/// Flicker, a walk, a filter and counts move nothing.
#[test]
fn noise_is_no_motion() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let flicker_dph = 30.0 * random.uniform();
        let walk_step_dph = if seed % 2 == 0 { 0.3 } else { 0.0 };
        let mut gyro = AtRest::new(flicker_dph, walk_step_dph);
        let (keeps, step_dph) = ([0.0, 0.9, 0.98][random.below(3)], [0.01, 30.0, 400.0][random.below(3)]);
        let mut filtered = 0.0;
        let rates = (0..20_000).map(|_| {
            filtered = keeps * filtered + (1.0 - keeps) * gyro.next(&mut random);
            (filtered / step_dph).round() * step_dph
        });
        let found = surveyed(log(rates));
        let said = found.cautions.iter().chain(&found.reason).find(|text| text.contains("not at rest"));
        assert!(said.is_none() && found.at_rest.is_none(), "seed {seed}: {said:?}");
    }
}
