//! The circle closes: simulate three runs, calibrate on two, prove on the third, for each ready scenario.
//!
//! The calibrator sees logs only. Truth comes in at the end, to name what is left: of each error source that part
//! which no series in T and no rate series can represent (least squares of the source itself on T⁰ … T⁶ and
//! Ṫ·T⁰ … Ṫ·T³, over the windows of the proof). docs/circle.md is this table; SAGNAC_WRITE_DOCS=1 writes it anew.

mod support;

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use sagnac::fit::{FitOptions, calibrate};
use sagnac::ingest::{LogReader, Pace};
use sagnac::report::Point;
use sagnac::setup::Setup;
use sagnac::verify::{Correction, verify_with_evidence};
use sagnac::window::WindowBuilder;
use sagnac_sim::Scenario;
use sagnac_sim::gyro::{GyroRun, SOURCES};
use sagnac_sim::log::LogText;
use support::model;

const READY: [&str; 4] = ["paper", "square-28cm", "prism-heater-loop", "triangle-28cm-dithered"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(name: &str, file: &str) -> String {
    std::fs::read_to_string(root().join("scenarios").join(name).join(file)).unwrap()
}

/// The log of a run, and its error sources second by second.
fn simulate(scenario: &Scenario, seed: u64) -> (Vec<u8>, Vec<[f64; SOURCES.len()]>) {
    let mut text = LogText::new(scenario);
    let mut log = text.header_line().into_bytes();
    let mut truth = Vec::new();
    GyroRun::new(scenario, seed)
        .unwrap()
        .each_row(|row, second| {
            truth.push(second.errors_dph);
            log.write_all(text.line(row, second))
        })
        .unwrap();
    (log, truth)
}

fn reader(log: Vec<u8>, setup: &Setup) -> LogReader {
    LogReader::from_reader("run.csv", Box::new(Cursor::new(log)), setup, Pace::Bulk).unwrap()
}

/// What a proof left, in °/h.
struct Left {
    model: String,
    before: f64,
    after: f64,
    floor: f64,
    /// Each source that leaves anything, largest first.
    sources: Vec<(&'static str, f64)>,
}

fn close(name: &str) -> Left {
    let scenario = Scenario::from_toml(&read(name, &format!("{name}.toml"))).unwrap();
    let setup: Setup = Setup::parse(&read(name, "bench.toml")).unwrap();
    assert!((setup.arcsec_per_count.unwrap() / scenario.arcsec_per_count() - 1.0).abs() < 1e-12, "{name}: bench.toml");
    let logs = [1, 2].map(|seed| reader(simulate(&scenario, seed).0, &setup)).into();
    let windows = WindowBuilder::read_all(logs, &setup).unwrap().finish(false);
    let options = FitOptions { model: model("auto"), source_date_epoch: None };
    let calibration = calibrate(windows, &setup, &options).unwrap();
    let chosen = calibration.axes[0].model.clone();
    let correction = Correction::from_calibration(calibration).unwrap();
    let (log, truth) = simulate(&scenario, 3);
    let (proof, evidence) = verify_with_evidence(&correction, vec![reader(log, &setup)], &setup, None, false).unwrap();
    let axis = &proof.axes[0];
    let used: Vec<&Point> =
        evidence.axes[0].points.iter().filter(|p| p.excluded.is_none() && p.after_dph.is_finite()).collect();
    Left {
        model: chosen,
        before: axis.before.sigma_dph,
        after: axis.after.sigma_dph,
        floor: axis.floor.as_ref().unwrap().value_dph,
        sources: unreachable_parts(&used, &truth),
    }
}

/// σ of what least squares on the present terms leaves of each source.
fn unreachable_parts(points: &[&Point], truth: &[[f64; SOURCES.len()]]) -> Vec<(&'static str, f64)> {
    let (lo, hi) =
        points.iter().fold((f64::MAX, f64::MIN), |(lo, hi), p| (lo.min(p.temperature_c), hi.max(p.temperature_c)));
    let basis = DMatrix::from_fn(points.len(), 11, |row, column| {
        let p = points[row];
        let x = (2.0 * p.temperature_c - lo - hi) / (hi - lo);
        if column < 7 { x.powi(column as i32) } else { p.rate_cpm * x.powi(column as i32 - 7) }
    });
    let svd = basis.clone().svd(true, true);
    let left = |source: usize| {
        let y = DVector::from_iterator(points.len(), points.iter().map(|p| mean(truth, p, source)));
        let fitted = svd.solve(&y, 1e-9).unwrap();
        ((&y - &basis * fitted).norm_squared() / points.len() as f64).sqrt()
    };
    let mut parts: Vec<(&str, f64)> = SOURCES.iter().enumerate().map(|(i, name)| (*name, left(i))).collect();
    parts.retain(|(_, sigma)| *sigma > 5e-5);
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    parts
}

/// Mean of a source over a window.
fn mean(truth: &[[f64; SOURCES.len()]], point: &Point, source: usize) -> f64 {
    let second = |hours: f64| (hours * 3600.0).round() as usize;
    let (from, to) = (second(point.hours - 0.5 * point.length_h), second(point.hours + 0.5 * point.length_h));
    let of_window = &truth[from.min(truth.len() - 1)..to.min(truth.len())];
    of_window.iter().map(|errors| errors[source]).sum::<f64>() / of_window.len() as f64
}

const HEAD: &str = "# The circle: simulated, calibrated, proven

Made by `SAGNAC_WRITE_DOCS=1 cargo test -p sagnac --test circle`, which also holds it: seeds 1 and 2 of each ready scenario are
calibrated with `auto`, seed 3 is the proof. σ of windows of 100 s, °/h. The calibrator sees logs only. *Left* comes from the
simulator's truth: the part of each error source that no series in T and no rate series can represent.
*Accounted* is the root of floor² + Σ left², to be compared with *after*.

| scenario | model | before | after | floor | after / floor | left, by source | accounted |
|---|---|---|---|---|---|---|---|
";

#[test]
fn three_runs_of_each_scenario() {
    let all: Vec<(&str, Left)> = std::thread::scope(|scope| {
        let threads = READY.map(|name| (name, scope.spawn(move || close(name))));
        threads.map(|(name, thread)| (name, thread.join().unwrap())).into()
    });
    let mut table = String::from(HEAD);
    for (name, left) in &all {
        let accounted = left.sources.iter().map(|(_, s)| s * s).sum::<f64>();
        let accounted = (left.floor * left.floor + accounted).sqrt();
        let words: Vec<String> =
            left.sources.iter().map(|(source, s)| format!("{} {s:.4}", source.replace('_', " "))).collect();
        writeln!(
            table,
            "| {name} | `{}` | {:.4} | {:.4} | {:.4} | {:.2} | {} | {accounted:.4} |",
            left.model,
            left.before,
            left.after,
            left.floor,
            left.after / left.floor,
            if words.is_empty() { "nothing".to_owned() } else { words.join(", ") }
        )
        .unwrap();
    }
    let path = root().join("docs/circle.md");
    if std::env::var_os("SAGNAC_WRITE_DOCS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), table, "docs/circle.md is not what this makes");
    for (name, left) in &all {
        let accounted = left.sources.iter().map(|(_, s)| s * s).sum::<f64>();
        let accounted = (left.floor * left.floor + accounted).sqrt();
        // What is over the floor is what the sources leave, and the error of the fit itself.
        assert!((left.after / accounted - 1.0).abs() < 0.12, "{name}: {} is not {accounted}", left.after);
        assert!(left.before > 1.8 * left.after, "{name}: nothing was gained");
    }
}
