//! A factory: ten thousand units, each with logs of its own, on threads and on a cluster of this machine.
//!
//! Each command runs once, for minutes.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::measures::bench::Bench;
use crate::measures::bench::fleet::{self, MODEL, RUNS, Started, alone};
use crate::measures::bench::process::{Cost, measure};

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
    let bytes = logs.iter().map(|log| Ok(fs::metadata(log)?.len())).sum::<Result<u64>>()?;
    // What keeps nothing from unit to unit takes as long for each unit of a tenth as of all.
    let few = (units / 10).max(1);
    let tenth = part_of(&folder, few)?;
    let folder = folder.display().to_string();
    let once = |what: &str, command: &[String]| -> Result<Cost> {
        let cost = measure(command)?;
        println!("{what}: {:.0} s, {:.1} MiB", cost.seconds, cost.peak_mib);
        Ok(cost)
    };
    let out = format!("{folder}-out");
    let two = once("two threads", &fleet::on_threads(bench, &folder, "2", MODEL, &out))?;
    let table_bytes = fs::metadata(Path::new(&out).join("fleet.parquet"))?.len();
    let mut clusters = Vec::new();
    let program = fleet::cluster_program()?;
    for (executors, source, of) in [(2, &folder, units), (1, &tenth, few), (4, &tenth, few)] {
        let one_core = executors == 1;
        let running = Started::new(&program, executors, 1, one_core)?;
        let command = fleet::on_cluster(bench, &program, source, &running.at)?;
        let cost = once("cluster", &if one_core { alone(command) } else { command })?;
        clusters.push((executors, of, cost, running.peak_mib()?));
    }
    let one = once("one thread", &alone(fleet::on_threads(bench, &tenth, "1", MODEL, &format!("{tenth}-out"))))?;
    let shell = once("shell", &fleet::by_shell(bench, &tenth))?;
    let shell_alone = once("shell on one core", &alone(fleet::by_shell(bench, &tenth)))?;
    let listed = bench.file("fleet-scale-logs.txt");
    let names: Vec<String> = logs.iter().take((few * RUNS) as usize).map(|log| log.display().to_string()).collect();
    fs::write(&listed, names.join("\n"))?;
    let bare = once("DuckDB", &fleet::by_duckdb(bench, &listed)?)?;
    let _ = write!(
        page,
        "{HEADING}\n\n{units} units of three axes and {RUNS} runs of ten hours at 1 Hz, every log of its own ({} logs, {:.1} GB of CSV), \
         `--model \"{MODEL}\"` (`cargo xtask bench fleet-scale`). Each command ran once, on two cores; the table has {:.1} MB. Rows of {few} units are of the \
         first of them.\n\n| | units | s | units a second | peak, MiB |\n|---|---|---|---|---|\n",
        units * RUNS,
        bytes as f64 / 1e9,
        table_bytes as f64 / 1e6
    );
    let each = |of: u64, cost: &Cost| cost.seconds / of as f64;
    let mut row = |what: &str, of: u64, cost: &Cost, peak_mib: f64| {
        let seconds = cost.seconds;
        let _ = writeln!(page, "| {what} | {of} | {seconds:.1} | {:.1} | {peak_mib:.1} |", 1.0 / each(of, cost));
    };
    row("`fleet calibrate --threads 2`", units, &two, two.peak_mib);
    for (executors, of, cost, peak_mib) in &clusters {
        let slots = if *executors == 1 { "1 executor on one core" } else { &format!("{executors} executors") };
        row(&format!("`sagnac-fleet`, {slots}, one slot each; peak of an executor"), *of, cost, *peak_mib);
    }
    row("`fleet calibrate --threads 1`, one core", few, &one, one.peak_mib);
    row("the loop, two cores", few, &shell, shell.peak_mib);
    row("the loop, one core", few, &shell_alone, shell_alone.peak_mib);
    row("DuckDB, bare window sums, two threads", few, &bare, bare.peak_mib);
    let over = |of: u64, cost: &Cost, by: &Cost| 100.0 * (each(of, cost) / each(few, by) - 1.0);
    let overheads: Vec<String> = clusters
        .iter()
        .map(|(n, of, cost, _)| {
            format!("{:+.0} % with {n}", over(*of, cost, if *n == 1 { &shell_alone } else { &shell }))
        })
        .collect();
    let most = clusters.iter().map(|(.., peak)| *peak).fold(0.0, f64::max);
    let driver = clusters.iter().map(|(_, _, cost, _)| cost.peak_mib).fold(0.0, f64::max);
    let _ = writeln!(
        page,
        "\n**Time of a unit over that of the loop on as many cores: {:+.0} % on two threads, {:+.0} % on one; on the cluster {} (asked: none; at most 5 %). \
         {:.2} of the time of DuckDB's bare sums (asked: at most 1.2). Largest executor {most:.1} MiB (asked: under {MOST_MIB}), the driver {driver:.1}.**",
        over(units, &two, &shell),
        over(few, &one, &shell_alone),
        overheads.join(", "),
        each(units, &two) / each(few, &bare)
    );
    Ok(())
}

/// A folder with the first units of another one, by links.
fn part_of(folder: &Path, units: u64) -> Result<String> {
    let part = folder.with_extension("part");
    let _ = fs::remove_dir_all(&part);
    fs::create_dir_all(&part)?;
    for unit in 0..units {
        let name = format!("RLG-{unit:05}");
        std::os::unix::fs::symlink(folder.join(&name), part.join(&name))?;
    }
    Ok(part.display().to_string())
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
