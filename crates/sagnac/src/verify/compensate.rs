//! `sagnac compensate`: a log in, the same log corrected out, row by row.
//!
//! The first line is a stamp by which Sagnac knows its own output; the count or rate columns are
//! renamed `compensated_…` (`compensated_…_increment` where the log holds running totals: what comes
//! out is the row's own counts) and a `status` column is added. Rows that could not be read have no
//! corrected value and are left out (and counted).

use std::io::Write;

use sagnac_core::Status;

use crate::error::{Error, Result};
use crate::ingest::header::COMPENSATED_PREFIX;
use crate::ingest::{AngleUnit, COMPENSATED_STAMP, LogReader, LogSummary, unquoted};
use crate::setup::{Counter, Setup};
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
    let suffix = if setup.counter == Counter::Cumulative { "_increment" } else { "" };
    let headers = log.headers().iter().enumerate().map(|(index, header)| {
        if columns.contains(&index) { format!("{COMPENSATED_PREFIX}{header}{suffix}") } else { header.clone() }
    });
    csv.write_record(headers.chain(std::iter::once("status".to_owned()))).map_err(|e| unwritten(e.into()))?;
    csv.flush().map_err(unwritten)?;
    let comma_is_decimal = log.delimiter() != b',';
    while let Some(batch) = log.next_batch()? {
        let corrected = replay.correct(batch)?;
        for (row, fields) in batch.fields.iter().enumerate() {
            let duration_s = s_from_ns(batch.end_ns[row] - batch.start_ns[row]);
            let decimal_comma = comma_is_decimal && fields.iter().any(|field| field.contains(&b','));
            let value = |axis: usize| {
                let text = value_text(corrected.angle[axis][row], shape.unit, units[axis], duration_s);
                if decimal_comma { text.replace('.', ",") } else { text }
            };
            let status = corrected.status.iter().fold(Status::OK, |all, axis| all | axis[row]);
            let cells = fields.iter().enumerate().map(|(index, field)| {
                let axis = columns.iter().position(|column| *column == index);
                axis.map_or_else(|| unquoted(field).to_vec(), |axis| value(axis).into_bytes())
            });
            csv.write_record(cells.chain(std::iter::once(status_text(status).into_bytes())))
                .map_err(|e| unwritten(e.into()))?;
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
