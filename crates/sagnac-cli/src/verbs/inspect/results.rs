//! `sagnac inspect` of what this program writes and does not read as a log: results, tables, messages, keys, sources, reports.

use std::path::Path;

#[cfg(feature = "full")]
use sagnac::fleet::table_summary;
use sagnac::fleet::{Prior, UnitResult};
use sagnac::verify::{Judged, Limits, Verification};
use sagnac::{Error, Result};
use sagnac_board::Message;
use sagnac_board::frame::FrameReader;
use sagnac_log::ingest::COMPENSATED_STAMP;
use sagnac_log::read::read_text;
use sagnac_log::setup::Setup;
use sagnac_loops::{LoopTable, TABLE_MAGIC};
use sagnac_sim::Scenario;
use sagnac_units::format::counted;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::files::loading;
use crate::output::console::Console;

/// Longest result that is read whole.
const MOST_BYTES: u64 = 16 << 20;
/// First lines of tables in text, and what they are.
const TABLES: [(&str, &str); 4] = [
    ("tau_s,adev_dph", "an Allan curve; `sagnac allan` reads it"),
    ("sequence,tick,time_s,counts,raw,status", "output frames of a gyro, of `sagnac line read`"),
    ("time_s,true_", "the truth of a simulated test"),
    ("frequency_hz,", "the response of a loop, of `sagnac simulate --bode`"),
];

/// Output of `inspect --json` for such a file.
#[derive(Serialize)]
struct ResultObject {
    kind: &'static str,
    what: String,
}

fn said(kind: &'static str, what: String, console: &mut Console) -> Result<bool> {
    console.say(&what);
    console.object(&ResultObject { kind, what })?;
    Ok(true)
}

/// The keys that distinguish results. The others are not kept.
#[derive(Deserialize)]
struct Peek {
    image_sha256: Option<IgnoredAny>,
    record_sha256: Option<IgnoredAny>,
    serial: Option<String>,
    program: Option<String>,
    records: Option<Vec<IgnoredAny>>,
    shared_logs: Option<IgnoredAny>,
    detrended: Option<IgnoredAny>,
    inputs: Option<Vec<IgnoredAny>>,
    axes: Option<Vec<PeekAxis>>,
    kind: Option<String>,
    outcome: Option<IgnoredAny>,
    refused: Option<bool>,
    reason: Option<String>,
}

#[derive(Deserialize)]
struct PeekAxis {
    points: Option<IgnoredAny>,
}

/// A result as JSON; false for a calibration, or JSON of another program.
pub(super) fn json(path: &Path, console: &mut Console) -> Result<bool> {
    let Ok(text) = read_text(path, "read the file", MOST_BYTES) else { return Ok(false) };
    let Ok(peek) = serde_json::from_str::<Peek>(&text) else { return Ok(false) };
    let axes = peek.axes.unwrap_or_default();
    let serial = peek.serial.unwrap_or_default();
    if peek.image_sha256.is_some() && peek.record_sha256.is_some() {
        let proof: Verification = serde_json::from_str(&text).map_err(|e| {
            Error::input(
                format!("not a whole verification: {e}"),
                "write it again: sagnac verify unit.cal.json retest.csv --json",
            )
            .file(path.display().to_string())
        })?;
        return said("verification", verification(&proof), console);
    }
    if let (Some(records), Some(_)) = (&peek.records, peek.shared_logs) {
        let what = format!("a comparison of {} calibrations of {serial}", records.len());
        return said("comparison", what, console);
    }
    if let (Some(_), Some(inputs), Some(program)) = (peek.detrended, &peek.inputs, peek.program) {
        let (axes, logs) = (counted(axes.len(), "axis", "axes"), counted(inputs.len(), "log", "logs"));
        return said("noise_budget", format!("a noise budget of {axes} from {logs}, by {program}"), console);
    }
    if peek.outcome.is_some()
        && let Ok(unit) = serde_json::from_str::<UnitResult>(&text)
    {
        let what = format!("what `sagnac fleet calibrate` found of {}: {}", unit.unit, unit.words());
        return said("fleet_unit", what, console);
    }
    if let Ok(prior) = Prior::from_json(&text) {
        let what = format!(
            "a prior of a fleet for `{}`, of {} axes; `sagnac fleet prior` merges it",
            prior.model, prior.fleet.axes
        );
        return said("fleet_prior", what, console);
    }
    if let Some(kind) = peek.kind {
        return said("inspection", format!("what `sagnac inspect` said of a {kind}"), console);
    }
    if let (Some(_), Some(reason)) = (peek.refused, peek.reason) {
        return said("refusal", format!("an error of this program: {reason}"), console);
    }
    if axes.first().is_some_and(|axis| axis.points.is_some()) {
        return said("evaluation", "a correction evaluated at temperatures, of `sagnac evaluate`".to_owned(), console);
    }
    Ok(false)
}

/// A log that `compensate` wrote, with what its first line says of it.
pub(super) fn compensated(stamp: Option<&str>, console: &mut Console) -> Result<()> {
    let origin = stamp.map_or(String::new(), |stamp| format!(" ({})", stamp.trim_start_matches(':').trim()));
    let what = format!("a compensated log{origin}: calibrating it or correcting it again would be wrong twice");
    said("compensated_log", what, console).map(|_| ())
}

/// Windows of a log, as text or Parquet.
pub(super) fn windows(console: &mut Console) -> Result<()> {
    said("table", "windows of a log, to look at, of `sagnac inspect --windows`".to_owned(), console).map(|_| ())
}

