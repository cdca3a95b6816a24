//! Sequences of stores, roll backs, trials and starts, cut at every step, as the Rust banks answer them: `check_banks` has to do the same
//! with the same flash, step for step.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use sagnac_core::{
    BankReport, Banks, Description, Gain, Gyro, Image, InputSpec, Loaded, MAX_TERMS, Origin, Shape, StoreError, Term,
};

use self::flash::{Dice, Fault, Flash};

/// The flash of the core's own tests.
#[path = "../../../../crates/sagnac-core/tests/flash/mod.rs"]
mod flash;

const BANK: u32 = 2048;
const NEVER: u32 = u32::MAX;
/// Cuts of one operation, at most, where a flash programs single bytes.
const MOST_CUTS: u64 = 60;

/// What is done to the banks.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "one at a time")]
enum Operation {
    Store {
        image: Image,
        trial: bool,
    },
    RollBack,
    Confirm,
    /// With so many watchdog resets in a row.
    Start(u8),
    /// A bit of a range flips.
    Rot {
        from: u16,
        to: u16,
    },
    /// Bytes appear by hand.
    Poke {
        at: u16,
        bytes: Vec<u8>,
    },
}

/// Records in the making.
struct Script<const U: usize, const S: usize> {
    bytes: Vec<u8>,
    operations: usize,
    kept: Flash<U, S>,
    now: Option<Flash<U, S>>,
}

/// Writes the records of so many sequences, over flashes of five families.
pub(super) fn records(folder: &Path, sequences: u64) -> Result<PathBuf> {
    let made: Vec<(Vec<u8>, usize)> = (0..sequences).map(one_sequence).collect();
    let operations: usize = made.iter().map(|(_, operations)| operations).sum();
    ensure!(operations > 50 * sequences as usize, "only {operations} operations");
    let file = folder.join(format!("banks-{sequences}.bin"));
    fs::write(&file, made.into_iter().flat_map(|(bytes, _)| bytes).collect::<Vec<u8>>())?;
    Ok(file)
}

/// The first sequences that fit so many bytes.
pub(super) fn records_within(folder: &Path, most: usize) -> Result<PathBuf> {
    let mut bytes = Vec::new();
    for (more, _) in (0..200).map(one_sequence) {
        if bytes.len() + more.len() <= most {
            bytes.extend(more);
        }
    }
    ensure!(bytes.len() > most / 2, "only {} bytes", bytes.len());
    let file = folder.join("banks.bin");
    fs::write(&file, bytes)?;
    Ok(file)
}

fn one_sequence(seed: u64) -> (Vec<u8>, usize) {
    match seed % 5 {
        0 => sequence::<4, 2048>(seed),
        1 => sequence::<8, 1024>(seed),
        2 => sequence::<16, 512>(seed),
        3 => sequence::<32, 2048>(seed),
        _ => sequence::<1, 256>(seed),
    }
}

fn image(sequence: u32, dice: &mut Dice) -> Image {
    let mut d = Description { sequence, ..Description::empty() };
    d.serial[..4].copy_from_slice(if dice.below(16) == 0 { b"RLG8" } else { b"RLG7" });
    d.input_count = 1;
    d.inputs[0] = InputSpec { gain: Gain { mantissa: 1 << 30, shift: 30 }, ..InputSpec::UNUSED };
    d.term_count = dice.below(MAX_TERMS as u64 + 1) as u8;
    for slot in &mut d.terms[..usize::from(d.term_count)] {
        *slot = Term {
            mantissa: dice.throw() as i32 | 1,
            shape: Shape::Chebyshev(dice.below(9) as u8),
            shift: 45,
            ..Term::ZERO
        };
    }
    Image::new(d).unwrap_or(Image::empty())
}

fn gyro() -> Gyro {
    let mut own = Description { sequence: 1, ..Description::empty() };
    own.serial[..4].copy_from_slice(b"RLG7");
    let own = Image::new(own).unwrap_or(Image::empty());
    Gyro { largest_increment: 1 << 40, largest_work: 2500, ..Gyro::of(&own, 1) }
}

fn encoded(image: &Image) -> Vec<u8> {
    let mut bytes = vec![0; image.encoded_len()];
    image.encode(&mut bytes).map_or_else(Vec::new, |_| bytes)
}

/// One flash from its first store on.
fn sequence<const U: usize, const S: usize>(seed: u64) -> (Vec<u8>, usize) {
    let mut dice = Dice(seed ^ 0xba9c);
    let mut script = Script::<U, S>::new(seed);
    let mut number = 0;
    for _ in 0..3 + dice.below(5) {
        let operation = next_operation(&mut dice, &mut number);
        let whole = script.operate(&operation, NEVER, 0, 1);
        let steps = whole.steps;
        let most = if U == 1 { MOST_CUTS } else { steps };
        for cut in 1..=steps.min(most) {
            let step = if most == steps { cut } else { 1 + dice.below(steps) };
            script.operate(&operation, step as u32, dice.throw() | 1, 1);
            // Once more, from the flash as the cut made it, with power.
            if dice.below(4) == 0 {
                script.operate(&operation, NEVER, 0, 0);
            }
        }
        script.operate(&operation, NEVER, 0, 3);
    }
    (script.bytes, script.operations)
}

