//! The first serial port of the MPS2 (Arm CMSDK APB UART), polled.

use core::ptr::{read_volatile, write_volatile};

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *const u32 = 0x4000_4004 as *const u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const DIVIDER: *mut u32 = 0x4000_4010 as *mut u32;
const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;

/// Switches the port on at its highest rate.
pub fn start() {
    // SAFETY: registers of this board, used by the main loop alone.
    unsafe {
        write_volatile(DIVIDER, 16);
        write_volatile(CONTROL, 3);
    }
}

/// Sends a byte; waits while the port is full.
pub fn put(byte: u8) {
    // SAFETY: as above.
    unsafe {
        while read_volatile(STATE) & TRANSMIT_FULL != 0 {}
        write_volatile(DATA, byte.into());
    }
}

/// The received byte, if any.
pub fn get() -> Option<u8> {
    // SAFETY: as above.
    unsafe { (read_volatile(STATE) & RECEIVE_FULL != 0).then(|| read_volatile(DATA) as u8) }
}
