//! Copies of logs in other forms; those over many records are in `measured/verify/copies.rs`.

use crate::hostile::{Bench, Dice};
use crate::measured::verify::copies::{HEAD, copies, edited, overlap, usual};
use crate::support::{fit, reader};
use sagnac::Setup;
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac_log::setup::Counter;

/// A rate log saved again with times that moved each by up to a microsecond, and a running total instead of its steps.
#[test]
fn copies_of_rates_and_of_running_totals_are_refused() {
    for seed in 0..10 {
        let mut dice = Dice::new(seed);
        let dps: Vec<f64> = (0..2000).map(|_| (4.5 + 0.08 * dice.normal()) / 3600.0).collect();
        let mut rates = |by_s: f64| {
            let row = |(i, dps): (usize, &f64)| {
                let celsius = 20.0 + 15.0 * (i as f64 / 300.0).sin();
                format!("{:.7},{celsius:.3},{dps:.12}\n", 5.0 * (i + 1) as f64 + by_s * dice.uniform())
            };
            let rows: String = dps.iter().enumerate().map(row).collect();
            format!("time_s,temperature_c,rate_dps\n{rows}").into_bytes()
        };
        let setup = Setup { reference_c: Some(20.0), ..Setup::default() };
        let unit = fit(vec![rates(0.0)], &setup, "bias 1").unwrap();
        assert_eq!(overlap(&unit, vec![rates(1e-6)], &setup), 1, "{seed}");
        // Steps summed to a total: the same rows but the first.
        let mut bench = Bench::new(seed, &usual);
        bench.hours = Some(4.0);
        let log = bench.log().csv();
        let unit = fit(vec![log.clone()], &Bench::setup(), "bias 1").unwrap();
        let total = std::cell::Cell::new(0.0);
        let summed = edited(&log, HEAD, |_, [t, c, n]| {
            total.set(total.get() + n.parse::<f64>().unwrap());
            Some(format!("{t},{c},{}\n", total.get()))
        });
        let cumulative = Setup { counter: Some(Counter::Cumulative), ..Bench::setup() };
        assert_eq!(overlap(&unit, vec![summed], &cumulative), 1, "{seed}");
    }
}

/// Copies of a retest are no further turn-ons: of runs alike by their rows the second is refused.
#[test]
fn a_copy_of_a_retest_is_no_other_run() {
    let setup = Bench::setup();
    let four_hours = |seed: u64| Bench { hours: Some(4.0), ..Bench::new(seed, &usual) }.log().csv();
    let unit = fit(vec![four_hours(1)], &setup, "bias 1").unwrap();
    let correction = Correction::from_calibration(unit).unwrap();
    let log = four_hours(2);
    for (name, copy) in copies(&log, 2).into_iter().filter(|(_, parts)| parts.len() == 1) {
        let logs: Vec<_> = [log.clone(), copy[0].clone()].into_iter().map(|log| reader(log, &setup)).collect();
        let refused = verify(&correction, logs, &setup, VerifyOptions::default())
            .map_or_else(|e| e.to_string(), |_| String::new());
        assert!(refused.contains("the file contains the same"), "{name}: {refused}");
    }
    let others: Vec<_> = [2, 3].map(|seed| reader(four_hours(seed), &setup)).into();
    assert!(verify(&correction, others, &setup, VerifyOptions::default()).is_ok());
}
