//! The core on this machine against a file of reference vectors, as every port does it.
//!
//! `cargo run --example check_a_file`

use sagnac_vectors::check;

fn main() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors/compensator-paper.hex");
    let text = std::fs::read(path).expect("the vectors are part of the repository");
    match check(&text) {
        Ok(passed) => println!("{:?}: {} ticks equal to the bit", passed.module, passed.ticks),
        Err(failure) => panic!("{failure}"),
    }
}
