//! Boards in every state that a rig does not reach: a survivor, a thermometer that stands still, lost steps, counts beyond a call.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_board::{ActuatorCodes, Board, BoardSetup, FRAME_TICKS, Message, Sample, StartCause, WatchSetup};
use sagnac_core::{BankReport, Description, Image, Loaded, Origin, Status, WatchSpec};
use sagnac_loops::Stripper;

use crate::targets::vector_files::{loops, table};

/// Levels of the two comparators in a quarter of the fringe.
fn levels(quarter: u8) -> (bool, bool) {
    (matches!(quarter & 3, 1 | 2), matches!(quarter & 3, 2 | 3))
}

/// The generator of the vectors.
struct Dice(u32);

impl Dice {
    fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0
    }

    fn below(&mut self, n: u32) -> u32 {
        (self.word() >> 8) % n
    }
}

/// Writes the records of so many boards.
pub(super) fn records(folder: &Path, boards: u32) -> Result<PathBuf> {
    let images =
        ["compensator-full", "compensator-inputs", "compensator-lags", "compensator-paper", "compensator-warm-up"];
    let images: Vec<Vec<u8>> = images.iter().map(|name| table(name)).collect::<Result<_>>()?;
    let (mut bytes, mut seen) = (table("path-length-mirror")?, Status::OK);
    for seed in 0..boards {
        one_board(seed, &images, &mut bytes, &mut seen)?;
    }
    for (bit, name) in Status::BOARD_NAMES {
        ensure!(seen.contains(bit), "no frame has {name}");
    }
    ensure!(seen.contains(Status::UNCORRECTED), "no frame is uncorrected");
    let file = folder.join("boards.bin");
    fs::write(&file, bytes)?;
    Ok(file)
}

fn loaded(dice: &mut Dice, images: &[Vec<u8>], bytes: &mut Vec<u8>) -> Result<Loaded> {
    let origin = [Origin::Newest, Origin::Newest, Origin::Survivor, Origin::FactoryDefaults][dice.below(4) as usize];
    let trial = dice.below(2) == 1;
    let own = Image::decode(&images[dice.below(images.len() as u32) as usize])?;
    // A number of its own, or the same once more.
    let mut description = Description { sequence: 1 + dice.below(2), ..*own.description() };
    // No whole number of the unit of a frame's angle.
    description.scale_factor_femto_arcsec += 1;
    if dice.below(4) == 0 {
        // Fewer ticks between two updates than an update has slices.
        (description.period_ticks, description.slew_ticks) = (1 + dice.below(20), 0);
    }
    let image = Image::new(description)?;
    let mut encoded = vec![0; image.encoded_len()];
    image.encode(&mut encoded).context("it fits its own length")?;
    bytes.extend([origin as u8, u8::from(trial)]);
    bytes.extend((encoded.len() as u16).to_le_bytes());
    bytes.extend(encoded);
    Ok(Loaded::new(image, origin, [BankReport::Uncommitted; 2], trial))
}

