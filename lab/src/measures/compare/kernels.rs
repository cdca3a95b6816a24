//! The kernels and trees of the ring laser literature on the same inputs: `kernels.py` fits and holds out, this makes the sections.
//!
//! The real recording is one sweep, held out in twelve contiguous blocks, as `calibrate` does. Where a kernel is better than
//! ours by over a tenth, the page names the term that lowers the error of a series in T and its rate most, by the same folds.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use xtask::shell::root;

use super::{Outcome, Second, error_of};
use crate::program::Program;

const SCRIPT: &str = include_str!("kernels.py");
/// In the order of the script.
pub(super) const METHODS: [&str; 4] = ["LS-SVM", "RBF network", "random forest", "Gaussian process"];
/// Ours is beaten where a kernel has less than this part of its error.
const BEATEN: f64 = 0.9;
const RECORDING: &str = "../shared/data/mems-chamber-sweep/imu_raw_data.csv";
/// Twenty rows a window, as the script has it.
const SETUP: &str = "window = 10.1
[columns]
timestamp = \"time_us\"
\"imu.gyro.x\" = \"rate_radps_x\"
\"imu.gyro.y\" = \"rate_radps_y\"
\"imu.gyro.z\" = \"rate_radps_z\"
\"imu.temperature\" = \"temperature_c\"
";

fn run(python: &str, folder: &Path, args: &[&Path], what: &str) -> Result<String> {
    let script = folder.join("kernels.py");
    fs::write(&script, SCRIPT)?;
    // One thread: matrices of about a hundred rows gain nothing by more.
    let mut command = Command::new(python);
    command.arg(&script).arg(what).args(args).env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1");
    let output = command.output().context("cannot start python")?;
    ensure!(output.status.success(), "the kernels: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8(output.stdout)?)
}

/// Each method's correction of a retest, against the truth.
pub(super) fn simulated(
    python: &str,
    folder: &Path,
    fit: &Path,
    retest: &Path,
    truth: &[Second],
) -> Result<Vec<Outcome>> {
    let out = folder.join("kernels.csv");
    run(python, folder, &[fit, retest, &out], "simulated")?;
    let table = fs::read_to_string(&out)?;
    let column = |at: usize| -> Vec<f64> {
        table.lines().map(|row| row.split(',').nth(at).and_then(|c| c.parse().ok()).unwrap_or(f64::NAN)).collect()
    };
    let of = |at: usize| {
        error_of(&column(at), truth).map_or(Outcome::Message("NaN".to_owned()), |(rms, most)| Outcome::Error(rms, most))
    };
    Ok((0..METHODS.len()).map(of).collect())
}

/// Held-out σ of `calibrate` on the recording, axis by axis, °/h, with its model.
fn ours(folder: &Path, recording: &str) -> Result<Vec<(String, f64, String)>> {
    let (setup, record) = (folder.join("sweep.toml"), folder.join("sweep.cal.json"));
    fs::write(&setup, SETUP)?;
    let (setup, record) = (setup.display().to_string(), record.display().to_string());
    let said =
        Program::beside_the_lab()?.stdout(&["calibrate", recording, "--setup", &setup, "-o", &record, "--json"])?;
    let object: serde_json::Value = serde_json::from_str(&said)?;
    let axes = object["axes"].as_array().context("no axes")?;
    let axis = |axis: &serde_json::Value| {
        let text = |key: &str| axis[key].as_str().map(str::to_owned);
        let sigma = axis["cross_validation"]["sigma_dph"].as_f64();
        text("axis").zip(sigma).zip(text("model")).map(|((axis, sigma), model)| (axis, sigma, model))
    };
    axes.iter().map(|found| axis(found).context("an axis without a held-out error")).collect()
}

/// The section of the real recording.
pub(super) fn real_section(python: &str, folder: &Path) -> Result<String> {
    let recording = root().join(RECORDING);
    ensure!(recording.exists(), "{} is missing", recording.display());
    let said = run(python, folder, &[&recording], "real")?;
    let found = |axis: &str, what: &str| -> Result<f64> {
        let line = said.lines().find_map(|line| line.strip_prefix(&format!("real: {axis}|{what}|")));
        line.with_context(|| format!("no {what} of axis {axis}"))?.parse().context("no number")
    };
    let mut page = format!(
        "\n## A real log\n\nThe [recording of a MEMS gyro](../tutorial/real-log.md): one sweep down and up, twelve contiguous blocks held out in turn, windows of \
         twenty rows. Held-out root mean square, °/h. The first column is the figure of `sagnac calibrate`, which selected its model on these blocks; all \
         others choose everything, the lag too, by inner folds. *Series* is Sagnac's family of models under that stricter rule.\n\n\
         | axis | `sagnac calibrate`, auto | series | cubic of T | {} |\n|---|---|---|---|---|---|---|---|\n",
        METHODS.join(" | ")
    );
    let mut notes = String::new();
    for (axis, sigma, model) in ours(folder, &recording.display().to_string())? {
        let kernels: Vec<(&str, f64)> =
            METHODS.iter().map(|method| Ok((*method, found(&axis, method)?))).collect::<Result<_>>()?;
        let cells: Vec<String> = kernels.iter().map(|(_, error)| format!("{error:.0}")).collect();
        let (series, cubic) = (found(&axis, "series")?, found(&axis, "cubic")?);
        // A String takes all that is written to it.
        let _ =
            writeln!(page, "| {axis} | {sigma:.0} (`{model}`) | {series:.0} | {cubic:.0} | {} |", cells.join(" | "));
        let best = kernels.iter().min_by(|a, b| a.1.total_cmp(&b.1)).context("no kernel")?;
        let against = sigma.min(series);
        let terms = ["second lag", "direction", "rate squared", "time"]
            .map(|term| found(&axis, &format!("term {term}")).map(|error| (term, error)))
            .into_iter()
            .collect::<Result<Vec<_>>>()?;
        let listed: Vec<String> = terms.iter().map(|(term, error)| format!("{term} {error:.0}")).collect();
        let least = terms.iter().min_by(|a, b| a.1.total_cmp(&b.1)).context("no term")?;
        let verdict = if best.1 >= BEATEN * against {
            "no kernel is better than the best of ours by over 10 %".to_owned()
        } else if least.1 < BEATEN * against {
            format!(
                "the {} is better by {:.0} %, and the missing term is: **{}**",
                best.0,
                100.0 * (1.0 - best.1 / against),
                least.0
            )
        } else {
            format!(
                "the {} is better by {:.0} %, and none of these terms accounts for it",
                best.0,
                100.0 * (1.0 - best.1 / against)
            )
        };
        let _ = writeln!(notes, "- Axis {axis}: {verdict}. Series with one term more: {}.", listed.join(", "));
    }
    page += "\nWhich term is missing is found by adding it to the series, by the same folds: a second rate behind another lag, the sign of the rate \
             (alone and times T), the rate squared (with and without its sign), or a straight line in time. In a single sweep a slow lag and time can \
             stand for each other.\n\n";
    Ok(page + &notes)
}
