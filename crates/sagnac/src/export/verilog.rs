//! The correction and the path-length loop as synthesizable Verilog-2005.
//!
//! The modules are the same for every gyro; what an image and a table hold goes into two headers that they include:
//! `sagnac_unit.vh` (one axis) and `sagnac_path_unit.vh`. Test benches that check themselves against the reference vectors
//! (`docs/reference/vectors.md`) are included. Sizes and frequencies: `docs/explanation/fpga.md`.
//!
//! The caller chooses the widths. An image whose terms could exceed them is refused with the name of the largest term: in
//! hardware an overflow would wrap silently.

use std::fmt::Write as _;

use sagnac_core::{Image, InputSpec, Kind, MAX_INPUTS, Multiplier, Shape, Term, ValueSource};
use sagnac_loops::LoopTable;

use super::TextFile;
use sagnac_log::error::{Error, Result};

const MODULES: [(&str, &str); 3] = [
    ("sagnac_fast.v", include_str!("verilog/sagnac_fast.v")),
    ("sagnac_series.v", include_str!("verilog/sagnac_series.v")),
    ("sagnac_quadrature.v", include_str!("verilog/sagnac_quadrature.v")),
];
const BENCHES: [(&str, &str); 2] = [
    ("tb_compensator.v", include_str!("verilog/tb_compensator.v")),
    ("tb_quadrature.v", include_str!("verilog/tb_quadrature.v")),
];
const PATH_LENGTH: [(&str, &str); 2] = [
    ("sagnac_path_length.v", include_str!("verilog/sagnac_path_length.v")),
    ("tb_path_length.v", include_str!("verilog/tb_path_length.v")),
];

/// Widths of the hardware, bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// Counts of a tick, signed: 2 to 32.
    pub raw: u32,
    /// Increment per tick in 2⁻³² counts, signed: 34 to 48.
    pub increment: u32,
}

impl Default for Widths {
    fn default() -> Self {
        Self { raw: 16, increment: 48 }
    }
}

/// The files for one axis, and for the path-length loop if its table is given.
///
/// # Errors
/// Widths out of their range; an image whose terms could exceed them, by the name of the largest.
pub fn verilog_files(image: &Image, loops: Option<&LoopTable>, widths: Widths) -> Result<Vec<TextFile>> {
    check_widths(image, widths)?;
    let mut files = vec![TextFile::new("sagnac_unit.vh", unit(image, widths))];
    files.extend(MODULES.iter().chain(&BENCHES).map(|(name, text)| TextFile::new(name, (*text).to_owned())));
    if let Some(loops) = loops {
        files.push(TextFile::new("sagnac_path_unit.vh", path_unit(loops)));
        files.extend(PATH_LENGTH.iter().map(|(name, text)| TextFile::new(name, (*text).to_owned())));
    }
    Ok(files)
}

fn check_widths(image: &Image, widths: Widths) -> Result<()> {
    for (name, value, range) in [("raw", widths.raw, 2..=32), ("increment", widths.increment, 34..=48)] {
        if !range.contains(&value) {
            return Err(Error::input(format!("the width must be {} to {} bits", range.start(), range.end()))
                .column(name)
                .value(value.to_string()));
        }
    }
    let most = (1_i64 << (widths.increment - 1)) - 1;
    let reach = image.reach(Kind::Bias);
    // Each term and the sum are rounded, and the integers' T_n overshoot 1 by a few 2^-31: docs/explanation/arithmetic.md.
    let reach = reach + 64 + (reach >> 25);
    if reach <= most {
        return Ok(());
    }
    let size = |term: &&Term| (i64::from(term.mantissa).abs() << 31) >> term.shift;
    let largest = image.terms().iter().filter(|term| term.kind == Kind::Bias).max_by_key(size);
    let named = largest.map_or_else(String::new, |term| {
        let rate = if term.multiplier == Multiplier::Rate { ", times the rate," } else { "" };
        let what = match term.shape {
            Shape::Chebyshev(order) => format!("bias term of order {order}"),
            Shape::Zone { .. } => "bias term of a zone".to_owned(),
            Shape::Step { .. } => "bias step".to_owned(),
            Shape::Cosine { .. } | Shape::Sine { .. } => "bias harmonic".to_owned(),
        };
        format!("; the {what}{rate} alone reaches {}", size(&term) >> 8)
    });
    let bits = 65 - reach.leading_zeros();
    Err(Error::refused(format!(
        "the increment can reach {reach} of 2^-32 counts per tick and {} bits hold {most}{named}",
        widths.increment
    ))
    .column("increment")
    .help(format!("give the increment {bits} bits")))
}

