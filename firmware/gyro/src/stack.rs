//! How much stack was used: the free part is painted at the start, and what is no longer paint was used.

use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};

const PAINT: u32 = 0x5afe_57ac;
/// What the painter itself may stand on.
const MARGIN: usize = 512;
/// As far down as is painted.
const DEPTH: usize = 64 * 1024;

unsafe extern "C" {
    static mut _stack_start: u32;
}

/// Paints below the current top.
pub fn paint() {
    let here = 0_u32;
    let top = addr_of!(here) as usize - MARGIN;
    let bottom = addr_of_mut!(_stack_start) as usize - DEPTH;
    for address in (bottom..top & !3).step_by(4) {
        // SAFETY: between the end of the statics (64 KB of 4 MB are used) and the stack that is in use.
        unsafe { write_volatile(address as *mut u32, PAINT) };
    }
}

/// Bytes that were used at most since [`paint`].
pub fn used() -> usize {
    let start = addr_of_mut!(_stack_start) as usize;
    let mut address = start - DEPTH;
    // SAFETY: as above.
    while address < start && unsafe { read_volatile(address as *const u32) } == PAINT {
        address += 4;
    }
    start - address
}
