//! The report for a port that differs by one bit: module, record and word.
//!
//! `cargo run --example find_a_difference`

use sagnac_vectors::{Failure, check};

fn main() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors/quadrature.hex");
    let mut text = std::fs::read_to_string(path).expect("the vectors are part of the repository");
    // The first output of the last record.
    let last = text.trim_end().rfind('\n').map_or(0, |at| at + 1);
    text.replace_range(last + 81..last + 89, "deadbeef");
    match check(text.as_bytes()) {
        Err(Failure::Differs { record, output, expected, .. }) => {
            println!("record {record}, output {output}: the file has {expected:08x}");
        }
        other => panic!("one word was changed, but the result is {other:?}"),
    }
}
