//! A fleet: next to a shell loop of the program, next to DuckDB's bare window sums, and memory over units.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result};
use sagnac_sim::{LaggedChamber, Leg};
use xtask::shell::{root, sh_in};

use crate::measures::bench::process::{Cost, Pairs, measure, median};
use crate::measures::bench::{Bench, line};

/// Heading of the section.
pub(super) const HEADING: &str = "\n## A fleet\n\n";
/// Units whose logs are made, and units of the manifest that names each of them so often.
const UNITS: u64 = 40;
const ALIASES: u64 = 10;
const PAIRS: usize = 5;
pub(super) const RUNS: u64 = 2;
const AXES: [char; 3] = ['x', 'y', 'z'];
/// Soak of a cycle of ten hours, s.
const SOAK_S: f64 = 11_400.0;
pub(super) const MODEL: &str = "bias 3, rate 0";

/// The bare sums of windows of 100 s, of every log.
const DUCKDB: &str = "import sys, duckdb
duckdb.sql('SET threads = 2')
for log in open(sys.argv[1]).read().split():
    duckdb.sql(f'''SELECT CAST(floor((time_s - 1) / 100) AS INT) AS w, count(*), avg(temperature_c), sum(counts_x), sum(counts_y), sum(counts_z)
                   FROM read_csv('{log}') GROUP BY w ORDER BY w''').fetchnumpy()
";

/// Units a second, memory, ratios.
pub(super) fn measure_fleet(bench: &Bench, page: &mut String) -> Result<()> {
    let bytes = logs(bench)?;
    let folder = bench.file("fleet").display().to_string();
    let out = format!("{folder}-out");
    let fleet = |source: &str, threads: &str| on_threads(bench, source, threads, MODEL, &out);
    let shell = by_shell(bench, &folder);
    let duckdb = by_duckdb(bench, &bench.file("fleet-logs.txt"))?;
    let shell_loops = [alone(shell.clone()), shell.clone()];
    let two = Pairs::run(PAIRS, &fleet(&folder, "2"), &shell)?;
    let one = Pairs::run(PAIRS, &alone(fleet(&folder, "1")), &shell_loops[0])?;
    let bare = Pairs::run(PAIRS, &fleet(&folder, "2"), &duckdb)?;
    let many = measure(&fleet(&bench.file("fleet-many.csv").display().to_string(), "2"))?;
    let auto = measure(&on_threads(bench, &folder, "2", "auto", &out))?;
    let clusters = on_clusters(bench, &folder, &shell_loops)?;
    *page += HEADING;
    let _ = write!(
        page,
        "{UNITS} units of three axes and {RUNS} runs of ten hours at 1 Hz each: {} logs, {:.0} MB of CSV, `--model \"{MODEL}\"`. The loop is a shell's over \
         `sagnac calibrate`; DuckDB sums the windows of the same logs and fits nothing.\n\n| | median, s | peak, MiB |\n|---|---|---|\n",
        UNITS * RUNS,
        bytes as f64 / 1e6
    );
    line(page, "`fleet calibrate --threads 2`", &two.ours());
    line(page, "the loop, two cores", &two.theirs());
    line(page, "`fleet calibrate --threads 1`, one core", &one.ours());
    line(page, "the loop, one core", &one.theirs());
    line(page, "DuckDB, bare window sums", &bare.theirs());
    line(page, &format!("`fleet calibrate --threads 2`, {} units of the same logs", UNITS * ALIASES), &many);
    line(page, "`fleet calibrate --threads 2 --model auto`", &auto);
    for Cluster { executors, cores, pairs, peak_mib } in &clusters {
        let cost = Cost { peak_mib: *peak_mib, ..pairs.ours() };
        line(page, &format!("`sagnac-fleet`, {executors} on {cores}; peak of an executor"), &cost);
    }
    let rate = |seconds: f64, units: u64| units as f64 / seconds;
    let _ = writeln!(
        page,
        "\n**{:.1} units a second on two cores, {:.1} on one; {:.2} and {:.2} times as fast as the loop, pair by pair; {:.2} times the time of DuckDB's bare sums** (asked: no \
         slower than the loop, 1.2). {} units take {:.1} a second with {:.1} MiB instead of {:.1}.",
        rate(two.ours().seconds, UNITS),
        rate(one.ours().seconds, UNITS),
        median(&two.ratios()),
        median(&one.ratios()),
        1.0 / median(&bare.ratios()),
        UNITS * ALIASES,
        rate(many.seconds, UNITS * ALIASES),
        many.peak_mib,
        two.ours().peak_mib
    );
    let over: Vec<String> = clusters
        .iter()
        .map(|cluster| {
            format!("{:+.0} % with {}", 100.0 * (1.0 / median(&cluster.pairs.ratios()) - 1.0), cluster.executors)
        })
        .collect();
    let _ = writeln!(
        page,
        "\n**On a cluster of this machine: time over that of the loop on as many cores, pair by pair: {}** (asked: at most 5 % more; executors under 256 MiB).",
        over.join(", ")
    );
    Ok(())
}

