//! What the Rust crates say of changed images and of odd thermometers, as records that the C programs read.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_core::{Compensator, ErrorBound, Image, State, UNBOUNDED, Watch, WatchSpec};
use sagnac_loops::LoopTable;

use crate::targets::vector_files::{image, table};

/// Changed images and tables with valid checksums: Rust and C must accept or refuse the same ones.
pub(super) fn verdicts(folder: &Path) -> Result<PathBuf> {
    let mut dice = 1_u32;
    let mut throw = |below: usize| {
        dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (dice >> 8) as usize % below
    };
    let images = ["edges", "full", "harmonic", "inputs", "lags", "paper", "warm-up"];
    let mut good: Vec<(u8, Vec<u8>)> =
        images.iter().map(|name| Ok((0, table(&format!("compensator-{name}"))?))).collect::<Result<_>>()?;
    good.push((1, table("path-length-heater")?));
    good.push((1, table("path-length-mirror")?));
    // Limits of fields, and octets that begin, continue and break characters of UTF-8 in the serial number.
    let edges = [
        0_u8, 1, 2, 7, 8, 15, 16, 30, 31, 32, 62, 63, 64, 0x7f, 0x80, 0x8f, 0x90, 0x9f, 0xa0, 0xbf, 0xc1, 0xc2, 0xdf,
        0xe0, 0xed, 0xef, 0xf0, 0xf4, 0xf5, 0xff,
    ];
    let mut records = Vec::new();
    for _ in 0..100_000 {
        let (kind, bytes) = &good[throw(good.len())];
        let mut bytes = bytes.clone();
        for _ in 0..throw(3) {
            let at = throw(bytes.len() - 4);
            bytes[at] = edges[throw(edges.len())];
            // A whole word at the end of its range, in one of three.
            if throw(3) == 0 {
                let word = [0, 1, i32::MAX as u32, 1 << 31, u32::MAX, 3 << 30][throw(6)].to_le_bytes();
                let (at, count) = (at & !3, [2, 4][throw(2)]);
                bytes[at..at + count].copy_from_slice(&word[..count]);
            }
        }
        if throw(40) == 0 {
            bytes.truncate(throw(bytes.len()) + 1);
        }
        if let Some(body) = bytes.len().checked_sub(4) {
            let crc = sagnac_core::bytes::crc32(&bytes[..body]);
            bytes[body..].copy_from_slice(&crc.to_le_bytes());
        }
        let accepted = if *kind == 0 { Image::decode(&bytes).is_ok() } else { LoopTable::decode(&bytes).is_ok() };
        records.extend([*kind, accepted.into(), bytes.len() as u8, (bytes.len() >> 8) as u8]);
        records.extend(bytes);
    }
    let file = folder.join("verdicts.bin");
    fs::write(&file, records)?;
    Ok(file)
}

/// Random walks, stuck values and extremes through the watch and the vote of both languages.
pub(super) fn watches(folder: &Path) -> Result<PathBuf> {
    let mut dice = 1_u32;
    let mut throw = || {
        dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        dice >> 4
    };
    let mut records = Vec::new();
    let (mut spec, mut values) = (WatchSpec::default(), [0_i32; 4]);
    let (mut watch, mut shown) = (Watch::<4>::new(spec), 0);
    for number in 0..50_000 {
        let new = number % 500 == 0;
        if new {
            spec = WatchSpec {
                shows: throw() >> (throw() % 28),
                still: throw() >> (throw() % 28),
                command_shows: throw() % 9000,
            };
            watch = Watch::new(spec);
        }
        for value in &mut values {
            *value = match throw() % 40 {
                0 => (throw() << 4).cast_signed(),
                1 => [i32::MIN, i32::MAX][(throw() % 2) as usize],
                2..8 => *value,
                _ => value.wrapping_add((throw() % 20_001).cast_signed() - 10_000),
            };
        }
        let present = (throw() & throw().rotate_left(3)) | (throw() % 16);
        let seen: [Option<i32>; 4] = std::array::from_fn(|at| (present >> at & 1 == 1).then_some(values[at]));
        let (has_command, command) = (throw() % 2, (throw() % 30_000).cast_signed());
        let named = watch.update(&seen, (has_command == 1).then_some(command));
        let codes: [i32; 8] = std::array::from_fn(|at| match throw() % 9 {
            0 => [i32::MIN, i32::MAX, 0][(throw() % 3) as usize],
            _ => values[at % 4].wrapping_add((throw() % 100).cast_signed()),
        });
        let (agree, voters) = (throw() >> (throw() % 28), throw() % 256);
        let cast: Vec<Option<i32>> = (0..8).map(|at| (voters >> at & 1 == 1).then_some(codes[at])).collect();
        let vote = sagnac_core::vote(&cast, agree);
        shown += [u32::from(named != 0), u32::from(vote.outvoted != 0 && vote.code.is_some())].iter().sum::<u32>();
        let word = u32::from(vote.code.is_some()) | u32::from(vote.outvoted) << 8 | u32::from(vote.voters) << 16;
        let first = [spec.shows, spec.still, spec.command_shows, present & 15];
        let rest = [has_command, command.cast_unsigned(), named, u32::from(new), agree, voters];
        let codes = codes.map(i32::cast_unsigned);
        let words = first.into_iter().chain(values.map(i32::cast_unsigned)).chain(rest).chain(codes);
        records.extend(words.chain([word, vote.code.unwrap_or(0).cast_unsigned()]).flat_map(u32::to_le_bytes));
    }
    ensure!(shown > 10_000, "only {shown} records name a thermometer");
    let file = folder.join("watch.bin");
    fs::write(&file, records)?;
    Ok(file)
}

