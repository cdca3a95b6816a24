//! The internal flash: sectors 1 and 2, 16 KB each, for the two banks; sector 3 for the table of the loops.
//!
//! This part has one flash bank, so an erase or a word stops the program, which runs from the same flash: 16 µs a word, 250 to 500 ms a sector.
//! The timers go on; the board makes up the ticks ([`sagnac_board::Board::make_up`]), and the frames have MISSED_TICKS. The loops hold their
//! outputs meanwhile. A gyro that cannot bear that stores in service only, or has an external flash.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use sagnac_loops::{LoopTable, TABLE_LEN};
use stm32f4::stm32f407::FLASH;

const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
const BASE: usize = 0x0800_4000;
const SECTOR: usize = 16 * 1024;
const SECTORS: usize = 2;
const FIRST_SECTOR: u8 = 1;
const LOOPS: usize = 0x0800_c000;
const WORD: usize = 4;

/// Length of a bank, bytes.
pub const BANK: u32 = SECTOR as u32;

/// The two sectors of the banks.
pub struct Internal(FLASH);

/// What the flash refused.
#[derive(Clone, Copy, Debug)]
pub struct Refused(NorFlashErrorKind);

impl NorFlashError for Refused {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

/// The table of the loops, if sector 3 holds one.
pub fn loops() -> Option<LoopTable> {
    // SAFETY: mapped flash, which nothing writes while the program runs.
    LoopTable::decode(unsafe { core::slice::from_raw_parts(LOOPS as *const u8, TABLE_LEN) }).ok()
}

impl Internal {
    pub const fn new(registers: FLASH) -> Self {
        Self(registers)
    }

    fn unlock(&self) {
        for key in KEYS {
            // SAFETY: the two keys of the reference manual, in their order.
            self.0.keyr().write(|w| unsafe { w.bits(key) });
        }
    }

    /// Waits for the end of an operation and locks the flash again.
    fn finish(&self) -> Result<(), Refused> {
        while self.0.sr().read().bsy().bit_is_set() {}
        let state = self.0.sr().read();
        let failed = state.wrperr().bit_is_set()
            || state.pgaerr().bit_is_set()
            || state.pgperr().bit_is_set()
            || state.pgserr().bit_is_set();
        self.0.sr().write(|w| {
            let w = w.eop().clear_bit_by_one().operr().clear_bit_by_one().wrperr().clear_bit_by_one();
            w.pgaerr().clear_bit_by_one().pgperr().clear_bit_by_one().pgserr().clear_bit_by_one()
        });
        self.0.cr().write(|w| w.lock().locked());
        // The data cache would go on giving what was there before.
        self.0.acr().modify(|_, w| w.dcen().disabled());
        self.0.acr().modify(|_, w| w.dcrst().reset());
        self.0.acr().modify(|_, w| w.dcrst().no_reset().dcen().enabled());
        if failed { Err(Refused(NorFlashErrorKind::Other)) } else { Ok(()) }
    }
}

/// The address of `len` bytes from `offset` on, if the banks have them.
fn address(offset: u32, len: usize) -> Result<usize, Refused> {
    let out = Refused(NorFlashErrorKind::OutOfBounds);
    let end = (offset as usize).checked_add(len).ok_or(out)?;
    if end > SECTOR * SECTORS { Err(out) } else { Ok(BASE + offset as usize) }
}

impl ErrorType for Internal {
    type Error = Refused;
}

impl ReadNorFlash for Internal {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Refused> {
        let from = address(offset, bytes.len())?;
        for (at, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within the banks; volatile, because an erase changes it behind the compiler.
            *byte = unsafe { ((from + at) as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SECTOR * SECTORS
    }
}

impl NorFlash for Internal {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Refused> {
        address(from, (to as usize).saturating_sub(from as usize))?;
        if !(from as usize).is_multiple_of(SECTOR) || !(to as usize).is_multiple_of(SECTOR) {
            return Err(Refused(NorFlashErrorKind::NotAligned));
        }
        for sector in from as usize / SECTOR..to as usize / SECTOR {
            self.unlock();
            let number = FIRST_SECTOR + sector as u8;
            // SAFETY: sector 1 or 2, which hold no program.
            self.0.cr().write(|w| unsafe { w.ser().set_bit().snb().bits(number).psize().psize32() });
            self.0.cr().modify(|_, w| w.strt().set_bit());
            self.finish()?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refused> {
        let to = address(offset, bytes.len())?;
        if !to.is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) {
            return Err(Refused(NorFlashErrorKind::NotAligned));
        }
        for (at, word) in bytes.as_chunks::<WORD>().0.iter().enumerate() {
            self.unlock();
            self.0.cr().write(|w| w.pg().set_bit().psize().psize32());
            // SAFETY: an aligned word of the banks; programming is switched on.
            unsafe { ((to + WORD * at) as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
            self.finish()?;
        }
        Ok(())
    }
}