/// A cluster that was measured.
struct Cluster {
    executors: String,
    cores: &'static str,
    pairs: Pairs,
    peak_mib: f64,
}

/// A process that ends with this.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A scheduler and executors on this machine, which end with this.
pub(super) struct Started {
    _scheduler: Running,
    executors: Vec<Running>,
    /// Where units are sent.
    pub(super) at: String,
}

impl Started {
    /// The executors have so many slots each; all are on the first core, or on every one.
    pub(super) fn new(program: &str, executors: usize, slots: usize, one_core: bool) -> Result<Self> {
        let start = |args: &[&str]| -> Result<Running> {
            let mut command = if one_core { Command::new("taskset") } else { Command::new(program) };
            if one_core {
                command.args(["-c", "0", program]);
            }
            let child = command.args(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
            Ok(Running(child.with_context(|| format!("cannot start {program}"))?))
        };
        let port = 50_150 + 20 * executors;
        let at = format!("127.0.0.1:{port}");
        let scheduler = start(&["scheduler", "--port", &port.to_string()])?;
        let executors = (1..=executors)
            .map(|number| {
                let own = (port + 2 * number).to_string();
                start(&["executor", "--scheduler", &at, "--port", &own, "--slots", &slots.to_string()])
            })
            .collect::<Result<_>>()?;
        Ok(Self { _scheduler: scheduler, executors, at })
    }

    /// The largest resident set of an executor so far, MiB.
    pub(super) fn peak_mib(&self) -> Result<f64> {
        let peaks = self.executors.iter().map(|executor| peak_mib(executor.0.id())).collect::<Result<Vec<_>>>()?;
        Ok(peaks.into_iter().fold(0.0, f64::max))
    }
}

/// Builds the program of the cluster; where it is.
pub(super) fn cluster_program() -> Result<String> {
    sh_in(&root().join("fleet"), "cargo", &["build", "--release", "--locked"], &[])?;
    Ok(root().join("fleet/target/release/sagnac-fleet").display().to_string())
}

/// The command that calibrates a folder of units on a cluster, all of them.
pub(super) fn on_cluster(bench: &Bench, program: &str, folder: &str, at: &str) -> Result<Vec<String>> {
    let setup = bench.file("fleet-bench.toml");
    fs::write(&setup, "arcsec_per_count = 0.15125\n")?;
    let words =
        ["calibrate", folder, "--again", "--model", MODEL, "--cluster", &format!("df://{at}")].map(str::to_owned);
    let more = ["--setup", &setup.display().to_string(), "-o", &format!("{folder}-cluster")].map(str::to_owned);
    Ok(std::iter::once(program.to_owned()).chain(words).chain(more).collect())
}

/// The command that calibrates a folder of units on threads of this machine, all of them.
pub(super) fn on_threads(bench: &Bench, source: &str, threads: &str, model: &str, to: &str) -> Vec<String> {
    let words = ["fleet", "calibrate", source, "--again", "--arcsec-per-count", "0.15125", "--model", model];
    let more = ["--threads", threads, "-o", to].map(str::to_owned);
    std::iter::once(bench.sagnac.clone()).chain(words.map(str::to_owned)).chain(more).collect()
}

/// The same by a shell that calls the program for each unit.
pub(super) fn by_shell(bench: &Bench, folder: &str) -> Vec<String> {
    let program = &bench.sagnac;
    let script = format!(
        "for u in {folder}/*; do {program} calibrate $u/*.csv --arcsec-per-count 0.15125 --model '{MODEL}' --serial $(basename $u) -o {folder}-loop.json; done"
    );
    ["sh", "-c", &script].map(str::to_owned).into()
}

/// The bare window sums by DuckDB of the logs that a file lists.
pub(super) fn by_duckdb(bench: &Bench, listed: &Path) -> Result<Vec<String>> {
    let sums = bench.file("duckdb_window_sums.py");
    fs::write(&sums, DUCKDB)?;
    Ok([bench.python.clone(), sums.display().to_string(), listed.display().to_string()].into())
}

/// One executor on one core, and one, two and four slots in two executors on two, next to the loop on the same cores.
fn on_clusters(bench: &Bench, folder: &str, loops: &[Vec<String>; 2]) -> Result<Vec<Cluster>> {
    let program = cluster_program()?;
    let mut measured = Vec::new();
    for (executors, slots, one_core) in [(1, 1, true), (2, 1, false), (4, 1, false)] {
        let running = Started::new(&program, executors, slots, one_core)?;
        let of_cluster = on_cluster(bench, &program, folder, &running.at)?;
        let ours = if one_core { alone(of_cluster) } else { of_cluster };
        let pairs = Pairs::run(PAIRS, &ours, &loops[usize::from(!one_core)])?;
        measured.push(Cluster {
            executors: if executors == 1 { "1 executor".to_owned() } else { format!("{executors} executors") },
            cores: if one_core { "one core" } else { "two cores" },
            pairs,
            peak_mib: running.peak_mib()?,
        });
    }
    Ok(measured)
}

/// A command on the first core alone.
pub(super) fn alone(of: Vec<String>) -> Vec<String> {
    ["taskset", "-c", "0"].map(str::to_owned).into_iter().chain(of).collect()
}

/// The largest resident set of a process so far: proc(5).
fn peak_mib(process: u32) -> Result<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).context("a process that has ended")?;
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    Ok(peak.context("no peak")? / 1024.0)
}