fn one_board(seed: u32, images: &[Vec<u8>], bytes: &mut Vec<u8>, seen: &mut Status) -> Result<()> {
    let mut dice = Dice(seed);
    let (strips, watches, heats) = (dice.below(3) == 0, dice.below(4) != 0, dice.below(2) == 1);
    let (longest, least) = (50_u16, 1000_u32);
    let spec = WatchSpec {
        shows: 1 << (18 + dice.below(8)),
        still: 1 << (8 + dice.below(12)),
        command_shows: dice.below(3) * 500,
    };
    bytes.extend([b'B', u8::from(strips)]);
    bytes.extend(longest.to_le_bytes());
    bytes.extend(least.to_le_bytes());
    bytes.push(watches.into());
    bytes.extend([spec.shows, spec.still, spec.command_shows].into_iter().flat_map(u32::to_le_bytes));
    bytes.push(heats.into());
    let first = loaded(&mut dice, images, bytes)?;
    let since_power_on_s = [None, Some(0), Some(5), Some(4000), Some(u32::MAX - 1)][dice.below(5) as usize];
    let is_reset = dice.below(2) == 1;
    bytes.push(is_reset.into());
    bytes.extend(since_power_on_s.unwrap_or(u32::MAX).to_le_bytes());
    let start = if is_reset { StartCause::Reset { since_power_on_s } } else { StartCause::PowerOn };
    let stripper = strips.then(|| Stripper::new(longest, least));
    let watch = watches.then_some(WatchSetup { spec, heats });
    let frame_ticks = [FRAME_TICKS, 0, 1, 250][dice.below(4) as usize];
    bytes.extend(frame_ticks.to_le_bytes());
    let setup = BoardSetup { loops: loops()?, stripper, watch, frame_ticks };
    let mut board = Board::new(start, first.image, first.origin, &setup, levels(0));
    board.use_loaded(&first);
    let mut quarter = 0;
    let mut codes = [0; 4].map(|_: i32| dice.word().cast_signed() >> 2);
    for _ in 0..12 {
        if dice.below(4) == 0 {
            bytes.push(b'U');
            let other = loaded(&mut dice, images, bytes)?;
            board.use_loaded(&other);
        }
        if dice.below(4) == 0 {
            bytes.push(b'R');
            let held = loaded(&mut dice, images, bytes)?;
            board.mend(&held, &setup);
        }
        if dice.below(3) == 0 {
            let missed = [0, 1, 7, 10_000, 65_537, 1 << 20, (1 << 20) + 1][dice.below(7) as usize];
            bytes.push(b'M');
            bytes.extend(u32::to_le_bytes(missed));
            board.make_up(missed);
        }
        // One thermometer of four stands still.
        for (i, code) in codes.iter_mut().enumerate() {
            *code = if i == (seed % 4) as usize {
                *code
            } else {
                code.wrapping_add((dice.word() >> 6).cast_signed() - (1 << 25))
            };
        }
        run(&mut dice, &mut board, codes, &mut quarter, bytes, seen)?;
    }
    Ok(())
}

fn run(
    dice: &mut Dice,
    board: &mut Board,
    codes: [i32; 4],
    quarter: &mut u8,
    bytes: &mut Vec<u8>,
    seen: &mut Status,
) -> Result<()> {
    let (count, seed) = (200 + dice.below(2000), dice.word());
    let steps = [0, 3, -2, 40, -40][dice.below(5) as usize] as i16;
    let doubles = [0_u16, 0, 0, 150][dice.below(4) as usize];
    let present = (dice.below(16) | dice.below(16)) as u8;
    let amplitude = [100_000, 100_000, 0, 1][dice.below(4) as usize] as u32;
    let (light, status) = (dice.below(1 << 23), [0_u16, 0, 1 << 12][dice.below(3) as usize]);
    bytes.push(b'T');
    bytes.extend(count.to_le_bytes());
    bytes.extend(seed.to_le_bytes());
    bytes.extend(steps.to_le_bytes());
    bytes.extend(doubles.to_le_bytes());
    bytes.extend(codes.into_iter().flat_map(i32::to_le_bytes));
    bytes.push(present);
    bytes.extend(amplitude.to_le_bytes());
    bytes.extend(light.to_le_bytes());
    bytes.extend(status.to_le_bytes());
    let mut noise = Dice(seed);
    let mut hash = 2_166_136_261_u32;
    let mut mix = |word: u32| hash = (hash ^ word).wrapping_mul(16_777_619);
    for tick in 0..count {
        let mut path: Vec<(bool, bool)> = Vec::new();
        for _ in 0..steps.unsigned_abs() {
            *quarter = quarter.wrapping_add(if steps > 0 { 1 } else { 3 });
            path.push(levels(*quarter));
        }
        if doubles != 0 && tick.is_multiple_of(doubles.into()) {
            *quarter = quarter.wrapping_add(2);
            path.push(levels(*quarter));
        }
        let pickoff = if tick % 25 < 12 { amplitude.cast_signed() } else { -amplitude.cast_signed() };
        let shown: [Option<i32>; 4] = std::array::from_fn(|i| (present >> i & 1 == 1).then_some(codes[i]));
        let sample = Sample {
            codes: shown,
            pickoff,
            light: light.wrapping_add(noise.word() >> 26).cast_signed(),
            status: Status::from_bits(status),
        };
        let (ActuatorCodes { actuator, modulation, current }, frame) = board.tick(path.into_iter(), &sample);
        if let Some(output) = frame {
            *seen |= output.status;
            let (frame, length) = Message::Output(output)
                .frame()
                .context("a frame fits")?
                .of_axis(board.image().description().axis)
                .bytes();
            frame[..length].iter().for_each(|byte| mix((*byte).into()));
        }
        [actuator, modulation, current].into_iter().for_each(|code| mix(code.cast_unsigned()));
    }
    bytes.extend(hash.to_le_bytes());
    bytes.push(board.standing_still() as u8);
    Ok(())
}
