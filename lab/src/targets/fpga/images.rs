//! Random images for the hardware: legal ones with records, and changed ones with the verdict of the loader.

use std::fmt::Write as _;

use anyhow::{Context, Result, ensure};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use sagnac_core::{
    DecodeError, Description, Gain, Image, InputSpec, Kind, LagSpec, MAX_INPUTS, Multiplier, Shape, Term, ValueSource,
};
use sagnac_ports::hex_words;
use sagnac_vectors::{MAGIC, Module};

use super::verdict::{Hardware, verdict};
use crate::makes::making::Making;
use crate::makes::making::image_bytes;

/// Module number of an image alone, for the bench of the hardware.
const IMAGE_ALONE: u32 = 6;
/// Updates of each random image, every second of them with samples that jump.
const UPDATES: u32 = 10;

/// Vector files of so many random images, one behind the other.
pub(super) fn random(count: u64) -> Result<String> {
    let mut text = String::new();
    for seed in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let image = any_image(&mut rng);
        text.push_str(&records(&mut rng, &image)?.words()?);
    }
    Ok(text)
}

/// Images of vectors and random ones, most of them changed, each with the fault that this hardware must find.
pub(super) fn alone(own: &[Vec<u8>], count: u64, hardware: Hardware) -> Result<String> {
    let mut text = String::new();
    let mut seen = [0_usize; 8];
    for seed in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64((1 << 32) | seed);
        let mut bytes = match own.get(rng.random_range(0..own.len() * 2)) {
            Some(own) => own.clone(),
            None => image_bytes(*any_image(&mut rng).description())?,
        };
        if rng.random_range(0..8) != 0 {
            change(&mut rng, &mut bytes);
        }
        let fault = verdict(&bytes, hardware);
        agrees(&bytes, fault)?;
        *seen.get_mut(fault as usize).context("a fault of the loader")? += 1;
        writeln!(text, "{MAGIC:08x} {IMAGE_ALONE:08x} {:08x} {fault:08x}", bytes.len())?;
        text.push_str(&hex_words(&bytes));
    }
    // Nothing is too much for the whole hardware; another unit's image needs registers, and the bench itself tries that.
    let wanted = if hardware == Hardware::WHOLE { &[0, 1, 2, 3, 4, 5][..] } else { &[0, 4, 5, 6] };
    let never: Vec<usize> = wanted.iter().copied().filter(|fault| seen.get(*fault) == Some(&0)).collect();
    ensure!(never.is_empty(), "no image of {count} has the faults {never:?}");
    Ok(text)
}

/// What the core reads, the hardware reads, but for what it was not built with; what the hardware reads beyond it has values out of range.
fn agrees(bytes: &[u8], fault: u32) -> Result<()> {
    let decoded = Image::decode(bytes);
    let as_it_should = match (&decoded, fault) {
        (Ok(_), 0 | Hardware::FAULT) | (Err(DecodeError::Invalid(_) | DecodeError::WrongMinor { .. }), _) => true,
        (Err(_), fault) => fault != 0,
        (Ok(_), _) => false,
    };
    ensure!(as_it_should, "fault {fault} for an image of which the core says {:?}", decoded.err());
    Ok(())
}

/// Borders of what a field may hold.
const BYTES: [u8; 14] = [0, 1, 2, 8, 9, 15, 16, 30, 31, 32, 33, 62, 63, 64];
const WORDS: [u32; 7] = [0, 1 << 24, (1 << 24) + 1, i32::MAX as u32, 1 << 31, (1 << 31) + 1, 60];

/// Changes one to three bytes or words, half of them to a border; two of three get their checksum back.
fn change(rng: &mut ChaCha8Rng, bytes: &mut [u8]) {
    let body = bytes.len() - 4;
    for _ in 0..rng.random_range(1..4) {
        let at = if rng.random() { rng.random_range(0..body) } else { rng.random_range(0..body.min(128)) };
        match rng.random_range(0..4) {
            0 => bytes[at / 4 * 4..][..4].copy_from_slice(&WORDS[rng.random_range(0..WORDS.len())].to_le_bytes()),
            1 => bytes[at] = BYTES[rng.random_range(0..BYTES.len())],
            _ => bytes[at] = rng.random(),
        }
    }
    if rng.random_range(0..3) != 0 {
        let crc = sagnac_core::bytes::crc32(&bytes[..body]);
        bytes[body..].copy_from_slice(&crc.to_le_bytes());
    }
}

