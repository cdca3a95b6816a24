//! `cargo xtask formats`: files of other programs, converted by the commands that `sagnac` prints when it refuses them.
//!
//! ```text
//! a chamber log ─▶ scipy, h5py, npTDMS, asammdf … ─▶ file ─▶ sagnac refuses it and prints a command ─▶ CSV ─┐
//!       │                                             └──▶ the script of docs/how-to/other-tools.md ─▶ Parquet ─┤
//!       └──────────────────────────────▶ sagnac calibrate ─▶ record ◀── equal? ──▶ record ◀── sagnac calibrate ─┘
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use xtask::debian::{self, need};
use xtask::shell::{output, root, sh, stdout_of, target, text};

use crate::places::{CHAMBER, FLEET_TABLE, OTHER_TOOLS};
use crate::program::Program;

const MAKE: &str = include_str!("make.py");
/// The packages, in the versions that docs/how-to/other-tools.md names, and what reads the table of a fleet.
const PACKAGES: [&str; 11] = [
    "numpy==2.4.6",
    "pandas==3.1.0",
    "pyarrow==26.0.0",
    "scipy==1.17.1",
    "h5py==3.16.0",
    "npTDMS==1.13.0",
    "asammdf==8.8.28",
    "pymavlink==2.4.50",
    "openpyxl==3.1.5",
    "polars==2.1.0",
    "duckdb==2.0.0",
];

/// A file of another program.
struct Foreign {
    folder: &'static str,
    file: &'static str,
    /// What the refusal calls it.
    name: &'static str,
    /// What to name in the command, as the refusal says it, and the name in this file.
    own: Option<(&'static str, &'static str, &'static str)>,
    /// What the setup says of its columns.
    columns: &'static str,
    /// Which of the how-to's scripts is for it.
    script: Option<usize>,
}

const FILES: [Foreign; 8] = [
    Foreign { folder: "matlab-5", file: "log.mat", name: "MATLAB 5", own: None, columns: MATLAB, script: Some(0) },
    Foreign { folder: "matlab-7.3", file: "log.mat", name: "MATLAB 7.3", own: None, columns: MATLAB, script: Some(1) },
    Foreign { folder: "hdf5", file: "log.h5", name: "HDF5", own: None, columns: "", script: None },
    Foreign {
        folder: "tdms",
        file: "log.tdms",
        name: "NI TDMS",
        own: None,
        columns: "Time = \"time_s\"\nT_Block = \"temperature_c\"\nCounts = \"counts\"",
        script: Some(2),
    },
    Foreign {
        folder: "ardupilot",
        file: "log.bin",
        name: "ArduPilot DataFlash",
        own: None,
        columns: "",
        script: Some(3),
    },
    Foreign {
        folder: "mdf",
        file: "log.mf4",
        name: "ASAM MDF",
        own: Some(("the gyro's channel for 'counts'", "'counts'", "'GyroCounts'")),
        columns: "BlockTemp = \"temperature_c\"\nGyroCounts = \"counts\"",
        script: Some(4),
    },
    Foreign {
        folder: "excel",
        file: "log.xlsx",
        name: "a zip archive, such as Excel's",
        own: None,
        columns: "",
        script: None,
    },
    Foreign {
        folder: "sqlite",
        file: "log.db",
        name: "SQLite",
        own: Some(("your table for log", "FROM log", "FROM cycle_1")),
        columns: "",
        script: None,
    },
];
const MATLAB: &str = "t = \"time_s\"\nT = \"temperature_c\"";

/// Setups: of the chamber's log as it is, and with the columns of the file.
const PLAIN: &str = "plain.toml";
const MAPPED: &str = "mapped.toml";

/// Every file, by its printed command and by its script.
pub(crate) fn formats() -> Result<()> {
    need(debian::FORMATS)?;
    let folder = target().join("formats");
    let bench = Bench { program: Program::beside_the_lab()?, bin: packages(&folder)?, folder };
    bench.make()?;
    let page = fs::read_to_string(root().join(OTHER_TOOLS))?;
    let scripts = scripts(&page);
    let wanted = FILES.iter().filter(|file| file.script.is_some()).count();
    ensure!(scripts.len() == wanted, "{OTHER_TOOLS} has {} scripts of Python instead of {wanted}", scripts.len());
    for file in &FILES {
        bench.check(file, file.script.and_then(|at| scripts.get(at)).copied())?;
    }
    bench.fleet()
}

/// The chamber's setup, its input rate as that of z: some of the files hold three axes.
fn setup() -> Result<String> {
    let bench = fs::read_to_string(root().join(CHAMBER).join("bench.toml"))?;
    let (before, rest) = bench.split_once("\ninput_rate_dph = ").context("the chamber's setup states no input rate")?;
    let (value, rest) = rest.split_once('\n').context("the chamber's setup ends in its input rate")?;
    Ok(format!("{before}\ninput_rate_dph = {{ z = {value} }}\n{rest}"))
}

/// A Python environment with the packages; the folder of its programs.
fn packages(folder: &Path) -> Result<PathBuf> {
    let venv = folder.join("venv");
    let bin = venv.join("bin");
    if !bin.join("python3").exists() {
        sh("python3", &["-m", "venv", text(&venv)?])?;
    }
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    sh(text(&bin.join("python3"))?, &[&install[..], &PACKAGES].concat())?;
    Ok(bin)
}

/// The blocks of Python on a page, in their order.
fn scripts(page: &str) -> Vec<&str> {
    let blocks = page.split("```python\n").skip(1);
    blocks.filter_map(|block| Some(block.split_once("\n```")?.0)).collect()
}

/// Where the files are, and what runs on them.
struct Bench {
    program: Program,
    bin: PathBuf,
    folder: PathBuf,
}

impl Bench {
    /// Writes the files again.
    fn make(&self) -> Result<()> {
        for file in &FILES {
            let folder = self.folder.join(file.folder);
            if folder.exists() {
                fs::remove_dir_all(&folder)?;
            }
        }
        let log = root().join(CHAMBER).join("cycle-1.csv.gz");
        self.python(&self.folder, MAKE, &[text(&log)?, text(&self.folder)?])?;
        Ok(())
    }

