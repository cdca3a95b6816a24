//! One test in many files is one run.

use crate::hostile::Bench;
use crate::measured::verify::many_files::{readers, strong};
use crate::support::{fit, model};
use sagnac::fit::{FitOptions, calibrate};
use sagnac::window::WindowBuilder;
use sagnac_log::setup::{RunDivision, Setup};

/// In hourly files the record is that of one file: the same terms, to the last digit, and one run offset.
#[test]
fn hourly_files_are_one_run() {
    let setup = Bench::setup();
    for seed in 0..3 {
        let log = Bench::new(seed, &strong).log();
        let whole = fit(vec![log.clone()], &setup, "bias 3").unwrap();
        for rows in [720, 100] {
            let files = readers(log.chunks(rows), &setup);
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
