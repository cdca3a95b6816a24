//! Flash banks: power fails at every step, and the banks hold the old image or the new one.

use crate::flash::{Dice, Fault, Flash};
use sagnac_core::{
    BANK_LEN, BankReport, Banks, Description, Gain, Gyro, Image, ImageMismatch, InputSpec, Kind, MAX_TERMS, Multiplier,
    Origin, Shape, StoreError, TRIAL_STARTS, Term,
};
use sha2::{Digest, Sha256};

const LEN: u32 = 2048;

/// An image of this gyro; `dice` gives its terms.
fn image(sequence: u32, dice: &mut Dice) -> Image {
    let mut d = Description { sequence, ..Description::empty() };
    d.serial[..4].copy_from_slice(b"RLG7");
    d.input_count = 1;
    d.inputs[0] = InputSpec { gain: Gain { mantissa: 1 << 30, shift: 30 }, ..InputSpec::UNUSED };
    d.term_count = dice.below(MAX_TERMS as u64 + 1) as u8;
    for slot in &mut d.terms[..usize::from(d.term_count)] {
        let mantissa = dice.throw() as i32 | 1;
        *slot = Term { mantissa, shape: Shape::Chebyshev(dice.below(9) as u8), shift: 45, ..Term::ZERO };
    }
    Image::new(d).unwrap()
}

/// Accepts every image that `image` can make.
fn gyro() -> Gyro {
    Gyro { largest_increment: 1 << 40, largest_work: 4000, ..Gyro::of(&image(0, &mut Dice(0)), 1) }
}

fn banks<const U: usize, const S: usize>(flash: Flash<U, S>) -> Banks<Flash<U, S>> {
    Banks::new(flash, 0, LEN).unwrap()
}

/// What a user does to the banks.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a few of them at a time")]
enum Update {
    Store(Image),
    RollBack,
}

fn apply<const U: usize, const S: usize>(flash: Flash<U, S>, update: &Update) -> (Flash<U, S>, bool) {
    let mut banks = banks(flash);
    let done = match update {
        Update::Store(image) => banks.store(&gyro(), image).is_ok(),
        Update::RollBack => banks.roll_back(&gyro()).is_ok(),
    };
    (banks.into_flash(), done)
}

fn active<const U: usize, const S: usize>(flash: &Flash<U, S>) -> (Image, Origin) {
    let loaded = banks(flash.clone()).load(&gyro());
    (loaded.image, loaded.origin)
}

/// Goes through a sequence of updates; cuts the power in every step of every one. Steps cut.
fn cut_everywhere<const U: usize, const S: usize>(seed: u64) -> u64 {
    let mut dice = Dice(seed);
    let mut flash = Flash::<U, S>::new(seed ^ 0xf1a5);
    let (mut sequence, mut cuts, mut can_go_back) = (0, 0, false);
    // What may be active: all images that were stored and not withdrawn.
    let mut stored = Vec::new();
    for _ in 0..1 + dice.below(4) {
        let update = if can_go_back && dice.below(3) == 0 {
            Update::RollBack
        } else {
            sequence += 1 + dice.below(3) as u32;
            Update::Store(image(sequence, &mut dice))
        };
        let before = active(&flash);
        let (after, done) = apply(Flash { steps: 0, ..flash.clone() }, &update);
        assert!(done, "seed {seed}: {update:?} without a cut");
        let wanted = active(&after);
        assert_ne!(before.0, wanted.0);
        assert_eq!(wanted.1, Origin::Newest);
        for step in 1..=after.steps {
            let tear = dice.throw();
            let torn = Flash { steps_left: Some(step), dice: Dice(tear), ..flash.clone() };
            let (torn, done) = apply(torn, &update);
            assert!(!done, "seed {seed}, step {step}: done in spite of the cut");
            let mut restarted = Flash { steps_left: None, ..torn };
            let found = active(&restarted);
            let kept =
                found.0 == before.0 && (before.1 == Origin::FactoryDefaults) == (found.1 == Origin::FactoryDefaults);
            assert!(kept || found.0 == wanted.0, "seed {seed}, step {step} of {update:?}: {found:?}");
            cuts += 1;
            // Damage in the inactive bank changes nothing; in the active one it is detected, and that image is never used.
            if dice.below(4) == 0 {
                let bank = dice.below(2) as u32 * LEN;
                restarted.rot(bank, bank + BANK_LEN);
                let rotten = active(&restarted);
                let known = rotten.0 == wanted.0 || stored.contains(&rotten.0);
                assert!(known || rotten.1 == Origin::FactoryDefaults, "seed {seed}, step {step}: {rotten:?}");
                continue;
            }
            // Once more, with power: done.
            if found.0 != wanted.0 {
                let (again, done) = apply(restarted, &update);
                assert!(done, "seed {seed}, step {step}: not again");
                assert_eq!(active(&again).0, wanted.0, "seed {seed}, step {step}");
            }
        }
        match &update {
            Update::Store(image) => stored.push(*image),
            Update::RollBack => stored.retain(|image| *image != before.0),
        }
        can_go_back = matches!(update, Update::Store(_)) && before.1 != Origin::FactoryDefaults;
        flash = after;
    }
    cuts
}

