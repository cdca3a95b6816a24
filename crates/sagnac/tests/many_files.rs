//! One test in many files is one test: its drift does not vanish in sixty offsets.

mod hostile;
mod support;

use hostile::{Bench, Now, fraction};
use sagnac::Limits;
use sagnac::fit::{FitOptions, calibrate};
use sagnac::verify::{Correction, VerifyOptions, verify};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::{RunDivision, Setup};
use support::evidence::evidence;
use support::{fit, model};

fn strong(now: Now) -> f64 {
    0.05 * now.u() - 0.03 * now.u().powi(2) + 0.02 * now.u().powi(3)
}

/// The rows of a log in files of so many.
fn split(log: &[u8], rows: usize) -> Vec<Vec<u8>> {
    let text = std::str::from_utf8(log).unwrap();
    let (head, body) = text.split_once('\n').unwrap();
    let lines: Vec<&str> = body.lines().collect();
    lines.chunks(rows).map(|part| format!("{head}\n{}\n", part.join("\n")).into_bytes()).collect()
}

fn readers(files: Vec<Vec<u8>>, setup: &Setup) -> Vec<LogReader> {
    let open = |(at, file): (usize, Vec<u8>)| {
        let source = Box::new(std::io::Cursor::new(file));
        LogReader::from_reader(&format!("hour-{at:02}.csv"), source, setup, ReadMode::Bulk).unwrap()
    };
    files.into_iter().enumerate().map(open).collect()
}

/// In hourly files the record is that of one file: the same terms, to the last digit, and one run offset.
#[test]
fn hourly_files_are_one_run() {
    let setup = Bench::setup();
    for seed in 0..10 {
        let log = Bench::new(seed, &strong).log();
        let whole = fit(vec![log.clone()], &setup, "bias 3").unwrap();
        for rows in [720, 100] {
            let files = readers(split(&log, rows), &setup);
            let count = files.len();
            let windows = WindowBuilder::read_all(files, &setup).unwrap().finish();
            assert_eq!((windows.runs.len(), windows.runs[0].files.len()), (1, count));
            let parts = calibrate(windows, &setup, &FitOptions::new(model("bias 3"))).unwrap();
            let terms = |of: &sagnac::Calibration| of.axes[0].correction.terms.clone();
            assert_eq!(terms(&parts), terms(&whole), "files of {rows} rows");
            assert_eq!(parts.axes[0].run_offsets.len(), 1);
            assert_eq!(parts.provenance.inputs.len(), count, "every file is in the provenance");
        }
    }
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
            let files = readers(split(&Bench::new(50 + seed, &strong).log(), 720), setup);
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
    let files = readers(split(&Bench::new(1, &strong).log(), 720), &apart);
    let windows = WindowBuilder::read_all(files, &apart).unwrap().finish();
    let record = calibrate(windows, &apart, &FitOptions::new(model("bias 0"))).unwrap();
    let hidden = record.axes[0].fit.as_ref().unwrap().hidden_in_offsets_dph.unwrap();
    assert!((0.03..0.15).contains(&hidden), "{hidden}");
    let one = fit(vec![Bench::new(1, &strong).log(), Bench::new(2, &strong).log()], &setup, "bias 3").unwrap();
    assert_eq!(one.axes[0].fit.as_ref().unwrap().hidden_in_offsets_dph, None, "whole cycles hide nothing");
}

/// A gap, a step back in time, another table entry: not the same run unless it is asked for.
#[test]
fn what_does_not_go_on_is_another_run() {
    let runs = |second_start_s: f64, setup: &Setup| {
        let mut benches = [Bench::new(1, &strong), Bench::new(2, &strong)];
        (benches[0].hours, benches[1].hours) = (Some(2.0), Some(2.0));
        benches[1].start_s = second_start_s;
        let files = readers(benches.iter().map(Bench::log).collect(), setup);
        WindowBuilder::read_all(files, setup).map(|builder| builder.finish().runs.len())
    };
    let setup = Bench::setup();
    assert_eq!(runs(7200.0, &setup).unwrap(), 1);
    assert_eq!(runs(7205.0, &setup).unwrap(), 1, "one row is missing");
    assert_eq!((runs(7220.0, &setup).unwrap(), runs(0.0, &setup).unwrap()), (2, 2));
    let one = Setup { runs: RunDivision::One, ..Bench::setup() };
    assert_eq!(runs(9000.0, &one).unwrap(), 1);
    assert!(runs(0.0, &one).unwrap_err().to_string().contains("before the end of hour-00.csv"));
    assert_eq!(runs(7200.0, &Setup { runs: RunDivision::Files, ..Bench::setup() }).unwrap(), 2);
}
