//! A gyro's program as C99: the correction with the constants of the unit and a check of both, and on request the parts around it.
//!
//! ```text
//! always            sagnac_compensator, sagnac_integer, sagnac_unit, sagnac_rates (°/s), sagnac_unit_check, README
//! board             order of a tick, dither, watches, upsets        loops   path length, intensity
//! banks             flash banks, signatures                         line    frames, uploads
//! all four          the Makefile, the reference vectors and their check too; with the loops, an example of a board
//! ```
//!
//! A part brings the modules that its headers include. The code needs only `<stdint.h>`, no 8-bit type and no allocation.
//! Documentation: `docs/explanation/on-target.md`.

use std::fmt::Write as _;
use std::io::Read as _;

use flate2::read::GzDecoder;
use sagnac_core::{Image, InputSpec, Kind, Multiplier, Shape, Term, ValueSource};
use sagnac_loops::LoopTable;

use crate::TextFile;
use crate::unit_check::unit_check;

/// A module: its header and its source.
macro_rules! modules {
    ($($name:literal),+ $(,)?) => {
        [$((concat!($name, ".h"), include_str!(concat!("../c/", $name, ".h"))), (concat!($name, ".c"), include_str!(concat!("../c/", $name, ".c")))),+]
    };
}

/// In the order of their layers: each includes only those before it.
const MODULES: [(&str, &str); 32] = modules!(
    "sagnac_integer",
    "sagnac_hash",
    "sagnac_compensator",
    "sagnac_error_bound",
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

/// Of every export.
const AROUND: [(&str, &str); 4] = [
    ("README.md", include_str!("../c/README.md")),
    ("CMakeLists.txt", include_str!("../c/CMakeLists.txt")),
    ("zephyr/module.yml", include_str!("../c/module.yml")),
    ("zephyr/Kconfig", include_str!("../c/Kconfig")),
];
/// Needs every part and the loops.
const EXAMPLE: (&str, &str) = ("example/board.c", include_str!("../c/example_board.c"));
const CHECK: [(&str, &str); 2] = [
    ("check/check_vectors.c", include_str!("../../firmware/c/check_vectors.c")),
    ("Makefile", include_str!("../c/Makefile")),
];

/// A part of the program around the correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The order of a tick, dither, watches on thermometers and memory.
    Board,
    /// Path-length and intensity control.
    Loops,
    /// Flash banks and signatures.
    Banks,
    /// Frames of the serial line and uploads.
    Line,
}

impl Part {
    /// All of them: the export has the reference vectors too.
    pub const ALL: [Self; 4] = [Self::Board, Self::Loops, Self::Banks, Self::Line];

    const fn modules(self) -> &'static [&'static str] {
        match self {
            Self::Board => &["sagnac_board", "sagnac_quadrature"],
            Self::Loops => &["sagnac_path_length", "sagnac_intensity"],
            Self::Banks => &["sagnac_banks", "sagnac_signature"],
            Self::Line => &["sagnac_frame", "sagnac_upload"],
        }
    }
}

/// The modules of some parts, with all that they include.
fn modules_of(parts: &[Part]) -> Vec<&'static (&'static str, &'static str)> {
    let mut wanted: Vec<String> = vec!["sagnac_compensator".to_owned()];
    wanted.extend(parts.iter().flat_map(|part| part.modules()).map(|name| (*name).to_owned()));
    let mut at = 0;
    while at < wanted.len() {
        let own = MODULES.iter().filter(|(name, _)| name.trim_end_matches(".h").trim_end_matches(".c") == wanted[at]);
        let included: Vec<String> = own
            .flat_map(|(_, text)| text.lines())
            .filter_map(|line| line.strip_prefix("#include \"")?.strip_suffix(".h\""))
            .map(str::to_owned)
            .collect();
        let new: Vec<String> = included.into_iter().filter(|name| !wanted.contains(name)).collect();
        wanted.extend(new);
        at += 1;
    }
    let is_wanted = |name: &str| {
        wanted.iter().any(|wanted| name.strip_prefix(wanted.as_str()).is_some_and(|end| end.starts_with('.')))
    };
    MODULES.iter().filter(|(name, _)| is_wanted(name)).collect()
}
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

/// What a correction does to the fixed bias; an image alone does not show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FixedBias {
    /// It stays in the corrected counts.
    Stays,
    /// The correction takes it out, °/h.
    RemovedDph(f64),
    /// Only an image is there.
    Unknown,
}

