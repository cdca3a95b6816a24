//! One test in many files is one test: its drift does not vanish in sixty offsets.

use crate::hostile::{Bench, Now, fraction};
use crate::support::evidence::evidence;
use crate::support::rows::{Log, Rows};
use crate::support::{fit, model};
use sagnac::Limits;
use sagnac::fit::{FitOptions, calibrate};
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::LogReader;
use sagnac_log::setup::{RunDivision, Setup};

pub(crate) fn strong(now: Now) -> f64 {
    0.05 * now.u() - 0.03 * now.u().powi(2) + 0.02 * now.u().powi(3)
}

pub(crate) fn readers(files: Vec<Rows<3>>, setup: &Setup) -> Vec<LogReader> {
    let open = |(at, file): (usize, Rows<3>)| file.reader(&format!("hour-{at:02}.csv"), setup);
    files.into_iter().enumerate().map(open).collect()
}

/// As runs of their own, sixty offsets hold the drift: the fit reports how much, and a verdict on such a retest counts it.
#[test]
fn what_the_offsets_of_short_runs_hide_is_counted() {
    let limits: Limits = "sigma_dph_max = 0.03".parse().unwrap();
    let setup = Bench::setup();
    let apart = Setup { runs: RunDivision::Files, ..Bench::setup() };
    let unit = fit(vec![Bench::new(1, &strong).log()], &setup, "bias 0").unwrap();
    let accepted = |setup: &Setup| {
        fraction(20, |seed| {
            let correction = Correction::from_calibration(unit.clone()).unwrap();
            let files = readers(Bench::retest(50 + seed, &strong).log().chunks(720), setup);
            let proof = verify(&correction, files, setup, VerifyOptions::default()).unwrap();
            proof.limits(&limits).unwrap().passed()
        })
    };
    evidence("hourly files of a drift that was not corrected are accepted, as one run", accepted(&setup), "≤ 0", 20);
    evidence(
        "hourly files of a drift that was not corrected are accepted, each file as a run (`--runs`)",
        accepted(&apart),
        "≤ 0",
        20,
    );
    let files = readers(Bench::new(1, &strong).log().chunks(720), &apart);
    let windows = WindowBuilder::read_all(files, &apart).unwrap().finish();
    let record = calibrate(windows, &apart, &FitOptions::new(model("bias 0"))).unwrap();
    let hidden = record.axes[0].fit.as_ref().unwrap().hidden_in_offsets_dph.unwrap();
    assert!((0.03..0.15).contains(&hidden), "{hidden}");
    let one = fit(vec![Bench::new(1, &strong).log(), Bench::new(2, &strong).log()], &setup, "bias 3").unwrap();
    assert_eq!(one.axes[0].fit.as_ref().unwrap().hidden_in_offsets_dph, None, "whole cycles hide nothing");
}

/// A log of counts as files of so many rows, each with a clock that starts at zero and a running total; `anew`: the total starts at
/// zero in each file as well. `first_row_again`: each file begins with the last row of the one before, at zero.
fn hourly_totals(log: &Rows<3>, rows: usize, anew: bool, first_row_again: bool) -> Vec<Rows<3>> {
    let mut total = 0.0;
    let mut files = log.chunks(rows);
    for (number, file) in files.iter_mut().enumerate() {
        let [first_s, celsius, _] = file.rows[0];
        let start_s = first_s - 5.0;
        let before = (first_row_again && number > 0).then_some([0.0, celsius, if anew { 0.0 } else { total }]);
        if anew {
            total = 0.0;
        }
        for [time_s, celsius, counts] in &mut file.rows {
            total += *counts;
            // No two files of the same values: they would be refused as one log given twice.
            *celsius += if anew { 1e-6 * number as f64 } else { 0.0 };
            (*time_s, *counts) = (*time_s - start_s, total);
        }
        file.rows.splice(0..0, before);
    }
    files
}

fn cumulative() -> Setup {
    Setup { counter: Some(sagnac_log::setup::Counter::Cumulative), ..Bench::setup() }
}

