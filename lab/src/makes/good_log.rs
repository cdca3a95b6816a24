//! *Is my log any good?*: logs with one fault each, their pictures, and the words of the program.
//!
//! ```text
//! a case ─▶ rows of a made gyro ─┬─▶ its picture, one panel of the drawing
//!                                └─▶ sagnac inspect --json ─▶ verdict and cautions, one row of the table
//! ```

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use plotters::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sagnac_units::format::significant;
use serde_json::Value;
use tempfile::TempDir;
use xtask::shell::{root, text};

use crate::made::{Made, between_marks, marks};
use crate::places::GOOD_LOG;
use crate::program::Program;

const PICTURE: &str = "docs/pictures/good-log.svg";
/// N of every gyro, °/√h.
const N_DEG_RT_H: f64 = 0.3;
const PANEL: (u32, u32) = (300, 210);
const IN_A_ROW: usize = 3;
/// Points of a panel, at most.
const MOST_POINTS: usize = 300;

/// A log with one fault.
struct Case {
    name: &'static str,
    csv: String,
    axes: [&'static str; 2],
    points: Vec<(f64, f64)>,
    /// How the user goes on.
    remedy: &'static str,
}

struct Dice(ChaCha8Rng);

impl Dice {
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// Rates at rest, °/h.
    fn rates(&mut self, rows: usize, rows_hz: f64) -> Vec<f64> {
        (0..rows).map(|_| 12.0 + N_DEG_RT_H * 60.0 * rows_hz.sqrt() * self.normal()).collect()
    }
}

fn csv(rows: impl Iterator<Item = (f64, f64)>) -> String {
    rows.fold("time_s,rate_dph\n".to_owned(), |text, (time_s, rate)| text + &format!("{time_s:.4},{rate:.3}\n"))
}

fn even(rates: &[f64], rows_hz: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
    rates.iter().enumerate().map(move |(row, rate)| ((row + 1) as f64 / rows_hz, *rate))
}

/// Rates at 100 Hz, of which the picture shows the first so many.
fn of_rates(name: &'static str, rates: &[f64], shown: usize, remedy: &'static str) -> Case {
    Case {
        name,
        csv: csv(even(rates, 100.0)),
        axes: ["time, s", "rate, °/h"],
        points: even(&rates[..shown], 100.0).collect(),
        remedy,
    }
}

/// A gyro at rest whose rows have these stamps, s; the picture shows every so many of the first rows.
fn of_stamps(
    dice: &mut Dice,
    name: &'static str,
    stamp_s: fn(usize) -> f64,
    (shown, every): (usize, usize),
    remedy: &'static str,
) -> Case {
    let rates = dice.rates(40_000, 100.0);
    Case {
        name,
        csv: csv(rates.iter().enumerate().map(|(row, rate)| (stamp_s(row), *rate))),
        axes: ["row", "stamp, s"],
        points: (0..shown).step_by(every).map(|row| (row as f64, stamp_s(row))).collect(),
        remedy,
    }
}

fn filtered(dice: &mut Dice) -> Vec<f64> {
    let (plain, mut state) = (dice.rates(60_000, 100.0), 0.0);
    let behind = plain.iter().map(|rate| {
        state += 0.3 * (rate - state);
        state
    });
    behind.collect()
}

/// A hand moves the gyro for a minute.
fn moved(dice: &mut Dice) -> Vec<f64> {
    let mut rates = dice.rates(40_000, 100.0);
    let mut motion = 0.0;
    for rate in &mut rates[10_000..16_000] {
        motion = 0.95 * motion + 8000.0 * dice.normal();
        *rate += motion;
    }
    rates
}

/// A narrow band of motion, about 1 Hz.
fn swinging(dice: &mut Dice) -> Vec<f64> {
    let (mut phase, mut size) = (0.0, 1.0);
    let still = dice.rates(20_000, 100.0);
    let rates = still.iter().map(|rate| {
        phase += std::f64::consts::TAU * (0.01 + 0.003 * dice.normal());
        size += 0.02 * (1.0 - size + dice.normal());
        rate + 40_000.0 * size * f64::sin(phase)
    });
    rates.collect()
}

fn clipped(dice: &mut Dice) -> Vec<f64> {
    dice.rates(20_000, 100.0).iter().map(|rate| (4.0 * rate).clamp(-1500.0, 1500.0)).collect()
}

/// Codes of 16 bits without a sign, read as °/s.
fn codes(dice: &mut Dice) -> Case {
    let code = |rate: f64| if rate < 0.0 { rate + 65_536.0 } else { rate };
    let rates: Vec<f64> = dice.rates(20_000, 100.0).iter().map(|rate| 3600.0 * code((rate / 10.0).round())).collect();
    let case = of_rates("unsigned 16 bits", &rates, 100, "subtract 65,536 from codes above 32,767");
    let points = case.points.iter().map(|(time_s, dph)| (*time_s, dph / 3600.0)).collect();
    Case { axes: ["time, s", "rate, °/s"], points, ..case }
}

/// A chamber log with a thermometer: °C of a time in s.
fn chamber(dice: &mut Dice, celsius: impl Fn(f64) -> f64, name: &'static str, remedy: &'static str) -> Case {
    let rates = dice.rates(36_000, 5.0);
    let mut text = "time_s,temperature_c,rate_dph\n".to_owned();
    for (time_s, rate) in even(&rates, 5.0) {
        let c = celsius(time_s);
        let _ = writeln!(text, "{time_s:.1},{:.2},{:.3}", c + 0.01 * dice.normal(), rate + 8.0 * c);
    }
    let points = (0..200).map(|at| (f64::from(at) * 0.01, celsius(f64::from(at) * 36.0))).collect();
    Case { name, csv: text, axes: ["time, h", "temperature, °C"], points, remedy }
}

fn cases(dice: &mut Dice) -> Vec<Case> {
    let cycle = |s: f64| 20.0 + 25.0 * (1.0 - (s / 3600.0 - 1.0).abs());
    let fourfold: Vec<f64> = dice.rates(15_000, 25.0).iter().flat_map(|rate| [*rate; 4]).collect();
    let packets = |row: usize| (row / 4 + 1) as f64 * 0.04;
    let bursts = |row: usize| (row / 5) as f64 * 0.078 + (row % 5) as f64 * 0.002;
    let restart = |row: usize| ((row % 25_000) + 1) as f64 * 0.01;
    vec![
        chamber(dice, cycle, "a good cycle", "`sagnac calibrate`"),
        chamber(dice, |s| 20.0 + 25.0 * s / 7200.0, "it only heats", "cool as well"),
        chamber(dice, |s| 22.0 + 0.5 * (s / 900.0).sin(), "a room", "a chamber; noise terms need none"),
        of_rates("a filter", &filtered(dice), 200, "nothing: N is right; switch the filter off to see Q"),
        of_rates("each value four times", &fourfold, 80, "nothing: N is right; log at the sensor's rate"),
        of_stamps(dice, "packets", packets, (40, 1), "nothing"),
        of_stamps(dice, "bursts", bursts, (40, 1), "give the interval that is true"),
        of_stamps(dice, "a restart", restart, (40_000, 200), "nothing: each part is a run"),
        of_rates("motion", &moved(dice), 40_000, "`sagnac allan --at-rest`"),
        of_rates("motion throughout", &swinging(dice), 600, "put the gyro at rest"),
        of_rates("full scale", &clipped(dice), 300, "choose a wider range of the sensor"),
        codes(dice),
    ]
}

/// Verdict and cautions of `inspect`, or its refusal.
fn said(program: &Program, folder: &Path, case: &Case) -> Result<String> {
    let log = folder.join("log.csv");
    std::fs::write(&log, &case.csv)?;
    let output = std::process::Command::new(program.path()).args(["inspect", text(&log)?, "--json"]).output()?;
    if !output.status.success() {
        let error = String::from_utf8(output.stderr)?;
        let words = error.lines().map(|line| line.trim().trim_start_matches("error: ").trim_start_matches("help: "));
        return Ok(words.collect::<Vec<_>>().join("; ").replace(text(&log)?, "log.csv"));
    }
    let object: Value = serde_json::from_slice(&output.stdout)?;
    let survey = &object["survey"];
    let words = |value: &Value| value.as_str().map(str::to_owned);
    let verdict = match survey["good_for"].as_str().context("no verdict")? {
        "calibration" => "good for calibration",
        "noise" => "good for noise only",
        _ => "not usable",
    };
    let cautions = survey["cautions"].as_array().context("no cautions")?.iter().filter_map(words);
    // The word on the missing thermometer is that of every log here without one.
    let reason = words(&survey["reason"]).filter(|reason| !reason.contains("no temperature column"));
    // How the log is read stands before its head, on standard error.
    let head = String::from_utf8(output.stderr)?;
    let read_as = head.split_once("a log of ").map_or("", |(before, _)| before);
    let read_as = read_as.split_whitespace().collect::<Vec<_>>().join(" ");
    let read_as = read_as.split_once("log.csv: ").map(|(_, words)| words.to_owned());
    let all: Vec<String> = [verdict.to_owned()].into_iter().chain(reason).chain(cautions).chain(read_as).collect();
    Ok(all.join("; ").replace(text(&log)?, "log.csv"))
}

/// Every one of many points, thinned to pairs of least and largest.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let size = (2 * points.len()).div_ceil(MOST_POINTS).max(1);
    if size <= 2 {
        return points.to_vec();
    }
    let pair = |part: &[(f64, f64)]| {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        [part.iter().min_by(by).copied(), part.iter().max_by(by).copied()]
    };
    points.chunks(size).flat_map(pair).flatten().collect()
}