fn any_image(rng: &mut ChaCha8Rng) -> Image {
    loop {
        let mut d = Description {
            period_ticks: rng.random_range(1..80),
            output_limit: if rng.random() { rng.random_range(1..200) } else { rng.random_range(1..1 << 31) },
            sequence: rng.random_range(0..1 << 31),
            ..Description::empty()
        };
        d.serial[..3].copy_from_slice(b"ANY");
        d.slew_ticks = rng.random_range(0..=d.period_ticks);
        d.input_count = rng.random_range(0..=MAX_INPUTS as u8);
        for index in 0..d.input_count {
            let of = rng.random_range(0..=index);
            let base = d.inputs[usize::from(of)];
            d.inputs[usize::from(index)] = any_input(rng, index, of, base);
        }
        let shift = rng.random_range(14..44_u8);
        d.term_count = if d.input_count == 0 { 0 } else { rng.random_range(0..=32) };
        for slot in d.terms.iter_mut().take(usize::from(d.term_count)) {
            *slot = any_term(rng, d.input_count, shift);
        }
        if let Ok(image) = Image::new(d) {
            return image;
        }
    }
}

fn any_input(rng: &mut ChaCha8Rng, index: u8, of: u8, base: InputSpec) -> InputSpec {
    let lo = rng.random_range(-(90_i32 << 24)..60 << 24);
    let (x_mantissa, x_shift, span) = loop {
        let span = rng.random_range(1_i32 << 20..60 << 24) & !1;
        let half = i64::from(span) >> 1;
        let shift = 48 - half.leading_zeros();
        if let Ok(mantissa) = u32::try_from((1_i64 << (47 + shift)) / half) {
            break (mantissa, shift as u8, span);
        }
    };
    let middle = lo + span / 2;
    let own = InputSpec {
        offset_q24: middle + rng.random_range(-(1 << 24)..1 << 24),
        gain: Gain { mantissa: rng.random_range(1 << 20..i32::MAX), shift: rng.random_range(18..40) },
        valid_lo_q24: lo.saturating_sub(rng.random_range(0..20 << 24)).max(i32::MIN + 1),
        valid_hi_q24: (lo + span).saturating_add(rng.random_range(1..20 << 24)).min(i32::MAX - 1),
        span_lo_q24: lo,
        span_hi_q24: lo + span,
        x_mantissa,
        x_shift,
        lag: if rng.random_range(0..3) == 0 { LagSpec::default() } else { any_lag(rng) },
        stale_after_updates: rng.random_range(0..6),
        settling_updates: rng.random_range(0..8),
        largest_step_q8: if rng.random() { 0 } else { rng.random_range(1..2000) },
        ..InputSpec::UNUSED
    };
    let step_growth = if own.largest_step_q8 == 0 { 0 } else { rng.random_range(0..=16) };
    let derived = InputSpec { offset_q24: 0, gain: Gain::ONE, largest_step_q8: 0, ..own };
    let own = InputSpec { step_growth, ..own };
    match rng.random_range(0..6) {
        0 if index > 1 => InputSpec {
            source: ValueSource::Difference { of, less: rng.random_range(0..index) },
            valid_lo_q24: -(120 << 24),
            valid_hi_q24: 120 << 24,
            ..derived
        },
        1 if index > 0 => InputSpec {
            source: ValueSource::Repeat { of },
            valid_lo_q24: base.valid_lo_q24,
            valid_hi_q24: base.valid_hi_q24,
            stale_after_updates: base.stale_after_updates,
            ..derived
        },
        2 => InputSpec {
            source: ValueSource::WarmUp,
            valid_lo_q24: -(2 << 24),
            valid_hi_q24: 2 << 24,
            span_lo_q24: -(1 << 24),
            span_hi_q24: 1 << 24,
            x_mantissa: 1 << 31,
            x_shift: 8,
            lag: any_lag(rng),
            ..derived
        },
        _ => own,
    }
}

