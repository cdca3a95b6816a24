//! Clocks of logs as the world writes them: each kind with many seeds, N of the generator as the truth.

use crate::support::records::Random;
use crate::support::{reader, windows};
use sagnac::allan::{NoiseBudget, Request, noise_budget};
use sagnac::window::WindowBuilder;
use sagnac_log::error::Error;
use sagnac_log::ingest::{LogReader, ReadMode, Reason};
use sagnac_log::setup::Setup;
use sagnac_noise::{Taus, TermValue};
use std::fmt::Write as _;
use std::io::Cursor;

const SEEDS: std::ops::Range<u64> = 0..60;
/// N of every record, °/√h.
const N_DEG_RT_H: f64 = 0.3;

/// Rates of so many rows a second, °/h: a bias of 12 °/h and white noise.
fn rates_dph(rows: usize, rows_hz: f64, random: &mut Random) -> Vec<f64> {
    let sigma = N_DEG_RT_H * 60.0 * rows_hz.sqrt();
    (0..rows).map(|_| 12.0 + sigma * random.normal()).collect()
}

/// A log of stamps in whole units; rows without a stamp are lost.
fn log(unit: &str, rows: impl Iterator<Item = (i64, f64)>) -> Vec<u8> {
    let mut text = format!("time_{unit},temperature_c,rate_dph\n");
    rows.for_each(|(stamp, rate)| writeln!(text, "{stamp},25.0,{rate:.2}").unwrap());
    text.into_bytes()
}

fn budget(log: Vec<u8>, setup: &Setup) -> NoiseBudget {
    noise_budget(vec![reader(log, setup)], None, setup, &Request::new(Taus::Octaves)).unwrap()
}

/// N by the whole record, and by the windows, over the truth; rows excluded.
struct Found {
    record: f64,
    windows: f64,
    budget: NoiseBudget,
}

fn found(log: Vec<u8>) -> Found {
    found_with(log, &Setup::default())
}

fn found_with(log: Vec<u8>, setup: &Setup) -> Found {
    let of_windows = windows(vec![log.clone()], setup).measured_noise(0).unwrap().terms.n_deg_rt_h();
    let budget = budget(log, setup);
    let TermValue::Found { value, .. } = budget.axes[0].terms.n_deg_rt_h else {
        panic!("{:?}", budget.axes[0].terms.n_deg_rt_h)
    };
    Found { record: value / N_DEG_RT_H, windows: of_windows / N_DEG_RT_H, budget }
}

impl Found {
    fn rows(&self) -> u64 {
        self.budget.axes[0].rows
    }

    fn excluded(&self, reason: Reason) -> u64 {
        self.budget.excluded.iter().filter(|tally| tally.reason == reason).map(|tally| tally.rows).sum()
    }

    /// Both within a tenth: about three standard errors of the shortest record here.
    fn is_right(&self, what: &str) {
        let near = |n: f64| (n - 1.0).abs() < 0.1;
        assert!(near(self.record) && near(self.windows), "{what}: N {} and {} of the truth", self.record, self.windows);
    }
}

/// Packets of 2 to 20 rows with the stamp of their last one; single packets are lost, and the log begins in the middle of one.
#[test]
fn packets_that_share_a_stamp_are_even_rows() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let (size, rows_hz) = (2 + random.below(19), [50.0, 100.0, 200.0][random.below(3)]);
        let first = random.below(size);
        let rates = rates_dph(30_000, rows_hz, &mut random);
        let lost: Vec<bool> = (0..30_000).map(|_| random.uniform() < 0.002).collect();
        let stamp = |row: usize| (((row + first) / size + 1) as f64 * size as f64 * 1e6 / rows_hz).round() as i64;
        let rows = (0..rates.len()).filter(|row| !lost[(row + first) / size]).map(|row| (stamp(row), rates[row]));
        let kept = rows.clone().count() as u64;
        let found = found(log("us", rows));
        found.is_right(&format!("seed {seed}, packets of {size} at {rows_hz} Hz"));
        assert!(found.rows() + 2 * size as u64 > kept, "seed {seed}: {} of {kept} rows", found.rows());
    }
}

/// Stamps in whole seconds: about as many rows as the rate, one more or less.
#[test]
fn stamps_in_whole_seconds_are_even_rows() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rows_hz = 40.0 + 80.0 * random.uniform();
        let rates = rates_dph(40_000, rows_hz, &mut random);
        let phase = random.uniform();
        let stamp = |row: usize| (row as f64 / rows_hz + phase).floor() as i64;
        let found = found(log("s", rates.iter().enumerate().map(|(row, rate)| (stamp(row), *rate))));
        found.is_right(&format!("seed {seed}, {rows_hz} Hz"));
        assert!(found.rows() > 39_800, "seed {seed}: {} rows", found.rows());
    }
}