impl FixedBias {
    /// Of a calibration's axis.
    pub fn of(removed_dph: Option<f64>) -> Self {
        removed_dph.map_or(Self::Stays, Self::RemovedDph)
    }
}

/// The files for some axes, each with a letter of its own: the correction, the constants (those of the loops if their table is given), a program
/// that checks them, and the parts. With all parts also the program that checks a port with the reference vectors. Names may have folders.
pub fn c_files(axes: &[(Image, FixedBias)], loops: Option<&LoopTable>, parts: &[Part]) -> Vec<TextFile> {
    let images: Vec<Image> = axes.iter().map(|(image, _)| *image).collect();
    let images = images.as_slice();
    let is_whole = Part::ALL.iter().all(|part| parts.contains(part));
    let mut parts = parts.to_vec();
    parts.extend(loops.map(|_| Part::Loops));
    let checks = CHECK.iter().filter(|_| is_whole);
    let example = [&EXAMPLE].into_iter().filter(|_| is_whole && loops.is_some());
    let texts = modules_of(&parts).into_iter().chain(&AROUND).chain(checks).chain(example);
    let mut files: Vec<TextFile> = texts.map(|(name, text)| TextFile::new(name, (*text).to_owned())).collect();
    if is_whole {
        files.extend(vectors());
    }
    files.push(TextFile::new("sagnac_version.h", version_header()));
    files.push(TextFile::new("sagnac_unit.h", unit_header(axes, loops)));
    files.push(TextFile::new("sagnac_unit.c", unit_source(images, loops)));
    files.push(TextFile::new("sagnac_rates.h", rates_header(images)));
    files.push(TextFile::new("sagnac_unit_check.c", unit_check(&named(images), &about(images))));
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

/// The beginning of an axis's constants.
fn macro_name(image: &Image) -> String {
    name_of(image).replace("sagnac_image_", "SAGNAC_").to_uppercase()
}

/// The images with their names in C.
fn named(images: &[Image]) -> Vec<(String, &Image)> {
    images.iter().map(|image| (name_of(image), image)).collect()
}

fn about(images: &[Image]) -> String {
    let mut serials: Vec<&str> = images.iter().map(|image| image.serial().unwrap_or("")).collect();
    serials.dedup();
    // A serial number may neither end the comment nor begin another.
    let plain = serials.join(", ").replace(|c: char| !c.is_ascii_alphanumeric() && !" -_.,".contains(c), "_");
    format!("/* Constants of gyro {plain}. Made by `sagnac export --to c`. */\n")
}

fn unit_header(axes: &[(Image, FixedBias)], loops: Option<&LoopTable>) -> String {
    let images: Vec<Image> = axes.iter().map(|(image, _)| *image).collect();
    let mut out = about(&images);
    out.push_str("#ifndef SAGNAC_UNIT_H\n#define SAGNAC_UNIT_H\n\n#include \"sagnac_compensator.h\"\n");
    if loops.is_some() {
        out.push_str("#include \"sagnac_intensity.h\"\n#include \"sagnac_path_length.h\"\n");
    }
    out.push_str("#include \"sagnac_version.h\"\n\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n");
    for (image, bias) in axes {
        let d = image.description();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "/* Axis {}, image {}. {}\n * {} */\nextern const sagnac_image {};\n",
            d.axis as char,
            d.sequence,
            size_of_count(image),
            fixed_bias(*bias),
            name_of(image)
        );
        if let Some([above, below]) = counts_per_nano_dps(image) {
            let name = macro_name(image);
            let _ = writeln!(out, "#define {name}_ABOVE INT64_C({above})\n#define {name}_BELOW INT64_C({below})\n");
        }
    }
    if images.iter().any(|image| counts_per_nano_dps(image).is_some()) {
        out.push_str(INTEGER_RATES);
    }
    if loops.is_some() {
        out.push_str("extern const sagnac_path_length sagnac_unit_path_length;\nextern const sagnac_intensity sagnac_unit_intensity;\n\n");
    }
    let names: Vec<String> = images.iter().map(|image| format!("&{}", name_of(image))).collect();
    let _ = write!(
        out,
        "/* All of them, for a loop over the axes. */\n#define SAGNAC_UNIT_AXES {}U\n#define SAGNAC_UNIT_IMAGES {{{}}}\n\n",
        names.len(),
        names.join(", ")
    );
    out + "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
}