/// Makes the logs and the manifest of many; their bytes.
fn logs(bench: &Bench) -> Result<u64> {
    let folder = bench.file("fleet");
    let (mut bytes, mut list, mut manifest) = (0, String::new(), "unit,run\n".to_owned());
    for unit in 0..UNITS {
        let own = folder.join(format!("RLG-{unit:03}"));
        fs::create_dir_all(&own)?;
        for run in 0..RUNS {
            let path = own.join(format!("run-{run}.csv"));
            if !path.exists() {
                fs::write(&path, log(unit, run)?)?;
            }
            bytes += fs::metadata(&path)?.len();
            let _ = writeln!(list, "{}", path.display());
            for alias in 0..ALIASES {
                let _ = writeln!(manifest, "RLG-{unit:03}-{alias},{}", path.strip_prefix(&bench.folder)?.display());
            }
        }
    }
    fs::write(bench.file("fleet-logs.txt"), list)?;
    fs::write(bench.file("fleet-many.csv"), manifest)?;
    Ok(bytes)
}

/// A run of a unit: three axes with curves of their own, at the temperatures of one block.
fn log(unit: u64, run: u64) -> Result<Vec<u8>> {
    let drift_dph = |axis: u64| {
        let step = 0.001 * ((unit * 7 + axis * 3) % 11) as f64;
        vec![0.01, 0.004 + step, -0.012 + step, 0.014]
    };
    log_of([0, 1, 2].map(drift_dph), 1000 * unit + 10 * run)
}

/// A run of three axes with these drifts in powers of u, °/h: ten hours of a cycle at 1 Hz.
pub(super) fn log_of(drifts: [Vec<f64>; 3], seed: u64) -> Result<Vec<u8>> {
    let legs = vec![Leg::Soak(SOAK_S), Leg::Ramp(70.0, 1.0), Leg::Soak(SOAK_S), Leg::Ramp(-40.0, 1.0)];
    let axis = |(at, drift_dph)| {
        let chamber = LaggedChamber { legs: legs.clone(), drift_dph, ..LaggedChamber::domain_notes() };
        chamber.run(seed + at)
    };
    let mut rows: Vec<_> = (0..).zip(drifts).map(axis).collect();
    let mut out = Vec::new();
    writeln!(out, "time_s,temperature_c,{}", AXES.map(|axis| format!("counts_{axis}")).join(","))?;
    while let Some(first) = rows[0].next() {
        write!(out, "{},{},{}", first.time_s, first.temperature_c, first.counts)?;
        for other in &mut rows[1..] {
            write!(out, ",{}", other.next().context("axes of unequal length")?.counts)?;
        }
        writeln!(out)?;
    }
    Ok(out)
}
