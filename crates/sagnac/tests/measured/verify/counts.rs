//! Counts and rows: running totals with rows lost, gaps, disturbed rows, a room that moves.
//!
//! The records are made in `support/records.rs`, which shares no code with the library.

use crate::IS_STUDY;
use crate::support::evidence::{Records, evidence, largest};
use crate::support::records::{Gyro, Random, TWELVE_HOURS, log, lost, steps};
use crate::support::{reader, windows};
use sagnac::allan::{NoiseBudget, Request, noise_budget};
use sagnac_log::ingest::Reason;
use sagnac_log::setup::{Counter, Setup};
use sagnac_noise::{Taus, TermValue};

pub(crate) fn setup(gyro: &Gyro, counter: Counter) -> Setup {
    Setup { arcsec_per_count: Some(gyro.arcsec_per_count), counter: Some(counter), ..Setup::default() }
}

/// N in °/√h and the noise floor in °/h of the windows of a log.
fn of_windows(log: Vec<u8>, setup: &Setup) -> (f64, f64) {
    let noise = windows(vec![log], setup).measured_noise(0).unwrap();
    (noise.terms.n_deg_rt_h(), noise.terms.floor_dph(100.0))
}

/// Mean, and the greatest distance from 1.
pub(crate) fn spread(ratios: &[f64]) -> (f64, f64) {
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    (mean, ratios.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max))
}

/// A log in which every twentieth line is there twice.
fn twice(log: Vec<u8>) -> Vec<u8> {
    let text = String::from_utf8(log).unwrap();
    let lines = text.lines().enumerate();
    lines
        .flat_map(|(at, line)| vec![line; 1 + usize::from(at % 20 == 7)])
        .flat_map(|line| [line, "\n"])
        .collect::<String>()
        .into_bytes()
}

/// N and the floor of a running total with rows lost are those of the same total without losses. Over 40 records of 12 h
/// each: the mean within 0.1 %, the worst at 10 % lost 1.9 % (asserted: 3 %).
#[test]
fn a_running_total_with_rows_lost_has_the_same_noise() {
    let setup = setup(&TWELVE_HOURS, Counter::Cumulative);
    const TOTALS: Records = Records::new(200).few(10);
    let mut all = Vec::new();
    for (part, bursts) in [(0.005, false), (0.02, false), (0.1, false), (0.02, true), (0.1, true)] {
        let (mut n, mut floor) = (Vec::new(), Vec::new());
        for seed in TOTALS.part(5).each() {
            let mut random = Random::new(seed);
            let totals = TWELVE_HOURS.totals(&TWELVE_HOURS.angles(&mut random));
            let whole = of_windows(log(&TWELVE_HOURS, &totals, &vec![false; totals.len()]), &setup);
            let lost = lost(totals.len(), part, bursts, &mut random);
            let with_losses = of_windows(log(&TWELVE_HOURS, &totals, &lost), &setup);
            n.push(with_losses.0 / whole.0);
            floor.push(with_losses.1 / whole.1);
        }
        for ratios in [n, floor] {
            let (mean, worst) = spread(&ratios);
            println!("{part} lost, bursts {bursts}: mean {mean:.5}, worst {worst:.4}");
            // Ten scatter twice as much as forty.
            assert!((mean - 1.0).abs() < if IS_STUDY { 0.002 } else { 0.004 }, "{part} {bursts}: {mean}");
            all.push(worst);
        }
    }
    let worst = all.into_iter().fold(0.0, f64::max);
    let claim = "N and noise floor of a running total with 0.5 … 10 % of the rows lost: largest deviation";
    largest(claim, worst, "≤ 0.03", TOTALS);
}

