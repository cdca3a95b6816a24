//! `cargo xtask compare`: fits by Sagnac and by other tools on the same logs with a known truth, for
//! docs/explanation/comparison.md.
//!
//! ```text
//! seven tests (fit log, retest, truth) ─┬▶ sagnac calibrate + compensate ─┬▶ truth minus correction on the retest ─▶ page
//!                                       └▶ numpy, as other tools' users do ┘
//! ```
//!
//! The figure is the error of the correction itself: true drift minus correction at every second of a retest, about its
//! mean. Sagnac must reach the noise floor or refuse with a reason; otherwise the task fails.

mod kernels;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use sagnac_sim::{NoiseConfig, Resting};
use xtask::shell::root;

use crate::measures::bench::peers;
use crate::places::COMPARISON;
use crate::program::Program;

/// Angle random walk of every log, °/√h; a window of 100 s then has σ = 0.018 °/h.
const ARW_DEG_RT_H: f64 = 0.003;
const FLOOR_DPH: f64 = 60.0 * ARW_DEG_RT_H / 10.0;
/// Largest error at the noise floor, as a fraction of the floor: it widens a retest's σ by a tenth, √(1 + 0.46²) = 1.10.
const AT_THE_FLOOR: f64 = 0.46;
const INPUT_DPH: f64 = 4.5;
/// Name of the trial that must be refused.
const NARROW: &str = "2 °C";

/// The other tools' models from their documentation, each a function of temperature fitted to the log's rows.
const PEERS: &str = r#"import sys, numpy as np
fit, retest, out = sys.argv[1:4]
def read(path):
    rows = np.genfromtxt(path, delimiter=',', names=True)
    return rows['temperature_c'], rows['rate_dph']
t, y = read(fit)
tr, _ = read(retest)
def px4(t, y, tr):
    # PX4 thermal calibration: polyfit of order 3 on the temperature about the middle of its range.
    middle = 0.5 * (np.max(t) + np.min(t))
    return np.polyval(np.polyfit(t - middle, y, 3), tr - middle)
def ardupilot(t, y, tr):
    # ArduPilot IMU temperature calibration: a cubic about 35 degC whose constant is not kept.
    return np.polyval(np.append(np.polyfit(t - 35.0, y, 3)[:3], 0.0), tr - 35.0)
def linear(t, y, tr):
    # Android's temperature bias models, MATLAB's imuSensor: one slope and a constant.
    return np.polyval(np.polyfit(t, y, 1), tr)
names, columns = [], []
for peer in (px4, ardupilot, linear):
    try:
        columns.append(peer(t, y, tr))
        names.append('peer: ok')
    except Exception as error:
        columns.append(np.full(len(tr), np.nan))
        names.append('peer: ' + type(error).__name__ + ': ' + str(error))
np.savetxt(out, np.column_stack(columns), delimiter=',', fmt='%.9g')
print('\n'.join(names))
"#;
const PEER_NAMES: [&str; 3] =
    ["cubic about mid-range (PX4)", "cubic about 35 °C (ArduPilot)", "linear (Android, MATLAB)"];

/// The gyro and its chamber in a test.
#[derive(Clone, Copy)]
struct Rig {
    /// Chamber: lowest and highest temperature, °C, and ramp rate, °C/min.
    span_c: [f64; 2],
    pace_cpm: f64,
    /// Soak at both ends, s.
    soak_s: f64,
    cycles: usize,
    /// Rate effect, °/h per °C/min of the block.
    rate_effect: f64,
    /// Half-width of the play between block and drift temperature, °C, and drift per °C of play, °/h.
    hysteresis: (f64, f64),
    /// Time constant of the thermometer behind the block, s.
    thermometer_lag_s: f64,
    thermometer_step_c: f64,
}

const QUIET: Rig = Rig {
    span_c: [-20.0, 60.0],
    pace_cpm: 0.25,
    soak_s: 1800.0,
    cycles: 1,
    rate_effect: 0.0,
    hysteresis: (0.0, 0.0),
    thermometer_lag_s: 0.0,
    thermometer_step_c: 0.001,
};
const MOVING: Rig = Rig {
    pace_cpm: 1.0,
    soak_s: 5400.0,
    cycles: 2,
    rate_effect: 0.05,
    hysteresis: (1.0, 0.0005),
    thermometer_lag_s: 240.0,
    ..QUIET
};

