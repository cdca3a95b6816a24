//! Instructions of a tick and of a slow update. The emulator runs one instruction a nanosecond (`-icount shift=0`), and
//! SysTick counts 25 MHz of that time: 40 instructions a count, so everything is run many times.
//!
//! The image is the file `measured.img` in the emulator's working folder, so that one program measures every image.
//!
//! Instructions are not cycles: only the real part shows the effect of flash wait states and its pipeline.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::entry;
use sagnac_board::{ActuatorCodes, Board, BoardSetup, FRAME_TICKS, Rig, RigSettings, Row, StartCause};
use sagnac_core::{
    BankReport, Compensator, Description, Image, Loaded, MAX_IMAGE_LEN, Origin, Output, SlowUpdate, State, Status,
};
use sagnac_firmware::{finish, host_file, say, stack, unit_loops};
use sagnac_loops::Stripper;

/// Instructions a count.
const PER_COUNT: u32 = 40;
const TIMES: u32 = 4000;

/// Instructions of one call of `act`, without the loop around it.
fn instructions(act: impl FnMut()) -> u32 {
    instructions_of(TIMES, act).saturating_sub(instructions_of(TIMES, || {
        black_box(());
    }))
}

/// Instructions per call over `times` calls, including the loop.
fn instructions_of(times: u32, mut act: impl FnMut()) -> u32 {
    let before = SYST::get_current();
    for _ in 0..times {
        act();
    }
    // The counter counts down and has 24 bits.
    let counts = before.wrapping_sub(SYST::get_current()) & 0x00ff_ffff;
    counts.saturating_mul(PER_COUNT).div_ceil(times)
}

#[entry]
fn main() -> ! {
    let (Some(image), Some(loops), Some(mut peripherals)) = (measured_image(), unit_loops(), Peripherals::take())
    else {
        finish(false);
    };
    peripherals.SYST.set_clock_source(SystClkSource::Core);
    peripherals.SYST.set_reload(0x00ff_ffff);
    peripherals.SYST.clear_current();
    peripherals.SYST.enable_counter();

    let gyro = Compensator::new(image);
    let codes = [Some(20 << 24); 4];
    let wanted = gyro.image().inputs().len();
    let codes = codes.get(..wanted).unwrap_or(&[]);

    let mut state = State::new();
    let slow = instructions(|| {
        // An update is due at power-on; each of these is one.
        let mut fresh = black_box(state);
        let _ = black_box(black_box(&gyro).update(black_box(&mut fresh), black_box(codes)));
    });
    let copy = instructions(|| {
        let _ = black_box(black_box(state));
    });
    let _ = gyro.update(&mut state, codes);
    let slew_ticks = image.description().slew_ticks;
    let slewing = tick_instructions(&gyro, &state, slew_ticks / 2, 37);
    let limited = limited_instructions(&gyro, slew_ticks / 2);
    let _ = gyro.skip(&mut state, slew_ticks);
    let plain = tick_instructions(&gyro, &state, image.description().period_ticks - slew_ticks, 37);

    let setup = BoardSetup { loops, stripper: Some(Stripper::new(50, 1 << 23)), watch: None, frame_ticks: FRAME_TICKS };
    let mut board = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup, Rig::LEVELS);
    let mut rig = Rig::new(RigSettings { wavelength: 100_000, lamp_gain: 1 << 16, ..RigSettings::default() });
    rig.start_row(Row { ticks: u32::MAX, counts: 0, present: 1, codes: [20 << 24; 4] });
    let (_, sample) = rig.tick(&ActuatorCodes::default());
    let whole = instructions(|| {
        let _ = black_box(board.tick(black_box([(true, false), (true, true)]).into_iter(), black_box(&sample)));
    });
    // Every tick around a slow update: its slices, its end, and the ticks after it.
    board.make_up(image.description().period_ticks.saturating_sub(100));
    let largest = (0..200).fold(0, |largest: u32, _| {
        let tick = instructions_of(1, || {
            let _ = black_box(board.tick(black_box([(true, false), (true, true)]).into_iter(), black_box(&sample)));
        });
        largest.max(tick)
    });
    let [swap, again] = swap_instructions(&mut board);
    say(format_args!("swap {swap}"));
    say(format_args!("no-swap {again}"));
    #[cfg(feature = "signed")]
    say(format_args!("verification {}", verification()));
    say(format_args!("slow-update {}", slow.saturating_sub(copy)));
    say(format_args!("slice {}", largest_slice(&gyro, codes)));
    say(format_args!(
        "stack-update {}",
        stack_of(|| {
            let mut fresh = black_box(State::new());
            let _ = black_box(black_box(&gyro).update(black_box(&mut fresh), black_box(codes)));
        })
    ));
    say(format_args!(
        "stack-tick {}",
        stack_of(|| {
            let mut fresh = black_box(state);
            let _ = black_box(tick(black_box(&gyro), black_box(&mut fresh), 37));
        })
    ));
    say(format_args!("tick {plain}"));
    say(format_args!("tick-slewing {slewing}"));
    say(format_args!("tick-limited {limited}"));
    say(format_args!("tick-whole {whole}"));
    say(format_args!("tick-largest {largest}"));
    finish(true)
}