fn any_lag(rng: &mut ChaCha8Rng) -> LagSpec {
    let alpha_shift = rng.random_range(31..=44_u8);
    let rate_hi = rng.random_range(1 << 20..i32::MAX);
    let y_shift = 31 - rate_hi.leading_zeros();
    LagSpec {
        alpha_mantissa: rng.random_range(1..=1 << 31),
        alpha_shift,
        rate_shift: rng.random_range(0..alpha_shift),
        rate_lo: -rng.random_range(0..=rate_hi),
        rate_hi,
        y_mantissa: u32::try_from((1_i64 << (31 + y_shift)) / i64::from(rate_hi)).unwrap_or(u32::MAX),
        y_shift: y_shift as u8,
    }
}

fn any_term(rng: &mut ChaCha8Rng, inputs: u8, shift: u8) -> Term {
    let kind = if rng.random_range(0..3) == 0 { Kind::Scale } else { Kind::Bias };
    let knot_q15 = rng.random();
    let turns_q18 = rng.random_range(1..=64 << 18);
    let shape = match rng.random_range(0..8) {
        0 => Shape::Zone { knot_q15 },
        1 => Shape::Step { knot_q15 },
        2 => Shape::Cosine { turns_q18 },
        3 => Shape::Sine { turns_q18 },
        _ => Shape::Chebyshev(rng.random_range(0..=8)),
    };
    Term {
        kind,
        input: rng.random_range(0..inputs),
        shape,
        multiplier: if rng.random_range(0..3) == 0 { Multiplier::Rate } else { Multiplier::One },
        mantissa: rng.random_range(-i32::MAX..=i32::MAX),
        shift: if kind == Kind::Scale { rng.random_range(42..60) } else { shift + rng.random_range(0..6) },
    }
}

/// Updates with samples that walk, jump or are missing; whole periods and parts of them; restarts and ends of an overflow.
fn records(rng: &mut ChaCha8Rng, image: &Image) -> Result<Making> {
    let mut making = Making::new(Module::Compensator, image_bytes(*image.description())?, "a random image")?;
    making.step(0, &[])?;
    let period = image.description().period_ticks;
    let mut codes = [0_u32; MAX_INPUTS];
    for update in 0..UPDATES {
        for (code, spec) in codes.iter_mut().zip(&image.description().inputs) {
            if update % 2 == 0 || rng.random_range(0..4) == 0 {
                *code = code_within(rng, spec);
            }
        }
        let present = if rng.random_range(0..4) == 0 { rng.random_range(0..16) } else { 15 };
        making.step(1, &[present, codes[0], codes[1], codes[2], codes[3]])?;
        let ticks = if rng.random_range(0..4) == 0 { rng.random_range(1..=period) } else { period };
        let bits = *[3_u32, 3, 8, 16, 29].get(rng.random_range(0..5_usize)).context("one of five")?;
        making.step(2, &[ticks, rng.random(), rng.random_range(0..9_u32).wrapping_sub(4), bits])?;
        match rng.random_range(0..6) {
            0 => drop(making.step(5, &[])?),
            1 => drop(making.step(6, &[])?),
            2 => drop(making.step(4, &[rng.random_range(0..=period)])?),
            // Before its time, if the period has not ended.
            3 => drop(making.step(1, &[15, codes[0], codes[1], codes[2], codes[3]])?),
            _ => {}
        }
    }
    Ok(making)
}

/// A code whose value is in the span, or a little beyond it; one in eight is anything.
fn code_within(rng: &mut ChaCha8Rng, spec: &InputSpec) -> u32 {
    if rng.random_range(0..8) == 0 {
        return rng.random();
    }
    let value = rng.random_range(i64::from(spec.span_lo_q24) - (2 << 24)..i64::from(spec.span_hi_q24) + (2 << 24));
    let scaled = i128::from(value - i64::from(spec.offset_q24)) << spec.gain.shift;
    let code = scaled / i128::from(spec.gain.mantissa).max(1);
    i32::try_from(code).map_or(0, i32::cast_unsigned)
}

#[cfg(test)]
mod tests {
    use super::super::{FILES, IMAGES_ALONE, NETLIST_IMAGES, table};
    use super::*;

    /// The verdicts stand to the core's as they should, and each fault is among them.
    #[test]
    fn images_alone_have_every_fault() {
        let own: Vec<Vec<u8>> = FILES.iter().map(|(name, _)| table(name).unwrap()).collect();
        for (count, hardware) in [(IMAGES_ALONE, Hardware::WHOLE), (NETLIST_IMAGES, Hardware::SMALL)] {
            alone(&own, count, hardware).unwrap();
        }
    }
}
