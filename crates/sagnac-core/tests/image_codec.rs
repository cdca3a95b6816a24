//! Images as bytes: encoding and decoding give the same image, and damaged bytes are refused.

use crate::support::{any_image_of_four, difference, image, repeat, term, thermometer, warm_up};
use proptest::prelude::*;
use sagnac_core::{
    DecodeError, Description, FORMAT_MINOR, Gain, Image, ImageError, InputSpec, Kind, LagSpec, MAX_IMAGE_LEN,
    MAX_TURNS_Q18, Multiplier, Shape, Term, ValueSource,
};

fn bytes_of(image: &Image) -> Vec<u8> {
    let mut out = vec![0; MAX_IMAGE_LEN];
    let len = image.encode(&mut out).unwrap();
    out.truncate(len);
    out
}

fn typical() -> Image {
    let rate = term(Kind::Bias, 0, Multiplier::Rate, -(1 << 30), 40);
    image(&[term(Kind::Bias, 1, Multiplier::One, 1 << 30, 40), rate], 10_000, 100)
}

/// CRC of the body put right again, so that the checks behind it are reached.
fn resealed(mut bytes: Vec<u8>, at: usize, value: u8) -> Vec<u8> {
    bytes[at] = value;
    let end = bytes.len() - 4;
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

proptest! {
    #[test]
    fn an_image_survives_its_bytes(image in any_image_of_four()) {
        prop_assert_eq!(Image::decode(&bytes_of(&image)), Ok(image));
    }

    #[test]
    fn any_bytes_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..900)) {
        prop_assert!(Image::decode(&bytes).is_err());
    }

    #[test]
    fn any_sealed_bytes_are_answered(changes in prop::collection::vec((16_usize..210, any::<u8>()), 1..8)) {
        let mut bytes = bytes_of(&typical());
        for (at, value) in changes {
            bytes = resealed(bytes, at, value);
        }
        // Either refused, or an image that gives the same bytes again.
        if let Ok(image) = Image::decode(&bytes) {
            prop_assert_eq!(bytes_of(&image), bytes);
        }
    }
}

/// SAG-CORE-018
#[test]
fn every_one_and_two_bit_flip_is_refused() {
    let image = typical();
    let good = bytes_of(&image);
    let bits = good.len() * 8;
    let mut bytes = good.clone();
    for first in 0..bits {
        bytes[first / 8] ^= 1 << (first % 8);
        assert!(Image::decode(&bytes).is_err(), "bit {first}");
        for second in first + 1..bits {
            bytes[second / 8] ^= 1 << (second % 8);
            assert!(Image::decode(&bytes).is_err(), "bits {first} and {second}");
            bytes[second / 8] ^= 1 << (second % 8);
        }
        bytes[first / 8] ^= 1 << (first % 8);
    }
    assert_eq!(bytes, good);
}

/// SAG-CORE-018
#[test]
fn every_truncation_and_extension_is_refused() {
    let good = bytes_of(&typical());
    for len in 0..good.len() {
        assert!(matches!(Image::decode(&good[..len]), Err(DecodeError::TooShort { .. })), "{len}");
    }
    let mut longer = good;
    longer.push(0);
    assert!(matches!(Image::decode(&longer), Err(DecodeError::TooLong { .. })));
}

#[test]
fn unknown_things_are_named() {
    let good = bytes_of(&typical());
    let terms = good.len() - 4 - 24;
    assert_eq!(Image::decode(b"time_s,counts\n1,2\n"), Err(DecodeError::NotAnImage));
    assert_eq!(Image::decode(&resealed(good.clone(), 8, 9)), Err(DecodeError::UnknownVersion(9)));
    assert_eq!(
        Image::decode(&resealed(good.clone(), terms + 12, 7)),
        Err(DecodeError::UnknownKind { term: 1, kind: 7 })
    );
    assert_eq!(
        Image::decode(&resealed(good.clone(), terms + 3, 2)),
        Err(DecodeError::UnknownMultiplier { term: 0, multiplier: 2 })
    );
    assert_eq!(
        Image::decode(&resealed(good.clone(), terms + 9, 5)),
        Err(DecodeError::UnknownShape { term: 0, shape: 5 })
    );
    // A zone has no order, a series no knot, a code of its own no thermometers to take from each other.
    assert_eq!(Image::decode(&resealed(good.clone(), terms + 9, 1)), Err(DecodeError::Reserved("a term")));
    assert_eq!(Image::decode(&resealed(good.clone(), terms + 11, 1)), Err(DecodeError::Reserved("a term")));
    // Source 4 is unknown, and a code of its own has no input that it is made from.
    for place in [13, 14, 15] {
        let bytes = resealed(good.clone(), 128 + place, 4);
        assert_eq!(Image::decode(&bytes), Err(DecodeError::Reserved("an input")), "{place}");
    }
    assert_eq!(Image::decode(&resealed(good, terms + 2, 9)), Err(DecodeError::Invalid(ImageError::Term(0, "order"))));
}