/// 1,000 sequences over the flashes of five families (4 bytes and 2 KB pages; 8; 16; 32 with error correction; 1).
/// SAG-CORE-021
#[test]
fn power_fails_at_every_step() {
    let mut cuts = 0;
    for seed in 0..1000 {
        cuts += match seed % 5 {
            0 => cut_everywhere::<4, 2048>(seed),
            1 => cut_everywhere::<8, 1024>(seed),
            2 => cut_everywhere::<16, 512>(seed),
            3 => cut_everywhere::<32, 2048>(seed),
            _ => cut_everywhere::<1, 256>(seed),
        };
    }
    println!("{cuts} cuts");
    assert!(cuts > 300_000, "{cuts}");
}

/// Three bits anywhere in one of two full banks: the other bank's image, or the active one, and never a withdrawn one.
#[test]
fn flipped_bits_in_either_bank_are_detected() {
    let (mut survivors, mut defaults) = (0, 0);
    for seed in 0..4000_u64 {
        let mut dice = Dice(seed);
        let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
        let mut flash = Flash::<8, 1024>::new(seed);
        for image in &images {
            flash = apply(flash, &Update::Store(*image)).0;
        }
        let went_back = seed % 2 == 0;
        if went_back {
            flash = apply(flash, &Update::RollBack).0;
        }
        let bank = (seed / 2 % 2) as u32 * LEN;
        for _ in 0..=dice.below(3) {
            flash.rot(bank, bank + BANK_LEN);
        }
        let (found, origin) = active(&flash);
        match (went_back, origin) {
            (true, Origin::Newest | Origin::Survivor) => assert_eq!(found, images[1], "seed {seed}"),
            (true, Origin::FactoryDefaults) => defaults += 1,
            (false, Origin::Newest) => assert_eq!(found, images[2], "seed {seed}"),
            (false, Origin::Survivor) => {
                survivors += 1;
                assert!(found == images[1] || found == images[2], "seed {seed}");
            }
            (false, Origin::FactoryDefaults) => panic!("seed {seed}: one bank is intact"),
        }
    }
    println!("{survivors} survivors, {defaults} defaults");
    assert!(survivors > 500 && defaults > 200);
}

#[test]
fn empty_banks_give_factory_defaults() {
    let loaded = banks(Flash::<4, 2048>::new(1)).load(&gyro());
    assert_eq!(loaded.origin, Origin::FactoryDefaults);
    assert_eq!(loaded.banks, [BankReport::Uncommitted; 2]);
    assert_eq!(loaded.image.serial(), Some("RLG7"));
    assert!(loaded.image.terms().is_empty());
}

