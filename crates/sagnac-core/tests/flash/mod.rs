//! A flash that loses power: words tear, erases stay half done, a unit is programmed once between two erases.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// splitmix64 (Steele, Lea and Flood 2014): the same numbers everywhere.
#[derive(Clone, Debug)]
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    pub(crate) fn throw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.throw() % n
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The power went away.
    PowerCut,
    /// A call that this flash does not allow.
    NotAllowed(NorFlashErrorKind),
}

impl NorFlashError for Fault {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::PowerCut => NorFlashErrorKind::Other,
            Self::NotAllowed(kind) => *kind,
        }
    }
}

/// Programs `UNIT` bytes at a time, erases `SECTOR`.
#[derive(Clone, Debug)]
pub(crate) struct Flash<const UNIT: usize, const SECTOR: usize> {
    pub(crate) bytes: Vec<u8>,
    pub(crate) programmed: Vec<bool>,
    /// Steps (units programmed, sectors erased) before the power goes; `None`: it stays.
    pub(crate) steps_left: Option<u64>,
    /// Steps so far.
    pub(crate) steps: u64,
    /// Programmed units that come back with a stuck bit.
    pub(crate) worn: bool,
    pub(crate) dice: Dice,
    /// Reading any of these bytes fails: an error beyond what the part's own code corrects.
    pub(crate) unreadable: std::ops::Range<usize>,
}

impl<const UNIT: usize, const SECTOR: usize> Flash<UNIT, SECTOR> {
    pub(crate) fn new(seed: u64) -> Self {
        let len = 8192;
        Self {
            bytes: vec![0xff; len],
            programmed: vec![false; len / UNIT],
            steps_left: None,
            steps: 0,
            worn: false,
            unreadable: 0..0,
            dice: Dice(seed),
        }
    }

    /// One step: true while there is power, false in the step in which it goes.
    fn step(&mut self) -> Result<bool, Fault> {
        self.steps += 1;
        match &mut self.steps_left {
            None => Ok(true),
            Some(0) => Err(Fault::PowerCut),
            Some(left) => {
                *left -= 1;
                Ok(*left > 0)
            }
        }
    }

    fn program(&mut self, unit: usize, with: &[u8]) -> Result<(), Fault> {
        let whole = self.step()?;
        if std::mem::replace(&mut self.programmed[unit], true) {
            return Err(Fault::NotAllowed(NorFlashErrorKind::Other));
        }
        for (byte, with) in self.bytes[unit * UNIT..].iter_mut().zip(with) {
            // Torn: each bit that should be cleared may or may not be.
            let kept = if whole { 0 } else { self.dice.throw() as u8 & self.dice.throw() as u8 };
            *byte &= with | kept;
        }
        if self.worn {
            self.bytes[unit * UNIT] |= 1;
        }
        if whole { Ok(()) } else { Err(Fault::PowerCut) }
    }

    fn erase_sector(&mut self, sector: usize) -> Result<(), Fault> {
        let whole = self.step()?;
        let how = self.dice.below(4);
        for unit in sector * SECTOR / UNIT..(sector + 1) * SECTOR / UNIT {
            // Half done: units erased, untouched, or with some bits already back at one.
            let fate = if whole || how == 0 { 0 } else { self.dice.below(if how == 1 { 2 } else { 3 }) };
            for byte in &mut self.bytes[unit * UNIT..(unit + 1) * UNIT] {
                *byte = match fate {
                    0 => 0xff,
                    1 => *byte,
                    _ => *byte | self.dice.throw() as u8,
                };
            }
            self.programmed[unit] = fate != 0 && self.programmed[unit];
        }
        if whole { Ok(()) } else { Err(Fault::PowerCut) }
    }

    /// A bit of the range changes on its own.
    pub(crate) fn rot(&mut self, from: u32, to: u32) {
        let at = from as usize + self.dice.below(u64::from(to - from)) as usize;
        self.bytes[at] ^= 1 << self.dice.below(8);
    }
}

impl<const UNIT: usize, const SECTOR: usize> ErrorType for Flash<UNIT, SECTOR> {
    type Error = Fault;
}

impl<const UNIT: usize, const SECTOR: usize> ReadNorFlash for Flash<UNIT, SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Fault> {
        let range = offset as usize..offset as usize + bytes.len();
        if range.start < self.unreadable.end && self.unreadable.start < range.end {
            return Err(Fault::NotAllowed(NorFlashErrorKind::Other));
        }
        let from = self.bytes.get(range).ok_or(Fault::NotAllowed(NorFlashErrorKind::OutOfBounds))?;
        bytes.copy_from_slice(from);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const UNIT: usize, const SECTOR: usize> NorFlash for Flash<UNIT, SECTOR> {
    const WRITE_SIZE: usize = UNIT;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Fault> {
        let (from, to) = (from as usize, to as usize);
        if !from.is_multiple_of(SECTOR) || !to.is_multiple_of(SECTOR) || to > self.bytes.len() {
            return Err(Fault::NotAllowed(NorFlashErrorKind::NotAligned));
        }
        (from / SECTOR..to / SECTOR).try_for_each(|sector| self.erase_sector(sector))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Fault> {
        let offset = offset as usize;
        if !offset.is_multiple_of(UNIT) || !bytes.len().is_multiple_of(UNIT) {
            return Err(Fault::NotAllowed(NorFlashErrorKind::NotAligned));
        }
        (0..bytes.len() / UNIT).try_for_each(|unit| {
            let with = bytes[unit * UNIT..(unit + 1) * UNIT].to_vec();
            self.program(offset / UNIT + unit, &with)
        })
    }
}
