//! `sagnac compensate`: a log in, the same log corrected out, row by row.
//!
//! The first line is a stamp by which Sagnac knows its own output; the count or rate columns are
//! renamed `compensated_…` and a `status` column is added. Rows that could not be read have no
//! corrected value and are left out (and counted).

use std::io::Write;

use sagnac_core::Status;

use crate::error::{Error, Result};
use crate::ingest::header::COMPENSATED_PREFIX;
use crate::ingest::{AngleUnit, COMPENSATED_STAMP, LogReader, LogSummary};
use crate::setup::Setup;
use crate::units::s_from_ns;
use crate::verify::{Correction, Replay};

/// Corrects a log as it is read; what was read.
///
/// # Errors
/// What the reader or the replay says; a failed write.
pub fn compensate(
    correction: &Correction,
    log: &mut LogReader,
    setup: &Setup,
    out: &mut dyn Write,
) -> Result<LogSummary> {
    let shape = log.shape().clone();
    let file = log.summary().file;
    let (images, sensor) = correction.fit_to(&shape, setup).map_err(|e| e.file(&file))?;
    let mut replay = Replay::new(&images, &shape, sensor, &file)?;
    let (columns, units) = (log.axis_columns(), log.rate_units());
    writeln!(out, "{COMPENSATED_STAMP}: serial {}, images {}", correction.serial(), correction.sha256())
        .map_err(unwritten)?;
    let mut csv = csv::WriterBuilder::new().delimiter(log.delimiter()).from_writer(out);
    let headers = log.headers().iter().enumerate().map(|(index, header)| {
        if columns.contains(&index) { format!("{COMPENSATED_PREFIX}{header}") } else { header.clone() }
    });
    csv.write_record(headers.chain(std::iter::once("status".to_owned()))).map_err(|e| unwritten(e.into()))?;
    csv.flush().map_err(unwritten)?;
    while let Some(batch) = log.next_batch()? {
        let corrected = replay.correct(batch)?;
        for (row, fields) in batch.fields.iter().enumerate() {
            let duration_s = s_from_ns(batch.end_ns[row] - batch.start_ns[row]);
            for (index, field) in fields.iter().enumerate() {
                match columns.iter().position(|column| *column == index) {
                    Some(axis) => {
                        let angle = corrected.angle[axis][row];
                        csv.write_field(value_text(angle, shape.unit, units[axis], duration_s))
                    }
                    None => csv.write_field(field),
                }
                .map_err(|e| unwritten(e.into()))?;
            }
            let status = corrected.status.iter().fold(Status::OK, |all, axis| all | axis[row]);
            csv.write_field(status_text(status)).map_err(|e| unwritten(e.into()))?;
            csv.write_record(None::<&[u8]>).map_err(|e| unwritten(e.into()))?;
        }
        csv.flush().map_err(unwritten)?;
    }
    Ok(log.summary())
}

fn unwritten(error: std::io::Error) -> Error {
    Error::io("output", "write", &error)
}

/// The corrected value in the column's own unit.
fn value_text(angle: f64, unit: AngleUnit, rate_unit: Option<f64>, duration_s: f64) -> String {
    match unit {
        AngleUnit::Quanta { quantum, .. } => {
            let decimals = quantum.to_string().split_once('.').map_or(0, |(_, fraction)| fraction.len());
            format!("{:.decimals$}", angle * quantum)
        }
        AngleUnit::Arcsec => (angle / duration_s / rate_unit.unwrap_or(1.0)).to_string(),
    }
}

/// Names of the bits, joined by `|`; `OK` for none.
pub fn status_text(status: Status) -> String {
    let names: Vec<&str> =
        Status::NAMES.iter().filter(|(bit, _)| status.contains(*bit)).map(|(_, name)| *name).collect();
    if names.is_empty() { "OK".to_owned() } else { names.join("|") }
}