fn next_operation(dice: &mut Dice, number: &mut u32) -> Operation {
    match dice.below(12) {
        0..=4 => {
            *number = match dice.below(12) {
                0 => *number,
                // Half of all numbers ahead, and one less.
                1 => number.wrapping_add(1 << 31),
                2 => number.wrapping_add((1 << 31) - 1),
                _ => number.wrapping_add(1 + dice.below(3) as u32),
            };
            Operation::Store { image: image(*number, dice), trial: dice.below(2) == 0 }
        }
        5 | 6 => Operation::RollBack,
        7 => Operation::Confirm,
        8 | 9 => Operation::Start([0, 0, 1, 3, 4, 7, 8, 255][dice.below(8) as usize]),
        10 => {
            let bank = dice.below(2) as u16 * BANK as u16;
            Operation::Rot { from: bank, to: bank + 1184 }
        }
        _ => by_hand(dice),
    }
}

/// A bank as docs/reference/image-format.md has it, with a number near the end of all numbers, and perhaps with bytes that are no image.
fn by_hand(dice: &mut Dice) -> Operation {
    let mut bytes = encoded(&image(1 + dice.below(4) as u32, dice));
    if dice.below(2) == 0 {
        bytes[40] ^= 1;
    }
    let number = u32::MAX - 3 + dice.below(3) as u32;
    let mut head = b"SAGNACBK".to_vec();
    for word in [3, number, bytes.len() as u32, dice.below(2) as u32, 0] {
        head.extend(word.to_le_bytes());
    }
    head.extend(sagnac_core::bytes::crc32(&head).to_le_bytes());
    let hash = sagnac_log::ingest::sha256(&[&head[..], &bytes].concat());
    let mut whole = b"COMMITTD".to_vec();
    whole.extend(number.to_le_bytes());
    whole.extend((!number).to_le_bytes());
    whole.extend(&hash[..16]);
    whole.resize(160, 0xff);
    whole.extend(head);
    whole.extend(bytes);
    whole.truncate(770);
    Operation::Poke { at: dice.below(2) as u16 * BANK as u16, bytes: whole }
}

impl<const U: usize, const S: usize> Script<U, S> {
    fn new(seed: u64) -> Self {
        let mut bytes = vec![b'F'];
        bytes.extend((U as u16).to_le_bytes());
        bytes.extend((S as u16).to_le_bytes());
        bytes.extend(seed.to_le_bytes());
        let gyro = gyro();
        bytes.push(b'G');
        bytes.extend(gyro.serial);
        bytes.push(gyro.axis);
        bytes.extend(gyro.tick_ns.to_le_bytes());
        bytes.extend(gyro.scale_factor_femto_arcsec.to_le_bytes());
        bytes.extend(gyro.quantum_nano_counts.to_le_bytes());
        bytes.extend(gyro.largest_increment.to_le_bytes());
        bytes.extend(gyro.largest_scale.to_le_bytes());
        bytes.extend(gyro.largest_work.to_le_bytes());
        // One of eight flashes is worn, or has a part that cannot be read.
        let mut kept = Flash::new(seed);
        let mut dice = Dice(!seed);
        (kept.worn, kept.unreadable) = match dice.below(24) {
            0 => (true, 0..0),
            1 | 2 => {
                let from = dice.below(2 * u64::from(BANK)) as usize;
                (false, from..from + 32)
            }
            _ => (false, 0..0),
        };
        bytes.extend([b'D', u8::from(kept.worn)]);
        bytes.extend((kept.unreadable.start as u16).to_le_bytes());
        bytes.extend((kept.unreadable.end as u16).to_le_bytes());
        Self { bytes, operations: 0, kept, now: None }
    }

