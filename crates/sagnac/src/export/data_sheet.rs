//! The data sheet of an image, as a parameter data item of DO-178C: where it comes from, every field with its bytes, and its error budget.
//!
//! ```text
//! image bytes ─▶ layout: offset, type, unit ─▶ fields ─┐
//! image ─▶ Compensator at rest, T ─▶ correction ───────┴▶ Markdown
//! record ─▶ correction at T with its 95 % interval ────┘
//! ```
//!
//! The fields are read from the bytes, not from the fit: what the sheet shows is what flash holds. What it cannot show is what the record
//! does not know: the gyro's own change from run to run, which `verify` judges on another test.

use std::fmt::Write as _;

use sagnac_core::{Compensator, Image, State, Status, ValueSource};
use sagnac_log::ingest::sha256;
use sagnac_units::NS_PER_S;
use sagnac_units::format::{one_line, plain, significant, with_sigma};

use super::{Code, codes, image_bytes};
use crate::calibration::{AxisCalibration, Calibration};

/// Temperatures of the error budget.
const POINTS: u32 = 13;

/// How a field's bytes are read.
#[derive(Clone, Copy)]
enum Type {
    /// Unsigned, of so many bytes.
    U(usize),
    /// Signed, of so many bytes.
    I(usize),
    /// Text, zeros behind it.
    Text(usize),
    /// Bytes as they are.
    Bytes(usize),
}

use Type::{Bytes, I, Text, U};

/// A field: name, type, and the unit of its value.
type Field = (&'static str, Type, &'static str);

/// docs/reference/image-format.md, in the order of the bytes.
const HEAD_FIELDS: [Field; 19] = [
    ("magic", Text(8), ""),
    ("format version", U(2), ""),
    ("minor version", U(2), ""),
    ("length", U(4), "bytes"),
    ("serial number", Text(32), ""),
    ("axis", Text(1), ""),
    ("inputs", U(1), ""),
    ("terms", U(1), ""),
    ("reserved", U(1), ""),
    ("tick", U(4), "ns"),
    ("temperature period", U(4), "ticks"),
    ("slew", U(4), "ticks"),
    ("scale factor S0", U(8), "1e-15 arcsec per count"),
    ("quantum", U(8), "1e-9 counts of the log"),
    ("reference temperature", I(4), "2⁻²⁴ °C"),
    ("sequence number", U(4), ""),
    ("output limit", U(4), "counts per tick"),
    ("SHA-256 of the parent", Bytes(32), ""),
    ("reserved", U(4), ""),
];
const INPUT_FIELDS: [Field; 24] = [
    ("value at code 0", I(4), "2⁻²⁴ °C"),
    ("gain mantissa", I(4), "2^−shift of 2⁻²⁴ °C per code"),
    ("gain shift", U(1), "bits"),
    ("x shift", U(1), "bits"),
    ("α shift", U(1), "bits"),
    ("rate shift", U(1), "bits"),
    ("y shift", U(1), "bits"),
    ("source", U(1), "0 code, 1 difference, 2 repeat, 3 warm-up"),
    ("of input", U(1), ""),
    ("less input", U(1), ""),
    ("valid range from", I(4), "2⁻²⁴ °C"),
    ("valid range to", I(4), "2⁻²⁴ °C"),
    ("span from", I(4), "2⁻²⁴ °C"),
    ("span to", I(4), "2⁻²⁴ °C"),
    ("x mantissa", U(4), ""),
    ("α mantissa", U(4), "2^−shift"),
    ("rate span from", I(4), "2^−(24 + shift) °C per period"),
    ("rate span to", I(4), "2^−(24 + shift) °C per period"),
    ("y mantissa", U(4), ""),
    ("hold time", U(4), "updates"),
    ("settling time", U(4), "updates"),
    ("unit exponent", I(1), ""),
    ("largest step", U(2), "2⁻⁸ °C"),
    ("reserved", U(1), ""),
];
const TERM_FIELDS: [Field; 8] = [
    ("kind", U(1), "1 bias, 2 scale"),
    ("input", U(1), ""),
    ("order, or turns, bits 16 to 23", U(1), ""),
    ("multiplier", U(1), "0 one, 1 rate"),
    ("mantissa", I(4), "2^(31 − shift) of 2⁻⁴⁰"),
    ("shift", U(1), "bits"),
    ("shape", U(1), "0 polynomial, 1 zone, 2 step, 3 cosine, 4 sine"),
    ("knot, or turns, bits 0 to 15", I(2), "2⁻¹⁵"),
];

