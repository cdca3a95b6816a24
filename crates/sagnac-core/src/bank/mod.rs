//! Two flash banks: the image in force, and the one before it.
//!
//! ```text
//! store:      erase the other bank ─▶ image ─▶ head ─▶ read back ─▶ commit word ─▶ read back
//! load:       of the committed, intact banks of this gyro that were not left, the one stored last
//! roll back:  one unit programmed in the older bank says that the newer one was left
//! ```
//!
//! Whatever step the power goes away in, [`Banks::load`] afterwards finds the old image or the new one: the bank in
//! force is never touched by a store, and the new one counts only by a commit word that is written last and names
//! the checksum of its head, which names that of the image.
//!
//! An image whose own sequence number is not above that of the image in force is refused, so that an old file cannot
//! come back by mistake; going back takes [`Banks::roll_back`]. What was left stays left, also when the older bank's
//! image is damaged later: the note stands beside that image, in four copies, and an erase of the bank that was left,
//! however far it comes, cannot remove it. Bytes: `docs/reference/image-format.md`.
//!
//! Where it fails: both banks damaged at once leave the factory defaults, and say so. A bank whose commit word is
//! damaged cannot be told from one whose store was cut short in that word; both are [`BankReport::Damaged`]. A commit
//! word torn so that it reads differently each time is beyond what reading can detect.

mod gyro;
mod layout;

use core::fmt;

use embedded_storage::nor_flash::NorFlash;

pub use gyro::{Gyro, Unfit};
pub use layout::{BANK_LEN, REGION_ALIGNMENT};

use crate::bytes::crc32;
use crate::codec::DecodeError;
use crate::image::Image;
use layout::{BLANK, COMMIT_AT, END, HEAD_AT, Head, IMAGE_AREA, IMAGE_AT, LEFT_AT, LEFT_SLOTS, Unit};

/// What a bank holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BankReport {
    /// Erased, or a store that was cut before its commit word.
    Uncommitted,
    /// A valid image.
    Valid {
        /// Number of the store that wrote it.
        stored: u32,
        /// The image's own sequence number.
        sequence: u32,
    },
    /// A valid image that was left by a roll back.
    Left {
        /// Number of the store that wrote it.
        stored: u32,
    },
    /// Commit word, head or image damaged.
    Damaged,
    /// Intact bytes that are no image for this program.
    NoImage(DecodeError),
    /// An intact image that is not for this gyro.
    Unfit(Unfit),
    /// The flash could not be read.
    Unreadable,
}

/// Where the image in force comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The newest that was stored.
    Newest,
    /// The only intact one beside a bank that is damaged, unreadable or another gyro's: it may be the older of the two.
    Survivor,
    /// No bank holds an image for this gyro: counts pass through uncorrected.
    FactoryDefaults,
}

/// What flash holds for a gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The image in force.
    pub image: Image,
    /// Where it comes from.
    pub origin: Origin,
    /// What each bank holds.
    pub banks: [BankReport; 2],
}

/// Why an image was not stored, or not gone back from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError<E> {
    /// It is not for this gyro.
    Unfit(Unfit),
    /// Its sequence number is not above that of the image in force.
    NotNewer {
        /// Number in force.
        in_force: u32,
        /// Number offered.
        offered: u32,
    },
    /// The image in force is the only one.
    NothingToGoBackTo,
    /// The bank's slots for the note are used up by attempts that were cut short.
    NoSlotLeft,
    /// The counter of stores is at its end.
    CounterAtEnd,
    /// What reads back is not what was written: worn out, or write-protected. The image in force is untouched.
    ReadBack {
        /// Where, from the start of the region.
        offset: u32,
    },
    /// The flash said no.
    Flash(E),
}