    /// Refused by its name; converted, it gives the record of the plain log.
    fn check(&self, file: &Foreign, script: Option<&str>) -> Result<()> {
        let folder = self.folder.join(file.folder);
        let bench = setup()?;
        fs::write(folder.join(PLAIN), &bench)?;
        fs::write(folder.join(MAPPED), format!("{bench}\n[columns]\n{}\n", file.columns))?;
        let own = folder.join("plain.csv");
        let plain = if own.exists() { own } else { root().join(CHAMBER).join("cycle-1.csv.gz") };
        let wanted = self.record(&folder, text(&plain)?, PLAIN)?;
        let command = self.command(&folder, file)?;
        let shell = format!("export PATH='{}':\"$PATH\"; {command}", text(&self.bin)?);
        stdout_of(300, "sh", &["-c", &shell], &folder).with_context(|| format!("the command of {}", file.name))?;
        let converted = self.record(&folder, &format!("{}.csv", file.file), MAPPED)?;
        ensure!(converted == wanted, "{}: the record of the converted file is another\n{command}", file.name);
        if let Some(script) = script {
            self.python(&folder, script, &[])?;
            let converted = self.record(&folder, "log.parquet", PLAIN)?;
            ensure!(converted == wanted, "{}: the record after the script of {OTHER_TOOLS} is another", file.name);
        }
        let by_script = if script.is_some() { " and by the script" } else { "" };
        println!("check: formats: {}: refused, and the same record by the printed command{by_script}", file.name);
        Ok(())
    }