/// Serial number, and per axis how it was judged.
fn verification(proof: &Verification) -> String {
    let axis = |axis: &sagnac::verify::AxisVerification| match axis.pass {
        Some(true) => format!("axis {}: {}", axis.axis, Judged::of(&axis.limits).words()),
        Some(false) => format!("axis {}: NOT ACCEPTED, {}", axis.axis, Judged::of(&axis.limits).words()),
        None => format!("axis {}: no limits", axis.axis),
    };
    let axes: Vec<String> = proof.axes.iter().map(axis).collect();
    let against = proof.limits.as_ref().map_or(String::new(), |limits| format!(" against {}", limits.name));
    let verdict = if proof.passed() { "" } else { "; NOT ACCEPTED" };
    format!("a verification of {}{against}, by {}: {}{verdict}", proof.serial, proof.program, axes.join("; "))
}

/// Says what a file is that is no log; false where it may be one.
pub(super) fn recognised(path: &Path, console: &mut Console) -> Result<bool> {
    if loading::is_pipe(path) {
        return Ok(false);
    }
    let start = loading::first_bytes(path)?;
    #[cfg(feature = "full")]
    if start.starts_with(b"PAR1")
        && let Some(table) = table_summary(path)?
    {
        let (units, rows) = (counted(table.units, "unit", "units"), counted(table.rows, "row", "rows"));
        let what =
            format!("a fleet of {units}, {} calibrated, in {rows}; any reader of Parquet opens it", table.calibrated);
        return said("fleet_table", what, console);
    }
    if start.starts_with(&TABLE_MAGIC) {
        return loop_table(path, console);
    }
    if start.starts_with(b"SG") {
        return messages(path, console);
    }
    let text = String::from_utf8_lossy(&start);
    let first = text.lines().next().unwrap_or_default().trim().to_owned();
    if text.starts_with("<!DOCTYPE html") && text.contains("<title>") {
        let title = text.split("<title>").nth(1).and_then(|rest| rest.split("</title>").next()).unwrap_or_default();
        return said("report", format!("a report: {title}; open it in a browser"), console);
    }
    for (mark, kind, what) in [
        ("-----BEGIN PRIVATE KEY-----", "private_key", "a private key: keep it secret; `sagnac key` signs with it"),
        ("-----BEGIN PUBLIC KEY-----", "public_key", "a public key; `sagnac key verify` checks images with it"),
    ] {
        if first == mark {
            return said(kind, what.to_owned(), console);
        }
    }
    if let Some(of) = first.strip_prefix(COMPENSATED_STAMP) {
        return compensated(Some(of), console).map(|()| true);
    }
    if let Some((_, what)) = TABLES.iter().find(|(head, _)| first.starts_with(head)) {
        return said("table", (*what).to_owned(), console);
    }
    if loading::has_extension(path, "toml") {
        return toml(path, console);
    }
    let source = ["c", "h", "v", "hex", "md"].iter().any(|extension| loading::has_extension(path, extension));
    let source = (source || path.file_name().is_some_and(|name| name == "Makefile")) && text.contains("sagnac");
    if source || text.contains("Made by `sagnac") {
        let title = first.trim_start_matches(['/', '*', '#', ' ']).trim_end_matches(['/', '*', ' ']);
        return said("export", format!("made by `sagnac export`: {title}"), console);
    }
    Ok(false)
}

fn loop_table(path: &Path, console: &mut Console) -> Result<bool> {
    let bytes = loading::image_bytes_of(path)?;
    let refused = |e: String| {
        Error::input(format!("not a usable table of the loops: {e}"), "copy the table again from its source")
            .file(path.display().to_string())
    };
    let table = LoopTable::decode(&bytes).map_err(|e| refused(e.to_string()))?;
    said("loop_table", format!("a table of the control loops for a tick of {} ns", table.tick_ns), console)
}

/// Frames of the serial line: an upload, or what a gyro sent.
fn messages(path: &Path, console: &mut Console) -> Result<bool> {
    let bytes = std::fs::read(path).map_err(|e| Error::io_path(path, "read", &e))?;
    let mut reader = FrameReader::new();
    let frames: Vec<_> = bytes.iter().filter_map(|byte| reader.push(*byte)).collect();
    let all: Vec<Message> = frames.iter().filter_map(Message::parse).collect();
    let count = |is: fn(&Message) -> bool| all.iter().filter(|message| is(message)).count();
    if all.is_empty() {
        return Ok(false);
    }
    let parts = [
        (count(|m| matches!(m, Message::Output(_))), "output frame", "output frames"),
        (count(|m| matches!(m, Message::Reply(_))), "reply", "replies"),
        (count(|m| matches!(m, Message::Piece(_))), "piece of an image", "pieces of an image"),
        (count(|m| matches!(m, Message::Commit(_))), "commit", "commits"),
    ];
    let rest = all.len() - parts.iter().map(|(n, ..)| n).sum::<usize>();
    let parts = parts.into_iter().chain([(rest, "other", "others")]).filter(|(n, ..)| *n > 0);
    let named: Vec<String> = parts.map(|(n, one, more)| counted(n, one, more)).collect();
    said(
        "messages",
        format!("messages of a gyro's serial line: {}; `sagnac line read` reads them", named.join(", ")),
        console,
    )
}

/// A setup, limits or a scenario. One of another kind, or with a mistake, is a setup that cannot be read.
fn toml(path: &Path, console: &mut Console) -> Result<bool> {
    let text = read_text(path, "read the file", 1 << 20)?;
    if Limits::parse(&text).is_ok() {
        return said("limits", "limits of an acceptance, for `sagnac verify --limits`".to_owned(), console);
    }
    if Scenario::from_toml(&text).is_ok() {
        return said("scenario", "a scenario, for `sagnac simulate`".to_owned(), console);
    }
    let setup = Setup::read(path)?;
    let owner = setup.serial.map_or(String::new(), |serial| format!(" of {serial}"));
    said("setup", format!("a setup{owner}, for --setup"), console)
}
