//! `cargo xtask bench`: times whole processes in alternating pairs, for docs/explanation/performance.md and its plot.
//!
//! ```text
//! logs (made once in target/bench) ─▶ ours, peer, ours, peer … ─▶ medians and ratios ─▶ docs/explanation/performance.md
//! ```
//!
//! Times depend on the machine that the page names; the targets are on the ratios.

mod deviations;
mod fleet;
mod fleet_scale;
mod live;
mod logs;
mod plot;
mod process;
mod python;
mod simulator;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use xtask::shell::{root, sh};

use crate::measures::bench::logs::{csv_log, parquet_log};
use crate::measures::bench::process::{Cost, Pairs, measure, median};
use crate::places::{PERFORMANCE, PERFORMANCE_PLOT};

const PAIRS: usize = 7;
/// Lengths of the plot, rows.
const LENGTHS: [u64; 5] = [1_000_000, 3_000_000, 10_000_000, 30_000_000, 100_000_000];

/// The same task with other tools, as a user would write it from their documentation.
const PANDAS: &str = "import sys, numpy as np, pandas as pd
log = pd.read_csv(sys.argv[1])
t = log['temperature_c'].to_numpy()
y = log['counts'].to_numpy(dtype=float)
fit = np.polynomial.chebyshev.Chebyshev.fit(t, y, 3)
print(fit.coef, (y - fit(t)).std())
";
const POLARS_CSV: &str = "import sys, numpy as np, polars as pl
log = pl.read_csv(sys.argv[1])
t = log['temperature_c'].to_numpy()
y = log['counts'].to_numpy().astype(float)
fit = np.polynomial.chebyshev.Chebyshev.fit(t, y, 3)
print(fit.coef, (y - fit(t)).std())
";
const DUCKDB: &str = "import sys, numpy as np, duckdb
log = duckdb.read_csv(sys.argv[1]).fetchnumpy()
t = log['temperature_c']
y = log['counts'].astype(float)
fit = np.polynomial.chebyshev.Chebyshev.fit(t, y, 3)
print(fit.coef, (y - fit(t)).std())
";
const POLARS: &str = "import sys, polars as pl
log = pl.read_parquet(sys.argv[1])
print(log.shape, log['counts'].sum())
";

/// By `perf` on the 10-million-row CSV; updated by hand.
const WHERE_THE_TIME_GOES: &str = "
The targets are missed. Of about 0.7 s of processor time on two cores a quarter goes to
fields; a sixth to SHA-256; an eighth to the kernel, most of it copies of the file; a quarter to checks, the sketch of the rows, sums and
Allan deviations; a fifth to the fit with its noise and nuisance models, which the others do not do. Even times and repeated temperatures
are recognised by their text, without reading digits; fields are read column by column; stretches without faults are not copied; windows are
summed on another thread than rows are checked. SHA-256 of the file and a fit of its windows alone take 0.16 s and 0.2 s of
processor time. The other programs vary by two between runs: page faults of 1.6 to 1.9 GB. Three runs of this section one after the other gave
7.1, 6.1, 8.6, then 6.1, 7.4, 8.3, then 5.9, 6.4, 8.5 times (pandas, polars, duckdb); one on the same day before fields were read by column
3.8, 4.8, 4.1 times.
";

/// Read the same CSV and fit it with numpy.
const CSV_PEERS: [(&str, &str); 3] = [("pandas", PANDAS), ("polars", POLARS_CSV), ("duckdb", DUCKDB)];

const CSV_HEADING: &str = "\n## CSV of 10 million rows";

struct Bench {
    sagnac: String,
    python: String,
    folder: PathBuf,
}

/// Runs everything (about ten minutes, 4 GB of disk), or one part (`csv`, `simulator`, `allan`, `fleet`, `fleet-scale`, `python`, `live`) and replaces its section.
pub(crate) fn bench(part: Option<&str>) -> Result<()> {
    sh("cargo", &["build", "--release", "--locked", "--package", "sagnac-cli"])?;
    let folder = root().join("target/bench");
    fs::create_dir_all(&folder)?;
    let bench = Bench { sagnac: "target/release/sagnac".to_owned(), python: peers(&folder)?, folder };
    match part {
        Some("csv") => return section_only(&bench, CSV_HEADING, Bench::against_readers),
        Some("simulator") => return section_only(&bench, simulator::HEADING, simulator::measure),
        Some("allan") => return section_only(&bench, deviations::HEADING, deviations::measure),
        Some("fleet") => return section_only(&bench, fleet::HEADING, fleet::measure_fleet),
        Some("python") => return section_only(&bench, python::HEADING, python::measure),
        // An hour each: only by name.
        Some("fleet-scale") => return section_only(&bench, fleet_scale::HEADING, fleet_scale::measure_scale),
        Some("live") => return section_only(&bench, live::HEADING, live::measure),
        Some(other) => {
            bail!("no part {other} of the bench; there are csv, simulator, allan, fleet, fleet-scale, python and live")
        }
        None => {}
    }
    let mut page = head(&bench)?;
    bench.against_readers(&mut page)?;
    bench.against_polars(&mut page)?;
    bench.lengths(&mut page)?;
    bench.ticks(&mut page)?;
    bench.verification(&mut page)?;
    deviations::measure(&bench, &mut page)?;
    simulator::measure(&bench, &mut page)?;
    fleet::measure_fleet(&bench, &mut page)?;
    python::measure(&bench, &mut page)?;
    fs::write(root().join(PERFORMANCE), &page)?;
    println!("{page}\nwrote {PERFORMANCE}");
    Ok(())
}