/// SAG-CORE-023
#[test]
fn an_image_for_another_gyro_is_refused_by_store_and_load() {
    let mut dice = Dice(5);
    let own = image(1, &mut dice);
    let with = |change: fn(&mut Description)| {
        let mut d = *own.description();
        change(&mut d);
        Image::new(d).unwrap()
    };
    let others = [
        (with(|d| d.serial[3] = b'8'), ImageMismatch::Serial),
        (with(|d| d.axis = b'y'), ImageMismatch::Axis),
        (with(|d| d.tick_ns = 50_000), ImageMismatch::Tick),
        (with(|d| d.scale_factor_femto_arcsec += 1), ImageMismatch::ScaleFactor),
        (with(|d| d.quantum_nano_counts = 250_000_000), ImageMismatch::Quantum),
        (
            with(|d| (d.terms[0], d.term_count) = (Term { mantissa: 1 << 30, shift: 12, ..Term::ZERO }, 1)),
            ImageMismatch::BiasTooLarge,
        ),
        (
            with(|d| {
                let scale =
                    Term { kind: Kind::Scale, multiplier: Multiplier::One, mantissa: 1 << 20, shift: 40, ..Term::ZERO };
                (d.terms[0], d.term_count) = (scale, 1);
            }),
            ImageMismatch::ScaleTooLarge,
        ),
        (
            // 572 + 15 + 32·(77 + 112).
            with(|d| {
                let sine = Term { shape: Shape::Sine { turns_q18: 1 }, mantissa: 1, shift: 40, ..Term::ZERO };
                (d.terms, d.term_count) = ([sine; MAX_TERMS], MAX_TERMS as u8);
            }),
            ImageMismatch::WorkTooLarge,
        ),
    ];
    for (other, why) in others {
        let mut banks = banks(Flash::<4, 2048>::new(1));
        assert_eq!(banks.store(&gyro(), &other), Err(StoreError::Mismatch(why)));
        // The same image, already in flash because the board was changed.
        let mut foreign = Gyro::of(&other, 1);
        (foreign.largest_increment, foreign.largest_scale, foreign.largest_work) = (i64::MAX, i64::MAX, u32::MAX);
        banks.store(&foreign, &other).unwrap();
        let loaded = banks.load(&gyro());
        assert_eq!(
            (loaded.origin, loaded.banks[0]),
            (Origin::FactoryDefaults, BankReport::Mismatch { stored: 1, mismatch: why })
        );
        banks.store(&gyro(), &own).unwrap();
        let loaded = banks.load(&gyro());
        assert_eq!(
            (loaded.image, loaded.banks[0]),
            (own, BankReport::Mismatch { stored: 1, mismatch: why }),
            "the other bank is used first"
        );
    }
}

#[test]
fn an_older_image_returns_only_by_roll_back() {
    let mut dice = Dice(9);
    let (old, new) = (image(4, &mut dice), image(5, &mut dice));
    let mut banks = banks(Flash::<4, 2048>::new(1));
    banks.store(&gyro(), &old).unwrap();
    assert_eq!(banks.roll_back(&gyro()), Err(StoreError::NoOlderImage));
    banks.store(&gyro(), &new).unwrap();
    for offered in [old, new] {
        let error = StoreError::NotNewer { active: 5, offered: offered.description().sequence };
        assert_eq!(banks.store(&gyro(), &offered), Err(error));
    }
    assert_eq!(banks.roll_back(&gyro()), Ok(old));
    assert_eq!(banks.load(&gyro()).image, old);
    assert!(matches!(banks.load(&gyro()).banks[1], BankReport::Withdrawn { stored: 2 }));
    assert_eq!(banks.roll_back(&gyro()), Err(StoreError::NoOlderImage));
    // The same image may be stored again: it is newer than the active one.
    banks.store(&gyro(), &new).unwrap();
    assert_eq!(banks.load(&gyro()).image, new);
}

/// After a roll back the older image decays, and a store is cut at every step: the withdrawn image stays withdrawn.
#[test]
fn a_withdrawn_image_stays_withdrawn_through_a_cut_store() {
    for seed in 0..60_u64 {
        let mut dice = Dice(seed);
        let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
        let mut flash = Flash::<8, 1024>::new(seed);
        for update in [Update::Store(images[0]), Update::Store(images[1]), Update::RollBack] {
            flash = apply(flash, &update).0;
        }
        // A bit of the older image, behind commit word and notes.
        flash.rot(200, 320);
        assert_eq!(active(&flash).1, Origin::FactoryDefaults, "seed {seed}");
        let (after, done) = apply(Flash { steps: 0, ..flash.clone() }, &Update::Store(images[2]));
        assert!(done && active(&after).0 == images[2]);
        for step in 1..=after.steps {
            let torn = Flash { steps_left: Some(step), dice: Dice(dice.throw()), ..flash.clone() };
            let (torn, _) = apply(torn, &Update::Store(images[2]));
            let found = active(&Flash { steps_left: None, ..torn });
            let new = found.0 == images[2];
            assert!(new || found.1 == Origin::FactoryDefaults, "seed {seed}, step {step}: {found:?}");
        }
    }
}