    /// The table of a fleet, by the scripts of its page.
    fn fleet(&self) -> Result<()> {
        let folder = self.folder.join("fleet");
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        for unit in 1..=2 {
            let own = folder.join(format!("units/RLG-{unit}"));
            fs::create_dir_all(&own)?;
            fs::copy(root().join(CHAMBER).join(format!("cycle-{unit}.csv.gz")), own.join("run.csv.gz"))?;
        }
        let bench = fs::read_to_string(root().join(CHAMBER).join("bench.toml"))?;
        let shared: Vec<&str> = bench.lines().filter(|line| !line.starts_with("serial")).collect();
        fs::write(folder.join(PLAIN), shared.join("\n"))?;
        self.program.stdout_in(&folder, &["fleet", "calibrate", "units", "--setup", PLAIN, "-o", "."])?;
        let page = fs::read_to_string(root().join(FLEET_TABLE))?;
        let scripts = scripts(&page);
        ensure!(scripts.len() == 2, "{FLEET_TABLE} has {} scripts of Python instead of 2", scripts.len());
        for (script, wanted) in scripts.iter().zip(["2", "RLG-2"]) {
            let said = self.python(&folder, script, &[])?;
            ensure!(said.contains(wanted), "{FLEET_TABLE}: no {wanted} in what the script printed:\n{said}");
        }
        println!("check: formats: the table of a fleet: read by the page's scripts, with DuckDB and polars");
        Ok(())
    }

    /// The command that the refusals of `inspect` and `calibrate` print.
    fn command(&self, folder: &Path, file: &Foreign) -> Result<String> {
        let command = self.refused(folder, &["inspect", file.file], file)?;
        let calibrate = ["calibrate", file.file, "--setup", MAPPED, "-o", "none.cal.json"];
        ensure!(self.refused(folder, &calibrate, file)? == command, "{}: two commands", file.name);
        Ok(command)
    }

    fn refused(&self, folder: &Path, args: &[&str], file: &Foreign) -> Result<String> {
        let name = file.name;
        let refusal = output(60, text(self.program.path())?, args, folder)?;
        let said = String::from_utf8_lossy(&refusal.stderr).into_owned();
        ensure!(refusal.status.code() == Some(2), "{}: {} instead of 2", args.join(" "), refusal.status);
        ensure!(said.contains(&format!("this is {name}, ")), "{name} is not named in: {said}");
        let with = file.own.map_or(String::new(), |(words, ..)| format!(", with {words}"));
        let before = format!("help: convert it{with}: ");
        let command = said.lines().find_map(|line| line.trim_start().strip_prefix(&before));
        let command = command.with_context(|| format!("no command in: {said}"))?;
        Ok(file.own.map_or(command.to_owned(), |(_, from, to)| command.replace(from, to)))
    }

    /// What `calibrate` finds, without what belongs to the file: its name, hash and columns.
    fn record(&self, folder: &Path, log: &str, setup: &str) -> Result<Value> {
        let out = "made.cal.json";
        self.program.stdout_in(folder, &["calibrate", log, "--setup", setup, "-o", out])?;
        let mut record: Value = serde_json::from_slice(&fs::read(folder.join(out))?)?;
        let whole = record.as_object_mut().context("a record is an object")?;
        whole.remove("provenance").context("no provenance")?;
        ensure!(whole.get("axes").is_some_and(|axes| axes.is_array()), "a record without axes");
        let setup = whole.get_mut("setup").and_then(Value::as_object_mut).context("no setup")?;
        setup.remove("columns").context("no columns")?;
        Ok(record)
    }

    /// What a script prints.
    fn python(&self, folder: &Path, script: &str, args: &[&str]) -> Result<String> {
        let python = self.bin.join("python3");
        stdout_of(300, text(&python)?, &[&["-c", script], args].concat(), folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_are_the_blocks_of_python() {
        let page = "a\n```python\nx = 1\ny = 2\n```\nb\n```sh\nls\n```\n```python\nz\n```\n";
        assert_eq!(scripts(page), ["x = 1\ny = 2", "z"]);
    }
}
