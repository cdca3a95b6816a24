//! The simulated gyro in its chamber, as rows for the emulated board.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use sagnac_board::Row;

use super::units::{CODES_PER_C, FRAME_TICKS};

/// The rows of a simulated log, one for each second: a frame of the target.
///
/// The slices of the slow update at the end of a row begin within it, so they read its temperature. A replay reads what is stamped at or before
/// its slow update, so it reads the same.
pub(super) fn rows(log: &Path) -> Result<Vec<Row>> {
    let text = std::fs::read_to_string(log).with_context(|| format!("cannot read {}", log.display()))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().context("an empty log")?.split(',').collect();
    let place = |name: &str| header.iter().position(|column| *column == name).with_context(|| format!("no {name}"));
    let [time, counts, temperature] = [place("time_s")?, place("counts")?, place("temperature_c")?];
    let mut rows = Vec::new();
    for (second, line) in (1_u32..).zip(lines) {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |at: usize| cells.get(at).copied().with_context(|| format!("a short row: {line}"));
        ensure!(cell(time)?.parse() == Ok(f64::from(second)), "rows of a second are needed: {line}");
        let code = (cell(temperature)?.parse::<f64>()? * CODES_PER_C).round() as i32;
        rows.push(Row { ticks: FRAME_TICKS, counts: cell(counts)?.parse()?, present: 1, codes: [code, 0, 0, 0] });
    }
    Ok(rows)
}