/// A second of a log.
struct Second {
    temperature_c: f64,
    rate_dph: f64,
    /// True drift, °/h.
    drift_dph: f64,
}

impl Rig {
    /// Chamber temperature, a value a second.
    fn chamber_c(&self) -> Vec<f64> {
        let [lo, hi] = self.span_c;
        let ramp_s = 60.0 * (hi - lo) / self.pace_cpm;
        let mut out = vec![lo; self.soak_s as usize];
        for _ in 0..self.cycles {
            let ramp = |from: f64, to: f64| (1..=ramp_s as usize).map(move |s| from + (to - from) * s as f64 / ramp_s);
            out.extend(ramp(lo, hi));
            out.extend(std::iter::repeat_n(hi, self.soak_s as usize));
            out.extend(ramp(hi, lo));
            out.extend(std::iter::repeat_n(lo, self.soak_s as usize));
        }
        out
    }

    fn run(&self, seed: u64) -> Vec<Second> {
        let chamber = self.chamber_c();
        let noise = NoiseConfig { arw_deg_rt_h: ARW_DEG_RT_H, ..NoiseConfig::default() };
        let noise = Resting { noise, q_arcsec: 0.0 }.angles(chamber.len(), seed);
        let start = chamber[0];
        let (mut block, mut thermometer, mut played) = (start, start, start);
        let rows = chamber.iter().zip(noise).map(|(chamber_c, noise)| {
            let before = block;
            // The block follows the chamber with a time constant of ten minutes.
            block += (chamber_c - block) / 600.0;
            thermometer += if self.thermometer_lag_s > 0.0 {
                (block - thermometer) / self.thermometer_lag_s
            } else {
                block - thermometer
            };
            played = played.clamp(block - self.hysteresis.0, block + self.hysteresis.0);
            let u = (block - 20.0) / 40.0;
            let curve = 0.06 * u - 0.04 * u * u + 0.03 * u * u * u;
            let drift = curve + self.rate_effect * 60.0 * (block - before) + self.hysteresis.1 * (block - played);
            Second {
                temperature_c: (thermometer / self.thermometer_step_c).round() * self.thermometer_step_c,
                rate_dph: INPUT_DPH + drift + noise,
                drift_dph: drift,
            }
        });
        rows.collect()
    }
}

/// One row of the comparison.
struct Trial {
    name: &'static str,
    what: &'static str,
    fit: Vec<Second>,
    retest: Vec<Second>,
}

fn trials() -> Vec<Trial> {
    let trial = |name, what, rig: Rig| Trial { name, what, fit: rig.run(1), retest: rig.run(2) };
    let mut bump = trial("bump", "clean, with 30 s of rotation at 1 °/s in the fitted log", QUIET);
    let middle = bump.fit.len() / 2;
    bump.fit[middle..middle + 30].iter_mut().for_each(|second| second.rate_dph += 3600.0);
    let mut missing = trial("NaN", "clean, one temperature of the fitted log is NaN", QUIET);
    missing.fit[5000].temperature_c = f64::NAN;
    let narrow = Rig { span_c: [20.0, 22.0], pace_cpm: 0.05, ..QUIET };
    vec![
        trial("clean ramp", "0.25 °C/min up and down over 80 °C, thermometer on the block", QUIET),
        trial(
            "rate and hysteresis",
            "1 °C/min, 0.05 °/h per °C/min, hysteresis, thermometer lags the block by 4 min",
            MOVING,
        ),
        bump,
        missing,
        trial("whole degrees", "clean, thermometer resolution 1 °C", Rig { thermometer_step_c: 1.0, ..QUIET }),
        Trial { retest: QUIET.run(2), ..trial(NARROW, "fitted over 2 °C, applied over 80 °C", narrow) },
        Trial {
            fit: MOVING.run(3),
            retest: Rig { pace_cpm: 0.5, ..MOVING }.run(4),
            ..trial("second cycle", "fitted at 1 °C/min, applied at 0.5 °C/min", MOVING)
        },
    ]
}

fn csv(seconds: &[Second]) -> String {
    let mut out = String::from("time_s,temperature_c,rate_dph\n");
    for (index, second) in seconds.iter().enumerate() {
        // A String takes all that is written to it.
        let _ = writeln!(out, "{},{},{:.6}", index + 1, second.temperature_c, second.rate_dph);
    }
    out
}