/// The change to the next image, and that to the image that is there, with the tick's interrupt masked.
fn swap_instructions(board: &mut Board) -> [u32; 2] {
    let mut other = *board.image().description();
    other.sequence = other.sequence.wrapping_add(1);
    let Ok(image) = Image::new(other) else { return [0; 2] };
    let loaded = Loaded::new(image, Origin::Newest, [BankReport::Uncommitted; 2], false);
    let mut swap = || instructions_of(1, || black_box(&mut *board).use_loaded(black_box(&loaded)));
    [swap(), swap()]
}

/// The image whose instructions are counted.
fn measured_image() -> Option<Image> {
    Image::decode(host_file::read(c"measured.img", &mut [0; MAX_IMAGE_LEN])?).ok()
}

/// The check of a signature over the longest image. The signature is wrong, but its parts are a point and a number of the group, so that all of
/// it is computed.
#[cfg(feature = "signed")]
fn verification() -> u32 {
    use sagnac_core::Trust;
    let fuses = sagnac_firmware::unit_trust();
    let Some(key) = fuses.public_key() else { return 0 };
    let mut signature = [0; 64];
    for (slot, byte) in signature.iter_mut().zip(key.iter().chain(&[7])) {
        *slot = *byte;
    }
    instructions_of(1, || {
        let _ = black_box(fuses.verify(black_box(&key), black_box(&[5; 836]), black_box(&signature)));
    })
}

/// Bytes of stack that a call uses, its own locals included.
#[inline(never)]
fn stack_of(act: impl FnOnce()) -> usize {
    let here = stack::depth();
    stack::paint();
    act();
    stack::used().saturating_sub(here)
}

/// The most expensive slice of a slow update.
fn largest_slice(gyro: &Compensator, codes: &[Option<i32>]) -> u32 {
    let Ok(mut update) = gyro.begin_update(&State::new(), codes) else { return 0 };
    let mut largest = 0;
    loop {
        let with = slice_instructions(gyro, &update, advance);
        let without = slice_instructions(gyro, &update, |_, _| false);
        largest = largest.max(with.saturating_sub(without));
        if gyro.advance_update(&mut update) {
            return largest;
        }
    }
}

/// Instructions of `act` on a copy of an update, the copy included.
#[inline(never)]
fn slice_instructions(
    gyro: &Compensator,
    update: &SlowUpdate,
    act: impl Fn(&Compensator, &mut SlowUpdate) -> bool,
) -> u32 {
    instructions(|| {
        let mut fresh = *black_box(update);
        let _ = black_box(act(black_box(gyro), black_box(&mut fresh)));
    })
}

/// A slice as a separate function with its state in memory, as an interrupt calls it.
#[inline(never)]
fn advance(gyro: &Compensator, update: &mut SlowUpdate) -> bool {
    gyro.advance_update(update)
}

/// A tick as a separate function with its state in memory, as an interrupt calls it.
#[inline(never)]
fn tick(gyro: &Compensator, state: &mut State, raw: i32) -> Option<Output> {
    gyro.tick(state, raw).ok()
}

/// Instructions of a tick, averaged over `ticks` ticks from this state.
fn tick_instructions(gyro: &Compensator, state: &State, ticks: u32, raw: i32) -> u32 {
    let ticks = ticks.clamp(1, 500);
    let many = instructions_of(TIMES / ticks + 1, || {
        let mut fresh = black_box(*state);
        for _ in 0..ticks {
            let _ = black_box(tick(black_box(gyro), black_box(&mut fresh), black_box(raw)));
        }
    });
    let none = instructions_of(TIMES / ticks + 1, || {
        let mut fresh = black_box(*state);
        for _ in 0..ticks {
            // Arguments and result, without the call.
            let _ = black_box((black_box(gyro), black_box(&mut fresh)));
            let _ = black_box(Some(Output { counts: black_box(raw), status: Status::OK }));
        }
    });
    many.saturating_sub(none).div_ceil(ticks)
}

/// A tick during the slew that exceeds the output limit.
fn limited_instructions(gyro: &Compensator, ticks: u32) -> u32 {
    let limited = Description { output_limit: 5, ..*gyro.image().description() };
    let Ok(image) = Image::new(limited) else { return 0 };
    let (gyro, mut state) = (Compensator::new(image), State::new());
    let codes = [Some(20 << 24); 4];
    let _ = gyro.update(&mut state, codes.get(..image.inputs().len()).unwrap_or(&[]));
    tick_instructions(&gyro, &state, ticks, 37)
}
