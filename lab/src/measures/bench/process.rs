//! Whole processes: wall clock and the largest resident set, by GNU time.

use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use xtask::shell::root;

/// Cost of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    pub(super) seconds: f64,
    pub(super) peak_mib: f64,
}

impl Cost {
    /// Median time, largest peak.
    pub(super) fn median_of(costs: &[Self]) -> Self {
        let seconds: Vec<f64> = costs.iter().map(|c| c.seconds).collect();
        Self { seconds: median(&seconds), peak_mib: costs.iter().map(|c| c.peak_mib).fold(0.0, f64::max) }
    }
}

/// Runs a command and discards its output.
pub(super) fn measure(command: &[String]) -> Result<Cost> {
    let started = Instant::now();
    let output = Command::new("/usr/bin/time")
        .args(["-f", "peak %M"])
        .args(command)
        .current_dir(root())
        .stdout(Stdio::null())
        .output()
        .context("cannot start /usr/bin/time; on Debian: apt-get install time")?;
    let seconds = started.elapsed().as_secs_f64();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(output.status.success(), "{}: {stderr}", command.join(" "));
    let peak = stderr.lines().rev().find_map(|line| line.strip_prefix("peak ")?.parse::<f64>().ok());
    Ok(Cost { seconds, peak_mib: peak.context("no peak")? / 1024.0 })
}

/// Output of a command.
pub(super) fn output(program: &str, args: &[&str]) -> Result<String> {
    let output = Command::new(program).args(args).output().with_context(|| format!("cannot start {program}"))?;
    ensure!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8(output.stdout)?)
}

pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { f64::midpoint(sorted[middle - 1], sorted[middle]) }
}

/// Two commands in turn.
pub(super) struct Pairs(Vec<(Cost, Cost)>);

impl Pairs {
    /// One pair to warm the file cache, then `count` measured pairs.
    pub(super) fn run(count: usize, ours: &[String], theirs: &[String]) -> Result<Self> {
        let mut pairs = Vec::new();
        for number in 0..=count {
            let pair = (measure(ours)?, measure(theirs)?);
            println!("ours {:.2} s, theirs {:.2} s", pair.0.seconds, pair.1.seconds);
            if number > 0 {
                pairs.push(pair);
            }
        }
        Ok(Self(pairs))
    }

    pub(super) fn ratios(&self) -> Vec<f64> {
        self.0.iter().map(|(ours, theirs)| theirs.seconds / ours.seconds).collect()
    }

    pub(super) fn ours(&self) -> Cost {
        Cost::median_of(&self.0.iter().map(|pair| pair.0).collect::<Vec<_>>())
    }

    pub(super) fn theirs(&self) -> Cost {
        Cost::median_of(&self.0.iter().map(|pair| pair.1).collect::<Vec<_>>())
    }
}