fn with_harmonics() -> Image {
    let harmonic = |shape, multiplier| Term { shape, ..term(Kind::Bias, 0, multiplier, 1 << 29, 40) };
    image(
        &[
            harmonic(Shape::Cosine { turns_q18: 0x12_3456 }, Multiplier::Rate),
            harmonic(Shape::Sine { turns_q18: MAX_TURNS_Q18 }, Multiplier::One),
        ],
        10_000,
        100,
    )
}

#[test]
fn harmonics_raise_the_minor_version() {
    assert_eq!((typical().format_minor(), bytes_of(&typical())[10]), (0, 0));
    let good = bytes_of(&with_harmonics());
    let terms = good.len() - 4 - 24;
    assert_eq!((with_harmonics().format_minor(), good[10], good[11]), (1, 1, 0));
    // Shape, the low 16 bits of the turns, their high 8 in the place of an order.
    assert_eq!((&good[terms + 9..terms + 12], good[terms + 2]), (&[3, 0x56, 0x34][..], 0x12));
    assert_eq!((&good[terms + 21..terms + 24], good[terms + 14]), (&[4, 0xff, 0xff][..], 0xff));
    assert_eq!(Image::decode(&good), Ok(with_harmonics()));

    let wrong = |stored, needed| Err(DecodeError::WrongMinor { stored, needed });
    assert_eq!(Image::decode(&resealed(good.clone(), 10, 0)), wrong(0, 1));
    assert_eq!(Image::decode(&resealed(bytes_of(&typical()), 10, 1)), wrong(1, 0));
    let newer = Image::decode(&resealed(good.clone(), 10, 6)).unwrap_err();
    assert_eq!(newer, DecodeError::UnknownMinor(FORMAT_MINOR + 1));
    assert_eq!(newer.to_string(), "image format version 1.6; this program reads up to 1.5");
    assert_eq!(Image::decode(&resealed(good, 11, 3)), Err(DecodeError::UnknownMinor(0x301)));
}

#[test]
fn turns_have_a_range() {
    let with = |shape: Shape| {
        let mut d = *with_harmonics().description();
        d.terms[1].shape = shape;
        Image::new(d)
    };
    for turns_q18 in [1, 1 << 18, MAX_TURNS_Q18] {
        let image = with(Shape::Cosine { turns_q18 }).unwrap();
        assert_eq!(Image::decode(&bytes_of(&image)), Ok(image), "{turns_q18}");
    }
    for turns_q18 in [0, MAX_TURNS_Q18 + 1, u32::MAX] {
        assert_eq!(with(Shape::Cosine { turns_q18 }), Err(ImageError::Term(1, "turns")), "{turns_q18}");
        assert_eq!(with(Shape::Sine { turns_q18 }), Err(ImageError::Term(1, "turns")), "{turns_q18}");
    }
    let none = [(2, 0), (10, 0), (11, 0)];
    let bytes = none.iter().fold(bytes_of(&with_harmonics()), |bytes, (at, value)| {
        let term = bytes.len() - 4 - 24;
        resealed(bytes, term + at, *value)
    });
    assert_eq!(Image::decode(&bytes), Err(DecodeError::Invalid(ImageError::Term(0, "turns"))));
}