/// Whole milliseconds at 600 to 950 Hz, of which half of the records lose one row in a hundred.
#[test]
fn whole_milliseconds_are_even_rows() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rows_hz = 600.0 + 350.0 * random.uniform();
        let part = if seed % 2 == 0 { 0.01 } else { 0.0 };
        let rates = rates_dph(200_000, rows_hz, &mut random);
        let stamp = |row: usize| (row as f64 * 1e3 / rows_hz).floor() as i64;
        let rows = rates.iter().enumerate().map(|(row, rate)| (stamp(row), *rate));
        let rows: Vec<(i64, f64)> = rows.filter(|_| random.uniform() >= part).collect();
        let kept = rows.len() as u64;
        let found = found(log("ms", rows.into_iter()));
        found.is_right(&format!("seed {seed}, {rows_hz} Hz, {part} lost"));
        assert!(found.rows() as f64 > 0.99 * kept as f64, "seed {seed}: {} of {kept}", found.rows());
    }
}

/// Rows of 100 Hz with stamps that a host gave them, up to 4 ms late.
#[test]
fn late_stamps_are_no_gaps() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rates = rates_dph(30_000, 100.0, &mut random);
        let stamps: Vec<i64> = (0..rates.len()).map(|row| 10_000 * row as i64 + random.below(4000) as i64).collect();
        let found = found(log("us", stamps.into_iter().zip(rates)));
        found.is_right(&format!("seed {seed}"));
    }
}

/// One rate row in 25 to 1,000 is lost, by itself or in short bursts: it costs that row, not its window.
#[test]
fn a_lost_rate_row_costs_that_row() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let part = [0.001, 0.01, 0.04][random.below(3)];
        let rates = rates_dph(60_000, 50.0, &mut random);
        let rows = rates.iter().enumerate().map(|(row, rate)| (20_000 * row as i64, *rate));
        let rows: Vec<(i64, f64)> = rows.filter(|_| random.uniform() >= part).collect();
        let made = windows(vec![log("us", rows.iter().copied())], &Setup::default());
        let used = (0..made.len()).filter(|i| made.rows.excluded[*i].is_none());
        let used: u64 = used.map(|i| u64::from(made.rows.samples[i])).sum();
        assert!(used as f64 > 0.98 * rows.len() as f64, "seed {seed}, {part} lost: {used} of {} rows used", rows.len());
        found(log("us", rows.into_iter())).is_right(&format!("seed {seed}, {part} lost"));
    }
}

/// A counter of 32 bits in microseconds, rows of 0.5 s over several turns: no row is dropped, and nothing but the rows is counted.
#[test]
fn a_clock_of_32_bits_wraps() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rates = rates_dph(30_000, 2.0, &mut random);
        let start = (random.uniform() * 2f64.powi(32)) as u64;
        let rows = rates.iter().enumerate().filter(|(row, _)| row % 700 != 13);
        let stamps = rows.map(|(row, rate)| (((start + 500_000 * row as u64) % (1 << 32)) as i64, *rate));
        let found = found(log("us", stamps));
        found.is_right(&format!("seed {seed}"));
        assert_eq!(found.excluded(Reason::TimeBackwards), 0, "seed {seed}");
        assert!(found.budget.warnings.iter().any(|line| line.contains("32 bits")), "{:?}", found.budget.warnings);
        assert_eq!(found.budget.axes[0].stretches, 1, "seed {seed}");
    }
}

/// The logger starts again after 20 min, the bias is 60 °/h higher: two runs, no row lost, and no slow term from the step.
#[test]
fn a_clock_that_starts_again_begins_a_run() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rows_of_first = 24_000 + random.below(3000);
        let mut rates = rates_dph(60_000, 20.0, &mut random);
        rates[rows_of_first..].iter_mut().for_each(|rate| *rate += 60.0);
        let start = random.below(5_000_000) as i64;
        let time = |row: usize| if row < rows_of_first { row } else { row - rows_of_first } as i64;
        let bytes = log("us", rates.iter().enumerate().map(|(row, rate)| (start + 50_000 * time(row), *rate)));
        let made = windows(vec![bytes.clone()], &Setup::default());
        assert_eq!(made.runs.len(), 2, "seed {seed}");
        assert_eq!(made.runs.iter().flat_map(|run| &run.files).map(|file| file.summary.rows).sum::<u64>(), 60_000);
        let found = found(bytes);
        found.is_right(&format!("seed {seed}"));
        assert_eq!((found.rows(), found.budget.axes[0].stretches), (60_000, 2), "seed {seed}");
        let terms = &found.budget.axes[0].terms;
        assert!(
            matches!(terms.k_dph_rt_h, TermValue::Unresolved { .. }) && found.excluded(Reason::TimeBackwards) == 0,
            "seed {seed}: {:?}",
            terms.k_dph_rt_h
        );
    }
}