/// Root mean square and largest absolute value of truth minus correction, about its mean; `None` where the correction
/// is not a number.
fn error_of(correction: &[f64], retest: &[Second]) -> Option<(f64, f64)> {
    let errors: Vec<f64> = correction.iter().zip(retest).map(|(c, second)| second.drift_dph - c).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let square = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64;
    let worst = errors.iter().map(|e| (e - mean).abs()).fold(0.0, f64::max);
    (square.is_finite() && !errors.is_empty()).then(|| (square.sqrt(), worst))
}

/// Result of one tool in one trial.
enum Outcome {
    /// Root mean square and largest absolute value, °/h.
    Error(f64, f64),
    /// Its message.
    Message(String),
}

/// Sagnac as a user runs it: fit, correct the retest, evaluate the correction that was subtracted.
fn ours(folder: &Path, fit: &Path, retest: &Path, truth: &[Second]) -> Result<Outcome> {
    let program = Program::beside_the_lab()?;
    let (record, corrected) = (folder.join("u.cal.json"), folder.join("corrected.csv"));
    let run =
        |args: &[&std::ffi::OsStr]| Command::new(program.path()).args(args).output().context("cannot start sagnac");
    let flags = ["-o".as_ref(), record.as_os_str(), "--serial".as_ref(), "COMPARED".as_ref()];
    let fitted = run(&[&["calibrate".as_ref(), fit.as_os_str()][..], &flags].concat())?;
    if !fitted.status.success() {
        let stderr = String::from_utf8_lossy(&fitted.stderr).into_owned();
        let words = stderr.lines().next().unwrap_or_default();
        return Ok(Outcome::Message(words.replace(&format!("{}/", folder.display()), "")));
    }
    let done =
        run(&["compensate".as_ref(), record.as_os_str(), retest.as_os_str(), "-o".as_ref(), corrected.as_os_str()])?;
    ensure!(done.status.success(), "compensate: {}", String::from_utf8_lossy(&done.stderr));
    let text = fs::read_to_string(&corrected)?;
    let header: Vec<&str> = text.lines().find(|line| !line.starts_with('#')).unwrap_or_default().split(',').collect();
    let column = header.iter().position(|name| name.starts_with("compensated_rate")).context("no corrected rate")?;
    let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let rates: Result<Vec<f64>, _> =
        rows.map(|row| row.split(',').nth(column).unwrap_or_default().parse::<f64>()).collect();
    let correction: Vec<f64> = rates?.iter().zip(truth).map(|(after, second)| second.rate_dph - after).collect();
    ensure!(correction.len() == truth.len(), "{} corrected rows of {}", correction.len(), truth.len());
    Ok(error_of(&correction, truth)
        .map_or(Outcome::Message("no number".to_owned()), |(rms, worst)| Outcome::Error(rms, worst)))
}

fn theirs(python: &str, folder: &Path, fit: &Path, retest: &Path, truth: &[Second]) -> Result<Vec<Outcome>> {
    let (script, out) = (folder.join("peers.py"), folder.join("peers.csv"));
    fs::write(&script, PEERS)?;
    let output = Command::new(python).arg(&script).args([fit, retest, &out]).output().context("cannot start python")?;
    ensure!(output.status.success(), "the other tools: {}", String::from_utf8_lossy(&output.stderr));
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let table = fs::read_to_string(&out)?;
    // Other lines are printed by libraries, not by the models.
    let words = stdout.lines().filter_map(|line| line.strip_prefix("peer: "));
    let outcomes = words.enumerate().map(|(peer, words)| {
        let column: Vec<f64> = table
            .lines()
            .map(|row| row.split(',').nth(peer).and_then(|c| c.parse().ok()).unwrap_or(f64::NAN))
            .collect();
        match error_of(&column, truth) {
            Some((rms, worst)) => Outcome::Error(rms, worst),
            None if words == "ok" => Outcome::Message("NaN, no message".to_owned()),
            None => Outcome::Message(words.to_owned()),
        }
    });
    Ok(outcomes.collect())
}

fn cell(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Error(rms, worst) => format!("{rms:.4}, {worst:.3}"),
        Outcome::Message(words) => words.replace('|', "/"),
    }
}

