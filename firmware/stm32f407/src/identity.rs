//! Which gyro this is: from the one-time programmable area of the processor, and the constants of its type.
//!
//! Block 0 has the serial number, UTF-8, padded with zero bytes; block 1 begins with the axis letter. Both are programmed and locked when the gyro
//! is built. An erased area is no identity: every image is then refused, and counts pass through UNCORRECTED.

use sagnac_core::Gyro;

use crate::fringes::TICK_NS;

const OTP: usize = 0x1fff_7800;
const BLOCK: usize = 32;
const ONE_COUNT: i64 = 1 << 32;

/// The identity, with the constants of this type of gyro: the paper's 1.059 arcsec per count, four counts a fringe.
pub fn gyro() -> Gyro {
    let byte = |at: usize| {
        // SAFETY: mapped memory that nothing writes.
        unsafe { ((OTP + at) as *const u8).read_volatile() }
    };
    Gyro {
        serial: core::array::from_fn(byte),
        axis: byte(BLOCK),
        tick_ns: TICK_NS,
        scale_factor_femto_arcsec: 264_750_000_000_000,
        quantum_nano_counts: 250_000_000,
        // 100 °/h: 100 arcsec/s · 100 µs / 0.26475 arcsec.
        largest_increment: ONE_COUNT * 10_000 / 264_750,
        // 1,000 ppm.
        largest_scale: ONE_COUNT / 1000,
        // A third of a tick of 16,800 clocks, at two clocks an instruction of the reference.
        largest_work: 2800,
    }
}