#[test]
fn a_difference_is_of_two_thermometers_before_it() {
    let with = |source: ValueSource, gain: Gain| {
        let mut d = *typical().description();
        d.inputs[1] = thermometer();
        d.inputs[2] = InputSpec { source, gain, ..difference() };
        d.input_count = 3;
        Image::new(d)
    };
    let between = |of, less| ValueSource::Difference { of, less };
    let image = with(between(0, 1), Gain::ONE).unwrap();
    assert_eq!(Image::decode(&bytes_of(&image)), Ok(image));
    for (of, less) in [(0, 0), (0, 2), (3, 1), (2, 0)] {
        assert_eq!(with(between(of, less), Gain::ONE), Err(ImageError::Input(2, "difference")), "{of} {less}");
    }
    let scaled = with(between(0, 1), Gain { mantissa: 2, shift: 1 });
    assert_eq!(scaled, Err(ImageError::Input(2, "conversion (a difference has no code)")));
}

/// The typical image with a second thermometer, the difference of both and a repeat.
fn with_repeat(repeat: InputSpec) -> Result<Image, ImageError> {
    let mut d = *typical().description();
    d.inputs[1] = thermometer();
    d.inputs[2] = difference();
    d.inputs[3] = repeat;
    d.input_count = 4;
    Image::new(d)
}

#[test]
fn repeats_raise_the_minor_version() {
    let image = with_repeat(repeat(2, difference())).unwrap();
    let good = bytes_of(&image);
    assert_eq!((image.format_minor(), good[10], good[11]), (2, 2, 0));
    let source = 128 + 3 * 64 + 13;
    assert_eq!(good[source..source + 3], [2, 2, 0]);
    assert_eq!(Image::decode(&good), Ok(image));
    // A program of version 1.1 refuses it by the version alone; a lower version in its place is not its own.
    for stored in [0, 1] {
        let wrong = Err(DecodeError::WrongMinor { stored, needed: 2 });
        assert_eq!(Image::decode(&resealed(good.clone(), 10, stored as u8)), wrong);
    }
    assert_eq!(Image::decode(&resealed(good, source + 2, 1)), Err(DecodeError::Reserved("an input")));
}

#[test]
fn warm_ups_raise_the_minor_version() {
    let image = with_repeat(warm_up()).unwrap();
    let good = bytes_of(&image);
    assert_eq!((image.format_minor(), good[10], good[11]), (3, 3, 0));
    let source = 128 + 3 * 64 + 13;
    assert_eq!(good[source..source + 3], [3, 0, 0]);
    assert_eq!(Image::decode(&good), Ok(image));
    let wrong = Err(DecodeError::WrongMinor { stored: 2, needed: 3 });
    assert_eq!(Image::decode(&resealed(good.clone(), 10, 2)), wrong);
    for byte in [source + 1, source + 2] {
        let stray = Err(DecodeError::Reserved("an input"));
        assert_eq!(Image::decode(&resealed(good.clone(), byte, 1)), stray);
    }
    let refused = |change: InputSpec| with_repeat(change).map(|_| ());
    let conversion = Err(ImageError::Input(3, "conversion (a warm-up has no code)"));
    assert_eq!(refused(InputSpec { offset_q24: 1, ..warm_up() }), conversion);
    assert_eq!(refused(InputSpec { gain: Gain { mantissa: 2, shift: 1 }, ..warm_up() }), conversion);
    let lag = Err(ImageError::Input(3, "lag (a warm-up is one)"));
    assert_eq!(refused(InputSpec { lag: LagSpec::default(), ..warm_up() }), lag);
    let valid = Err(ImageError::Input(3, "valid range (a warm-up is 0)"));
    assert_eq!(refused(InputSpec { valid_lo_q24: 1, valid_hi_q24: 2, ..warm_up() }), valid);
    assert_eq!(refused(InputSpec { valid_lo_q24: -2, valid_hi_q24: -1, ..warm_up() }), valid);
    // A warm-up cannot be repeated.
    let mut d = *image.description();
    d.inputs[2] = warm_up();
    d.inputs[3] = InputSpec { source: ValueSource::Repeat { of: 2 }, ..warm_up() };
    assert_eq!(Image::new(d), Err(ImageError::Input(3, "repeat")));
}