/// On flash with error correction a torn unit may not read at all: one such slot takes no other note away.
#[test]
fn an_unreadable_note_does_not_hide_the_others() {
    let mut dice = Dice(21);
    let images = [1, 2].map(|sequence| image(sequence, &mut dice));
    let mut flash = Flash::<8, 1024>::new(1);
    for image in &images {
        flash = apply(flash, &Update::Store(*image)).0;
    }
    // The first slot is torn and unreadable; the note goes to the second, and counts.
    flash.unreadable = 32..64;
    let (flash, done) = apply(flash, &Update::RollBack);
    assert!(done);
    assert_eq!(active(&flash), (images[0], Origin::Newest));
    for slot in [0, 2, 3] {
        let slot = Flash { unreadable: 32 + 32 * slot..64 + 32 * slot, ..flash.clone() };
        assert_eq!(active(&slot), (images[0], Origin::Newest));
    }
    // The active bank itself is damaged: the withdrawn image does not return.
    let unreadable = Flash { unreadable: 192..224, ..flash.clone() };
    assert_eq!(active(&unreadable).1, Origin::FactoryDefaults);
}

/// Found by fuzzing: four zero bytes at the place of a note are not a note, and stores continue.
#[test]
fn zeros_in_a_blank_place_are_not_a_note() {
    let mut dice = Dice(2);
    let (old, new) = (image(1, &mut dice), image(2, &mut dice));
    let (mut flash, _) = apply(Flash::<4, 2048>::new(1), &Update::Store(old));
    flash.bytes[36..40].fill(0);
    assert_eq!(active(&flash), (old, Origin::Newest));
    let (flash, done) = apply(flash, &Update::Store(new));
    assert!(done);
    assert_eq!(active(&flash), (new, Origin::Newest));
}

#[test]
fn worn_flash_is_reported_and_the_old_image_stays() {
    let mut dice = Dice(3);
    let (old, new) = (image(1, &mut dice), image(2, &mut dice));
    let (flash, _) = apply(Flash::<4, 2048>::new(1), &Update::Store(old));
    let mut banks = banks(Flash { worn: true, ..flash });
    assert!(matches!(banks.store(&gyro(), &new), Err(StoreError::ReadBack { offset }) if offset >= LEN));
    assert_eq!(banks.load(&gyro()).image, old);
}

#[test]
fn banks_that_do_not_fit_the_flash_are_refused() {
    assert!(Banks::new(Flash::<4, 2048>::new(0), 1024, LEN).is_none(), "not on a sector");
    assert!(Banks::new(Flash::<4, 512>::new(0), 0, 512).is_none(), "too short");
    assert!(Banks::new(Flash::<4, 2048>::new(0), 4096, 4096).is_none(), "beyond the end");
    assert!(Banks::new(Flash::<64, 2048>::new(0), 0, LEN).is_none(), "programs 64 bytes at a time");
    let mut dead = Flash::<4, 2048>::new(0);
    dead.steps_left = Some(0);
    let refused = Banks::new(dead, 0, LEN).unwrap().store(&gyro(), &image(1, &mut Dice(0)));
    assert_eq!(refused, Err(StoreError::Flash(Fault::PowerCut)));
}

/// Parts of a bank: commit word, head, image.
const PARTS: [std::ops::Range<usize>; 3] = [0..32, 160..192, 192..992];