/// A total of 16 bits that wraps every 3 h, with 5 % of the rows lost, some rows twice and two resets.
#[test]
fn wraps_resets_and_repeated_rows_do_not_matter() {
    let plain = setup(&TWELVE_HOURS, Counter::Cumulative);
    const TOTALS: Records = Records::new(60);
    let of_16_bits = Setup { counter_bits: Some(16), ..plain.clone() };
    let mut ratios = Vec::new();
    for seed in 100..100 + TOTALS.count() / 2 {
        let mut random = Random::new(seed);
        let totals = TWELVE_HOURS.totals(&TWELVE_HOURS.angles(&mut random));
        let whole = of_windows(log(&TWELVE_HOURS, &totals, &vec![false; totals.len()]), &plain);
        let lost = lost(totals.len(), 0.05, seed % 2 == 0, &mut random);
        let wrapped: Vec<i64> = totals.iter().map(|total| total.rem_euclid(1 << 16)).collect();
        ratios.push(of_windows(twice(log(&TWELVE_HOURS, &wrapped, &lost)), &of_16_bits).0 / whole.0);
        // The power fails twice: each time the total starts at zero.
        let [first, second] = [2000 + random.below(2000), 5000 + random.below(2000)].map(|row| totals[row]);
        let since = |total: i64| {
            if total < first {
                total
            } else if total < second {
                total - first
            } else {
                total - second
            }
        };
        let reset: Vec<i64> = totals.iter().map(|total| since(*total)).collect();
        let windows = windows(vec![log(&TWELVE_HOURS, &reset, &lost)], &plain);
        let resets = windows.tallies.list().into_iter().find(|tally| tally.reason == Reason::CounterReset);
        assert_eq!(resets.map(|tally| tally.rows), Some(2), "seed {seed}");
        ratios.push(windows.measured_noise(0).unwrap().terms.n_deg_rt_h() / whole.0);
        // No window holds a step of the counter as if the gyro had turned.
        let rates = (0..windows.len()).map(|window| windows.rate_dph(0, window));
        rates.for_each(|rate| assert!((rate - TWELVE_HOURS.rate_dph).abs() < 1.0, "seed {seed}: {rate}"));
    }
    let (mean, worst) = spread(&ratios);
    println!("mean {mean:.5}");
    assert!((mean - 1.0).abs() < if IS_STUDY { 0.002 } else { 0.004 }, "{mean}");
    largest("N with wraps, resets, repeated rows and 5 % lost: largest deviation", worst, "≤ 0.03", TOTALS);
}

pub(crate) fn budget(log: Vec<u8>, setup: &Setup) -> NoiseBudget {
    noise_budget(vec![reader(log, setup)], None, setup, &Request::new(Taus::Octaves)).unwrap()
}

pub(crate) fn value(term: &TermValue) -> f64 {
    match term {
        TermValue::Found { value, .. } => *value,
        TermValue::Unresolved { unresolved } => panic!("{unresolved}"),
    }
}

/// True where the 95 % interval of N contains the truth.
fn covers(term: &TermValue, truth: f64) -> bool {
    matches!(term, TermValue::Found { lower: Some(lower), upper: Some(upper), .. } if (*lower..=*upper).contains(&truth))
}

/// N of records with rows lost over N of the same records without, and how often the interval contains the truth; the
/// deviations at every τ over those without losses, root mean square over records.
struct Compared {
    n: Vec<f64>,
    covered: usize,
    /// τ, and mean and root mean square of the ratio of deviations less 1.
    curve: Vec<(f64, f64, f64)>,
}

impl Compared {
    fn coverage(&self) -> f64 {
        self.covered as f64 / self.n.len() as f64
    }
}

fn compare(counter: Counter, lose: impl Fn(usize, &mut Random) -> Vec<bool>) -> Compared {
    let (gyro, records) = (&TWELVE_HOURS, 10);
    let setup = setup(gyro, counter);
    let mut compared = Compared { n: Vec::new(), covered: 0, curve: Vec::new() };
    for seed in 0..records {
        let mut random = Random::new(1000 + seed);
        let totals = gyro.totals(&gyro.angles(&mut random));
        let values = if counter == Counter::Cumulative { totals } else { steps(&totals) };
        let whole = budget(log(gyro, &values, &vec![false; values.len()]), &setup).axes.remove(0);
        let lost = lose(values.len(), &mut random);
        let with_losses = budget(log(gyro, &values, &lost), &setup).axes.remove(0);
        compared.n.push(value(&with_losses.terms.n_deg_rt_h) / value(&whole.terms.n_deg_rt_h));
        compared.covered += usize::from(covers(&with_losses.terms.n_deg_rt_h, gyro.n_deg_rt_h));
        assert_eq!((with_losses.stretches, with_losses.curve.len()), (1, whole.curve.len()));
        for (at, (one, other)) in whole.curve.iter().zip(&with_losses.curve).enumerate() {
            if compared.curve.len() == at {
                compared.curve.push((one.tau_s, 0.0, 0.0));
            }
            let off = other.adev_dph / one.adev_dph - 1.0;
            compared.curve[at].1 += off / records as f64;
            compared.curve[at].2 += off * off / records as f64;
        }
    }
    compared
}

/// 10 % of a running total lost, row by row or in bursts: over ten records each N is within 1 % (asserted: 3 %) of that without
/// losses, its interval holds the truth, and deviations at every τ scatter about theirs.
#[test]
fn a_running_total_with_gaps_has_the_same_budget() {
    let compared = compare(Counter::Cumulative, |rows, random| lost(rows, 0.1, false, random));
    check(&compared);
    let claim = "95 % interval of N covers the truth, running total with 10 % of the rows lost";
    evidence(claim, compared.coverage(), "≥ 0.8", 10);
}

