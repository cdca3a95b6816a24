//! The bench recording, checked against the input of the chamber and the values of the host.

use std::fs::File;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use sagnac_board::Row;
use sagnac_log::ingest::column_numbers;

use super::units::{CODES_PER_C, WINDOW};
use crate::program::Program;

/// Columns of a recording, a value for each frame.
pub(super) struct Record {
    /// Counts before the correction.
    pub(super) counts: Vec<f64>,
    /// What the slow update at the end of the frame read, °C.
    pub(super) temperature_c: Vec<f64>,
    /// Counts as the target corrected them.
    pub(super) target: Vec<f64>,
    sequence: Vec<f64>,
}

impl Record {
    /// Reads a recording.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let column = |name: &str| column(path, name).with_context(|| format!("{}: {name}", path.display()));
        Ok(Self {
            counts: column("counts_z")?,
            temperature_c: column("temperature_c")?,
            target: column("target_counts")?,
            sequence: column("sequence")?,
        })
    }

    /// Every row that was fed is a frame of the recording, with its counts and what the slow update at its end read: its own code. The
    /// last one, behind which nothing was read, has that of its beginning. No frame is missing.
    pub(super) fn holds_what_was_fed(&self, fed: &[Row]) -> Result<i64> {
        ensure!(
            self.counts.len() == fed.len(),
            "{} frames are recorded, {} rows were fed",
            self.counts.len(),
            fed.len()
        );
        let in_order = (0_u32..).zip(&self.sequence).all(|(number, sequence)| f64::from(number) == *sequence);
        ensure!(in_order, "a frame is missing or twice");
        let before_last = fed.iter().rev().skip(1).take(1);
        let read = fed.iter().take(fed.len().saturating_sub(1)).chain(before_last);
        let rows = self.counts.iter().zip(&self.temperature_c).zip(fed.iter().zip(read)).zip(1_u32..);
        for (((counts, celsius), (row, read)), second) in rows {
            let code = celsius * CODES_PER_C;
            ensure!(
                *counts == f64::from(row.counts) && code == f64::from(read.codes[0]),
                "second {second}: {counts} counts at {celsius} °C are recorded, {row:?} was fed"
            );
        }
        Ok(fed.iter().map(|row| i64::from(row.counts)).sum())
    }

    /// The target's corrected counts are, in every frame, those of `sagnac compensate` with this image on the recorded log.
    pub(super) fn is_as_compensated(&self, work: &Path, image: &str, setup: &str, name: &str) -> Result<usize> {
        let (log, corrected) = (format!("{name}.parquet"), format!("{name}-corrected.csv"));
        let compensate = ["compensate", image, &log, "--setup", setup, "-o", &corrected];
        Program::beside_the_lab()?.stdout_in(work, &compensate)?;
        let host = compensated(&work.join(&corrected))?;
        ensure!(host.len() == self.target.len(), "{} rows of the host, {} frames", host.len(), self.target.len());
        let first = host.iter().zip(&self.target).position(|(host, target)| host != target);
        let Some(at) = first else { return Ok(host.len()) };
        let (host, target) = (host.get(at), self.target.get(at));
        bail!("{name}, second {}: the target's corrected counts are {target:?}, the host's {host:?}", at + 1)
    }

    /// What `sagnac verify` computes of the recorded raw counts (`after`: figures of counts per window) is what the target's own counts give.
    pub(super) fn is_as_verified(&self, after: &serde_json::Value) -> Result<usize> {
        ensure!(self.target.len().is_multiple_of(WINDOW), "{} s are not whole windows", self.target.len());
        let windows: Vec<f64> = self.target.chunks(WINDOW).map(|window| window.iter().sum()).collect();
        let number = |name: &str| after[name].as_f64().with_context(|| format!("no {name} in the proof"));
        let n = windows.len() as f64;
        let mean = windows.iter().sum::<f64>() / n;
        let sigma = (windows.iter().map(|window| (window - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let [lo, hi] = [windows.iter().copied().reduce(f64::min), windows.iter().copied().reduce(f64::max)];
        let whole = number("n")? == n && Some(number("min")?) == lo && Some(number("max")?) == hi;
        let near = |name: &str, own: f64| Ok::<_, anyhow::Error>((number(name)? - own).abs() <= ROUNDING * own.abs());
        let equal = whole && near("mean", mean)? && near("sigma", sigma)?;
        ensure!(equal, "verify has {after}, the target's counts {n} windows, {lo:?} to {hi:?}, mean {mean}, σ {sigma}");
        Ok(windows.len())
    }
}

/// Relative error of a mean and of a σ that are summed in another order.
const ROUNDING: f64 = 1e-12;

/// The corrected counts of a corrected log.
fn compensated(path: &Path) -> Result<Vec<f64>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().context("no header")?;
    let place = header.split(',').position(|name| name == "compensated_counts_z");
    let place = place.with_context(|| format!("no corrected counts in {header}"))?;
    lines.map(|line| Ok(line.split(',').nth(place).context("a short row")?.parse()?)).collect()
}

/// A column of a Parquet file.
fn column(path: &Path, name: &str) -> Result<Vec<f64>> {
    let mut values = Vec::new();
    for batch in ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?.build()? {
        let batch = batch?;
        let column = batch.column_by_name(name).context("no such column")?;
        values.extend(column_numbers(column).context("no numbers")?);
    }
    Ok(values)
}
