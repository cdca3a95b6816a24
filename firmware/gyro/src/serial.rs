//! The first serial port of the MPS2 (Arm CMSDK APB UART). It sends polled; a received byte raises an interrupt.

use core::ptr::{read_volatile, write_volatile};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *const u32 = 0x4000_4004 as *const u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const INTERRUPT_CLEAR: *mut u32 = 0x4000_400c as *mut u32;
const DIVIDER: *mut u32 = 0x4000_4010 as *mut u32;
const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;
const RECEIVE_INTERRUPT: u32 = 2;
/// Transmit, receive, and the interrupt of the latter.
const ON: u32 = 1 | 2 | 8;

/// The interrupt of a received byte: the first of this board.
#[derive(Clone, Copy, Debug)]
pub struct Received;

// SAFETY: number 0 is within the vectors of every Cortex-M, and this board has its receive interrupt there.
unsafe impl InterruptNumber for Received {
    fn number(self) -> u16 {
        0
    }
}

/// Switches the port on at its highest rate.
pub fn start() {
    // SAFETY: registers of this board, used by the main loop alone.
    unsafe {
        write_volatile(DIVIDER, 16);
        write_volatile(CONTROL, ON);
    }
    listen(true);
}

/// Lets received bytes interrupt, or makes the sender wait.
pub fn listen(on: bool) {
    if on {
        // SAFETY: the handler exists, and shares its buffer by critical sections alone.
        unsafe { NVIC::unmask(Received) };
    } else {
        NVIC::mask(Received);
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

/// The received byte, if any, in its interrupt.
pub fn get() -> Option<u8> {
    // SAFETY: registers of this board, read in this interrupt alone.
    unsafe {
        write_volatile(INTERRUPT_CLEAR, RECEIVE_INTERRUPT);
        (read_volatile(STATE) & RECEIVE_FULL != 0).then(|| read_volatile(DATA) as u8)
    }
}