/// Runs every trial and writes the page.
pub(crate) fn compare() -> Result<()> {
    let folder: PathBuf = root().join("target/compare");
    fs::create_dir_all(root().join("target/bench"))?;
    fs::create_dir_all(&folder)?;
    let python = peers(&root().join("target/bench"))?;
    let mut page = format!(
        "# Comparison with other tools\n\nMade by `cargo xtask compare`; do not edit.\n\nAll logs are simulated, so the true drift is known: a \
         cubic over 80 °C of up to 0.13 °/h, with an ARW of {ARW_DEG_RT_H} °/√h. Each tool fits one log and corrects another, the retest. The table \
         states the error of the correction at every second of the retest, true drift minus correction, about its mean: root mean square and \
         largest absolute value, °/h.\n\nAt this noise a window of 100 s has σ = {FLOOR_DPH} °/h. An error below {:.4} cannot be seen in a retest and \
         counts as at the noise floor. The other tools' fits are written with numpy from their documentation; none of their code runs here.\n\n\
         | test | `sagnac calibrate`, auto | {} |\n|---|---|---|---|---|\n",
        AT_THE_FLOOR * FLOOR_DPH,
        PEER_NAMES.join(" | ")
    );
    let mut missed = Vec::new();
    let mut of_kernels = format!(
        "\n## Kernels and trees\n\nThe ring laser literature fits T and its rate by kernels. Each gets what Sagnac has: windows of 100 s, T and its rate behind \
         a lag, and chooses lag and settings by five inner folds of the fitted log, the Gaussian process by its marginal likelihood. LS-SVM and the RBF \
         network are written in numpy, the others are of scikit-learn. Rows without a temperature are dropped for them. The same figures, °/h:\n\n\
         | test | `sagnac calibrate`, auto | {} |\n|---|---|---|---|---|---|\n",
        kernels::METHODS.join(" | ")
    );
    let mut beaten = Vec::new();
    for trial in trials() {
        let (fit, retest) = (folder.join("fit.csv"), folder.join("retest.csv"));
        fs::write(&fit, csv(&trial.fit))?;
        fs::write(&retest, csv(&trial.retest))?;
        let mine = ours(&folder, &fit, &retest, &trial.retest)?;
        let others = theirs(&python, &folder, &fit, &retest, &trial.retest)?;
        let cells: Vec<String> = others.iter().map(cell).collect();
        let row = format!("| **{}**: {} | {} | {} |", trial.name, trial.what, cell(&mine), cells.join(" | "));
        println!("{row}");
        page = page + &row + "\n";
        let others = kernels::simulated(&python, &folder, &fit, &retest, &trial.retest)?;
        let cells: Vec<String> = others.iter().map(cell).collect();
        let row = format!("| **{}** | {} | {} |", trial.name, cell(&mine), cells.join(" | "));
        println!("{row}");
        of_kernels = of_kernels + &row + "\n";
        let rms = |outcome: &Outcome| if let Outcome::Error(rms, _) = outcome { *rms } else { f64::INFINITY };
        let best = others.iter().map(rms).fold(f64::INFINITY, f64::min);
        if best < 0.9 * rms(&mine) && !matches!(mine, Outcome::Message(_)) {
            beaten.push(format!("*{}* ({:.0} %)", trial.name, 100.0 * (1.0 - best / rms(&mine))));
        }
        let kept = match &mine {
            Outcome::Error(rms, _) => *rms <= AT_THE_FLOOR * FLOOR_DPH,
            // A refusal is correct only where the data cannot support a fit.
            Outcome::Message(words) => trial.name == NARROW && words.starts_with("refused: "),
        };
        if !kept {
            missed.push(trial.name);
        }
    }
    page += "\nSagnac handles a bump, a step or a missing temperature before the fit: it excludes the affected windows and names the reason. It refuses \
             a span that is too small. The other models have no rate term; a thermometer that lags the block acts like a rate effect.\n";
    let beaten = match beaten.is_empty() {
        true => "No kernel is better than Sagnac by over 10 % in any of these tests.".to_owned(),
        false => format!("A kernel is better than Sagnac by over 10 % in {}.", beaten.join(", ")),
    };
    page = page + &of_kernels + "\n" + &beaten + "\n" + &kernels::real_section(&python, &folder)?;
    fs::write(root().join(COMPARISON), &page)?;
    ensure!(missed.is_empty(), "not at the floor and not refused: {}", missed.join(", "));
    println!("wrote {COMPARISON}");
    Ok(())
}
