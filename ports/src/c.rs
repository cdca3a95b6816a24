//! The whole of a gyro's program as C99: correction, loops, counting, banks, signature, serial line and the order of a tick.
//!
//! The modules are the same for every gyro and load an image or table from bytes; `sagnac_unit.c` holds the images and the
//! table as constants for builds that compile them in. The code needs only `<stdint.h>`, no 8-bit type and no
//! allocation. Documentation: `docs/explanation/on-target.md`.

use std::fmt::Write as _;
use std::io::Read as _;

use flate2::read::GzDecoder;
use sagnac_core::{Image, InputSpec, Kind, Multiplier, Shape, Term, ValueSource};
use sagnac_loops::LoopTable;

use crate::TextFile;

/// A module: its header and its source.
macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        [$((concat!($name, ".h"), include_str!(concat!("../c/", $name, ".h"))), (concat!($name, ".c"), include_str!(concat!("../c/", $name, ".c")))),+]
    };
}

/// In the order of their layers: each includes only those before it.
const MODULES: [(&str, &str); 30] = modules!(
    "sagnac_integer",
    "sagnac_hash",
    "sagnac_compensator",
    "sagnac_upset",
    "sagnac_watch",
    "sagnac_quadrature",
    "sagnac_strip",
    "sagnac_path_length",
    "sagnac_intensity",
    "sagnac_identity",
    "sagnac_banks",
    "sagnac_signature",
    "sagnac_frame",
    "sagnac_upload",
    "sagnac_board",
);

const CHECK: [(&str, &str); 3] = [
    ("check/check_vectors.c", include_str!("../../firmware/c/check_vectors.c")),
    ("Makefile", include_str!("../c/Makefile")),
    ("README.md", include_str!("../c/README.md")),
];
/// What the checking program reads, packed by build.rs.
const VECTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/vectors.gz"));

/// The reference vectors, each with its name.
fn vectors() -> Vec<TextFile> {
    let mut text = String::new();
    // What build.rs packed can be unpacked: a test compares every byte.
    let _ = GzDecoder::new(VECTORS).read_to_string(&mut text);
    let files = text.split("=== ").filter_map(|file| file.split_once('\n'));
    files.map(|(name, text)| TextFile::new(&format!("vectors/{name}"), text.to_owned())).collect()
}

/// The files for some axes of a gyro: every module, the constants of the unit (those of its loops if their table is given), the program
/// that checks a port with its reference vectors, a Makefile and a README. Names have folders, `check/` and `vectors/`.
pub fn c_files(images: &[Image], loops: Option<&LoopTable>) -> Vec<TextFile> {
    let whole = MODULES.iter().chain(&CHECK);
    let mut files: Vec<TextFile> = whole.map(|(name, text)| TextFile::new(name, (*text).to_owned())).collect();
    files.extend(vectors());
    files.push(TextFile::new("sagnac_version.h", version_header()));
    files.push(TextFile::new("sagnac_unit.h", unit_header(images, loops)));
    files.push(TextFile::new("sagnac_unit.c", unit_source(images, loops)));
    files
}

