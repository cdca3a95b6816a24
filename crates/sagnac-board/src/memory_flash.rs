//! Flash in memory: for boards that are emulated, and for tests.
//!
//! It has the manners of flash and none of its ageing: programming only clears bits, a unit of 8 bytes once between
//! two erases of 2 KB. Power never fails here; that is the business of the banks' own tests.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// See the module.
#[derive(Clone, Debug)]
pub struct MemoryFlash {
    bytes: [u8; Self::LEN],
    programmed: [bool; Self::LEN / Self::UNIT],
}

/// What [`MemoryFlash`] refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotAllowed(NorFlashErrorKind);

impl NorFlashError for NotAllowed {
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

    /// Erased.
    pub const fn new() -> Self {
        Self { bytes: [0xff; Self::LEN], programmed: [false; Self::LEN / Self::UNIT] }
    }
}

impl ErrorType for MemoryFlash {
    type Error = NotAllowed;
}

impl ReadNorFlash for MemoryFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NotAllowed> {
        let from = self.bytes.get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
        bytes.copy_from_slice(from.ok_or(NotAllowed(NorFlashErrorKind::OutOfBounds))?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::LEN
    }
}

impl NorFlash for MemoryFlash {
    const WRITE_SIZE: usize = Self::UNIT;
    const ERASE_SIZE: usize = Self::SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NotAllowed> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(Self::SECTOR) || !to.is_multiple_of(Self::SECTOR) {
            return Err(NotAllowed(NorFlashErrorKind::NotAligned));
        }
        let out = NotAllowed(NorFlashErrorKind::OutOfBounds);
        self.bytes.get_mut(from..to).ok_or(out)?.fill(0xff);
        self.programmed.get_mut(from / Self::UNIT..to / Self::UNIT).ok_or(out)?.fill(false);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NotAllowed> {
        let offset = offset as usize;
        if !offset.is_multiple_of(Self::UNIT) || !bytes.len().is_multiple_of(Self::UNIT) {
            return Err(NotAllowed(NorFlashErrorKind::NotAligned));
        }
        let out = NotAllowed(NorFlashErrorKind::OutOfBounds);
        let units = offset / Self::UNIT..(offset + bytes.len()) / Self::UNIT;
        let programmed = self.programmed.get_mut(units).ok_or(out)?;
        if programmed.contains(&true) {
            return Err(NotAllowed(NorFlashErrorKind::Other));
        }
        programmed.fill(true);
        let room = self.bytes.get_mut(offset..).and_then(|rest| rest.get_mut(..bytes.len())).ok_or(out)?;
        room.iter_mut().zip(bytes).for_each(|(slot, byte)| *slot &= byte);
        Ok(())
    }
}
