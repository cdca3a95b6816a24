//! Two flash banks: the active image and the one before it.
//!
//! ```text
//! store:      erase the other bank ─▶ image ─▶ head ─▶ read back ─▶ commit word ─▶ read back
//! load:       the last stored of the banks that are committed, intact, for this gyro and not withdrawn
//! roll back:  program one note in the older bank: the newer image is withdrawn
//! trial:      start 1, 2, 3, 4: a mark each ─▶ confirm, or start 5 rolls back by itself
//! ```
//!
//! Power may fail at any step: [`Banks::load`] then finds the old image or the new one. A store never touches the bank of the active
//! image. The new image counts only with its commit word, which is written last and contains a hash of its head and all of the image. So
//! an image that comes under the head of another one by hand is damaged, however legal it is. Two banks of one store number, which no
//! store makes, are a copy by hand; the first is used, as a survivor.
//!
//! An image that is stored on trial is in force until [`Banks::confirm`], or until it has been started [`TRIAL_STARTS`] times without it: an
//! image with which the board does not live long enough to be confirmed goes by itself. Call [`Banks::start`] at power-on; it counts.
//!
//! A store never erases the only confirmed image: while an image is on trial over a confirmed one, confirm it or roll it back first. It
//! erases nothing while neither bank can be read.
//!
//! An image that makes the board miss its watchdog would do so for ever. [`Banks::start`] takes the number of watchdog resets in a row: from
//! [`TRIAL_STARTS`] on it sets the active image aside, and from twice as many on the other one too, until power-on or the next store.
//!
//! A store refuses an image whose own sequence number is not after that of the active one (RFC 1982: less than 2³¹ above it, over the end of
//! the numbers as well), so an old file cannot return by mistake, and no number is the last one. Use [`Banks::roll_back`] to go back. A
//! withdrawn image stays withdrawn, even if the older image is damaged later: the note is next to that image, in four copies, and no erase
//! of the withdrawn bank can remove it. `docs/reference/image-format.md` has the bytes.
//!
//! Limits: if both banks are damaged at once the factory defaults run, and [`Loaded::origin`] says so. A damaged commit word looks like
//! a store that was cut in that word; both are [`BankReport::Damaged`]. A commit word that reads differently each time cannot be detected.

mod gyro;
mod layout;

use core::cmp::Ordering;
use core::fmt;

use embedded_storage::nor_flash::NorFlash;

pub use gyro::{Gyro, ImageMismatch};
pub use layout::{BANK_LEN, REGION_ALIGNMENT, TRIAL_STARTS};

use crate::codec::DecodeError;
use crate::image::Image;
use layout::{
    BLANK, COMMIT_AT, CONFIRM_AT, CONFIRMS, END, HEAD_AT, Head, IMAGE_AREA, IMAGE_AT, NOTES, NOTES_AT, STARTS_AT, Unit,
    is_newer, next_number,
};

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
    /// A valid image that a roll back has withdrawn.
    Withdrawn {
        /// Number of the store that wrote it.
        stored: u32,
    },
    /// A valid image that was running when the watchdog reset the board again and again.
    SetAside {
        /// Number of the store that wrote it.
        stored: u32,
    },
    /// Commit word, head or image damaged.
    Damaged,
    /// Intact bytes that this code refuses as an image.
    NoImage {
        /// Number of the store that wrote them.
        stored: u32,
        /// Why.
        error: DecodeError,
    },
    /// An intact image for another gyro.
    Mismatch {
        /// Number of the store that wrote it.
        stored: u32,
        /// Why.
        mismatch: ImageMismatch,
    },
    /// The flash could not be read.
    Unreadable,
}

impl BankReport {
    /// Number of the store that wrote what is intact here; no store has 0.
    fn stored(&self) -> Option<u32> {
        let stored = match self {
            Self::Valid { stored, .. }
            | Self::Withdrawn { stored }
            | Self::SetAside { stored }
            | Self::NoImage { stored, .. }
            | Self::Mismatch { stored, .. } => *stored,
            Self::Uncommitted | Self::Damaged | Self::Unreadable => 0,
        };
        (stored != 0).then_some(stored)
    }

    /// Without an active image a store takes the bank of the lower rank: a withdrawn image first (its note is in the other bank), then what
    /// can never be an image, then what may be one again.
    const fn rank(&self) -> u8 {
        match self {
            Self::Withdrawn { .. } => 0,
            Self::Uncommitted | Self::Damaged | Self::Valid { .. } => 1,
            Self::Unreadable => 2,
            Self::SetAside { .. } | Self::NoImage { .. } | Self::Mismatch { .. } => 3,
        }
    }
}