/// The sheet of one axis, as Markdown.
pub fn data_sheet(calibration: &Calibration, axis: &AxisCalibration, image: &Image) -> String {
    let bytes = image_bytes(image);
    let d = image.description();
    let mut out = format!(
        "# Parameter data item: image {} of gyro {}, axis {}\n\nMade by `{}` and `sagnac export --to data-sheet`. The fields are read from the \
         image's bytes.\n\n",
        d.sequence,
        cell(&calibration.serial),
        char::from(d.axis),
        cell(&calibration.provenance.program)
    );
    identification(&mut out, calibration, axis, image, &bytes);
    content(&mut out, image, &bytes);
    budget(&mut out, calibration, axis, image);
    out
}

/// Text of a record in a cell: nothing in it ends the cell or begins a line.
fn cell(text: &str) -> String {
    one_line(text).replace('\\', "\\\\").replace('|', "\\|").replace('`', "\\`").replace('<', "&lt;")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn identification(out: &mut String, calibration: &Calibration, axis: &AxisCalibration, image: &Image, bytes: &[u8]) {
    let crc = bytes.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc));
    // Writing to a String cannot fail.
    let _ = writeln!(out, "## Identification\n\n| | |\n|---|---|");
    let _ = writeln!(out, "| gyro, axis | {}, {} |", cell(&calibration.serial), axis.axis);
    let _ = writeln!(out, "| image | {}, format 1.{} |", image.description().sequence, image.format_minor());
    let _ = writeln!(out, "| length | {} bytes |", bytes.len());
    let _ = writeln!(out, "| CRC-32 | {crc:08x} |\n| SHA-256 | {} |", hex(&sha256(bytes)));
    let _ = writeln!(out, "| SHA-256 of the calibration | {} |", hex(&image.description().parent));
    let _ = writeln!(out, "| model | {} |", cell(&axis.correction.model));
    for log in &calibration.provenance.inputs {
        let _ = writeln!(out, "| log {}, {} rows | SHA-256 {} |", cell(&log.file), log.rows, cell(&log.sha256));
    }
}

fn content(out: &mut String, image: &Image, bytes: &[u8]) {
    let _ = writeln!(out, "\n## Fields\n\n| offset | type | field | value | unit |\n|---|---|---|---|---|");
    let mut at = fields(out, bytes, 0, &HEAD_FIELDS, "");
    for index in 0..image.inputs().len() {
        at = fields(out, bytes, at, &INPUT_FIELDS, &format!("input {index}: "));
    }
    for index in 0..image.terms().len() {
        at = fields(out, bytes, at, &TERM_FIELDS, &format!("term {index}: "));
    }
    fields(out, bytes, at, &[("CRC-32", U(4), "")], "");
}

/// A row for each field from `at` on; the offset behind the last.
fn fields(out: &mut String, bytes: &[u8], mut at: usize, fields: &[Field], block: &str) -> usize {
    for (name, read, unit) in fields {
        let (U(len) | I(len) | Text(len) | Bytes(len)) = *read;
        let here = bytes.get(at..at + len).unwrap_or(&[]);
        let unsigned = here.iter().rev().fold(0_u64, |value, byte| (value << 8) | u64::from(*byte));
        let bits = 8 * len as u32;
        let (kind, value) = match read {
            U(_) => (format!("u{bits}"), unsigned.to_string()),
            I(_) => (format!("i{bits}"), ((unsigned << (64 - bits)).cast_signed() >> (64 - bits)).to_string()),
            Text(_) => (format!("{len} bytes"), cell(String::from_utf8_lossy(here).trim_end_matches('\0'))),
            Bytes(_) => (format!("{len} bytes"), hex(here)),
        };
        let _ = writeln!(out, "| {at} | {kind} | {block}{name} | {value} | {unit} |");
        at += len;
    }
    at
}