#[test]
fn a_running_total_with_bursts_lost_has_the_same_budget() {
    let compared = compare(Counter::Cumulative, |rows, random| lost(rows, 0.1, true, random));
    check(&compared);
    let claim = "95 % interval of N covers the truth, running total with 10 % of the rows lost in bursts";
    evidence(claim, compared.coverage(), "≥ 0.8", 10);
}

/// Steps of which 1 % or 4 % are lost, one by one: their angle is truly lost. Long τ are kept, N is within 1 % (asserted: 3 %)
/// of that without losses, and no τ has a bias that ten records show.
#[test]
fn single_rows_lost_keep_every_tau() {
    let compared = compare(Counter::Incremental, |rows, random| lost(rows, 0.01, false, random));
    check(&compared);
    let claim = "95 % interval of N covers the truth, steps with 1 % of the rows lost";
    evidence(claim, compared.coverage(), "≥ 0.8", 10);
}

#[test]
fn one_row_in_25_lost_keeps_every_tau() {
    let compared = compare(Counter::Incremental, |rows, random| lost(rows, 0.04, false, random));
    check(&compared);
    let claim = "95 % interval of N covers the truth, steps with 4 % of the rows lost";
    evidence(claim, compared.coverage(), "≥ 0.8", 10);
}

/// N within a bound, its interval around the truth, and at every τ a mean ratio within four of its own standard errors of 1.
fn check(compared: &Compared) {
    let records = compared.n.len();
    let (mean, worst) = spread(&compared.n);
    println!("N: mean {mean:.4}, worst {worst:.4}; {} of {records} intervals hold the truth", compared.covered);
    assert!((mean - 1.0).abs() < 0.005 && worst < 0.03, "{mean} {worst}");
    assert_eq!(compared.curve.last().unwrap().0, 10_240.0);
    for (tau_s, mean, square) in &compared.curve {
        println!("  {tau_s} s: mean {mean:.5}, scatter {:.5}", square.sqrt());
        assert!(mean.abs() < 4.0 * (square / records as f64).sqrt() + 0.001, "{tau_s} s: {mean}");
        assert!(square.sqrt() < 0.15, "{tau_s} s: {square}");
    }
}

/// One row of 20 arcsec in 12 h makes N about 12 % too large. It is found by its line, both values are shown, and the clean
/// one, which is used, is within 1 % (asserted: 3 %) of N without the disturbance; in steps and in a running total.
#[test]
fn a_disturbed_row_is_found_named_and_excluded() {
    let (mut clean, mut unclean) = (Vec::new(), Vec::new());
    for seed in 0..8 {
        let counter = if seed % 2 == 0 { Counter::Incremental } else { Counter::Cumulative };
        let setup = setup(&TWELVE_HOURS, counter);
        let mut random = Random::new(2000 + seed);
        let mut angles = TWELVE_HOURS.angles(&mut random);
        let none = vec![false; angles.len()];
        let values = |angles: &[f64]| {
            let totals = TWELVE_HOURS.totals(angles);
            if counter == Counter::Cumulative { totals } else { steps(&totals) }
        };
        let quiet = budget(log(&TWELVE_HOURS, &values(&angles), &none), &setup).axes.remove(0);
        assert_eq!(quiet.disturbed, None);
        let (row, sign) = (1 + random.below(angles.len() - 1), if random.uniform() < 0.5 { 20.0 } else { -20.0 });
        angles[row] += sign;
        let axis = budget(log(&TWELVE_HOURS, &values(&angles), &none), &setup).axes.remove(0);
        let disturbed = axis.disturbed.unwrap();
        assert!(disturbed.excluded && disturbed.rows == 1, "seed {seed}: {disturbed:?}");
        assert_eq!(disturbed.first[0].at, format!("simulated.csv:{}", row + 2));
        assert!((disturbed.first[0].deviation_arcsec - sign).abs() < 2.5, "{:?}", disturbed.first);
        clean.push(value(&axis.terms.n_deg_rt_h) / value(&quiet.terms.n_deg_rt_h));
        unclean.push(value(&disturbed.alternative_terms.n_deg_rt_h) / value(&quiet.terms.n_deg_rt_h));
    }
    let ((clean, worst), (unclean, _)) = (spread(&clean), spread(&unclean));
    println!("clean: mean {clean:.4}, worst {worst:.4}; unclean: mean {unclean:.4}");
    assert!((clean - 1.0).abs() < 0.005, "{clean}");
    largest("one row of 20 arcsec in 12 h is found: N without it, largest deviation", worst, "≤ 0.03", 8);
    assert!((1.08..1.16).contains(&unclean), "{unclean}");
}