/// Where the active image comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// The newest image that was stored.
    Newest,
    /// The only usable image: the other bank is damaged, unreadable, set aside, for another gyro, or a copy of this one. It may be the older
    /// of the two.
    Survivor,
    /// No bank holds an image for this gyro. Counts pass through uncorrected.
    #[default]
    FactoryDefaults,
}

/// What flash holds for a gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The active image.
    pub image: Image,
    /// Where it comes from.
    pub origin: Origin,
    /// What each bank holds.
    pub banks: [BankReport; 2],
    /// The active image is on trial: not confirmed yet.
    pub trial: bool,
    /// [`Image::checksum`] of the image, made here so that the tick does not wait for it.
    checksum: u32,
}

impl Loaded {
    /// An image, where it comes from, and whether it is on trial.
    pub fn new(image: Image, origin: Origin, banks: [BankReport; 2], trial: bool) -> Self {
        Self { image, origin, banks, trial, checksum: image.checksum() }
    }

    /// [`Image::checksum`] of the image.
    pub const fn checksum(&self) -> u32 {
        self.checksum
    }
}

/// Why a store or a roll back failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError<E> {
    /// The image is for another gyro.
    Mismatch(ImageMismatch),
    /// The active image is on trial over a confirmed one, which a store would erase.
    OnTrial,
    /// The sequence number of the image is not after that of the active one.
    NotNewer {
        /// Sequence number of the active image.
        active: u32,
        /// Sequence number of the refused image.
        offered: u32,
    },
    /// There is no older image to go back to.
    NoOlderImage,
    /// All places for a note are used, by roll backs or confirmations that were cut short.
    NoFreeNote,
    /// No image is on trial.
    NotOnTrial,
    /// The flash does not read back what was written: worn out, or write-protected. The active image is not affected.
    ReadBack {
        /// Offset from the start of the flash.
        offset: u32,
    },
    /// The flash reported an error.
    Flash(E),
}

