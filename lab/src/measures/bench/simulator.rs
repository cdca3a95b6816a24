//! The simulator: speed per core as a multiple of real time, and whole processes of `sagnac simulate`.

use std::fmt::Write as _;
use std::fs;

use anyhow::{Context, Result};
use xtask::shell::root;

use crate::measures::bench::{Bench, line, median_cost, process};

/// Heading of the section.
pub(super) const HEADING: &str = "\n## The simulator\n\n";
/// Simulated seconds of the beat, and of a log with a row per tick.
const BEAT_S: u32 = 60;
const TICKS_S: u32 = 600;

/// Beat, count level, text out, and a 72-hour test.
pub(super) fn measure(bench: &Bench, page: &mut String) -> Result<()> {
    let scenario = root().join("scenarios/triangle-28cm-dithered/triangle-28cm-dithered.toml");
    let text = fs::read_to_string(&scenario).context("the ready scenario is missing")?;
    let args = ["run", "--quiet", "--release", "--locked", "-p", "sagnac-sim", "--example", "speed", "--"];
    let (path, seconds) = (scenario.display().to_string(), BEAT_S.to_string());
    let stdout = process::output("cargo", &[&args[..], &[&path, &seconds]].concat())?;
    let times = |name: &str| -> Result<f64> {
        let line =
            stdout.lines().find_map(|l| l.strip_prefix(name)).with_context(|| format!("no {name} in {stdout}"))?;
        Ok(line.split_whitespace().next().unwrap_or_default().parse()?)
    };
    let ticks = ready_with(bench, &text, "ticks", 0.0001, f64::from(TICKS_S))?;
    let days = ready_with(bench, &text, "days", 1.0, 72.0 * 3600.0)?;
    let out = bench.file("simulated.csv").display().to_string();
    let simulate = |scenario: &str| {
        let words = [bench.sagnac.as_str(), "simulate", scenario, "-o", &out];
        median_cost(&words.map(str::to_owned))
    };
    let (tick_cost, day_cost) = (simulate(&ticks)?, simulate(&days)?);
    let _ = fs::remove_file(&out);
    *page += HEADING;
    *page += "Dithered triangle of 28 cm, one core, without control loops. Speed as a multiple of real time.\n\n| | times real time | target |\n|---|---|---|\n";
    let rows = [
        ("beat level, Adler form", times("adler ")?, 50),
        ("beat level, two-mode form", times("two-mode ")?, 8),
        ("count level at 100 µs, no output", times("count ")?, 5000),
        ("count level at 100 µs to CSV, whole process", f64::from(TICKS_S) / tick_cost.seconds, 1000),
    ];
    for (name, times, wanted) in rows {
        let _ = writeln!(page, "| {name} | {times:.0} | {wanted} |");
    }
    *page += "\n| | median, s | peak, MiB |\n|---|---|---|\n";
    line(page, "10 minutes at 100 µs to CSV (6 million rows)", &tick_cost);
    line(page, "72 hours at 1 s to CSV; target: 1 s", &day_cost);
    Ok(())
}

/// The scenario with another interval and one long soak.
fn ready_with(bench: &Bench, text: &str, name: &str, interval_s: f64, soak_s: f64) -> Result<String> {
    let before = text.split("[chamber]").next().context("a scenario without a chamber")?;
    let path = bench.file(&format!("{name}.toml"));
    let tail = format!(
        "[run]\ninterval_s = {interval_s}\n[chamber]\nleg = [{{ soak_s = {soak_s} }}]\n[input]\nrate_dph = 4.5\n"
    );
    fs::write(&path, format!("{before}{tail}"))?;
    Ok(path.display().to_string())
}
