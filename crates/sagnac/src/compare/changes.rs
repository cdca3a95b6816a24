//! Differences between two records apart from their values: model, setup, data, program.
//!
//! A change of a value means something else when the model or the setup changed with it, so that these are said first.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::calibration::{AxisCalibration, Calibration};
use sagnac_units::format::{celsius, significant};

/// One thing that is otherwise than in the first record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Change {
    /// Record, from 1: the others are compared with the first.
    pub record: usize,
    /// `model`, `setup`, `data` or `program`.
    pub kind: String,
    /// What: an axis's model, a key of the setup, the span.
    pub what: String,
    /// In the first record.
    pub from: String,
    /// In this record.
    pub to: String,
}

impl Change {
    /// The change in words.
    pub fn words(&self) -> String {
        format!("{}, {}: {} → {}", self.kind, self.what, self.from, self.to)
    }
}

/// Everything in which a record differs from the first.
pub(super) fn changes(records: &[(String, Calibration)]) -> Vec<Change> {
    let Some(((_, first), others)) = records.split_first() else { return Vec::new() };
    let mut all = Vec::new();
    for (index, (_, other)) in others.iter().enumerate() {
        let mut put = |kind: &str, what: &str, from: String, to: String| {
            if from != to {
                let [kind, what] = [kind, what].map(str::to_owned);
                all.push(Change { record: index + 1, kind, what, from, to });
            }
        };
        for (a, b) in first.axes.iter().filter_map(|a| Some((a, other.axes.iter().find(|b| b.axis == a.axis)?))) {
            let model = |axis: &AxisCalibration| format!("`{}`", axis.correction.model);
            put("model", &format!("axis {}", a.axis), model(a), model(b));
        }
        for key in keys_of(&first.setup).union(&keys_of(&other.setup)) {
            put("setup", key, setting(&first.setup, key), setting(&other.setup, key));
        }
        let window = |record: &Calibration| format!("{} s", significant(record.window_s, 5));
        put("setup", "window", window(first), window(other));
        for (a, b) in first.axes.iter().filter_map(|a| Some((a, other.axes.iter().find(|b| b.axis == a.axis)?))) {
            put("data", &format!("axis {}", a.axis), data(a, first), data(b, other));
        }
        put("program", "version", first.provenance.program.clone(), other.provenance.program.clone());
    }
    all
}

/// The keys of a setup, without those whose change is of the data or shown elsewhere.
fn keys_of(setup: &impl Serialize) -> BTreeSet<String> {
    const ELSEWHERE: [&str; 2] = ["window", "noise"];
    let value = serde_json::to_value(setup).unwrap_or_default();
    let keys = value.as_object().into_iter().flat_map(|object| object.keys().cloned());
    keys.filter(|key| !ELSEWHERE.contains(&key.as_str())).collect()
}

/// A setting as it stands in the record.
fn setting(setup: &impl Serialize, key: &str) -> String {
    match serde_json::to_value(setup).unwrap_or_default().get(key) {
        None | Some(Value::Null) => "not set".to_owned(),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    }
}

/// The data of an axis: logs, windows, span.
fn data(axis: &AxisCalibration, record: &Calibration) -> String {
    let logs = record.provenance.inputs.len();
    let [lo, hi] = axis.span_c().map(celsius);
    let windows = axis.residual().map_or(0, |residual| residual.n);
    format!("{logs} log{}, {windows} windows, {lo} … {hi} °C", if logs == 1 { "" } else { "s" })
}