/// The version of the program that made the export, as text and as one number that grows.
fn version_header() -> String {
    let parts = [env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")];
    let number = parts.iter().fold(0_u32, |sum, part| sum * 1000 + part.parse::<u32>().unwrap_or(0));
    format!(
        "/* The version of this export. Made by `sagnac export --to c`. */\n\
         #ifndef SAGNAC_VERSION_H\n#define SAGNAC_VERSION_H\n\n\
         #define SAGNAC_VERSION \"{}\"\n\
         /* 1000000 times the first number, 1000 times the second, the third. */\n\
         #define SAGNAC_VERSION_NUMBER {number}UL\n\n#endif\n",
        env!("CARGO_PKG_VERSION")
    )
}

fn name_of(image: &Image) -> String {
    let axis = image.description().axis;
    if axis.is_ascii_alphanumeric() {
        format!("sagnac_image_{}", axis as char)
    } else {
        format!("sagnac_image_{axis:02x}")
    }
}

fn about(images: &[Image]) -> String {
    let serial = images.first().and_then(Image::serial).unwrap_or("");
    // A serial number may neither end the comment nor begin another.
    let plain = serial.replace(|c: char| !c.is_ascii_alphanumeric() && !" -_.".contains(c), "_");
    format!("/* Constants of gyro {plain}. Made by `sagnac export --to c`. */\n")
}

fn unit_header(images: &[Image], loops: Option<&LoopTable>) -> String {
    let mut out = about(images);
    out.push_str("#ifndef SAGNAC_UNIT_H\n#define SAGNAC_UNIT_H\n\n#include \"sagnac_compensator.h\"\n");
    if loops.is_some() {
        out.push_str("#include \"sagnac_intensity.h\"\n#include \"sagnac_path_length.h\"\n");
    }
    out.push_str("#include \"sagnac_version.h\"\n\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n");
    for image in images {
        let d = image.description();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "/* Axis {}, image {}. */\nextern const sagnac_image {};\n",
            d.axis as char,
            d.sequence,
            name_of(image)
        );
    }
    if loops.is_some() {
        out.push_str("extern const sagnac_path_length sagnac_unit_path_length;\nextern const sagnac_intensity sagnac_unit_intensity;\n\n");
    }
    out + "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
}

fn unit_source(images: &[Image], loops: Option<&LoopTable>) -> String {
    let mut out = about(images) + "#include \"sagnac_unit.h\"\n";
    for image in images {
        let _ = write!(out, "\nconst sagnac_image {} = {{\n{}}};\n", name_of(image), image_fields(image));
    }
    if let Some(loops) = loops {
        let listed = |entries: &mut dyn Iterator<Item = i16>| {
            entries.map(|entry| entry.to_string()).collect::<Vec<_>>().join(", ")
        };
        let sine = listed(&mut loops.path_length.sine_q15());
        let second = listed(&mut loops.path_length.second_q15());
        let mut fields = loops.path_length.fields().to_vec();
        fields.retain(|(name, _)| *name != "range_middle_q32");
        let _ = write!(
            out,
            "\nconst sagnac_path_length sagnac_unit_path_length = {{\n    .sine_q15 = {{{sine}}},\n    .second_q15 = {{{second}}},\n{}}};\n",
            loop_fields(&fields)
        );
        let fields = loop_fields(&loops.intensity.fields());
        let _ = write!(out, "\nconst sagnac_intensity sagnac_unit_intensity = {{\n{fields}}};\n");
    }
    out
}

/// `kp_mantissa` is `kp.mantissa` in C.
fn loop_fields(fields: &[(&str, i64)]) -> String {
    let line = |(name, value): &(&str, i64)| {
        let place = name.replace("kp_", "kp.").replace("ki_", "ki.");
        format!("    .{place} = {},\n", constant(*value))
    };
    fields.iter().map(line).collect()
}

/// A constant with an explicit type.
fn constant(value: i64) -> String {
    let wide = i32::try_from(value).is_err() && u32::try_from(value).is_err();
    match (wide, value < 0) {
        (true, _) => format!("INT64_C({value})"),
        (false, true) if value == i64::from(i32::MIN) => "(-INT32_C(2147483647) - 1)".to_owned(),
        (false, true) => format!("-INT32_C({})", -value),
        (false, false) if value > i64::from(i32::MAX) => format!("UINT32_C({value})"),
        (false, false) => value.to_string(),
    }
}

fn image_fields(image: &Image) -> String {
    let d = image.description();
    let words: Vec<String> = d
        .serial
        .chunks_exact(4)
        .map(|four| format!("UINT32_C(0x{:08x})", u32::from_le_bytes([four[0], four[1], four[2], four[3]])))
        .collect();
    let mut out = format!("    .serial = {{{}}},\n", words.join(", "));
    let narrow = [
        ("axis", u32::from(d.axis)),
        ("tick_ns", d.tick_ns),
        ("period_ticks", d.period_ticks),
        ("slew_ticks", d.slew_ticks),
        ("sequence", d.sequence),
        ("output_limit", d.output_limit),
        ("input_count", d.input_count.into()),
        ("term_count", d.term_count.into()),
    ];
    for (name, value) in narrow {
        let _ = writeln!(out, "    .{name} = UINT32_C({value}),");
    }
    let wide =
        [("scale_factor_femto_arcsec", d.scale_factor_femto_arcsec), ("quantum_nano_counts", d.quantum_nano_counts)];
    for (name, value) in wide {
        let _ = writeln!(out, "    .{name} = UINT64_C({value}),");
    }
    let inputs: String = image.inputs().iter().map(input).collect();
    let terms: String = image.terms().iter().map(term).collect();
    for (name, list) in [("inputs", inputs), ("terms", terms)] {
        if !list.is_empty() {
            let _ = write!(out, "    .{name} = {{\n{list}    }},\n");
        }
    }
    out
}