/// Hourly files whose clock restarts and whose running total goes on are one run, with the rows at the joints: the record is that of
/// one file. Over 40 tests, rates of either sign.
#[test]
fn a_running_total_that_goes_on_joins_files() {
    let setup = cumulative();
    let joined = fraction(40, |seed| {
        let mut bench = Bench::new(100 + seed, &strong);
        (bench.cycles, bench.input_dph) = (1, [4.5, -7.0, 10.2, 15.0][seed as usize % 4]);
        let log = bench.log();
        let whole = hourly_totals(&log, usize::MAX, false, false);
        let windows = WindowBuilder::read_all(readers(whole, &setup), &setup).unwrap().finish();
        let whole = calibrate(windows, &setup, &FitOptions::new(model("bias 3"))).unwrap();
        let files = hourly_totals(&log, 720, false, seed % 2 == 1);
        let windows = WindowBuilder::read_all(readers(files.clone(), &setup), &setup).unwrap().finish();
        let runs = windows.runs.len();
        assert!(windows.runs[0].files[1..].iter().all(|file| file.summary.follows_by_counter));
        let parts = calibrate(windows, &setup, &FitOptions::new(model("bias 3"))).unwrap();
        let terms = |of: &sagnac::Calibration| of.axes[0].correction.terms.clone();
        assert_eq!(terms(&parts), terms(&whole), "{seed}");
        // A retest in such files is one run, too.
        let correction = Correction::from_calibration(whole.clone()).unwrap();
        let apart = verify(&correction, readers(files, &setup), &setup, VerifyOptions::default()).unwrap();
        let whole = hourly_totals(&log, usize::MAX, false, false);
        let one = verify(&correction, readers(whole, &setup), &setup, VerifyOptions::default()).unwrap();
        let after = |proof: &sagnac::Proof| proof.verification.axes[0].after;
        assert_eq!(after(&apart), after(&one), "{seed}");
        runs == 1
    });
    evidence("hourly files whose clock restarts and whose running total goes on are one run", joined, "≥ 1", 40);
}

/// Unrelated runs, each with a counter from zero, never join; near zero nothing is evidence, whatever the pace. Files of a few
/// minutes, slow rates, runs that end where the next begins.
#[test]
fn counters_that_begin_anew_do_not_join() {
    let setup = cumulative();
    let joined = fraction(60, |seed| {
        let mut bench = Bench::new(300 + seed, &strong);
        bench.hours = Some(2.0);
        bench.input_dph = [0.0, 0.01, 4.5, -4.5, 15.0][seed as usize % 5];
        let rows = [720, 60, 5][seed as usize % 3];
        let files = hourly_totals(&bench.log(), rows, true, seed % 2 == 1);
        let count = files.len();
        let windows = WindowBuilder::read_all(readers(files, &setup), &setup).unwrap().finish();
        windows.runs.len() != count
    });
    evidence("runs whose counters each start at zero are joined", joined, "≤ 0", 60);
    // Tests of two gyros, and of one gyro on two days, whose totals do not go on.
    let joined = fraction(60, |seed| {
        let part = |k: u64| {
            let mut bench = Bench::new(500 + 2 * seed + k, &strong);
            bench.hours = Some(1.0 + 0.1 * (seed % 7) as f64 + 0.3 * k as f64);
            hourly_totals(&bench.log(), usize::MAX, false, false).remove(0)
        };
        let windows = WindowBuilder::read_all(readers(vec![part(0), part(1)], &setup), &setup).unwrap().finish();
        windows.runs.len() != 2
    });
    evidence("tests whose running totals have nothing to do with each other are joined", joined, "≤ 0", 60);
    // A counter that goes on, out of order, or with an hour missing between: the total says so.
    let log = Bench::new(1, &strong).log();
    let files = hourly_totals(&log, 720, false, false);
    for order in [[2, 1], [1, 3]] {
        let some = order.map(|at| files[at].clone()).to_vec();
        let windows = WindowBuilder::read_all(readers(some, &setup), &setup).unwrap().finish();
        assert_eq!(windows.runs.len(), 2, "{order:?}");
    }
    // --runs keeps each file a run.
    let apart = Setup { runs: RunDivision::Files, ..cumulative() };
    let count = files.len();
    let windows = WindowBuilder::read_all(readers(files, &apart), &apart).unwrap().finish();
    assert_eq!(windows.runs.len(), count);
}