impl<E: fmt::Debug> fmt::Display for StoreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mismatch(mismatch) => write!(f, "{mismatch}"),
            Self::NotNewer { active, offered } => {
                write!(f, "sequence number {offered} is not after {active}, that of the active image")
            }
            Self::OnTrial => f.write_str("the active image is on trial: confirm it or roll it back first"),
            Self::NoOlderImage => f.write_str("the other bank holds no image to go back to"),
            Self::NoFreeNote => f.write_str("no place for another note; store an image instead"),
            Self::NotOnTrial => f.write_str("no image is on trial"),
            Self::ReadBack { offset } => write!(f, "flash does not read back what was written at {offset:#x}"),
            Self::Flash(error) => write!(f, "flash: {error:?}"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for StoreError<E> {}

/// Two banks in one flash, one after the other.
#[derive(Debug)]
pub struct Banks<F> {
    flash: F,
    base: u32,
    len: u32,
    /// Banks whose image the watchdog has shown to be bad.
    aside: [bool; 2],
}

/// One bank as found.
#[derive(Clone, Copy, Debug)]
struct Found {
    report: BankReport,
    /// The other bank's images are withdrawn up to this store.
    withdrawn: Option<u32>,
    /// On trial and not confirmed.
    trial: bool,
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
        fits.then_some(Self { flash, base, len, aside: [false; 2] })
    }

    /// The flash, for other uses.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Power-on or reset: the active image for this gyro. An image on trial is marked as started once more; if all its starts are used, it is
    /// withdrawn, and the image before it is active again. Without an image before it, it stays.
    ///
    /// `watchdog_resets`: resets by the watchdog in a row, from memory that a reset leaves alone; begin again at 0 at power-on and when the
    /// board has run for a minute. 0 if there is no such memory: then only an image on trial goes by itself.
    ///
    /// **SAG-CORE-022** An image on trial is withdrawn after four starts without a confirmation.
    ///
    /// **SAG-CORE-029** After four watchdog resets in a row the active image is set aside, after eight the other one too.
    #[inline(never)]
    pub fn start(&mut self, gyro: &Gyro, watchdog_resets: u32) -> Loaded {
        self.aside = [false; 2];
        match self.mark_trial(gyro, STARTS_AT, TRIAL_STARTS) {
            Ok(()) | Err(StoreError::NotOnTrial) => {}
            // All starts are used, or the flash takes no more marks. If it takes no note either, the image stays on trial, and says so.
            Err(_) => {
                if self.roll_back(gyro).is_ok() {
                    return self.load(gyro);
                }
            }
        }
        for _ in 0..(watchdog_resets / TRIAL_STARTS).min(2) {
            let current = active(&self.inspect_both(gyro).map(|bank| bank.report));
            if let Some(aside) = current.and_then(|bank| self.aside.get_mut(bank)) {
                *aside = true;
            }
        }
        self.load(gyro)
    }

    /// Confirms the active image: it is no longer on trial.
    ///
    /// # Errors
    /// [`StoreError::NotOnTrial`]; [`StoreError::NoFreeNote`] after two confirmations that were cut; [`StoreError::ReadBack`] and
    /// [`StoreError::Flash`], then it may be on trial or confirmed.
    #[inline(never)]
    pub fn confirm(&mut self, gyro: &Gyro) -> Result<(), StoreError<F::Error>> {
        self.mark_trial(gyro, CONFIRM_AT, CONFIRMS)
    }

    /// Programs a mark of the active image's store into a row of its bank, if it is on trial.
    fn mark_trial(&mut self, gyro: &Gyro, row: u32, units: u32) -> Result<(), StoreError<F::Error>> {
        let inspected = self.inspect_both(gyro);
        let current = active(&inspected.map(|bank| bank.report)).and_then(|bank| Some((bank, inspected.get(bank)?)));
        match current {
            Some((bank, Found { report: BankReport::Valid { stored, .. }, trial: true, .. })) => {
                let start = self.start_of(bank);
                self.mark(start + row, units, *stored)
            }
            _ => Err(StoreError::NotOnTrial),
        }
    }

    /// The active image for this gyro. Only reads the flash.
    #[inline(never)]
    pub fn load(&mut self, gyro: &Gyro) -> Loaded {
        let inspected = self.inspect_both(gyro);
        let banks = inspected.map(|bank| bank.report);
        let current = active(&banks);
        let image = current.and_then(|bank| self.image_of(bank, gyro));
        let origin = match (image, current.and_then(|bank| banks.get(1 - bank))) {
            (None, _) => Origin::FactoryDefaults,
            (Some(_), Some(BankReport::Uncommitted | BankReport::Withdrawn { .. })) => Origin::Newest,
            (Some(_), Some(BankReport::Valid { stored, .. })) if !twice(&banks, *stored) => Origin::Newest,
            (Some(_), _) => Origin::Survivor,
        };
        let trial = current.and_then(|bank| inspected.get(bank)).is_some_and(|bank| bank.trial);
        Loaded::new(image.unwrap_or_else(|| gyro.factory_defaults()), origin, banks, trial)
    }

    /// Stores an image in the bank that is not active, and makes it the active one.
    ///
    /// # Errors
    /// [`StoreError`]; then the active image is the one from before.
    pub fn store(&mut self, gyro: &Gyro, image: &Image) -> Result<(), StoreError<F::Error>> {
        self.store_as(gyro, image, false)
    }

    /// The same, on trial: see [`Banks::start`] and [`Banks::confirm`].
    ///
    /// # Errors
    /// [`StoreError`]; then the active image is the one from before.
    pub fn store_on_trial(&mut self, gyro: &Gyro, image: &Image) -> Result<(), StoreError<F::Error>> {
        self.store_as(gyro, image, true)
    }

    /// What a store of this image would answer without touching the flash, so that a counter can be raised before it.
    ///
    /// # Errors
    /// [`StoreError`], but for those of programming and erasing.
    #[inline(never)]
    pub fn check(&mut self, gyro: &Gyro, image: &Image) -> Result<(), StoreError<F::Error>> {
        self.place_for(gyro, image).map(|_| ())
    }

    /// **SAG-CORE-021** A loss of power at any step of a store leaves the old image or the new one in force, never a mixture.
    #[inline(never)]
    fn store_as(&mut self, gyro: &Gyro, image: &Image, trial: bool) -> Result<(), StoreError<F::Error>> {
        let (target, number) = self.place_for(gyro, image)?;
        if let Some(aside) = self.aside.get_mut(target) {
            *aside = false;
        }
        self.write(target, number, image, trial)
    }

    /// The bank for this image, and the number of its store.
    ///
    /// **SAG-CORE-030** A store never erases the only confirmed image, and erases nothing while neither bank can be read.
    fn place_for(&mut self, gyro: &Gyro, image: &Image) -> Result<(usize, u32), StoreError<F::Error>> {
        gyro.accept(image).map_err(StoreError::Mismatch)?;
        let inspected = self.inspect_both(gyro);
        let banks = inspected.map(|bank| bank.report);
        if banks == [BankReport::Unreadable; 2] {
            self.read_unit(self.start_of(0) + HEAD_AT)
                .or_else(|_| self.read_unit(self.start_of(1) + HEAD_AT))
                .map_err(StoreError::Flash)?;
        }
        let current = active(&banks);
        let other = current.and_then(|bank| inspected.get(1 - bank));
        let active = match current.and_then(|bank| inspected.get(bank)) {
            Some(Found { trial: true, .. })
                if other.is_some_and(|other| matches!(other.report, BankReport::Valid { .. }) && !other.trial) =>
            {
                return Err(StoreError::OnTrial);
            }
            Some(Found { report: BankReport::Valid { sequence, .. }, .. }) => Some(*sequence),
            _ => None,
        };
        let offered = image.description().sequence;
        // Replies report the factory defaults as 0, so no image has that number.
        if offered == 0 || active.is_some_and(|active| !is_newer(offered, active)) {
            return Err(StoreError::NotNewer { active: active.unwrap_or(0), offered });
        }
        let numbers = inspected.iter().flat_map(|bank| [bank.report.stored(), bank.withdrawn]).flatten();
        let newest = numbers.reduce(|a, b| if is_newer(b, a) { b } else { a }).unwrap_or(0);
        let target = match (current, &banks) {
            (Some(bank), _) => 1 - bank,
            (None, [first, second]) => match second.rank().cmp(&first.rank()) {
                Ordering::Less => 1,
                Ordering::Greater => 0,
                // The older of two that may be images again.
                Ordering::Equal => match (first.stored(), second.stored()) {
                    (Some(first), Some(second)) => usize::from(is_newer(first, second)),
                    _ => 0,
                },
            },
        };
        Ok((target, next_number(newest)))
    }

    /// Withdraws the active image. The one before it becomes active again and is returned.
    ///
    /// # Errors
    /// [`StoreError::NoOlderImage`] unless the other bank holds a valid image for this gyro. After a flash error either of the two
    /// may be active.
    #[inline(never)]
    pub fn roll_back(&mut self, gyro: &Gyro) -> Result<Image, StoreError<F::Error>> {
        let inspected = self.inspect_both(gyro);
        let number = |report: BankReport| match report {
            BankReport::Valid { stored, .. } | BankReport::SetAside { stored } => Some(stored),
            _ => None,
        };
        let (older, number) = match inspected.map(|bank| number(bank.report)) {
            [Some(a), Some(b)] if is_newer(b, a) => (0, b),
            [Some(a), Some(_)] => (1, a),
            _ => return Err(StoreError::NoOlderImage),
        };
        let start = self.start_of(older);
        self.mark(start + NOTES_AT, NOTES, number)?;
        self.image_of(older, gyro).ok_or(StoreError::NoOlderImage)
    }

    fn start_of(&self, bank: usize) -> u32 {
        if bank == 0 { self.base } else { self.base + self.len }
    }

    /// Programs a note into the first unit of a row that takes it. An earlier attempt that was cut may have made a unit unreadable, on
    /// flash with error correction, or left it blank and not programmable.
    fn mark(&mut self, first: u32, units: u32, number: u32) -> Result<(), StoreError<F::Error>> {
        let mut result = Err(StoreError::NoFreeNote);
        for offset in (0..units).map(|slot| first + slot * REGION_ALIGNMENT as u32) {
            if self.read_unit(offset).is_ok_and(|unit| unit == BLANK) {
                result = self.program(offset, &layout::note_unit(number));
                if result.is_ok() {
                    break;
                }
            }
        }
        result
    }

    #[inline(never)]
    fn write(&mut self, bank: usize, sequence: u32, image: &Image, trial: bool) -> Result<(), StoreError<F::Error>> {
        let start = self.start_of(bank);
        let mut area = [0xff; IMAGE_AREA];
        // The longest image fits.
        let len = image.encode(&mut area).unwrap_or(0);
        let head = Head { sequence, len: len as u32, trial };
        self.erase(start)?;
        for (index, unit) in (0_u32..).zip(area.chunks_exact(REGION_ALIGNMENT)) {
            if let Some(unit) = unit.first_chunk::<REGION_ALIGNMENT>().filter(|_| (index as usize) * 32 < len) {
                self.program(start + IMAGE_AT + index * REGION_ALIGNMENT as u32, unit)?;
            }
        }
        self.program(start + HEAD_AT, &head.unit())?;
        self.program(start + COMMIT_AT, &head.commit(area.get(..len).unwrap_or(&[])))
    }

    /// Erases a bank, beginning with the sector of its commit word, and checks that it is blank.
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

    #[inline(never)]
    fn inspect_both(&mut self, gyro: &Gyro) -> [Found; 2] {
        let mut inspected = [self.inspect(0, gyro), self.inspect(1, gyro)];
        let withdrawn = inspected.map(|bank| bank.withdrawn);
        for ((bank, withdrawn), aside) in inspected.iter_mut().zip(withdrawn.iter().rev()).zip(self.aside) {
            if let BankReport::Valid { stored, .. } = bank.report {
                if withdrawn.is_some_and(|number| !is_newer(stored, number)) {
                    bank.report = BankReport::Withdrawn { stored };
                } else if aside {
                    bank.report = BankReport::SetAside { stored };
                }
            }
        }
        inspected
    }

    #[inline(never)]
    fn inspect(&mut self, bank: usize, gyro: &Gyro) -> Found {
        let start = self.start_of(bank);
        let withdrawn = self.newest_note(start + NOTES_AT, NOTES);
        let without = |report| Found { report, withdrawn, trial: false };
        match self.read_bank(start) {
            Err(_) => without(BankReport::Unreadable),
            Ok(Err(report)) => without(report),
            Ok(Ok((head, image))) => match gyro.accept(&image) {
                Err(mismatch) => without(BankReport::Mismatch { stored: head.sequence, mismatch }),
                Ok(()) => {
                    let (stored, sequence) = (head.sequence, image.description().sequence);
                    let confirmed = self.newest_note(start + CONFIRM_AT, CONFIRMS) == Some(stored);
                    let report = BankReport::Valid { stored, sequence };
                    Found { report, withdrawn, trial: head.trial && !confirmed }
                }
            },
        }
    }

    /// The image of a bank, read and checked once more: two images at a time would double the stack.
    #[inline(never)]
    fn image_of(&mut self, bank: usize, gyro: &Gyro) -> Option<Image> {
        let (_, image) = self.read_bank(self.start_of(bank)).ok()?.ok()?;
        gyro.accept(&image).is_ok().then_some(image)
    }

    /// The newest number of the notes of a row that can be read.
    fn newest_note(&mut self, first: u32, units: u32) -> Option<u32> {
        let offsets = (0..units).map(|slot| first + slot * REGION_ALIGNMENT as u32);
        let numbers = offsets.filter_map(|offset| layout::note_number(&self.read_unit(offset).ok()?));
        numbers.reduce(|a, b| if is_newer(b, a) { b } else { a })
    }

    /// The head and the image. The outer error is from the flash, the inner one says what is wrong with the bank.
    fn read_bank(&mut self, start: u32) -> Result<Result<(Head, Image), BankReport>, F::Error> {
        let commit = self.read_unit(start + COMMIT_AT)?;
        if commit == BLANK {
            return Ok(Err(BankReport::Uncommitted));
        }
        let Some(head) = Head::read(&self.read_unit(start + HEAD_AT)?) else { return Ok(Err(BankReport::Damaged)) };
        let mut area = [0xff; IMAGE_AREA];
        self.flash.read(start + IMAGE_AT, &mut area)?;
        let bytes = area.get(..head.len as usize).unwrap_or(&[]);
        if head.commit(bytes) != commit {
            return Ok(Err(BankReport::Damaged));
        }
        Ok(Image::decode(bytes)
            .map(|image| (head, image))
            .map_err(|error| BankReport::NoImage { stored: head.sequence, error }))
    }
}

/// Both banks are of this store.
fn twice(banks: &[BankReport; 2], number: u32) -> bool {
    banks.iter().all(|report| matches!(report, BankReport::Valid { stored, .. } if *stored == number))
}

/// The valid bank of the later store; the first one if both are equal, which no store makes.
fn active(banks: &[BankReport; 2]) -> Option<usize> {
    let number = |report: &BankReport| match report {
        BankReport::Valid { stored, .. } => Some(*stored),
        _ => None,
    };
    match banks.each_ref().map(number) {
        [Some(first), Some(second)] => Some(usize::from(is_newer(second, first))),
        [Some(_), None] => Some(0),
        [None, Some(_)] => Some(1),
        [None, None] => None,
    }
}
