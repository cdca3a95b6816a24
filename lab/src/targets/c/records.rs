//! What the Rust crates say of changed images and of odd thermometers, as records that the C programs read.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use sagnac_core::{Image, Watch, WatchSpec};
use sagnac_loops::LoopTable;

use crate::targets::vector_files::table;

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