/// A vector of equal fields, the first in the lowest bits.
fn packed(out: &mut String, name: &str, width: u32, values: impl DoubleEndedIterator<Item = i64>) {
    let mask = if width >= 64 { u64::MAX } else { (1 << width) - 1 };
    let fields: Vec<String> = values.rev().map(|value| format!("{width}'h{:x}", value as u64 & mask)).collect();
    let total = width * fields.len() as u32;
    // Writing to a String cannot fail.
    let _ = writeln!(out, "localparam [{}:0] {name} = {{{}}};", total - 1, fields.join(", "));
}

/// A unit header's first lines.
fn opening(out: &mut String, about: &str) {
    let _ = writeln!(
        out,
        "// {about}\n// Made by `sagnac export --to verilog`; included by the modules, not compiled alone."
    );
    out.push_str("/* verilator lint_off UNUSEDPARAM */\n");
}

fn unit(image: &Image, widths: Widths) -> String {
    let d = image.description();
    let mut out = String::new();
    let serial = image.serial().unwrap_or("").escape_default().to_string();
    opening(&mut out, &format!("Constants of gyro {serial}, axis {}, image {}.", d.axis as char, d.sequence));
    let highest = image.terms().iter().filter_map(|term| term.shape.order()).max().unwrap_or(0);
    let _ = writeln!(out, "localparam [31:0] IMAGE_CRC = 32'h{:08x};", crc_of(&super::image_bytes(image)));
    let _ = writeln!(out, "localparam integer RAW_WIDTH = {};", widths.raw);
    let _ = writeln!(out, "localparam integer INCREMENT_WIDTH = {};", widths.increment);
    let _ = writeln!(out, "localparam [31:0] PERIOD_TICKS = 32'd{};", d.period_ticks);
    let _ = writeln!(out, "localparam [31:0] SLEW_TICKS = 32'd{};", d.slew_ticks);
    let _ = writeln!(out, "localparam [31:0] OUTPUT_LIMIT = 32'd{};", d.output_limit);
    let _ = writeln!(out, "localparam integer HIGHEST_ORDER = {highest};");
    let _ = writeln!(out, "localparam [2:0] INPUTS = 3'd{};", d.input_count);
    let _ = writeln!(out, "localparam [5:0] TERMS = 6'd{};", d.term_count);
    inputs(&mut out, &d.inputs);
    terms(&mut out, &d.terms);
    out.push_str("/* verilator lint_on UNUSEDPARAM */\n");
    out
}

