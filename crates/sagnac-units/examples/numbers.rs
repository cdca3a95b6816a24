//! Numbers with no more digits than their uncertainty supports.
//!
//! `cargo run --example numbers`

use sagnac_units::format::{significant, with_sigma};

fn main() {
    for (value, sigma) in [(0.049_123_456, 0.001_31), (1043.39, 12.0), (-7.656e-9, 2.64e-10)] {
        println!("{value} with σ {sigma} reads {}", with_sigma(value, Some(sigma)));
    }
    println!("without σ: {}", significant(0.000_123_456, 3));
    assert_eq!(with_sigma(0.049_123_456, Some(0.001_31)), "0.0491 ± 0.0013");
}
