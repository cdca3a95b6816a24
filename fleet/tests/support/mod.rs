//! A factory of simulated units and a cluster of real processes on this machine's loopback.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use sagnac_sim::rigs::{PaperRig, csv_bytes};
use tempfile::TempDir;

/// How long something may take that takes seconds.
const PATIENCE: Duration = Duration::from_secs(120);
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_sagnac-fleet");
/// The setup of every unit.
const SETUP: &str = "arcsec_per_count = 1.059\nquantum = 0.25\ninput_rate_dph = 4.5\n";

/// Waits until something is so.
#[track_caller]
pub(crate) fn until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "waited for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Units in a folder of their own.
pub(crate) struct Factory(TempDir);

impl Factory {
    /// So many units with two runs and a retest each, and one whose log is broken.
    pub(crate) fn new(units: u64) -> Self {
        let it = Self(tempfile::tempdir().unwrap());
        it.write("bench.toml", SETUP.as_bytes());
        for unit in 0..units {
            for (name, run) in [("run-1", 1), ("run-2", 2), ("retest/run-3", 3)] {
                let mut log = csv_bytes(PaperRig::PAPER.run(unit * 10 + run));
                if unit == 1 {
                    // A row that is none: records and proofs name its place.
                    let middle = log.len() / 2 + log[log.len() / 2..].iter().position(|byte| *byte == b'\n').unwrap();
                    log.splice(middle..middle, *b"\nno,row,here");
                }
                it.write(&format!("units/RLG-{unit}/{name}.csv"), &log);
            }
        }
        it.write("units/RLG-99/run-1.parquet", b"PAR1 and no more");
        it
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    /// `sagnac-fleet calibrate` of a source into a folder.
    pub(crate) fn command(&self, source: &str, folder: &str, more: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.current_dir(self.0.path()).args(["calibrate", source, "--setup", "bench.toml", "-o", folder]);
        command.args(["--limits", "paper"]).args(more);
        command
    }

    /// The same, ended: status, standard output, standard error.
    pub(crate) fn calibrate(&self, source: &str, folder: &str, more: &[&str]) -> (i32, String, String) {
        said(self.command(source, folder, more).output().unwrap())
    }

    /// Every file of a folder of results but its lock.
    pub(crate) fn files(&self, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut all = BTreeMap::new();
        let mut folders = vec![self.path(folder)];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    folders.push(path);
                } else if entry.file_name() != "lock" {
                    all.insert(
                        path.strip_prefix(self.0.path()).unwrap().iter().skip(1).collect(),
                        fs::read(path).unwrap(),
                    );
                }
            }
        }
        all
    }

    /// Results of units that are there.
    pub(crate) fn done(&self, folder: &str) -> usize {
        let is_result = |entry: &fs::DirEntry| entry.path().extension().is_some_and(|ending| ending == "json");
        fs::read_dir(self.path(folder).join("units")).map_or(0, |all| all.flatten().filter(is_result).count())
    }
}

pub(crate) fn said(output: Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
}

/// A process that ends with the test.
pub(crate) struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    pub(crate) fn start(command: &mut Command, log: PathBuf) -> Self {
        let file = File::create(&log).unwrap();
        let child = command.stdout(file.try_clone().unwrap()).stderr(file).stdin(Stdio::null()).spawn().unwrap();
        Self { child, log }
    }

    pub(crate) fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    pub(crate) fn log(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// So many free ports that follow each other.
pub(crate) fn free_ports(count: u16) -> u16 {
    for _ in 0..1000 {
        let first = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let Some(last) = first.checked_add(count - 1) else { continue };
        if (first..=last).map(|port| TcpListener::bind(("127.0.0.1", port))).all(|bound| bound.is_ok()) {
            return first;
        }
    }
    panic!("no {count} free ports in a row");
}

pub(crate) fn answers(port: u16) -> bool {
    TcpStream::connect(("127.0.0.1", port)).is_ok()
}

/// A scheduler and its executors.
pub(crate) struct Cluster {
    folder: TempDir,
    port: u16,
    scheduler: Option<Process>,
    executors: Vec<Process>,
    environment: Vec<(String, String)>,
}

impl Cluster {
    pub(crate) fn new(executors: usize) -> Self {
        Self::with(executors, &[])
    }

    /// With an environment of the executors.
    pub(crate) fn with(executors: usize, environment: &[(String, String)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let environment = environment.to_vec();
        let mut it = Self { folder, port: free_ports(1), scheduler: None, executors: Vec::new(), environment };
        it.start_scheduler();
        (0..executors).for_each(|_| it.add_executor());
        it
    }

    pub(crate) fn url(&self) -> String {
        format!("df://127.0.0.1:{}", self.port)
    }

    /// A scheduler at the cluster's port: a second one knows nothing of the first.
    pub(crate) fn start_scheduler(&mut self) {
        let mut command = Command::new(PROGRAM);
        command.args(["scheduler", "--port", &self.port.to_string()]);
        self.scheduler = Some(Process::start(&mut command, self.folder.path().join("scheduler.log")));
        until("the scheduler", || answers(self.port));
    }

    pub(crate) fn kill_scheduler(&mut self) {
        self.scheduler = None;
        until("the scheduler's end", || !answers(self.port));
    }

    pub(crate) fn add_executor(&mut self) {
        let number = self.executors.len();
        let port = free_ports(2);
        let mut command = Command::new(PROGRAM);
        command.args(["executor", "--slots", "1", "--scheduler", &format!("127.0.0.1:{}", self.port)]);
        command.args(["--port", &port.to_string()]).arg("--work").arg(self.work(number));
        command.args(["--store-patience", "20", "--store-silence", "2"]);
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        fs::create_dir(self.work(number)).unwrap();
        let log = self.folder.path().join(format!("executor-{number}.log"));
        self.executors.push(Process::start(&mut command, log));
        until("the executor", || answers(port));
    }

    pub(crate) fn executors(&self) -> usize {
        self.executors.len()
    }

    fn work(&self, executor: usize) -> PathBuf {
        self.folder.path().join(format!("work-{executor}"))
    }

    /// An executor has answers of units in its folder.
    pub(crate) fn has_answers(&self, executor: usize) -> bool {
        has_file(&self.work(executor))
    }

    pub(crate) fn kill_executor(&mut self, executor: usize) {
        self.executors[executor].kill();
    }

    /// What its processes said, for a test that fails.
    pub(crate) fn logs(&self) -> String {
        self.scheduler.iter().chain(&self.executors).map(Process::log).collect::<Vec<_>>().join("\n")
    }
}

fn has_file(folder: &Path) -> bool {
    fs::read_dir(folder).is_ok_and(|all| all.flatten().any(|entry| entry.path().is_file() || has_file(&entry.path())))
}
