//! Measures the stack: the free part is filled with a pattern at the start; what no longer has it was used.

use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};

const PAINT: u32 = 0x5afe_57ac;
/// Stack reserved for `paint` itself.
const MARGIN: usize = 64;
/// Depth of the pattern, bytes.
const DEPTH: usize = 64 * 1024;

unsafe extern "C" {
    static mut _stack_start: u32;
}

/// Fills the stack below its current top.
pub fn paint() {
    let here = 0_u32;
    let top = addr_of!(here) as usize - MARGIN;
    let bottom = addr_of_mut!(_stack_start) as usize - DEPTH;
    for address in (bottom..top & !3).step_by(4) {
        // SAFETY: between the end of the statics (64 KB of 4 MB are used) and the stack that is in use.
        unsafe { write_volatile(address as *mut u32, PAINT) };
    }
}

/// Bytes of stack in use now.
pub fn depth() -> usize {
    let here = 0_u32;
    addr_of_mut!(_stack_start) as usize - addr_of!(here) as usize
}

/// Largest number of bytes used since [`paint`].
pub fn used() -> usize {
    let start = addr_of_mut!(_stack_start) as usize;
    let mut address = start - DEPTH;
    // SAFETY: as above.
    while address < start && unsafe { read_volatile(address as *const u32) } == PAINT {
        address += 4;
    }
    start - address
}