#[test]
fn largest_steps_raise_the_minor_version() {
    let mut d = *typical().description();
    d.inputs[0].largest_step_q8 = 0x1234;
    let image = Image::new(d).unwrap();
    let good = bytes_of(&image);
    assert_eq!((image.format_minor(), good[10], &good[128 + 61..128 + 64]), (4, 4, &[0x34, 0x12, 0][..]));
    assert_eq!(Image::decode(&good), Ok(image));
    d.inputs[0].step_growth = 16;
    let image = Image::new(d).unwrap();
    let good = bytes_of(&image);
    assert_eq!((image.format_minor(), good[10], good[128 + 63]), (5, 5, 16));
    assert_eq!(Image::decode(&good), Ok(image));
    let growth = Err(ImageError::Input(0, "growth of the largest step (at most 16, and 0 without one)"));
    d.inputs[0].step_growth = 17;
    assert_eq!(Image::new(d).map(|_| ()), growth);
    (d.inputs[0].step_growth, d.inputs[0].largest_step_q8) = (1, 0);
    assert_eq!(Image::new(d).map(|_| ()), growth);
    let of_source = Err(ImageError::Input(3, "largest step (an input without a code has those of its source)"));
    for derived in [repeat(0, thermometer()), difference(), warm_up()] {
        assert_eq!(with_repeat(InputSpec { largest_step_q8: 1, ..derived }).map(|_| ()), of_source);
    }
}

#[test]
fn a_repeat_is_of_an_input_before_it_and_held_like_it() {
    for (of, base) in [(0, thermometer()), (1, thermometer()), (2, difference())] {
        assert!(with_repeat(repeat(of, base)).is_ok(), "{of}");
    }
    for of in [3, 4, 255] {
        assert_eq!(with_repeat(repeat(of, thermometer())), Err(ImageError::Input(3, "repeat")), "{of}");
    }
    // A repeat of a repeat would be a third lag that no version knows.
    let mut d = *with_repeat(repeat(0, thermometer())).unwrap().description();
    d.inputs[2] = repeat(1, thermometer());
    d.inputs[3].source = ValueSource::Repeat { of: 2 };
    assert_eq!(Image::new(d), Err(ImageError::Input(3, "repeat")));

    let of_first = repeat(0, thermometer());
    let scaled = InputSpec { gain: Gain { mantissa: 2, shift: 1 }, ..of_first };
    assert_eq!(with_repeat(scaled), Err(ImageError::Input(3, "conversion (a repeat has no code)")));
    let held = "unit, valid range or hold time (not those of the input that it repeats)";
    for other in [
        InputSpec { valid_lo_q24: of_first.valid_lo_q24 + 1, ..of_first },
        InputSpec { valid_hi_q24: of_first.valid_hi_q24 + 1, ..of_first },
        InputSpec { stale_after_updates: of_first.stale_after_updates + 1, ..of_first },
        InputSpec { unit_exponent: 1, ..of_first },
    ] {
        assert_eq!(with_repeat(other), Err(ImageError::Input(3, held)));
    }
}

/// SAG-CORE-019
#[test]
fn a_description_out_of_range_is_refused_by_field() {
    let refuse = |change: &dyn Fn(&mut Description)| {
        let mut d = *typical().description();
        change(&mut d);
        Image::new(d).unwrap_err()
    };
    assert_eq!(refuse(&|d| d.tick_ns = 0), ImageError::Head("tick_ns"));
    assert_eq!(refuse(&|d| d.slew_ticks = 10_001), ImageError::Head("slew_ticks"));
    assert_eq!(refuse(&|d| d.inputs[0].span_hi_q24 += 1), ImageError::Input(0, "span"));
    assert_eq!(refuse(&|d| d.inputs[0].x_mantissa /= 2), ImageError::Input(0, "x mantissa or shift"));
    assert_eq!(refuse(&|d| d.inputs[0].lag.rate_lo = i32::MIN), ImageError::Input(0, "rate span"));
    assert_eq!(refuse(&|d| d.terms[1].input = 1), ImageError::Term(1, "input"));
    let long_period = |d: &mut Description| (d.period_ticks, d.terms[0].shift) = (1 << 24, 8);
    assert_eq!(refuse(&long_period), ImageError::IncrementTooLarge);
    let scale = |d: &mut Description| d.terms[0] = term(Kind::Scale, 0, Multiplier::One, 1 << 30, 26);
    assert_eq!(refuse(&scale), ImageError::ScaleTooLarge);
}
