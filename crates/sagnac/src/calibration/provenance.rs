//! Where a record comes from: program, time and logs. No clock: the same input gives the same bytes.

use crate::window::Windows;
use sagnac_log::ingest::{LogSummary, share_rows};
use sagnac_noise::Trace;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where a record comes from. No clock: the same input gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Time of the newest input sample in the log's own time, s, or SOURCE_DATE_EPOCH.
    pub time_s: f64,
    /// Which of the two.
    pub time_source: String,
    /// The logs.
    pub inputs: Vec<LogFile>,
    /// Noise of their rows; absent where they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_trace: Option<NoiseTrace>,
}

/// Noise of the first axis over all training logs, one after the other, by which rows that were resampled, averaged, or changed one by one
/// are recognised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct NoiseTrace {
    /// Length of a part of the time, s.
    pub part_s: f64,
    /// Differences between the sums of neighbouring parts, a character each: a fifth of their median size a step; `.` where rows are missing.
    pub differences: String,
}

impl NoiseTrace {
    /// Of the rows behind some windows.
    pub(crate) fn of(windows: &Windows) -> Option<Self> {
        let (part_s, differences) = windows.trace.text()?;
        Some(Self { part_s, differences })
    }

    pub(crate) fn trace(&self) -> Option<Trace> {
        Trace::of_text(self.part_s, &self.differences)
    }
}

/// Name and version of this program.
pub fn program() -> String {
    format!("sagnac {}", env!("CARGO_PKG_VERSION"))
}

/// One log file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogFile {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Rows read.
    pub rows: u64,
    /// In the record of a calibration: 64 hashes of 64 rows each and 64 of 12, by which a copy in other bytes is recognised; the rows
    /// cannot be had from them. Empty for a log that says too little.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub rows_sketch: String,
}

impl LogFile {
    /// Of a log that was read.
    pub(crate) fn of(summary: &LogSummary) -> Self {
        Self {
            file: sagnac_units::format::file_name(&summary.file),
            sha256: summary.sha256.clone(),
            rows: summary.rows,
            rows_sketch: summary.rows_sketch.clone(),
        }
    }

    /// Without the hashes of its rows: for results, which nothing is compared with later.
    pub(crate) fn named(self) -> Self {
        Self { rows_sketch: String::new(), ..self }
    }

    /// The same bytes, or for a part the same rows.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.sha256 == other.sha256 || share_rows(&[&self.rows_sketch], &[&other.rows_sketch])
    }
}

/// The logs behind some windows.
pub(crate) fn log_files(windows: &Windows) -> Vec<LogFile> {
    let mut files: Vec<LogFile> = Vec::new();
    for file in windows.runs.iter().flat_map(|run| &run.files).map(|file| LogFile::of(&file.summary)) {
        // Runs of one file, whose clock starts again within it.
        match files.last_mut().filter(|last| last.sha256 == file.sha256) {
            Some(last) => *last = LogFile { rows: last.rows + file.rows, ..file },
            None => files.push(file),
        }
    }
    files
}
