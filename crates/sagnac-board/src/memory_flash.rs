//! Flash in memory, for emulated boards and for tests.
//!
//! It behaves like flash without ageing: programming only clears bits, and a unit of 8 bytes can be programmed once
//! between two erases of 2 KB. Power never fails here; the tests of `sagnac_core::Banks` cover that.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Flash in memory: 4 KB, for two banks of 2 KB.
#[derive(Clone, Debug)]
pub struct MemoryFlash {
    bytes: [u8; Self::LEN],
    programmed: [bool; Self::LEN / Self::UNIT],
}

/// An access that [`MemoryFlash`] refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryFlashError(NorFlashErrorKind);

impl NorFlashError for MemoryFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl Default for MemoryFlash {
    fn default() -> Self {
        Self::new()
    }
}

impl MemoryFlash {
    /// Length, bytes: room for two banks.
    pub const LEN: usize = 4096;
    /// Length of a bank, bytes.
    pub const BANK: u32 = 2048;
    const UNIT: usize = 8;
    const SECTOR: usize = 2048;

    /// An erased flash.
    pub const fn new() -> Self {
        Self { bytes: [0xff; Self::LEN], programmed: [false; Self::LEN / Self::UNIT] }
    }
}

impl ErrorType for MemoryFlash {
    type Error = MemoryFlashError;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryFlashError> {
        let from = self.bytes.get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
        bytes.copy_from_slice(from.ok_or(MemoryFlashError(NorFlashErrorKind::OutOfBounds))?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::LEN
    }
}

impl NorFlash for MemoryFlash {
    const WRITE_SIZE: usize = Self::UNIT;
    const ERASE_SIZE: usize = Self::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryFlashError> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(Self::SECTOR) || !to.is_multiple_of(Self::SECTOR) {
            return Err(MemoryFlashError(NorFlashErrorKind::NotAligned));
        }
        let out = MemoryFlashError(NorFlashErrorKind::OutOfBounds);
        self.bytes.get_mut(from..to).ok_or(out)?.fill(0xff);
        self.programmed.get_mut(from / Self::UNIT..to / Self::UNIT).ok_or(out)?.fill(false);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryFlashError> {
        let offset = offset as usize;
        if !offset.is_multiple_of(Self::UNIT) || !bytes.len().is_multiple_of(Self::UNIT) {
            return Err(MemoryFlashError(NorFlashErrorKind::NotAligned));
        }
        let out = MemoryFlashError(NorFlashErrorKind::OutOfBounds);
        let units = offset / Self::UNIT..(offset + bytes.len()) / Self::UNIT;
        let programmed = self.programmed.get_mut(units).ok_or(out)?;
        if programmed.contains(&true) {
            return Err(MemoryFlashError(NorFlashErrorKind::Other));
        }
        programmed.fill(true);
        let room = self.bytes.get_mut(offset..).and_then(|rest| rest.get_mut(..bytes.len())).ok_or(out)?;
        room.iter_mut().zip(bytes).for_each(|(slot, byte)| *slot &= byte);
        Ok(())
    }
}
