//! A factory: ten thousand units, each with logs of its own, on threads and on a cluster of this machine.
//!
//! Each command runs once: minutes each, and 15 GB that no file cache of this machine holds.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::bench::fleet::{self, MODEL, RUNS, Started};
use crate::bench::process::{Cost, measure};
use crate::bench::{Bench, line};

pub(super) const HEADING: &str = "\n## Ten thousand units";
/// Units, unless SAGNAC_FLEET_UNITS says another number.
const UNITS: u64 = 10_000;
/// What the issue asks of an executor, MiB.
const MOST_MIB: f64 = 256.0;

/// Makes the logs that are not there and measures.
pub(super) fn measure_scale(bench: &Bench, page: &mut String) -> Result<()> {
    let units = std::env::var("SAGNAC_FLEET_UNITS")
        .ok()
        .map_or(Ok(UNITS), |text| text.parse())
        .context("SAGNAC_FLEET_UNITS")?;
    let folder = bench.file(&format!("fleet-{units}"));
    let logs = make(&folder, units)?;
    let listed = bench.file("fleet-scale-logs.txt");
    let names: Vec<String> = logs.iter().map(|log| log.display().to_string()).collect();
    fs::write(&listed, names.join("\n"))?;
    let bytes = logs.iter().map(|log| Ok(fs::metadata(log)?.len())).sum::<Result<u64>>()?;
    let folder = folder.display().to_string();
    let once = |what: &str, command: &[String]| -> Result<Cost> {
        let cost = measure(command)?;
        println!("{what}: {:.0} s, {:.1} MiB", cost.seconds, cost.peak_mib);
        Ok(cost)
    };
    let threads = |number| fleet::on_threads(bench, &folder, number, MODEL, &format!("{folder}-out"));
    let two = once("two threads", &threads("2"))?;
    let table_bytes = fs::metadata(Path::new(&format!("{folder}-out")).join("fleet.parquet"))?.len();
    let shell = once("shell", &fleet::by_shell(bench, &folder))?;
    let mut clusters = Vec::new();
    let program = fleet::cluster_program()?;
    for executors in [1, 2, 4] {
        let running = Started::new(&program, executors, 1, false)?;
        let cost = once("cluster", &fleet::on_cluster(bench, &program, &folder, &running.at)?)?;
        clusters.push((executors, cost, running.peak_mib()?));
    }
    let bare = once("DuckDB", &fleet::by_duckdb(bench, &listed)?)?;
    let one = once("one thread", &threads("1"))?;
    let _ = write!(
        page,
        "{HEADING}\n\n{units} units of three axes and {RUNS} runs of ten hours at 1 Hz, every log of its own ({} logs, {:.1} GB of CSV), \
         `--model \"{MODEL}\"` (`cargo xtask bench fleet-scale`). Each command ran once. The table has {:.1} MB.\n\n| | s | peak, MiB |\n|---|---|---|\n",
        units * RUNS,
        bytes as f64 / 1e9,
        table_bytes as f64 / 1e6
    );
    line(page, "`fleet calibrate --threads 2`", &two);
    line(page, "`fleet calibrate --threads 1`", &one);
    line(page, "the loop, one unit at a time", &shell);
    line(page, "DuckDB, bare window sums, two threads", &bare);
    for (executors, cost, peak_mib) in &clusters {
        line(page, &format!("`sagnac-fleet`, executors of one slot: {executors}; the driver's peak"), cost);
        let _ = writeln!(page, "| the largest executor of these | | {peak_mib:.1} |");
    }
    let rate = |cost: &Cost| units as f64 / cost.seconds;
    let over = |cost: &Cost| 100.0 * (cost.seconds / shell.seconds - 1.0);
    let overheads: Vec<String> = clusters.iter().map(|(n, cost, _)| format!("{:+.0} % with {n}", over(cost))).collect();
    let most = clusters.iter().map(|(_, _, peak)| *peak).fold(0.0, f64::max);
    let _ = writeln!(
        page,
        "\n**{:.1} units a second on two threads, {:.1} on one. Time over that of the loop: {:+.0} % on threads; on the cluster {} (asked: none; at \
         most 5 %). {:.2} of the time of DuckDB's bare sums (asked: at most 1.2). Largest executor {most:.1} MiB (asked: under {MOST_MIB}).**",
        rate(&two),
        rate(&one),
        over(&two),
        overheads.join(", "),
        two.seconds / bare.seconds
    );
    Ok(())
}

/// The logs of every unit, on two threads; those that are there already stay.
fn make(folder: &Path, units: u64) -> Result<Vec<PathBuf>> {
    let part = |first: u64| -> Result<Vec<PathBuf>> {
        let mut logs = Vec::new();
        for unit in (first..units).step_by(2) {
            let own = folder.join(format!("RLG-{unit:05}"));
            fs::create_dir_all(&own)?;
            for run in 0..RUNS {
                let path = own.join(format!("run-{run}.csv"));
                if !path.exists() {
                    let unfinished = own.join("unfinished");
                    fs::write(
                        &unfinished,
                        fleet::log_of([0, 1, 2].map(|axis| drift(unit, axis)), 8 * (unit * RUNS + run))?,
                    )?;
                    fs::rename(&unfinished, &path)?;
                }
                logs.push(path);
            }
        }
        Ok(logs)
    };
    let [even, odd] = std::thread::scope(|scope| {
        let parts = [0, 1].map(|first| scope.spawn(move || part(first)));
        parts.map(|part| part.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    });
    let mut logs = [even?, odd?].concat();
    logs.sort();
    Ok(logs)
}

/// Drift of an axis in powers of u, °/h: no two alike.
fn drift(unit: u64, axis: u64) -> Vec<f64> {
    // The fractional parts of multiples of irrational numbers: even over [-0.5, 0.5), and no random numbers that would have to be stated.
    let even = |root: f64| ((unit * 3 + axis) as f64 * root.sqrt()).fract() - 0.5;
    vec![0.01 + 0.04 * even(2.0), 0.004 + 0.04 * even(3.0), -0.012 + 0.03 * even(5.0), 0.014 + 0.02 * even(7.0)]
}