    /// Does it, on the flash that was kept (flag 1) or as the last one left it, and records the answer; keeps the flash with flag 2.
    fn operate(&mut self, operation: &Operation, cut: u32, tear: u64, flags: u8) -> Flash<U, S> {
        let before =
            if flags & 1 == 1 { self.kept.clone() } else { self.now.clone().unwrap_or_else(|| self.kept.clone()) };
        let dice = if tear == 0 { before.dice.clone() } else { Dice(tear) };
        let steps_left = (cut != NEVER).then_some(u64::from(cut));
        let flash = Flash { steps: 0, steps_left, dice, ..before };
        let (kind, argument) = operation.record();
        let (flash, result, started) = operation.apply(flash);
        let steps = flash.steps;
        let mut banks = banks(Flash { steps_left: None, ..flash });
        // A start sets images aside until the next one; a cut ends that too.
        let loaded = started.filter(|_| cut == NEVER).unwrap_or_else(|| banks.load(&gyro()));
        let flash = banks.into_flash();
        let hash = flash.bytes[..2 * BANK as usize]
            .iter()
            .fold(2_166_136_261_u32, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(16_777_619));
        self.bytes.extend([b'O', kind, flags]);
        self.bytes.extend(cut.to_le_bytes());
        self.bytes.extend(tear.to_le_bytes());
        self.bytes.extend((argument.len() as u16).to_le_bytes());
        self.bytes.extend(argument);
        self.bytes.push(result);
        self.bytes.extend((steps as u32).to_le_bytes());
        self.bytes.extend(hash.to_le_bytes());
        self.bytes.extend([origin(loaded.origin), u8::from(loaded.trial)]);
        self.bytes.extend(loaded.image.description().sequence.to_le_bytes());
        for bank in loaded.banks {
            let (content, stored) = content(bank);
            self.bytes.push(content);
            self.bytes.extend(stored.to_le_bytes());
        }
        self.operations += 1;
        self.now = Some(flash.clone());
        if flags & 2 == 2 {
            self.kept = flash.clone();
        }
        flash
    }
}

impl Operation {
    /// Its number, and the bytes that belong to it.
    fn record(&self) -> (u8, Vec<u8>) {
        match self {
            Self::Store { image, trial } => (u8::from(*trial), encoded(image)),
            Self::RollBack => (2, Vec::new()),
            Self::Confirm => (3, Vec::new()),
            Self::Start(resets) => (4, vec![*resets]),
            Self::Rot { from, to } => (6, [from.to_le_bytes(), to.to_le_bytes()].concat()),
            Self::Poke { at, bytes } => (7, [&at.to_le_bytes()[..], bytes].concat()),
        }
    }

    fn apply<const U: usize, const S: usize>(&self, mut flash: Flash<U, S>) -> (Flash<U, S>, u8, Option<Loaded>) {
        match self {
            Self::Rot { from, to } => flash.rot((*from).into(), (*to).into()),
            Self::Poke { at, bytes } => {
                flash.bytes[usize::from(*at)..usize::from(*at) + bytes.len()].copy_from_slice(bytes);
            }
            _ => {
                let (mut banks, mut started) = (banks(flash), None);
                let result = match self {
                    Self::Store { image, trial: false } => banks.store(&gyro(), image),
                    Self::Store { image, trial: true } => banks.store_on_trial(&gyro(), image),
                    Self::RollBack => banks.roll_back(&gyro()).map(|_| ()),
                    Self::Confirm => banks.confirm(&gyro()),
                    Self::Start(resets) => {
                        started = Some(banks.start(&gyro(), (*resets).into()));
                        Ok(())
                    }
                    _ => Ok(()),
                };
                return (banks.into_flash(), result.map_or_else(|error| code(&error), |()| 0), started);
            }
        }
        (flash, 0, None)
    }
}

fn banks<const U: usize, const S: usize>(flash: Flash<U, S>) -> Banks<Flash<U, S>> {
    Banks::new(flash, 0, BANK).expect("two banks of 2 KB fit 8 KB")
}

/// The numbers of `sagnac_store_result`.
const fn code(error: &StoreError<Fault>) -> u8 {
    match error {
        StoreError::Mismatch(_) => 2,
        StoreError::NotNewer { .. } => 3,
        StoreError::NoOlderImage => 4,
        StoreError::NoFreeNote => 5,
        StoreError::NotOnTrial => 6,
        StoreError::ReadBack { .. } => 7,
        StoreError::Flash(_) => 8,
        StoreError::OnTrial => 9,
    }
}

/// The numbers of `sagnac_origin`.
const fn origin(origin: Origin) -> u8 {
    match origin {
        Origin::Newest => 0,
        Origin::Survivor => 1,
        Origin::FactoryDefaults => 2,
    }
}

/// The numbers of `sagnac_bank_content`, and that of the store.
const fn content(report: BankReport) -> (u8, u32) {
    match report {
        BankReport::Uncommitted => (0, 0),
        BankReport::Valid { stored, .. } => (1, stored),
        BankReport::Withdrawn { stored } => (2, stored),
        BankReport::Damaged => (3, 0),
        BankReport::NoImage { stored, .. } => (4, stored),
        BankReport::Mismatch { stored, .. } => (5, stored),
        BankReport::Unreadable => (6, 0),
        BankReport::SetAside { stored } => (7, stored),
    }
}