/// Measures one section and replaces it on the page, or appends it.
fn section_only(bench: &Bench, heading: &str, measure: impl Fn(&Bench, &mut String) -> Result<()>) -> Result<()> {
    let path = root().join(PERFORMANCE);
    let page = fs::read_to_string(&path)?;
    let (before, after) = match page.split_once(heading) {
        Some((before, section)) => (before, section.find("\n## ").map_or("", |next| &section[next..])),
        None => (page.as_str(), ""),
    };
    let mut made = before.to_owned();
    measure(bench, &mut made)?;
    fs::write(&path, made + after)?;
    println!("wrote {PERFORMANCE}");
    Ok(())
}

/// A Python environment with the other tools, made once.
pub(crate) fn peers(folder: &Path) -> Result<String> {
    let venv = folder.join("venv");
    let python = venv.join("bin/python").display().to_string();
    if !Path::new(&python).exists() {
        sh("python3", &["-m", "venv", &venv.display().to_string()])?;
    }
    sh(
        &python,
        &["-m", "pip", "install", "--quiet", "numpy", "pandas", "polars", "duckdb", "allantools", "scikit-learn"],
    )?;
    for (name, script) in CSV_PEERS {
        fs::write(folder.join(format!("{name}_csv_peer.py")), script)?;
    }
    fs::write(folder.join("polars_peer.py"), POLARS)?;
    Ok(python)
}

fn head(bench: &Bench) -> Result<String> {
    let versions = "import numpy, pandas, polars, duckdb, sys; print(f'Python {sys.version.split()[0]}, numpy {numpy.__version__}, \
                    pandas {pandas.__version__}, polars {polars.__version__}, DuckDB {duckdb.__version__}')";
    let peers = process::output(&bench.python, &["-c", versions])?;
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|l| l.strip_prefix("model name\t: ")).unwrap_or("unknown processor").to_owned();
    let cores = std::thread::available_parallelism()?;
    let rust = process::output("rustc", &["--version"])?;
    Ok(format!(
        "# Performance\n\nMade by `cargo xtask bench`; do not edit. Times are of whole processes by the wall clock, medians; the \
         programs of a pair run in turn. Peaks are the largest resident sets.\n\nMachine: {model}, {cores} cores, shared; {}. Peers: {}.\n",
        rust.trim(),
        peers.trim()
    ))
}

fn line(page: &mut String, name: &str, cost: &Cost) {
    // Writing to a String cannot fail.
    let _ = writeln!(page, "| {name} | {:.2} | {:.1} |", cost.seconds, cost.peak_mib);
}

fn pair(page: &mut String, ours: &str, theirs: &str, pairs: &Pairs) {
    *page += "| | median, s | peak, MiB |\n|---|---|---|\n";
    line(page, ours, &pairs.ours());
    line(page, theirs, &pairs.theirs());
    let all: Vec<String> = pairs.ratios().iter().map(|r| format!("{r:.1}")).collect();
    let _ = writeln!(
        page,
        "\n**{:.1} times faster**: the median of {} pairs ({}).",
        median(&pairs.ratios()),
        all.len(),
        all.join(", ")
    );
}

impl Bench {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn calibrate(&self, log: &Path) -> Vec<String> {
        let out = self.file("unit.cal.json").display().to_string();
        let flags = ["--arcsec-per-count", logs::ARCSEC_PER_COUNT, "--serial", "BENCH", "-o", &out];
        let log = log.display().to_string();
        let command = [&[self.sagnac.as_str(), "calibrate", &log][..], &flags].concat();
        command.into_iter().map(str::to_owned).collect()
    }

    fn peer(&self, script: &str, log: &Path) -> Vec<String> {
        [self.python.clone(), self.file(script).display().to_string(), log.display().to_string()].into()
    }