/// By hand: parts of one legal bank under those of another. No mixture of two stores is an image, whichever part is which; a CRC would
/// not see it, because that of every image is the same number.
/// SAG-CORE-021
#[test]
fn parts_of_two_stores_are_no_image() {
    let mut mixtures = 0;
    for seed in 0..200_u64 {
        let mut dice = Dice(seed);
        let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
        let one = |image: &Image| apply(Flash::<8, 1024>::new(seed), &Update::Store(*image)).0;
        let mut flash = one(&images[0]);
        flash = apply(flash, &Update::Store(images[1])).0;
        // The third as the first store of another board, and as the second of one like this.
        let first = one(&images[2]);
        let second = apply(one(&images[0]), &Update::Store(images[2])).0;
        let others = [(&first, 0), (&second, LEN as usize), (&flash, 0)];
        for (other, from) in others {
            for mixture in 1..7_u8 {
                let mut mixed = flash.clone();
                let to = LEN as usize;
                for part in (0..3).filter(|part| mixture >> part & 1 == 1).map(|part| PARTS[part].clone()) {
                    mixed.bytes[to + part.start..to + part.end]
                        .copy_from_slice(&other.bytes[from + part.start..from + part.end]);
                }
                let is_all_of = |whole: &[u8], at: usize| {
                    PARTS.iter().all(|p| mixed.bytes[to + p.start..to + p.end] == whole[at + p.start..at + p.end])
                };
                // Heads of one length are equal, so that two parts may be a whole bank of the other.
                let wanted = if is_all_of(&flash.bytes, to) {
                    (images[1], Origin::Newest)
                } else if is_all_of(&other.bytes, from) {
                    (images[2], Origin::Newest)
                } else {
                    mixtures += 1;
                    (images[0], Origin::Survivor)
                };
                assert_eq!(active(&mixed), wanted, "seed {seed}, parts {mixture:03b}");
            }
        }
    }
    assert!(mixtures > 3000, "{mixtures}");
}

/// A whole bank copied over the newer one brings the older image back, and says that it may be the older.
#[test]
fn a_copied_bank_is_a_survivor() {
    let mut dice = Dice(5);
    let images = [1, 2].map(|sequence| image(sequence, &mut dice));
    let mut flash = Flash::<8, 1024>::new(5);
    for image in &images {
        flash = apply(flash, &Update::Store(*image)).0;
    }
    assert_eq!(active(&flash), (images[1], Origin::Newest));
    let (older, newer) = flash.bytes.split_at_mut(LEN as usize);
    newer[..LEN as usize].copy_from_slice(older);
    assert_eq!(active(&flash), (images[0], Origin::Survivor));
    // The next store ends it.
    let newest = image(3, &mut dice);
    let (flash, done) = apply(flash, &Update::Store(newest));
    assert!(done);
    assert_eq!(active(&flash), (newest, Origin::Newest));
}

fn start<const U: usize, const S: usize>(flash: Flash<U, S>) -> (Flash<U, S>, Image, bool) {
    let mut banks = banks(flash);
    let loaded = banks.start(&gyro(), 0);
    (banks.into_flash(), loaded.image, loaded.trial)
}

fn on_trial<const U: usize, const S: usize>(flash: Flash<U, S>, image: &Image) -> (Flash<U, S>, bool) {
    let mut banks = banks(flash);
    let done = banks.store_on_trial(&gyro(), image).is_ok();
    (banks.into_flash(), done)
}

fn confirm<const U: usize, const S: usize>(flash: Flash<U, S>) -> (Flash<U, S>, bool) {
    let mut banks = banks(flash);
    let done = banks.confirm(&gyro()).is_ok();
    (banks.into_flash(), done)
}

/// Never confirmed: four starts, and the fifth goes back by itself. Confirmed after any of them: it stays.
/// SAG-CORE-022
#[test]
fn a_trial_ends_by_confirmation_or_by_itself() {
    let mut dice = Dice(11);
    let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
    let (flash, _) = apply(Flash::<8, 1024>::new(3), &Update::Store(images[0]));
    assert_eq!(banks(flash.clone()).confirm(&gyro()), Err(StoreError::NotOnTrial));
    let (flash, done) = on_trial(flash, &images[1]);
    assert!(done);
    for confirmed_after in 0..=TRIAL_STARTS {
        let mut flash = flash.clone();
        for at in 0..TRIAL_STARTS {
            if at == confirmed_after {
                let (after, done) = confirm(flash);
                assert!(done);
                flash = after;
            }
            let (after, image, trial) = start(flash);
            assert_eq!((image, trial), (images[1], at < confirmed_after), "start {at}");
            flash = after;
        }
        let (after, image, trial) = start(flash);
        let wanted = if confirmed_after < TRIAL_STARTS { images[1] } else { images[0] };
        assert_eq!((image, trial), (wanted, false), "confirmed after {confirmed_after}");
        // And so it stays; the next store is possible in either case.
        let (after, image, _) = start(after);
        assert_eq!(image, wanted);
        let (after, done) = apply(after, &Update::Store(images[2]));
        assert!(done && active(&after) == (images[2], Origin::Newest));
    }
}