fn inputs(out: &mut String, all: &[InputSpec; MAX_INPUTS]) {
    /// A field's name, width and position.
    type Field = (&'static str, u32, fn(&InputSpec) -> i64);
    let fields: [Field; 25] = [
        ("IS_DERIVED", 1, |t| (t.source != ValueSource::Code).into()),
        ("IS_REPEAT", 1, |t| matches!(t.source, ValueSource::Repeat { .. }).into()),
        ("IS_WARM_UP", 1, |t| (t.source == ValueSource::WarmUp).into()),
        ("DERIVED_OF", 2, |t| derived_from(t)[0]),
        ("DERIVED_LESS", 2, |t| derived_from(t)[1]),
        ("OFFSET", 32, |t| t.offset_q24.into()),
        ("GAIN_MANTISSA", 32, |t| t.gain.mantissa.into()),
        ("GAIN_SHIFT", 7, |t| t.gain.shift.into()),
        ("VALID_LO", 32, |t| t.valid_lo_q24.into()),
        ("VALID_HI", 32, |t| t.valid_hi_q24.into()),
        ("SPAN_LO", 32, |t| t.span_lo_q24.into()),
        ("SPAN_HI", 32, |t| t.span_hi_q24.into()),
        ("X_MANTISSA", 32, |t| t.x_mantissa.into()),
        ("X_SHIFT", 7, |t| t.x_shift.into()),
        ("ALPHA_MANTISSA", 32, |t| t.lag.alpha_mantissa.into()),
        ("ALPHA_SHIFT", 7, |t| t.lag.alpha_shift.into()),
        ("RATE_SHIFT", 7, |t| t.lag.rate_shift.into()),
        ("RATE_LO", 32, |t| t.lag.rate_lo.into()),
        ("RATE_HI", 32, |t| t.lag.rate_hi.into()),
        ("Y_MANTISSA", 32, |t| t.lag.y_mantissa.into()),
        ("Y_SHIFT", 7, |t| t.lag.y_shift.into()),
        ("STALE_AFTER_UPDATES", 32, |t| t.stale_after_updates.into()),
        ("SETTLING_UPDATES", 32, |t| t.settling_updates.into()),
        ("LARGEST_STEP", 16, |t| t.largest_step_q8.into()),
        ("LONGEST_HOLD", 32, |t| t.lag.longest_hold_updates().into()),
    ];
    for (name, width, field) in fields {
        packed(out, name, width, all.iter().map(field));
    }
}

/// The two inputs of a difference; twice the one of a repeat.
fn derived_from(t: &InputSpec) -> [i64; 2] {
    match t.source {
        ValueSource::Code | ValueSource::WarmUp => [0, 0],
        ValueSource::Difference { of, less } => [of.into(), less.into()],
        ValueSource::Repeat { of } => [of.into(), of.into()],
    }
}

fn terms(out: &mut String, all: &[Term]) {
    let knot = |term: &Term| match term.shape {
        Shape::Chebyshev(_) => 0,
        Shape::Zone { knot_q15 } | Shape::Step { knot_q15 } => knot_q15.into(),
        // Turns count from the lower end of the span: the subtraction that a knot needs gives x + 1.
        Shape::Cosine { .. } | Shape::Sine { .. } => i16::MIN.into(),
    };
    packed(out, "TERM_INPUT", 2, all.iter().map(|term| term.input.into()));
    packed(out, "TERM_ORDER", 4, all.iter().map(|term| term.shape.order().unwrap_or(0).into()));
    packed(out, "TERM_IS_ZONE", 1, all.iter().map(|term| matches!(term.shape, Shape::Zone { .. }).into()));
    packed(out, "TERM_IS_STEP", 1, all.iter().map(|term| matches!(term.shape, Shape::Step { .. }).into()));
    packed(out, "TERM_KNOT", 16, all.iter().map(knot));
    packed(out, "TERM_TURNS", 24, all.iter().map(|term| term.shape.turns_q18().unwrap_or(0).into()));
    packed(out, "TERM_IS_COSINE", 1, all.iter().map(|term| matches!(term.shape, Shape::Cosine { .. }).into()));
    packed(out, "TERM_MANTISSA", 32, all.iter().map(|term| term.mantissa.into()));
    packed(out, "TERM_SHIFT", 7, all.iter().map(|term| term.shift.into()));
    packed(out, "TERM_RATED", 1, all.iter().map(|term| (term.multiplier == Multiplier::Rate).into()));
    packed(out, "TERM_SCALES", 1, all.iter().map(|term| (term.kind == Kind::Scale).into()));
}

fn path_unit(loops: &LoopTable) -> String {
    let mut out = String::new();
    opening(&mut out, "Constants of a path-length loop.");
    let _ = writeln!(out, "localparam [31:0] TABLE_CRC = 32'h{:08x};", crc_of(&loops.encode()));
    let path = &loops.path_length;
    let ticks = path.ticks_per_period();
    let mut sine: Vec<i64> = path.sine_q15().map(i64::from).collect();
    let mut second: Vec<i64> = path.second_q15().map(i64::from).collect();
    for (name, table) in [("SINE", &mut sine), ("SECOND", &mut second)] {
        table.resize(64, 0);
        packed(&mut out, name, 16, table.iter().copied());
    }
    let _ = writeln!(out, "localparam [5:0] LAST = 6'd{};", ticks - 1);
    for (name, value) in path.fields() {
        let upper = name.to_uppercase();
        let _ = match name {
            "delay" => {
                writeln!(out, "localparam [5:0] FIRST_DELAYED = 6'd{};", (i64::from(ticks) - value) % i64::from(ticks))
            }
            "error_shift" | "kp_shift" | "ki_shift" => writeln!(out, "localparam integer {upper} = {value};"),
            "kp_mantissa" | "ki_mantissa" | "modulation" | "low" | "high" => {
                writeln!(out, "localparam signed [31:0] {upper} = {};", signed(value, 32))
            }
            "wavelength" | "range_middle_q32" => {
                writeln!(out, "localparam signed [63:0] {upper} = {};", signed(value, 64))
            }
            _ => Ok(()),
        };
    }
    out.push_str("/* verilator lint_on UNUSEDPARAM */\n");
    out
}

/// The checksum at the end of an image or table: it identifies the vectors of a bench.
fn crc_of(bytes: &[u8]) -> u32 {
    bytes.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc))
}

fn signed(value: i64, width: u32) -> String {
    let sign = if value < 0 { "-" } else { "" };
    format!("{sign}{width}'sd{}", value.unsigned_abs())
}
