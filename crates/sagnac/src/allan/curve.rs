//! A bare curve from a file: τ and σ of an Allan deviation that another program computed.
//!
//! Columns `tau_s` and `adev_dph`, `adev_dps` or `adev_radps`, with `_x`, `_y`, `_z` for several axes; others are not
//! read. The curve that `sagnac allan -o` writes is one.

use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_noise::{AxisBudget, BareCurve, budget_of_curve};
use sagnac_units::format::file_name;
use sagnac_units::{DPH_PER_DPS, DPH_PER_RADPS};

use crate::allan::read::{NoiseBudget, misfit_text};
use crate::calibration::{LogFile, program};

/// Header of τ.
const TAU: &str = "tau_s";
/// Recognised headers of a deviation, and their unit in °/h.
const DEVIATIONS: [(&str, f64); 3] = [("adev_dph", 1.0), ("adev_dps", DPH_PER_DPS), ("adev_radps", DPH_PER_RADPS)];
/// Largest number of points.
const MAX_BYTES: u64 = 16 << 20;

/// A byte order mark, as spreadsheets write it.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// True for text whose first line, but for comments, names τ and a deviation.
pub fn is_curve(start: &[u8]) -> bool {
    let start = start.strip_prefix(BOM).unwrap_or(start);
    let mut lines = start.split(|byte| matches!(byte, b'\n' | b'\r'));
    let line = lines.find(|line| !line.is_empty() && !line.starts_with(b"#")).unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    let mut fields = line.split(',').map(str::trim);
    fields.clone().any(|field| field == TAU) && fields.any(|field| column_of(field).is_some())
}

/// Axis and unit of a column of deviations.
fn column_of(header: &str) -> Option<(char, f64)> {
    DEVIATIONS.iter().find_map(|(name, unit)| match header.strip_prefix(name)? {
        "" => Some(('x', *unit)),
        rest => {
            let mut letters = rest.strip_prefix('_')?.chars();
            let letter = letters.next().filter(char::is_ascii_lowercase)?;
            letters.next().is_none().then_some((letter, *unit))
        }
    })
}

/// Reads a curve.
///
/// # Errors
/// No curve, a cell that is not a number above zero, τ that do not rise.
pub fn read_curve(path: &Path) -> Result<(Vec<BareCurve>, LogFile)> {
    let name = path.display().to_string();
    let file = sagnac_log::read::open_input(path).map_err(|e| Error::io_path(path, "open", &e))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io_path(path, "read", &e))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::input(
            "the file is too large for an Allan curve",
            "give a table with the columns tau_s and adev_dph",
        )
        .file(name));
    }
    let curves = parse_curve(&bytes).map_err(|e| e.file(&name))?;
    let rows = curves.iter().map(|curve| curve.points.len()).max().unwrap_or(0) as u64;
    Ok((curves, LogFile { file: file_name(&name), sha256: hex(&sha256(&bytes)), rows, rows_sketch: String::new() }))
}

/// Deviations of a curve, °/h: the largest is about 3·10⁶ °/s, and no gyro of this world is as quiet as the least.
const DEVIATIONS_DPH: RangeInclusive<f64> = 1e-15..=1e10;
/// τ of a curve, s.
const TAUS_S: RangeInclusive<f64> = 1e-12..=1e15;

/// Reads the text of a curve.
///
/// # Errors
/// As [`read_curve`].
pub fn parse_curve(text: &[u8]) -> Result<Vec<BareCurve>> {
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.strip_prefix(BOM).unwrap_or(text));
    let unread = |e: &csv::Error| {
        Error::input(format!("not a readable table: {e}"), "write a CSV table with the columns tau_s and adev_dph")
    };
    let headers = csv.headers().map_err(|e| unread(&e))?.clone();
    let tau = headers.iter().position(|header| header == TAU);
    let tau = tau.ok_or_else(|| Error::input("no column `tau_s`", "name the columns tau_s and adev_dph"))?;
    let columns: Vec<(usize, char, f64)> = headers
        .iter()
        .enumerate()
        .filter_map(|(index, header)| column_of(header).map(|(axis, unit)| (index, axis, unit)))
        .collect();
    for (index, (_, axis, _)) in columns.iter().enumerate() {
        if columns[..index].iter().any(|(_, other, _)| other == axis) {
            return Err(Error::input(format!("axis {axis} has two columns"), "name them adev_dph_x, adev_dph_y …"));
        }
    }
    let mut curves: Vec<BareCurve> =
        columns.iter().map(|(_, axis, _)| BareCurve { axis: *axis, points: Vec::new() }).collect();
    for record in csv.records() {
        let record = record.map_err(|e| unread(&e))?;
        let line = record.position().map_or(0, csv::Position::line);
        let value = |index: usize| {
            let cell = record.get(index).unwrap_or_default();
            let number = cell.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
            let column = headers.get(index).unwrap_or_default();
            number.ok_or_else(|| {
                Error::input("must be a number above zero", "correct or remove this line")
                    .line(line)
                    .column(column)
                    .value(cell)
            })
        };
        let tau_s = value(tau)?;
        if !TAUS_S.contains(&tau_s) {
            let error = Error::input("τ is outside 1e-12 … 1e15 s", "write τ in seconds").line(line).column(TAU);
            return Err(error.value(format!("{tau_s:e}")));
        }
        for ((index, _, unit), curve) in columns.iter().zip(&mut curves) {
            if record.get(*index).is_some_and(str::is_empty) {
                continue;
            }
            if curve.points.last().is_some_and(|(last, _)| *last >= tau_s) {
                return Err(Error::input("τ must rise from line to line", "sort the lines by τ")
                    .line(line)
                    .column(TAU));
            }
            let deviation_dph = value(*index)? * unit;
            if !DEVIATIONS_DPH.contains(&deviation_dph) {
                let size = if deviation_dph < 1.0 { "small" } else { "large" };
                let error =
                    Error::input(format!("the deviation is too {size} for a gyro"), "write the deviation in °/h")
                        .line(line);
                return Err(error.column(headers.get(*index).unwrap_or_default()).value(format!("{deviation_dph:e}")));
            }
            curve.points.push((tau_s, deviation_dph));
        }
    }
    if curves.iter().all(|curve| curve.points.is_empty()) {
        return Err(Error::input("the curve has no points", "give rows of tau_s and adev_dph"));
    }
    Ok(curves)
}

/// The five terms of bare curves; `record_s` is the length of the record behind them, if it is known.
///
/// # Errors
/// A record too short for the curve's longest τ, or longer than any.
pub fn budget_of_curves(curves: &[BareCurve], record_s: Option<f64>, input: LogFile) -> Result<NoiseBudget> {
    let one = |curve: &BareCurve| {
        budget_of_curve(curve, record_s).map_err(|e| {
            Error::input(e.to_string(), "give the length of the record in seconds, longer than the largest τ")
                .column("--duration")
                .value(e.record_s.to_string())
        })
    };
    let axes: Vec<AxisBudget> = curves.iter().map(one).collect::<Result<_>>()?;
    Ok(NoiseBudget {
        warnings: axes.iter().filter_map(misfit_text).collect(),
        axes,
        detrended: false,
        at_rest: None,
        excluded: Vec::new(),
        inputs: vec![input],
        program: program(),
    })
}