/// The first image of a gyro has none before it: it stays on trial, and says so.
#[test]
fn a_first_image_stays_on_trial() {
    let first = image(1, &mut Dice(4));
    let (mut flash, _) = on_trial(Flash::<4, 2048>::new(1), &first);
    for _ in 0..3 * TRIAL_STARTS {
        let (after, image, trial) = start(flash);
        assert_eq!((image, trial), (first, true));
        flash = after;
    }
    let (flash, done) = confirm(flash);
    assert!(done && !start(flash).2);
}

/// The power goes at every step of every start and of the confirmation: one of the two images is active, the trial is over after at
/// most one start more, and a confirmation that was cut can be made again.
#[test]
fn a_trial_survives_power_cuts() {
    let mut cuts = 0;
    for seed in 0..400_u64 {
        let mut dice = Dice(seed);
        let images = [1, 2].map(|sequence| image(sequence, &mut dice));
        let (flash, _) = apply(Flash::<16, 512>::new(seed), &Update::Store(images[0]));
        let (mut flash, _) = on_trial(flash, &images[1]);
        for _ in 0..dice.below(u64::from(TRIAL_STARTS) + 1) {
            flash = start(flash).0;
        }
        let whole = [start(Flash { steps: 0, ..flash.clone() }).0, confirm(Flash { steps: 0, ..flash.clone() }).0];
        for (confirms, whole) in whole.iter().enumerate() {
            for step in 1..=whole.steps {
                cuts += 1;
                let torn = Flash { steps_left: Some(step), dice: Dice(dice.throw()), ..flash.clone() };
                let torn = if confirms == 1 { confirm(torn).0 } else { start(torn).0 };
                let mut flash = Flash { steps_left: None, ..torn };
                let (found, origin) = active(&flash);
                assert!(origin == Origin::Newest && images.contains(&found), "seed {seed}, step {step}: {found:?}");
                if confirms == 1 && banks(flash.clone()).load(&gyro()).trial {
                    let (again, done) = confirm(flash);
                    assert!(done, "seed {seed}, step {step}: not again");
                    flash = again;
                }
                for _ in 0..=TRIAL_STARTS {
                    flash = start(flash).0;
                }
                let (_, last, trial) = start(flash);
                assert!(!trial && (last == images[1]) == (confirms == 1), "seed {seed}, step {step}");
            }
        }
    }
    assert!(cuts > 1000, "{cuts}");
}

/// A bank made by hand, byte by byte as docs/reference/image-format.md has it.
fn by_hand(flash: &mut Flash<8, 1024>, bank: usize, number: u32, image: &Image) {
    let mut bytes = vec![0; image.encoded_len()];
    image.encode(&mut bytes).unwrap();
    let mut head = b"SAGNACBK".to_vec();
    for word in [3, number, bytes.len() as u32, 0, 0] {
        head.extend(word.to_le_bytes());
    }
    head.extend(sagnac_core::bytes::crc32(&head).to_le_bytes());
    let hash = Sha256::new().chain_update(&head).chain_update(&bytes).finalize();
    let mut commit = b"COMMITTD".to_vec();
    commit.extend(number.to_le_bytes());
    commit.extend((!number).to_le_bytes());
    commit.extend(&hash[..16]);
    for (at, part) in [(0, &commit), (160, &head), (192, &bytes)] {
        let at = bank * LEN as usize + at;
        flash.bytes[at..at + part.len()].copy_from_slice(part);
    }
}