/// The same of packets: found by a log of six rows to a stamp, whose second run was taken for doubled rows.
#[test]
fn a_clock_of_packets_that_starts_again_begins_a_run() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let (size, of_first) = (2 + random.below(19), 10_000 + random.below(10_000));
        let rates = rates_dph(30_000, 100.0, &mut random);
        let stamp = |row: usize| {
            let row = if row < of_first { row } else { row - of_first };
            ((row / size + 1) * size) as i64 * 10_000 + 500_000
        };
        let bytes = log("us", rates.iter().enumerate().map(|(row, rate)| (stamp(row), *rate)));
        assert_eq!(windows(vec![bytes.clone()], &Setup::default()).runs.len(), 2, "seed {seed}, packets of {size}");
        let found = found(bytes);
        found.is_right(&format!("seed {seed}, packets of {size}"));
        assert!(found.rows() > 29_990, "seed {seed}, packets of {size}: {} rows", found.rows());
    }
}

/// Rows in the wrong order, doubled ones, and a log written twice are counted as that.
#[test]
fn other_rows_that_go_back_are_counted() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rates = rates_dph(20_000, 20.0, &mut random);
        let rows: Vec<(i64, f64)> = rates.iter().enumerate().map(|(row, rate)| (50_000 * row as i64, *rate)).collect();
        let mut swapped = rows.clone();
        (0..50).for_each(|_| swapped.swap(random.below(10_000), 10_000 + random.below(10_000)));
        let twice = rows.iter().chain(&rows).copied();
        let doubled = rows.iter().flat_map(|row| [*row, *row]);
        for (what, bytes, reason, least) in [
            ("swapped", log("us", swapped.iter().copied()), Reason::TimeBackwards, 50),
            ("twice", log("us", twice), Reason::TimeBackwards, 19_999),
            ("doubled", log("us", doubled), Reason::DuplicateTime, 20_000),
        ] {
            let made = windows(vec![bytes], &Setup::default());
            let counted: u64 =
                made.tallies.list().iter().filter(|tally| tally.reason == reason).map(|tally| tally.rows).sum();
            assert_eq!(made.runs.len(), 1, "seed {seed}: {what}");
            assert!(counted >= least, "seed {seed}: {what}: {counted} {:?}", made.tallies.list());
        }
    }
}

fn opened(log: Vec<u8>, setup: &Setup) -> Result<LogReader, Error> {
    LogReader::from_reader("log.csv", Box::new(Cursor::new(log)), setup, ReadMode::Bulk)
}

/// Bursts have two readings: refused with both, and either is taken.
#[test]
fn bursts_are_refused_with_both_readings() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let (size, step_us, pause_us) = (4 + random.below(12), 2000, 70_000);
        let rates = rates_dph(20_000, 100.0, &mut random);
        let burst_us = pause_us + step_us * (size as i64 - 1);
        let stamp = |row: usize| (row / size) as i64 * burst_us + (row % size) as i64 * step_us;
        let bytes = log("us", rates.iter().enumerate().map(|(row, rate)| (stamp(row), *rate)));
        let error = opened(bytes.clone(), &Setup::default()).map(|_| ()).unwrap_err();
        let even_s = burst_us as f64 / size as f64 * 1e-6;
        let text = format!("{error}: {}", error.help);
        assert!(text.contains(&format!("bursts of {size}")) && text.contains("--sample-interval 0.002"), "{text}");
        for (interval_s, rows) in [(even_s, 19_000), (0.002, 0)] {
            let setup = Setup { sample_interval_s: Some(interval_s), ..Setup::default() };
            let log = opened(bytes.clone(), &setup).unwrap();
            assert!((log.shape().nominal_ns as f64 * 1e-9 / interval_s - 1.0).abs() < 0.01, "seed {seed}");
            let longest_s = budget(bytes.clone(), &setup).axes[0].longest_s;
            assert!(longest_s >= f64::from(rows) * interval_s, "seed {seed}: {longest_s} s at {interval_s} s");
        }
    }
}

/// Rows without times at a given interval make the windows of the same rows with times; without an interval there is a bound.
#[test]
fn rows_at_an_even_interval_need_no_times() {
    for seed in SEEDS {
        let mut random = Random::new(seed);
        let rows_hz = [10.0, 50.0, 200.0][random.below(3)];
        let rates = rates_dph(30_000, rows_hz, &mut random);
        let step_us = (1e6 / rows_hz) as i64;
        let timed = log("us", rates.iter().enumerate().map(|(row, rate)| (step_us * (row as i64 + 1), *rate)));
        let mut untimed = "temperature_c,rate_dph\n".to_owned();
        rates.iter().for_each(|rate| writeln!(untimed, "25.0,{rate:.2}").unwrap());
        let even = Setup { sample_interval_s: Some(rows_hz.recip()), ..Setup::default() };
        let made = windows(vec![untimed.clone().into_bytes()], &even);
        assert_eq!(made.rows.angle, windows(vec![timed], &Setup::default()).rows.angle, "seed {seed}");
        found_with(untimed.clone().into_bytes(), &even).is_right(&format!("seed {seed}, {rows_hz} Hz"));
        let error = WindowBuilder::read_all(vec![reader(untimed.into_bytes(), &Setup::default())], &Setup::default());
        assert!(error.is_err_and(|error| error.help.contains("--sample-interval")), "seed {seed}");
    }
}
