//! What the programs of this folder share: the serial line, the unit, the end of a run, and no way to panic.
#![no_std]

pub mod serial;
pub mod stack;

use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m_semihosting::{debug, hio};
use sagnac_core::{Gyro, Image};
use sagnac_loops::LoopTable;

unsafe extern "C" {
    fn sagnac_firmware_has_a_panic_path() -> !;
}

/// As long as one panic path remains, this program does not link.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never runs; if this call is kept, the link fails, which is the point.
    unsafe { sagnac_firmware_has_a_panic_path() }
}

/// The image that the programs were built with. A production board knows its serial number from a fuse; this one knows
/// it from here.
pub fn unit_image() -> Option<Image> {
    Image::decode(include_bytes!(concat!(env!("OUT_DIR"), "/unit.img"))).ok()
}

/// The gyro: what the image says, and four times its correction is believed.
pub fn unit_gyro() -> Option<Gyro> {
    unit_image().map(|image| Gyro::of(&image, 4))
}

/// The loops.
pub fn unit_loops() -> Option<LoopTable> {
    LoopTable::decode(include_bytes!(concat!(env!("OUT_DIR"), "/unit.loops"))).ok()
}

/// A line to the host that emulates.
pub fn say(text: fmt::Arguments<'_>) {
    #[cfg(feature = "broken")]
    assert!(text.as_str() != Some("x"), "a panic path on purpose");
    if let Ok(mut out) = hio::hstdout() {
        let _ = out.write_fmt(text);
        let _ = out.write_str("\n");
    }
}

/// Ends the emulation.
pub fn finish(passed: bool) -> ! {
    loop {
        debug::exit(if passed { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
}