/// Bounds of the error after random codes, for images with other limits, lags, ticks and scale factors; a third has no sample now and then.
pub(super) fn bounds(folder: &Path) -> Result<PathBuf> {
    let names =
        ["compensator-full", "compensator-inputs", "compensator-lags", "compensator-harmonic", "compensator-warm-up"];
    let images: Vec<Image> = names.iter().map(|name| image(name)).collect::<Result<_>>()?;
    let mut dice = 7_u32;
    let mut throw = move |n: u32| {
        dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (dice >> 8) % n
    };
    let (mut bytes, mut unbounded, mut values) = (Vec::new(), 0, BTreeSet::new());
    let mut number = 0;
    while number < 3000 {
        let mut d = *images[number % images.len()].description();
        let seconds = [1_u32, 10, 1000][throw(3) as usize];
        (d.tick_ns, d.scale_factor_femto_arcsec) = (100_000 * seconds, 1 << throw(62));
        d.scale_factor_femto_arcsec += u64::from(throw(1 << 20));
        for input in &mut d.inputs[..usize::from(d.input_count)] {
            let has_code = input.source == sagnac_core::ValueSource::Code;
            (input.largest_step_q8, input.step_growth) =
                if has_code { (throw(3000) as u16, throw(17) as u8) } else { (0, 0) };
            if input.largest_step_q8 == 0 {
                input.step_growth = 0;
            }
            input.settling_updates = throw(200);
            if input.lag.is_used() && throw(2) == 0 {
                input.lag.alpha_shift = 31 + throw(10) as u8;
                input.lag.rate_shift = throw(u32::from(input.lag.alpha_shift)) as u8;
            }
        }
        if throw(2) == 0 {
            let term = &mut d.terms[throw(d.term_count.into()) as usize];
            (term.mantissa, term.shift) = (throw(1 << 24).cast_signed() << throw(8), 8 + throw(20) as u8);
        }
        // The bounds of all fields together refuse some.
        let Ok(image) = Image::new(d) else { continue };
        number += 1;
        let mut encoded = vec![0; image.encoded_len()];
        image.encode(&mut encoded).context("it fits its own length")?;
        bytes.extend((encoded.len() as u16).to_le_bytes());
        bytes.extend(encoded);
        let (gyro, mut state, mut bound) = (Compensator::new(image), State::new(), ErrorBound::new());
        let mut codes = code_in_span(&image);
        for _ in 0..40 {
            let present = if throw(3) == 0 { throw(16) } else { 15 };
            for (at, code) in codes.iter_mut().enumerate() {
                let by = throw(2001).cast_signed() - 1000;
                *code = code.wrapping_add(if throw(30) == 0 { by << throw(18) } else { by });
                bytes.extend(if at == 0 { vec![present as u8] } else { Vec::new() });
                bytes.extend(code.to_le_bytes());
            }
            let shown: [Option<i32>; 4] = std::array::from_fn(|at| (present >> at & 1 == 1).then_some(codes[at]));
            gyro.update(&mut state, &shown[..image.inputs().len()])?;
            bound.update(&image, &state);
            let ticks = state.ticks_to_update();
            gyro.advance(&mut state, 0, ticks)?;
            bytes.extend(bound.milli_dph().to_le_bytes());
            unbounded += usize::from(bound.milli_dph() == UNBOUNDED);
            values.insert(bound.milli_dph());
        }
    }
    ensure!(unbounded > 1000 && values.len() > 1000, "{unbounded} without a bound, {} different ones", values.len());
    let file = folder.join("bounds.bin");
    fs::write(&file, bytes)?;
    Ok(file)
}

/// Codes in the middle of their spans.
fn code_in_span(image: &Image) -> [i32; 4] {
    std::array::from_fn(|at| {
        let Some(input) = image.inputs().get(at).filter(|input| input.gain.mantissa != 0) else { return 0 };
        let middle_q24 = (i64::from(input.span_lo_q24) + i64::from(input.span_hi_q24)) / 2;
        let per_code = f64::from(input.gain.mantissa) / 2_f64.powi(input.gain.shift.into());
        ((middle_q24 - i64::from(input.offset_q24)) as f64 / per_code) as i32
    })
}
