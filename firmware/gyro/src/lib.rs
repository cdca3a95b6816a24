//! Shared by the programs of this folder: the serial port, the unit's image and loops, the end of a run, and the panic check.
#![no_std]

pub mod host_file;
#[cfg(feature = "signed")]
pub mod key;
pub mod serial;
pub mod stack;

use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m_semihosting::{debug, hio};
#[cfg(not(feature = "signed"))]
use sagnac_core::NoKey;
use sagnac_core::{Gyro, Image};
use sagnac_loops::LoopTable;

#[cfg(not(feature = "signed"))]
unsafe extern "C" {
    fn sagnac_firmware_has_a_panic_path() -> !;
}

/// The library of the signature has panic paths: a program with a key starts again.
#[cfg(feature = "signed")]
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// While any panic path remains, this program does not link.
#[cfg(not(feature = "signed"))]
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never runs; if this call is kept, the link fails, which is the point.
    unsafe { sagnac_firmware_has_a_panic_path() }
}

/// The image that the programs were built with. A production board reads its serial number from a fuse; this one takes it from here.
pub fn unit_image() -> Option<Image> {
    Image::decode(include_bytes!(concat!(env!("OUT_DIR"), "/unit.img"))).ok()
}

/// The identity of the gyro: that of the image, with limits of four times its correction.
pub fn unit_gyro() -> Option<Gyro> {
    unit_image().map(|image| Gyro::of(&image, 4))
}

/// What this board trusts.
#[cfg(not(feature = "signed"))]
pub type UnitTrust = NoKey;

/// What this board trusts.
#[cfg(not(feature = "signed"))]
pub const fn unit_trust() -> UnitTrust {
    NoKey
}

/// What this board trusts.
#[cfg(feature = "signed")]
pub type UnitTrust = sagnac_signature::Keyed<fn() -> [u8; 16]>;

/// What this board trusts.
#[cfg(feature = "signed")]
pub const fn unit_trust() -> UnitTrust {
    key::emulated_fuses()
}

/// The loop table.
pub fn unit_loops() -> Option<LoopTable> {
    LoopTable::decode(include_bytes!(concat!(env!("OUT_DIR"), "/unit.loops"))).ok()
}

/// Prints a line on the host of the emulator.
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