    /// Next to what others read CSV with, each in pairs of the same run.
    fn against_readers(&self, page: &mut String) -> Result<()> {
        let log = csv_log(&self.folder, 10_000_000, 100)?;
        let _ = write!(
            page,
            "{CSV_HEADING}\n\nColumns `time_s,temperature_c,counts` at 100 Hz (27.8 h). Sagnac reads, hashes and checks the rows, sums windows, \
             fits 45 candidates × 24 τ × 12 folds, estimates the covariance and writes JSON. The others read the file on all cores and do a \
             Chebyshev fit of order 3 and its residual with numpy. Target: 10 times faster than pandas, 8 times faster than the best of the \
             others, under 32 MiB.\n\n| | median, s | peak, MiB | times as long as Sagnac, pair by pair | median |\n|---|---|---|---|---|\n"
        );
        let mut ours = Vec::new();
        for (name, _) in CSV_PEERS {
            let pairs = Pairs::run(PAIRS, &self.calibrate(&log), &self.peer(&format!("{name}_csv_peer.py"), &log))?;
            let (cost, ratios) = (pairs.theirs(), pairs.ratios());
            let each: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.1}")).collect();
            let (each, median) = (each.join(", "), median(&ratios));
            let _ = writeln!(
                page,
                "| {name} and numpy | {:.2} | {:.0} | {each} | **{median:.1}** |",
                cost.seconds, cost.peak_mib
            );
            ours.push(pairs.ours());
        }
        let ours = Cost::median_of(&ours);
        let _ = writeln!(page, "| `sagnac calibrate`, model auto | {:.2} | {:.1} | | |", ours.seconds, ours.peak_mib);
        *page += WHERE_THE_TIME_GOES;
        Ok(())
    }

    fn against_polars(&self, page: &mut String) -> Result<()> {
        let log = parquet_log(&self.folder, 10_000_000, 100)?;
        let pairs = Pairs::run(PAIRS, &self.calibrate(&log), &self.peer("polars_peer.py", &log))?;
        *page += "\n## Parquet of the same rows\n\nSagnac does all of the above; polars only reads the file. Target: no slower.\n\n";
        pair(page, "`sagnac calibrate`, model auto", "polars, read only", &pairs);
        Ok(())
    }

    /// The same test with increasing numbers of rows, and one that lasts ten times longer.
    fn lengths(&self, page: &mut String) -> Result<()> {
        *page += "\n## Time and memory against length\n\nLogs at 1 kHz of 17 minutes to 27.8 hours. Memory depends on the number of windows \
                  (about 20 kB per hour of test), not on the number of rows.\n\n![Time and memory against length](performance.svg)\n\n";
        *page += "| rows | seconds | peak, MiB |\n|---|---|---|\n";
        let mut points = Vec::new();
        for rows in LENGTHS {
            let log = csv_log(&self.folder, rows, 1000)?;
            let cost = median_cost(&self.calibrate(&log))?;
            line(page, &format!("{} million at 1 kHz", rows / 1_000_000), &cost);
            points.push((rows as f64, cost));
        }
        let long = csv_log(&self.folder, 100_000_000, 100)?;
        let cost = median_cost(&self.calibrate(&long))?;
        line(page, "100 million at 100 Hz (11.6 days)", &cost);
        plot::draw(&root().join(PERFORMANCE_PLOT), &points)
    }

    /// Only the compensator, with the image of the calibration just made.
    fn ticks(&self, page: &mut String) -> Result<()> {
        let (record, image) = (self.file("unit.cal.json"), self.file("unit.img"));
        let (record, image) = (record.display().to_string(), image.display().to_string());
        process::output(&self.sagnac, &["export", &record, "--to", "image", "-o", &image])?;
        let example =
            ["run", "--quiet", "--release", "--locked", "-p", "sagnac-core", "--example", "ticks", "--", &image];
        let stdout = process::output("cargo", &example)?;
        let _ = writeln!(
            page,
            "\n## A tick of the compensator\n\n864 million ticks (24 h at 100 µs), one call per tick, with a slow update every second. \
             Fastest of three runs: **{}**. Target: 1.5.",
            stdout.trim()
        );
        Ok(())
    }

    fn verification(&self, page: &mut String) -> Result<()> {
        let log = csv_log(&self.folder, 8_640_000, 100)?;
        let log_text = log.display().to_string();
        let record = self.file("unit.cal.json").display().to_string();
        let words = |command: &[&str]| -> Vec<String> { command.iter().map(|word| (*word).to_owned()).collect() };
        let table = self.file("w.parquet").display().to_string();
        let flags = ["--arcsec-per-count", logs::ARCSEC_PER_COUNT, "--windows", &table];
        let verify = median_cost(&words(&[&self.sagnac, "verify", &record, &log_text]))?;
        let window = median_cost(&words(&[&[self.sagnac.as_str(), "inspect", &log_text][..], &flags].concat()))?;
        let bytes = median_cost(&words(&["sha256sum", &log_text]))?;
        *page += "\n## A retest of 24 hours\n\nA log at 100 Hz, replayed end to end at the tick of 100 µs, compared with only reading it.\n\n";
        *page += "| | median, s | peak, MiB |\n|---|---|---|\n";
        line(page, "`sagnac verify`: read, check, 864 million ticks, figures", &verify);
        line(page, "`sagnac inspect --windows`: read, check, sum, survey", &window);
        line(page, "`sha256sum` of the file", &bytes);
        Ok(())
    }
}

fn median_cost(command: &[String]) -> Result<Cost> {
    let costs: Result<Vec<Cost>> = (0..3).map(|_| measure(command)).collect();
    Ok(Cost::median_of(&costs?))
}