/// The number of a store has no end: the one after the largest is the later one, and stores, roll backs and notes go on.
#[test]
fn the_number_of_a_store_goes_round() {
    let mut dice = Dice(8);
    let images: Vec<Image> = (1..9).map(|sequence| image(sequence, &mut dice)).collect();
    let mut flash = Flash::<8, 1024>::new(1);
    by_hand(&mut flash, 0, u32::MAX - 2, &images[0]);
    assert_eq!(active(&flash), (images[0], Origin::Newest));
    for (before, image) in images.iter().zip(&images[1..]) {
        let (after, done) = apply(flash, &Update::Store(*image));
        assert!(done && active(&after) == (*image, Origin::Newest));
        let (back, done) = apply(after.clone(), &Update::RollBack);
        assert!(done && active(&back) == (*before, Origin::Newest));
        flash = after;
    }
}

/// An image's own number has no end either: over the line none can be the last one for ever, and an older one still does not return.
#[test]
fn the_own_number_of_an_image_goes_round() {
    let mut dice = Dice(6);
    let numbers = [4_294_901_760, u32::MAX, 1, 1 << 31, u32::MAX - 5, 7];
    let mut banks = banks(Flash::<8, 1024>::new(1));
    for (before, number) in [0].iter().chain(&numbers).zip(&numbers) {
        let new = image(*number, &mut dice);
        banks.store(&gyro(), &new).unwrap();
        assert_eq!(banks.load(&gyro()).image, new);
        for older in [0, *number, number.wrapping_sub(1), number.wrapping_sub((1 << 31) - 1), *before] {
            let error = StoreError::NotNewer { active: *number, offered: older };
            assert_eq!(banks.store(&gyro(), &image(older, &mut dice)), Err(error));
        }
    }
}

/// A trial over a trial would erase the only confirmed image: refused, on trial or not, until the first is confirmed or withdrawn.
/// SAG-CORE-030
#[test]
fn the_only_confirmed_image_is_never_erased() {
    let mut dice = Dice(12);
    let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
    let (flash, _) = apply(Flash::<8, 1024>::new(3), &Update::Store(images[0]));
    let (flash, _) = on_trial(flash, &images[1]);
    for confirmed in [false, true] {
        let mut banks = banks(flash.clone());
        assert_eq!(banks.store_on_trial(&gyro(), &images[2]), Err(StoreError::OnTrial));
        assert_eq!(banks.store(&gyro(), &images[2]), Err(StoreError::OnTrial));
        assert_eq!(banks.check(&gyro(), &images[2]), Err(StoreError::OnTrial));
        if confirmed {
            banks.confirm(&gyro()).unwrap();
        } else {
            banks.roll_back(&gyro()).unwrap();
        }
        banks.store_on_trial(&gyro(), &images[2]).unwrap();
        for _ in 0..TRIAL_STARTS {
            assert_eq!(banks.start(&gyro(), 0).image, images[2]);
        }
        let back = banks.start(&gyro(), 0);
        assert_eq!((back.image, back.trial), (images[usize::from(confirmed)], false));
    }
}

/// Two trials of a gyro that never had a confirmed image: nothing is lost.
#[test]
fn trials_without_a_confirmed_image_replace_each_other() {
    let mut dice = Dice(13);
    let mut flash = Flash::<8, 1024>::new(3);
    for sequence in 1..6 {
        let image = image(sequence, &mut dice);
        let (after, done) = on_trial(flash, &image);
        assert!(done && active(&after) == (image, Origin::Newest));
        flash = after;
    }
}