impl<E: fmt::Debug> fmt::Display for StoreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unfit(unfit) => write!(f, "{unfit}"),
            Self::NotNewer { in_force, offered } => {
                write!(f, "sequence number {offered} is not above {in_force}, which is in force")
            }
            Self::NothingToGoBackTo => f.write_str("the other bank holds no image to go back to"),
            Self::NoSlotLeft => f.write_str("no slot for the note is free any more; store an image instead"),
            Self::CounterAtEnd => f.write_str("the counter of stores is at its end"),
            Self::ReadBack { offset } => write!(f, "flash does not read back what was written at {offset:#x}"),
            Self::Flash(error) => write!(f, "flash: {error:?}"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for StoreError<E> {}

/// Two banks, one after the other.
#[derive(Debug)]
pub struct Banks<F> {
    flash: F,
    base: u32,
    len: u32,
}

/// One bank as found.
#[derive(Clone, Copy, Debug)]
struct Found {
    report: BankReport,
    image: Option<Image>,
    /// Stores of the other bank up to this number were left.
    left: Option<u32>,
}

impl<F: NorFlash> Banks<F> {
    /// Banks at `base` and `base + len`. `None` when they do not fit the flash: both must be multiples of its erase
    /// size, `len` at least [`BANK_LEN`], and it must read and program in units that divide [`REGION_ALIGNMENT`].
    pub fn new(flash: F, base: u32, len: u32) -> Option<Self> {
        let divides = |size: usize, whole: usize| whole.checked_rem(size) == Some(0);
        let erase = u32::try_from(F::ERASE_SIZE).ok()?;
        let end = len.checked_mul(2).and_then(|both| base.checked_add(both))?;
        let fits = divides(F::READ_SIZE, REGION_ALIGNMENT)
            && divides(F::WRITE_SIZE, REGION_ALIGNMENT)
            && base.checked_rem(erase) == Some(0)
            && len.checked_rem(erase) == Some(0)
            && len >= BANK_LEN
            && end as usize <= flash.capacity();
        fits.then_some(Self { flash, base, len })
    }

    /// The flash, for other uses.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// The image in force for this gyro. Reads only.
    pub fn load(&mut self, gyro: &Gyro) -> Loaded {
        let found = self.look_at_both(gyro);
        let banks = found.map(|bank| bank.report);
        let force = in_force(&banks);
        let image = force.and_then(|bank| found.get(bank)).and_then(|bank| bank.image);
        let origin = match (image, force.and_then(|bank| banks.get(1 - bank))) {
            (None, _) => Origin::FactoryDefaults,
            (Some(_), Some(BankReport::Uncommitted | BankReport::Valid { .. } | BankReport::Left { .. })) => {
                Origin::Newest
            }
            (Some(_), _) => Origin::Survivor,
        };
        Loaded { image: image.unwrap_or_else(|| gyro.factory_defaults()), origin, banks }
    }

    /// Stores an image in the bank that is not in force, which it then is.
    ///
    /// # Errors
    /// [`StoreError`]; the image that was in force still is.
    pub fn store(&mut self, gyro: &Gyro, image: &Image) -> Result<(), StoreError<F::Error>> {
        gyro.accept(image).map_err(StoreError::Unfit)?;
        let found = self.look_at_both(gyro);
        let banks = found.map(|bank| bank.report);
        let force = in_force(&banks);
        let in_force =
            if let Some(BankReport::Valid { sequence: in_force, .. }) = force.and_then(|bank| banks.get(bank)) {
                *in_force
            } else {
                // Replies tell the factory defaults by 0, so no image has it.
                0
            };
        let offered = image.description().sequence;
        if offered <= in_force {
            return Err(StoreError::NotNewer { in_force, offered });
        }
        let stored = |report: &BankReport| match report {
            BankReport::Valid { stored, .. } | BankReport::Left { stored } => Some(*stored),
            _ => None,
        };
        let newest = found.iter().flat_map(|bank| [stored(&bank.report), bank.left]).flatten().max().unwrap_or(0);
        let sequence = newest.checked_add(1).filter(|next| *next < u32::MAX).ok_or(StoreError::CounterAtEnd)?;
        // With nothing in force: what was left goes first, because the note that it was stands in the other bank; what
        // is for another gyro goes last.
        let rank = |report: &BankReport| match report {
            BankReport::Left { .. } => 0,
            BankReport::NoImage(_) | BankReport::Unfit(_) => 2,
            _ => 1,
        };
        let target = match (force, &banks) {
            (Some(bank), _) => 1 - bank,
            (None, [first, second]) => usize::from(rank(second) < rank(first)),
        };
        self.write(target, sequence, image)
    }

    /// Leaves the image in force, so that the one before it is in force again, which is returned.
    ///
    /// # Errors
    /// [`StoreError::NothingToGoBackTo`] unless the other bank holds a valid image for this gyro; flash errors, after
    /// which one of the two is in force.
    pub fn roll_back(&mut self, gyro: &Gyro) -> Result<Image, StoreError<F::Error>> {
        let found = self.look_at_both(gyro);
        let (older, number) = match found.map(|bank| bank.report) {
            [BankReport::Valid { stored: a, .. }, BankReport::Valid { stored: b, .. }] => {
                if a < b {
                    (0, b)
                } else {
                    (1, a)
                }
            }
            _ => return Err(StoreError::NothingToGoBackTo),
        };
        let start = self.start(older);
        for slot in 0..LEFT_SLOTS {
            let offset = start + LEFT_AT + slot * REGION_ALIGNMENT as u32;
            // A slot that cannot be read was torn by an attempt before, on flash with error correction.
            if self.read_unit(offset).is_ok_and(|unit| unit == BLANK) {
                self.program(offset, &layout::left_unit(number))?;
                return found.get(older).and_then(|bank| bank.image).ok_or(StoreError::NothingToGoBackTo);
            }
        }
        Err(StoreError::NoSlotLeft)
    }

    fn start(&self, bank: usize) -> u32 {
        if bank == 0 { self.base } else { self.base + self.len }
    }

    fn write(&mut self, bank: usize, sequence: u32, image: &Image) -> Result<(), StoreError<F::Error>> {
        let start = self.start(bank);
        let mut area = [0xff; IMAGE_AREA];
        // The area is as long as the longest image.
        let len = image.encode(&mut area).unwrap_or(0);
        let image_crc = crc32(area.get(..len).unwrap_or(&[]));
        let head = Head { sequence, len: len as u32, image_crc };
        self.erase(start)?;
        for (index, unit) in (0_u32..).zip(area.chunks_exact(REGION_ALIGNMENT)) {
            if let Some(unit) = unit.first_chunk::<REGION_ALIGNMENT>().filter(|_| (index as usize) * 32 < len) {
                self.program(start + IMAGE_AT + index * REGION_ALIGNMENT as u32, unit)?;
            }
        }
        self.program(start + HEAD_AT, &head.unit())?;
        self.program(start + COMMIT_AT, &head.commit())
    }

    /// Erases a bank, the sector of its commit word first, and makes sure that it is.
    fn erase(&mut self, start: u32) -> Result<(), StoreError<F::Error>> {
        let mut from = start;
        while from < start + self.len {
            let to = from + F::ERASE_SIZE as u32;
            self.flash.erase(from, to).map_err(StoreError::Flash)?;
            from = to;
        }
        let mut offset = start;
        while offset < start + END {
            if self.read_unit(offset).map_err(StoreError::Flash)? != BLANK {
                return Err(StoreError::ReadBack { offset });
            }
            offset += REGION_ALIGNMENT as u32;
        }
        Ok(())
    }

    fn program(&mut self, offset: u32, unit: &Unit) -> Result<(), StoreError<F::Error>> {
        self.flash.write(offset, unit).map_err(StoreError::Flash)?;
        let back = self.read_unit(offset).map_err(StoreError::Flash)?;
        if back == *unit { Ok(()) } else { Err(StoreError::ReadBack { offset }) }
    }

    fn read_unit(&mut self, offset: u32) -> Result<Unit, F::Error> {
        let mut unit = BLANK;
        self.flash.read(offset, &mut unit)?;
        Ok(unit)
    }

    fn look_at_both(&mut self, gyro: &Gyro) -> [Found; 2] {
        let mut found = [self.look(0, gyro), self.look(1, gyro)];
        let left = found.map(|bank| bank.left);
        for (bank, left) in found.iter_mut().zip(left.iter().rev()) {
            if let BankReport::Valid { stored, .. } = bank.report
                && left.is_some_and(|left| stored <= left)
            {
                bank.report = BankReport::Left { stored };
            }
        }
        found
    }

    fn look(&mut self, bank: usize, gyro: &Gyro) -> Found {
        let start = self.start(bank);
        let left = self.read_left(start);
        match self.read_bank(start) {
            Err(_) => Found { report: BankReport::Unreadable, image: None, left },
            Ok(Err(report)) => Found { report, image: None, left },
            Ok(Ok((stored, image))) => match gyro.accept(&image) {
                Err(unfit) => Found { report: BankReport::Unfit(unfit), image: None, left },
                Ok(()) => {
                    let sequence = image.description().sequence;
                    Found { report: BankReport::Valid { stored, sequence }, image: Some(image), left }
                }
            },
        }
    }

    /// The highest number of the notes that can be read.
    fn read_left(&mut self, start: u32) -> Option<u32> {
        let units = (0..LEFT_SLOTS).map(|slot| start + LEFT_AT + slot * REGION_ALIGNMENT as u32);
        units.filter_map(|offset| layout::left_number(&self.read_unit(offset).ok()?)).max()
    }

    /// Number of the store and image. The outer error is the flash's, the inner one what is wrong with the bank.
    fn read_bank(&mut self, start: u32) -> Result<Result<(u32, Image), BankReport>, F::Error> {
        let commit = self.read_unit(start + COMMIT_AT)?;
        if commit == BLANK {
            return Ok(Err(BankReport::Uncommitted));
        }
        let head = match Head::read(&self.read_unit(start + HEAD_AT)?) {
            Some(head) if head.commit() == commit => head,
            _ => return Ok(Err(BankReport::Damaged)),
        };
        let mut area = [0xff; IMAGE_AREA];
        self.flash.read(start + IMAGE_AT, &mut area)?;
        let bytes = area.get(..head.len as usize).unwrap_or(&[]);
        if crc32(bytes) != head.image_crc {
            return Ok(Err(BankReport::Damaged));
        }
        Ok(Image::decode(bytes).map(|image| (head.sequence, image)).map_err(BankReport::NoImage))
    }
}

/// The bank with the higher number of the valid ones; of two equal numbers, which no store makes, the first.
fn in_force(banks: &[BankReport; 2]) -> Option<usize> {
    let number = |report: &BankReport| match report {
        BankReport::Valid { stored, .. } => Some(*stored),
        _ => None,
    };
    match banks.each_ref().map(number) {
        [Some(first), Some(second)] => Some(usize::from(second > first)),
        [Some(_), None] => Some(0),
        [None, Some(_)] => Some(1),
        [None, None] => None,
    }
}
