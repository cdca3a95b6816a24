//! Units of the field: 1 °/h is 1 arcsec/s, and the rate of a count.
//!
//! `cargo run --example convert`

use sagnac_units::{ARCSEC_RT_S_PER_DEG_RT_H, DPH_PER_RADPS, EARTH_RATE_DPH};

fn main() {
    // The Earth's rate on a vertical axis at 17.4° N, and in counts of 1.059 arcsec per 100 s.
    let vertical_dph = EARTH_RATE_DPH * 17.4_f64.to_radians().sin();
    println!("{vertical_dph:.3} °/h is {:.2} counts per 100 s", vertical_dph * 100.0 / 1.059);
    println!("0.003 °/√h is {:.2} arcsec/√s", 0.003 * ARCSEC_RT_S_PER_DEG_RT_H);
    println!("1 rad/s is {DPH_PER_RADPS:.1} °/h");
    assert!((vertical_dph - 4.498).abs() < 5e-4);
}