fn drawn(cases: &[Case]) -> Result<String> {
    let failed = |e: &dyn std::fmt::Display| anyhow!("cannot draw {PICTURE}: {e}");
    let lines = cases.len().div_ceil(IN_A_ROW);
    let mut svg = String::new();
    let size = (PANEL.0 * IN_A_ROW as u32, PANEL.1 * lines as u32);
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(|e| failed(&e))?;
        for (number, (case, area)) in cases.iter().zip(area.split_evenly((lines, IN_A_ROW))).enumerate() {
            panel(&area, number + 1, case).map_err(|e| failed(&e))?;
        }
    }
    Ok(svg)
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    number: usize,
    case: &Case,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let points = thinned(&case.points);
    let ends = |pick: fn(&(f64, f64)) -> f64| {
        points.iter().map(pick).fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
    };
    let ([x_lo, x_hi], [y_lo, y_hi]) = (ends(|point| point.0), ends(|point| point.1));
    let short =
        |value: &f64| significant(*value, 3).parse::<f64>().map_or(String::new(), |rounded| rounded.to_string());
    let margin = 0.05 * (y_hi - y_lo);
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{number}. {}", case.name), ("sans-serif", 16))
        .margin(6)
        .margin_right(14)
        .x_label_area_size(32)
        .y_label_area_size(58)
        .build_cartesian_2d(x_lo..x_hi, y_lo - margin..y_hi + margin)?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(RGBColor(222, 225, 230))
        .x_labels(4)
        .y_labels(4)
        .x_desc(case.axes[0])
        .y_desc(case.axes[1])
        .x_label_formatter(&short)
        .y_label_formatter(&short)
        .label_style(("sans-serif", 12))
        .draw()?;
    chart.draw_series(LineSeries::new(points, RGBColor(0, 114, 178).stroke_width(1)))?;
    Ok(())
}

pub(crate) fn make(program: &Program) -> Result<Vec<Made>> {
    let folder = TempDir::new()?;
    let cases = cases(&mut Dice(ChaCha8Rng::seed_from_u64(47)));
    let mut table = "| | the log has | `sagnac inspect` says | next |\n|---|---|---|---|\n".to_owned();
    for (number, case) in cases.iter().enumerate() {
        let said = said(program, folder.path(), case)?.replace('|', "/");
        writeln!(table, "| {} | {} | {said} | {} |", number + 1, case.name, case.remedy)?;
    }
    let page = std::fs::read_to_string(root().join(GOOD_LOG))?;
    let page = between_marks(&page, &marks("cases", "good-log"), &table)?;
    Ok(vec![Made::new(PICTURE, drawn(&cases)?), Made::new(GOOD_LOG, page)])
}