fn budget(out: &mut String, calibration: &Calibration, axis: &AxisCalibration, image: &Image) {
    let main = axis.thermometer();
    let _ = writeln!(
        out,
        "\n## Error budget\n\nAt rest, over the span of {}; every other input at its reference. The interval is that of the fit's curve, 95 %, with what memory of temperature may add. Image − record is what \
         integers add: the correction that the target computes from the thermometer's code, less that of the record at the same temperature.\n\n\
         | T, °C | correction, °/h | interval, ± °/h | image − record, °/h |\n|---|---|---|---|",
        cell(&main.name)
    );
    let removed_dph = axis.correction.fixed_bias.map_or(0.0, |bias| bias.value_dph);
    for point in 0..POINTS {
        let celsius = main.span[0] + (main.span[1] - main.span[0]) * f64::from(point) / f64::from(POINTS - 1);
        let on_target = at_rest(axis, image, celsius);
        let here = axis.evaluate(on_target.map_or(celsius, |(celsius, _)| celsius), 0.0);
        let corrected_dph = here.drift_dph + removed_dph;
        let half = here.upper_dph.map_or("–".to_owned(), |upper| significant(upper - here.drift_dph, 3));
        let error = on_target.map_or("–".to_owned(), |(_, dph)| significant(dph - corrected_dph, 2));
        let _ = writeln!(out, "| {:.3} | {} | {half} | {error} |", here.temperature_c, significant(corrected_dph, 6));
    }
    out.push('\n');
    if let Some(bias) = axis.correction.fixed_bias {
        let value = with_sigma(bias.value_dph, Some(bias.sigma_dph));
        let _ = writeln!(out, "The correction has the fixed bias in it: {value} °/h, mean of {} runs.\n", bias.runs);
    }
    if image.inputs().iter().any(|input| matches!(input.source, ValueSource::Difference { .. })) {
        out.push_str("The target was not run here: a difference of two inputs has no reference of its own there.\n\n");
    }
    if let Some(fit) = &axis.fit {
        let _ = writeln!(
            out,
            "The residual of the fit is {} °/h (σ of windows of {} s).",
            significant(fit.residual.sigma_dph, 3),
            plain(calibration.window_s)
        );
        if let Some(floor) = &fit.noise_floor {
            let _ = writeln!(out, "The noise floor of these windows is {} °/h.", significant(floor.value_dph, 3));
        }
    }
    out.push_str(
        "\nNot in this budget: the change of the gyro from run to run, and temperatures and rates that the calibration did not see. `sagnac verify` \
         judges both on another test, and its report has the limits.\n",
    );
}

/// The temperature that a code of the thermometer stands for, °C, and the correction that the target computes there, °/h.
fn at_rest(axis: &AxisCalibration, image: &Image, celsius: f64) -> Option<(f64, f64)> {
    if image.inputs().iter().any(|input| matches!(input.source, ValueSource::Difference { .. })) {
        return None;
    }
    let main = &axis.thermometer().name;
    let code_of = |code: &Code| -> Option<i32> {
        let input = axis.correction.inputs.iter().find(|input| input.name == code.name)?;
        let value = if code.name == *main { celsius } else { input.reference };
        Some(((value - code.offset) / code.per_code?).round() as i32)
    };
    let of_image = codes(axis);
    let given: Vec<Option<i32>> = of_image.iter().map(code_of).collect();
    let place = of_image.iter().position(|code| code.name == *main)?;
    let exact_c = f64::from(image.inputs().get(place)?.value_q24((*given.get(place)?)?)?) / f64::from(1 << 24);
    let mut state = State::warm();
    Compensator::new(*image).update(&mut state, &given).ok()?;
    let d = image.description();
    let arcsec_per_count = d.scale_factor_femto_arcsec as f64 * 1e-15;
    // 1 arcsec/s is 1 °/h.
    let dph = state.target_increment() as f64 * 2.0_f64.powi(-32) * arcsec_per_count * NS_PER_S / f64::from(d.tick_ns);
    (!state.status().contains(Status::HELD)).then_some((exact_c, dph))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn len(fields: &[Field]) -> u64 {
        fields
            .iter()
            .map(|(_, read, _)| match *read {
                U(n) | I(n) | Text(n) | Bytes(n) => n as u64,
            })
            .sum()
    }

    #[test]
    fn the_layout_has_every_byte_once() {
        assert_eq!([len(&HEAD_FIELDS), len(&INPUT_FIELDS), len(&TERM_FIELDS)], [128, 64, 12]);
    }
}