fn input(t: &InputSpec) -> String {
    let (source, of, less) = match t.source {
        ValueSource::Code => ("CODE", 0, 0),
        ValueSource::Difference { of, less } => ("DIFFERENCE", of.into(), less.into()),
        ValueSource::Repeat { of } => ("REPEAT", of.into(), 0),
        ValueSource::WarmUp => ("WARM_UP", 0, 0),
    };
    let fields: [(&str, i64); 22] = [
        ("of", of),
        ("less", less),
        ("unit_exponent", t.unit_exponent.into()),
        ("offset_q24", t.offset_q24.into()),
        ("gain_mantissa", t.gain.mantissa.into()),
        ("gain_shift", t.gain.shift.into()),
        ("valid_lo_q24", t.valid_lo_q24.into()),
        ("valid_hi_q24", t.valid_hi_q24.into()),
        ("span_lo_q24", t.span_lo_q24.into()),
        ("span_hi_q24", t.span_hi_q24.into()),
        ("x_mantissa", t.x_mantissa.into()),
        ("x_shift", t.x_shift.into()),
        ("alpha_mantissa", t.lag.alpha_mantissa.into()),
        ("alpha_shift", t.lag.alpha_shift.into()),
        ("rate_shift", t.lag.rate_shift.into()),
        ("rate_lo", t.lag.rate_lo.into()),
        ("rate_hi", t.lag.rate_hi.into()),
        ("y_mantissa", t.lag.y_mantissa.into()),
        ("y_shift", t.lag.y_shift.into()),
        ("stale_after_updates", t.stale_after_updates.into()),
        ("settling_updates", t.settling_updates.into()),
        ("largest_step_q8", t.largest_step_q8.into()),
    ];
    let list: Vec<String> = fields.iter().map(|(name, value)| format!(".{name} = {}", constant(*value))).collect();
    format!("        {{.source = SAGNAC_{source}, {}}},\n", list.join(", "))
}

fn term(term: &Term) -> String {
    let kind = match term.kind {
        Kind::Bias => "SAGNAC_BIAS",
        Kind::Scale => "SAGNAC_SCALE",
    };
    let rate = u8::from(term.multiplier == Multiplier::Rate);
    let (shape, order, knot) = match term.shape {
        Shape::Chebyshev(order) => ("CHEBYSHEV", order, 0),
        Shape::Zone { knot_q15 } => ("ZONE", 0, knot_q15),
        Shape::Step { knot_q15 } => ("STEP", 0, knot_q15),
        Shape::Cosine { .. } => ("COSINE", 0, 0),
        Shape::Sine { .. } => ("SINE", 0, 0),
    };
    let turns = term.shape.turns_q18().unwrap_or(0);
    format!(
        "        {{.kind = {kind}, .input = {}, .shape = SAGNAC_{shape}, .order = {order}, .knot_q15 = {}, \
         .turns_q18 = {turns}, .times_rate = {rate}, .mantissa = {}, .shift = {}}},\n",
        term.input,
        constant(knot.into()),
        constant(term.mantissa.into()),
        term.shift
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every file of testdata/vectors, byte for byte.
    #[test]
    fn the_vectors_are_those_of_the_project() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../testdata");
        let packed = vectors();
        assert_eq!(packed.len(), std::fs::read_dir(format!("{folder}/vectors")).unwrap().count());
        for file in packed {
            assert_eq!(file.text, std::fs::read_to_string(format!("{folder}/{}", file.name)).unwrap(), "{}", file.name);
        }
    }
}