/// A number for people: twelve digits, an exponent where it is small.
fn decimal(value: f64) -> String {
    let value: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    if (1e-3..1e6).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// Angle of a count, arcsec, and the rate of one count in a tick, °/s.
fn count_of(image: &Image) -> [f64; 2] {
    let d = image.description();
    let arcsec = d.scale_factor_femto_arcsec as f64 * 1e-15;
    [arcsec, arcsec / 3600.0 / (f64::from(d.tick_ns) * 1e-9)]
}

/// What `raw` and `counts` of an axis are, in words.
fn size_of_count(image: &Image) -> String {
    let [arcsec, dps] = count_of(image);
    let tick_us = f64::from(image.description().tick_ns) * 1e-3;
    format!(
        "raw and counts: 1 is {} arcsec of angle;\n * 1 in each tick of {} us is {} deg/s. Another size corrects wrongly, and no status shows it.",
        decimal(arcsec),
        decimal(tick_us),
        decimal(dps)
    )
}

/// The same in words.
fn fixed_bias(bias: FixedBias) -> String {
    match bias {
        FixedBias::RemovedDph(dph) => format!("The correction takes the fixed bias out: {} deg/h.", decimal(dph)),
        FixedBias::Stays => "The fixed bias stays in the corrected counts.".to_owned(),
        FixedBias::Unknown => {
            "Fixed bias: only the calibration of this image shows whether it is taken out.".to_owned()
        }
    }
}

/// Counts of a tick from a rate in 1e-9 °/s, as a ratio of whole numbers: 3600·tick/(1000·size); `None` where 2000 °/s would overflow.
fn counts_per_nano_dps(image: &Image) -> Option<[u64; 2]> {
    let d = image.description();
    let (above, below) = (3600 * u64::from(d.tick_ns), d.scale_factor_femto_arcsec.checked_mul(1000)?);
    let (mut a, mut b) = (above, below);
    while b > 0 {
        (a, b) = (b, a % b);
    }
    let ratio = [above.checked_div(a)?, below.checked_div(a)?];
    (ratio[0] <= 2_000_000 && ratio[1] <= u64::MAX / 8).then_some(ratio)
}

/// Whole counts from rates in whole nano-degrees per second, in integers.
const INTEGER_RATES: &str = "/* Counts of one tick from a rate in 1e-9 deg/s, at most 2000 deg/s: rate * above / below. `rest` begins at 0 and keeps what is less\n \
     * than a count for the next tick, so that no angle is lost. above and below are those of the axis. */\n\
     static inline int32_t sagnac_unit_counts(int64_t rate_nano_dps, int64_t above, int64_t below, int64_t *rest)\n{\n    \
     const int64_t whole = (rate_nano_dps * above) + *rest;\n    const int64_t counts = whole / below;\n    \
     *rest = whole - (counts * below);\n    return (int32_t)counts;\n}\n\n";

/// Rates in °/s to counts of a tick and back: the only file with floating point.
fn rates_header(images: &[Image]) -> String {
    let mut out = about(images);
    out.push_str(
        "/* Rates in deg/s, for a gyro whose output is a rate. Floating point stands in this file alone; the correction does not need it.\n \
         * A tick takes whole counts: sagnac_rates_to_counts keeps the rest for the next tick, so that no angle is lost. */\n\
         #ifndef SAGNAC_RATES_H\n#define SAGNAC_RATES_H\n\n#include <stdint.h>\n\n",
    );
    for image in images {
        let [arcsec, dps] = count_of(image);
        let name = macro_name(image);
        let _ = write!(
            out,
            "/* Axis {}. */\n#define {name}_ARCSEC_PER_COUNT {arcsec:e}\n#define {name}_DEG_PER_S_PER_COUNT {dps:e}\n\n",
            image.description().axis as char
        );
    }
    out + "/* Counts of one tick from a rate; `rest` begins at 0. The rate is within 2^29 counts. */\n\
           static inline int32_t sagnac_rates_to_counts(double deg_per_s, double deg_per_s_per_count, double *rest)\n{\n    \
           const double whole = (deg_per_s / deg_per_s_per_count) + *rest;\n    \
           const int32_t counts = (int32_t)((whole < 0.0) ? (whole - 0.5) : (whole + 0.5));\n    \
           *rest = whole - (double)counts;\n    return counts;\n}\n\n\
           /* The rate of some counts in one tick. */\n\
           static inline double sagnac_rates_of_counts(int32_t counts, double deg_per_s_per_count)\n{\n    \
           return (double)counts * deg_per_s_per_count;\n}\n\n#endif\n"
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
    let fields: [(&str, i64); 23] = [
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
        ("step_growth", t.step_growth.into()),
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