/// Firmware with lower limits refuses both images and stores a third; firmware with the old limits then runs the third: the numbers of
/// refused images count.
#[test]
fn an_older_image_does_not_win_after_a_change_of_limits() {
    for seed in 0..100_u64 {
        let mut dice = Dice(seed);
        let large = |sequence: u32, dice: &mut Dice| {
            let mut d = *image(sequence, dice).description();
            (d.terms[0], d.term_count) = (Term { mantissa: 1 << 30, shift: 25, ..Term::ZERO }, 1);
            Image::new(d).unwrap()
        };
        let images = [large(10, &mut dice), large(11, &mut dice)];
        let small = Image::new(Description { sequence: 12, serial: gyro().serial, ..Description::empty() });
        let wide = Gyro { largest_increment: i64::MAX, ..gyro() };
        let narrow = Gyro { largest_increment: 1 << 20, ..gyro() };
        let mut banks = banks(Flash::<8, 1024>::new(seed));
        for image in &images[seed as usize % 2..] {
            banks.store(&wide, image).unwrap();
        }
        assert_eq!(banks.load(&narrow).origin, Origin::FactoryDefaults);
        banks.store(&narrow, &small.unwrap()).unwrap();
        let loaded = banks.load(&wide);
        assert_eq!((loaded.image.description().sequence, loaded.origin), (12, Origin::Newest), "seed {seed}");
        // The older of two refused images was overwritten.
        assert!(loaded.banks.iter().any(|bank| matches!(bank, BankReport::Valid { sequence: 11, .. })), "seed {seed}");
    }
}

/// No bank can be read: nothing is erased, and both images are there when it can be read again. One that cannot is overwritten.
/// SAG-CORE-030
#[test]
fn nothing_is_erased_while_neither_bank_can_be_read() {
    let mut dice = Dice(14);
    let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
    let mut flash = Flash::<8, 1024>::new(1);
    for image in &images[..2] {
        flash = apply(flash, &Update::Store(*image)).0;
    }
    let dark = Flash { unreadable: 0..2 * LEN as usize, ..flash.clone() };
    let mut refused = banks(dark);
    assert!(matches!(refused.store(&gyro(), &images[2]), Err(StoreError::Flash(_))));
    let after = Flash { unreadable: 0..0, ..refused.into_flash() };
    assert_eq!(after.bytes, flash.bytes);
    // A commit word torn to something unreadable, on flash with error correction, is erased with its bank.
    let torn = Flash { unreadable: LEN as usize..LEN as usize + 8, ..flash };
    assert_eq!(active(&torn), (images[0], Origin::Survivor));
    let mut banks = banks(torn);
    assert!(!matches!(banks.check(&gyro(), &images[2]), Err(StoreError::Flash(_))));
}

/// An image with which the watchdog resets the board: after four resets in a row the one before it runs, after eight none. Flash stays as
/// it is: after a start without such resets the newest runs again. A store replaces the bad one.
/// SAG-CORE-029
#[test]
fn a_bad_image_makes_no_watchdog_loop() {
    let mut dice = Dice(15);
    let images = [1, 2, 3].map(|sequence| image(sequence, &mut dice));
    let mut flash = Flash::<8, 1024>::new(1);
    for image in &images[..2] {
        flash = apply(flash, &Update::Store(*image)).0;
    }
    let before = flash.bytes.clone();
    let mut banks = banks(flash);
    for resets in 0..20 {
        let loaded = banks.start(&gyro(), resets);
        let wanted = match resets {
            0..4 => (images[1], Origin::Newest),
            4..8 => (images[0], Origin::Survivor),
            _ => (gyro().factory_defaults(), Origin::FactoryDefaults),
        };
        assert_eq!((loaded.image, loaded.origin), wanted, "{resets} resets");
        assert_eq!(banks.load(&gyro()).image, wanted.0, "it stays set aside until the next start");
    }
    let loaded = banks.start(&gyro(), 4);
    assert_eq!(loaded.banks, [BankReport::Valid { stored: 1, sequence: 1 }, BankReport::SetAside { stored: 2 }]);
    banks.store(&gyro(), &images[2]).unwrap();
    let loaded = banks.load(&gyro());
    assert_eq!((loaded.image, loaded.origin), (images[2], Origin::Newest));
    assert_eq!(
        loaded.banks,
        [BankReport::Valid { stored: 1, sequence: 1 }, BankReport::Valid { stored: 3, sequence: 3 }]
    );
    // By hand: the bad one is withdrawn for good.
    let mut again = Banks::new(Flash::<8, 1024> { bytes: before, ..banks.into_flash() }, 0, LEN).unwrap();
    again.start(&gyro(), 4);
    assert_eq!(again.roll_back(&gyro()), Ok(images[0]));
    assert_eq!(again.start(&gyro(), 0).image, images[0]);
}
