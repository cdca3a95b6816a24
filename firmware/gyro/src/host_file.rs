//! A file of the emulator's host, read by semihosting.

use core::ffi::CStr;

use cortex_m_semihosting::{nr, syscall};

/// The beginning of a file in the emulator's working folder, as much as there is room for. `None` where it cannot be read.
#[inline(never)]
pub fn read<'a>(name: &CStr, room: &'a mut [u8]) -> Option<&'a [u8]> {
    let bytes = name.to_bytes();
    // SAFETY: the host reads the name, with the zero behind it, during the call.
    let file = unsafe { syscall!(OPEN, bytes.as_ptr(), nr::open::R_BINARY, bytes.len()) };
    if file == usize::MAX {
        return None;
    }
    // SAFETY: the host writes into the room alone, during the call.
    let left = unsafe { syscall!(READ, file, room.as_mut_ptr(), room.len()) };
    room.get(..room.len().checked_sub(left)?)
}
