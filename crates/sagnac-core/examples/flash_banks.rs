//! Stores images in two flash banks, survives a power cut, and goes back to the older image.
//!
//! ```sh
//! cargo run -p sagnac-core --example flash_banks
//! ```
//!
//! On a target, replace `Memory` by the `embedded-storage` driver of your part.

use std::error::Error;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use sagnac_core::{Banks, Description, Gyro, Image, Origin, StoreError};

/// Length of a bank: two sectors of the flash.
const BANK: u32 = 2048;

/// Flash in memory: sectors of 1 KB, programmed 8 bytes at a time. `writes_left` simulates a power cut.
struct Memory {
    bytes: Vec<u8>,
    writes_left: usize,
}

/// The power is off.
#[derive(Debug)]
struct PowerCut;

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Memory {
    type Error = PowerCut;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        let from = offset as usize;
        bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 1024;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        self.bytes[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        self.writes_left = self.writes_left.checked_sub(1).ok_or(PowerCut)?;
        let from = offset as usize;
        // Programming only clears bits.
        self.bytes[from..from + bytes.len()].iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(())
    }
}

/// An image of the gyro with serial number RLG-7.
fn image(sequence: u32) -> Result<Image, Box<dyn Error>> {
    let mut description = Description { sequence, ..Description::empty() };
    description.serial[..5].copy_from_slice(b"RLG-7");
    Ok(Image::new(description)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    // What the board knows about its gyro: it refuses images for any other.
    let gyro = Gyro::of(&image(0)?, 1);
    let flash = Memory { bytes: vec![0xff; 2 * BANK as usize], writes_left: 100 };
    let mut banks = Banks::new(flash, 0, BANK).ok_or("the banks do not fit the flash")?;

    let loaded = banks.load(&gyro);
    println!("new flash: {:?}", loaded.origin);
    assert_eq!(loaded.origin, Origin::FactoryDefaults);

    banks.store(&gyro, &image(1)?)?;
    banks.store(&gyro, &image(2)?)?;
    println!("after two stores: image {}", banks.load(&gyro).image.description().sequence);
    assert_eq!(banks.load(&gyro).image, image(2)?);

    // An old file cannot return by mistake.
    let refused = banks.store(&gyro, &image(1)?);
    assert!(matches!(refused, Err(StoreError::NotNewer { active: 2, offered: 1 })));

    // The power fails in the middle of a store: image 2 is still there.
    let mut flash = banks.into_flash();
    flash.writes_left = 3;
    let mut banks = Banks::new(flash, 0, BANK).ok_or("the banks do not fit the flash")?;
    let cut = banks.store(&gyro, &image(3)?);
    println!("power cut: {}", cut.unwrap_err());
    let mut flash = banks.into_flash();
    flash.writes_left = 100;
    let mut banks = Banks::new(flash, 0, BANK).ok_or("the banks do not fit the flash")?;
    assert_eq!(banks.load(&gyro).image, image(2)?);

    // With power again the store succeeds, and the older image is one roll back away.
    banks.store(&gyro, &image(3)?)?;
    let older = banks.roll_back(&gyro)?;
    println!("after a roll back: image {}", older.description().sequence);
    assert_eq!(banks.load(&gyro).image, image(2)?);
    Ok(())
}
