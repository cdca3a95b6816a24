//! The full circle for each ready scenario: simulate three runs, calibrate on two, verify on the third.
//!
//! The calibration gets only logs. The truth gives the residual and its sources: the true errors of each window minus the
//! correction, without noise. The page is not written if the residual is larger than claimed.

use std::io::{Cursor, Write as _};

use anyhow::{Context, Result, anyhow, ensure};
use nalgebra::{DMatrix, DVector};
use sagnac::diagnostics::WindowPoint;
use sagnac::fit::{FitOptions, calibrate};
use sagnac::verify::{Correction, Proof, VerifyOptions, verify};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::{LogReader, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_sim::{ERROR_SOURCES, LogText, Scenario};
use xtask::shell::root;

use crate::made::Made;
use crate::places::CIRCLE;

fn read(name: &str, file: &str) -> Result<String> {
    let path = root().join("scenarios").join(name).join(file);
    std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
}

/// Error sources of a second.
type Errors = [f64; ERROR_SOURCES.len()];

/// The log of a run, and its error sources second by second.
fn simulate(scenario: &Scenario, seed: u64) -> Result<(Vec<u8>, Vec<Errors>)> {
    let mut text = LogText::new(scenario);
    let mut log = text.header_line().into_bytes();
    let mut truth = Vec::new();
    scenario.build()?.start(seed).each_row(|row, second| {
        truth.push(second.errors_dph);
        log.write_all(text.line(row, second))
    })?;
    Ok((log, truth))
}

fn reader(log: Vec<u8>, setup: &Setup) -> Result<LogReader> {
    Ok(LogReader::from_reader("run.csv", Box::new(Cursor::new(log)), setup, ReadMode::Bulk)?)
}

/// Figures of a proof, in °/h.
struct Found {
    model: String,
    windows: usize,
    before: f64,
    after: f64,
    floor: f64,
    /// σ of true errors minus the correction, without noise.
    residual: f64,
    /// Contribution of each source that the selected terms cannot represent, largest first.
    sources: Vec<(&'static str, f64)>,
    /// The rest: uncertainty of the coefficients, and errors of thermometer and lag in the correction.
    fit: f64,
}

fn close(name: &str) -> Result<Found> {
    let scenario = Scenario::from_toml(&read(name, &format!("{name}.toml"))?)?;
    let setup = Setup::parse(&read(name, "bench.toml")?)?;
    let logs = vec![reader(simulate(&scenario, 1)?.0, &setup)?, reader(simulate(&scenario, 2)?.0, &setup)?];
    let windows = WindowBuilder::read_all(logs, &setup)?.finish();
    let calibration = calibrate(windows, &setup, &FitOptions::new("auto".parse()?))?;
    let chosen = calibration.axes[0].correction.model.clone();
    let correction = Correction::from_calibration(calibration)?;
    let (log, truth) = simulate(&scenario, 3)?;
    let Proof { verification: proof, report_data, .. } =
        verify(&correction, vec![reader(log, &setup)?], &setup, VerifyOptions::default())?;
    let axis = &proof.axes[0];
    let used: Vec<&WindowPoint> =
        report_data.axes[0].points.iter().filter(|p| p.excluded.is_none() && p.after_dph.is_finite()).collect();
    let all = |p: &&WindowPoint| (0..ERROR_SOURCES.len()).map(|source| mean(&truth, p, source)).sum::<f64>();
    let residual = sigma(&used.iter().map(|p| all(p) - (p.before_dph - p.after_dph)).collect::<Vec<f64>>());
    let sources = unreachable_parts(&used, &truth, &chosen)?;
    let named: f64 = sources.iter().map(|(_, s)| s * s).sum();
    Ok(Found {
        model: chosen,
        windows: used.len(),
        before: axis.before.sigma_dph,
        after: axis.after.sigma_dph,
        floor: axis.noise_floor.as_ref().context("no noise floor")?.value_dph,
        residual,
        sources,
        fit: (residual * residual - named).max(0.0).sqrt(),
    })
}

fn sigma(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Orders of `bias 3, rate 0`: 3 and, if there is a rate, 0.
fn orders(model: &str) -> (i32, Option<i32>) {
    let order = |kind: &str| model.split(", ").find_map(|term| term.strip_prefix(kind)?.trim().parse().ok());
    (order("bias").unwrap_or(0), order("rate"))
}

/// σ of the residual of each source after least squares on the terms of the model.
fn unreachable_parts(points: &[&WindowPoint], truth: &[Errors], model: &str) -> Result<Vec<(&'static str, f64)>> {
    let (bias, rate) = orders(model);
    let (lo, hi) =
        points.iter().fold((f64::MAX, f64::MIN), |(lo, hi), p| (lo.min(p.temperature_c), hi.max(p.temperature_c)));
    let columns = (bias + 1 + rate.map_or(0, |order| order + 1)) as usize;
    let basis = DMatrix::from_fn(points.len(), columns, |row, column| {
        let p = points[row];
        let x = (2.0 * p.temperature_c - lo - hi) / (hi - lo);
        let power = column as i32;
        if power <= bias { x.powi(power) } else { p.rate_cpm * x.powi(power - bias - 1) }
    });
    let svd = basis.clone().svd(true, true);
    let residual = |source: usize| -> Result<f64> {
        let y = DVector::from_iterator(points.len(), points.iter().map(|p| mean(truth, p, source)));
        let fitted = svd.solve(&y, 1e-9).map_err(|e| anyhow!("least squares: {e}"))?;
        Ok(((&y - &basis * fitted).norm_squared() / points.len() as f64).sqrt())
    };
    let parts = ERROR_SOURCES.iter().enumerate().map(|(i, name)| Ok((*name, residual(i)?)));
    let mut parts: Vec<(&str, f64)> = parts.collect::<Result<_>>()?;
    parts.retain(|(_, sigma)| *sigma > 5e-5);
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(parts)
}

/// Mean of a source over a window.
fn mean(truth: &[Errors], point: &WindowPoint, source: usize) -> f64 {
    let second = |hours: f64| (hours * 3600.0).round() as usize;
    let (from, to) = (second(point.hours - 0.5 * point.length_h), second(point.hours + 0.5 * point.length_h));
    let of_window = &truth[from.min(truth.len() - 1)..to.min(truth.len())];
    of_window.iter().map(|errors| errors[source]).sum::<f64>() / of_window.len() as f64
}

const HEAD: &str = "# The full circle

Made by `cargo xtask bless`; do not edit.

Each ready scenario is simulated three times. Seeds 1 and 2 are calibrated with `auto`; seed 3 is the retest. The calibration gets only
logs. All figures are σ of windows of 100 s, °/h.

| column | meaning |
|---|---|
| before, after, floor | as in [Verification](verification.md#figures) |
| residual | true errors of the simulator minus the correction, without noise; *after* is the root of floor² + residual² within the sampling error of n windows |
| by source | contribution of each error source that the selected terms cannot represent (least squares of the source itself on them) |
| fit | the rest: uncertainty of the coefficients from two noisy runs, and errors of thermometer and lag |

| scenario | model | n | before | after | floor | residual | by source | fit |
|---|---|---|---|---|---|---|---|---|
";

/// Largest residual as a fraction of the noise floor: 1.5 times the measured one.
const MOST_RESIDUAL: [(&str, f64); 4] =
    [("paper", 0.41), ("square-28cm", 0.36), ("prism-heater-loop", 0.40), ("triangle-28cm-dithered", 0.32)];

pub(crate) fn make() -> Result<Vec<Made>> {
    let all: Vec<Result<Found>> = std::thread::scope(|scope| {
        let threads = MOST_RESIDUAL.map(|(name, _)| scope.spawn(move || close(name).with_context(|| name)));
        threads.map(|thread| thread.join().unwrap_or_else(|_| Err(anyhow!("a panic, see above")))).into()
    });
    let mut table = String::from(HEAD);
    for ((name, most), found) in MOST_RESIDUAL.into_iter().zip(all) {
        let found = found?;
        holds(name, most, &found)?;
        table += &row(name, &found);
    }
    Ok(vec![Made::new(CIRCLE, table)])
}

fn row(name: &str, l: &Found) -> String {
    let words: Vec<String> =
        l.sources.iter().map(|(source, s)| format!("{} {s:.4}", source.replace('_', " "))).collect();
    let words = if words.is_empty() { "nothing".to_owned() } else { words.join(", ") };
    let figures = format!("{:.4} | {:.4} | {:.4} | {:.4}", l.before, l.after, l.floor, l.residual);
    format!("| {name} | `{}` | {} | {figures} | {words} | {:.4} |\n", l.model, l.windows, l.fit)
}

/// Checks the claims of the page.
fn holds(name: &str, most: f64, l: &Found) -> Result<()> {
    ensure!(l.residual < most * l.floor, "{name}: residual {}, floor {}", l.residual, l.floor);
    ensure!(l.before > 5.0 * l.residual, "{name}: residual {} of {}", l.residual, l.before);
    // Three standard errors of a σ of n windows, on each side of the comparison.
    let (expected, sampling) = (l.floor.hypot(l.residual), 3.0 / (l.windows as f64).sqrt());
    ensure!((l.after / expected - 1.0).abs() < sampling, "{name}: {} is not {expected}", l.after);
    Ok(())
}
