//! The correction, the watch over thermometers and the path-length loop as synthesizable Verilog-2005.
//!
//! The modules are the same for every gyro and load an image and a table of the loops from their bytes, so one bitstream serves a
//! fleet. `sagnac_image.hex` and `sagnac_loops.hex` have the words of one gyro, for a bench or for hardware that nobody loads; the
//! first lines of the image say what hardware it needs. Test benches that check themselves against the reference vectors
//! (`docs/reference/vectors.md`) are included. Sizes and frequencies: `docs/explanation/fpga.md`.

use sagnac_core::{Image, MAX_IMAGE_LEN, MAX_INCREMENT, Shape, ValueSource};
use sagnac_loops::LoopTable;

use crate::TextFile;

const MODULES: [(&str, &str); 11] = [
    ("sagnac_increments.v", include_str!("../verilog/sagnac_increments.v")),
    ("sagnac_constraints.xdc", include_str!("../verilog/sagnac_constraints.xdc")),
    ("sagnac_constraints.sdc", include_str!("../verilog/sagnac_constraints.sdc")),
    ("sagnac_fast.v", include_str!("../verilog/sagnac_fast.v")),
    ("sagnac_series.v", include_str!("../verilog/sagnac_series.v")),
    ("sagnac_image.v", include_str!("../verilog/sagnac_image.v")),
    ("sagnac_correction.v", include_str!("../verilog/sagnac_correction.v")),
    ("sagnac_axi4_lite.v", include_str!("../verilog/sagnac_axi4_lite.v")),
    ("sagnac_quadrature.v", include_str!("../verilog/sagnac_quadrature.v")),
    ("sagnac_watch.v", include_str!("../verilog/sagnac_watch.v")),
    ("sagnac_vote.v", include_str!("../verilog/sagnac_vote.v")),
];
const BENCHES: [(&str, &str); 3] = [
    ("tb_compensator.v", include_str!("../verilog/tb_compensator.v")),
    ("tb_quadrature.v", include_str!("../verilog/tb_quadrature.v")),
    ("tb_watch.v", include_str!("../verilog/tb_watch.v")),
];
const PATH_LENGTH: [(&str, &str); 2] = [
    ("sagnac_path_length.v", include_str!("../verilog/sagnac_path_length.v")),
    ("tb_path_length.v", include_str!("../verilog/tb_path_length.v")),
];

// The increment's 48 bits hold that of every legal image, with the rounding of each term and of the sum, and the few 2^-31 by which
// the integers' T_n overshoot 1 (docs/explanation/arithmetic.md).
const _: () = assert!(MAX_INCREMENT + 64 + (MAX_INCREMENT >> 25) < 1 << 47);

/// The files for one axis, and for the path-length loop if its table is given.
pub fn verilog_files(image: &Image, loops: Option<&LoopTable>) -> Vec<TextFile> {
    let mut files = vec![TextFile::new("sagnac_image.hex", image_words(image))];
    files.extend(MODULES.iter().chain(&BENCHES).map(|(name, text)| TextFile::new(name, (*text).to_owned())));
    if let Some(loops) = loops {
        files.push(TextFile::new("sagnac_loops.hex", loop_words(loops)));
        files.extend(PATH_LENGTH.iter().map(|(name, text)| TextFile::new(name, (*text).to_owned())));
    }
    files
}

/// The image's words, the first byte of each in the lowest bits.
fn image_words(image: &Image) -> String {
    let d = image.description();
    let serial = image.serial().unwrap_or("").escape_default().to_string();
    let mut out = format!(
        "// Image {} of gyro {serial}, axis {}. Made by `sagnac export --to verilog`; for $readmemh.\n// {}\n",
        d.sequence,
        char::from(d.axis),
        needed_hardware(image)
    );
    let mut bytes = [0; MAX_IMAGE_LEN];
    // The room holds every image.
    let len = image.encode(&mut bytes).unwrap_or(0);
    out.push_str(&hex_words(&bytes[..len]));
    out
}

/// The words of the loops' table.
fn loop_words(loops: &LoopTable) -> String {
    let about = "// Table of the control loops. Made by `sagnac export --to verilog`; for $readmemh.\n";
    about.to_owned() + &hex_words(&loops.encode())
}

/// Bytes as words of 32 bits in hexadecimal, eight a line, the first byte in the lowest bits.
pub fn hex_words(bytes: &[u8]) -> String {
    let mut out = String::new();
    for line in bytes.chunks(32) {
        let words = line.chunks(4).map(|four| {
            let word = four.iter().rev().fold(0_u32, |word, byte| (word << 8) | u32::from(*byte));
            format!("{word:08x}")
        });
        out.push_str(&words.collect::<Vec<_>>().join(" "));
        out.push('\n');
    }
    out
}

/// The parameters of the smallest hardware that loads this image.
fn needed_hardware(image: &Image) -> String {
    let pieces = image.terms().iter().any(|term| matches!(term.shape, Shape::Zone { .. } | Shape::Step { .. }));
    let harmonics = image.terms().iter().any(|term| term.shape.turns_q18().is_some());
    let derived = image.inputs().iter().any(|input| input.source != ValueSource::Code);
    let step_limits = image.inputs().iter().any(|input| input.largest_step_q8 != 0);
    format!(
        "Needs INPUTS {}, PIECES {}, HARMONICS {}, DERIVED {}, STEP_LIMITS {} or more.",
        image.inputs().len().max(1),
        u8::from(pieces),
        u8::from(harmonics),
        u8::from(derived),
        u8::from(step_limits)
    )
}
