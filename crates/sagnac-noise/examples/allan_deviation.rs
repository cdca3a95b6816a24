//! The overlapping Allan deviation of angles in memory, against a value of NIST SP 1065.
//!
//! `cargo run --example allan_deviation`

use sagnac_noise::{Deviation, Difference, overlapping, phases};

fn main() {
    // The ten points of NBS14, NIST SP 1065, table 31.
    let rates = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
    let wanted = [1, 2].map(|m| Difference { deviation: Deviation::Allan, m });
    let sums = overlapping(&phases(&rates, 0.0), &wanted);
    for (difference, sum) in wanted.iter().zip(&sums) {
        let tau_s = difference.m as f64;
        let deviation = sum.variance(difference.deviation, tau_s).map(f64::sqrt).unwrap_or(f64::NAN);
        println!("τ = {tau_s} s: {deviation:.5}");
    }
    let at_two = sums[1].variance(Deviation::Allan, 2.0).map(f64::sqrt);
    assert!(at_two.is_some_and(|deviation| (deviation - 85.952_87).abs() < 1e-5));
}
