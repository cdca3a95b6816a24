//! A link check. This library calls all functions that `sagnac-core`, `sagnac-loops` and `sagnac-board` have for a target; its panic handler
//! calls a symbol that nothing defines. While any panic path remains, the library does not link.
//!
//! `cargo xtask no-panic` builds and links it.
#![no_std]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use embedded_hal::pwm::SetDutyCycle;
use embedded_hal::spi::{Operation, SpiDevice};
use embedded_io::{Read, ReadReady, Write as _};
use sagnac_board::{
    Action, ActuatorCodes, Axis, Board, BoardSetup, CommandHandler, Converters, FringeCounter, Line, MemoryFlash,
    Message, PwmOutput, Sample, SpiDac, StartCause, TickClock, run,
};
use sagnac_core::{
    Banks, Compensator, Description, Gyro, Image, MAX_IMAGE_LEN, State, Status, Trust, Trusted, Watch, WatchSpec, vote,
};
use sagnac_loops::{Counting, Intensity, LoopTable, PathLength, Quadrature, QuadratureState, Stripper, TABLE_LEN};

unsafe extern "C" {
    fn sagnac_has_a_panic_path() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never runs; if this call is kept, the link fails, which is the point.
    unsafe { sagnac_has_a_panic_path() }
}

/// Discards formatted text.
struct Nowhere;

impl Write for Nowhere {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        black_box(text);
        Ok(())
    }
}

/// Calls everything with values the compiler cannot see.
#[unsafe(no_mangle)]
pub extern "C" fn sagnac_core_everything(raw: i32, ticks: u32, code: i32) -> i32 {
    let mut watch = Watch::<4>::new(black_box(WatchSpec { shows: 100, still: 1, command_shows: 7 }));
    black_box(watch.update(&black_box([Some(code), None, Some(raw), Some(7)]), black_box(Some(code))));
    black_box(vote(&black_box([Some(code), None, Some(raw)]), ticks));
    let bytes = black_box([0_u8; MAX_IMAGE_LEN]);
    let len = black_box(ticks) as usize;
    let image = match Image::decode(bytes.get(..len).unwrap_or(&[])) {
        Ok(image) => image,
        Err(error) => {
            let _ = write!(Nowhere, "{error}");
            match Image::new(black_box(Description::empty())) {
                Ok(image) => image,
                Err(error) => {
                    let _ = write!(Nowhere, "{error}");
                    return -1;
                }
            }
        }
    };
    let mut out = [0_u8; MAX_IMAGE_LEN];
    black_box(image.encode(&mut out));
    black_box(image.serial());
    black_box((image.inputs().len(), image.terms().len(), image.encoded_len()));
    let gyro = Compensator::new(image);
    let mut state = black_box(State::new());
    let codes = black_box([Some(code); 4]);
    let count = gyro.image().inputs().len();
    let status = gyro.update(&mut state, codes.get(..count).unwrap_or(&[])).unwrap_or_default();
    if let Ok(mut update) = gyro.begin_update(&state, codes.get(..count).unwrap_or(&[])) {
        black_box((gyro.advance_update(&mut update), gyro.slices()));
        if let Err(misuse) = gyro.apply_update(&mut state, &mut update) {
            let _ = write!(Nowhere, "{misuse}");
        }
    }
    black_box(gyro.rest(&mut state, codes.get(..count).unwrap_or(&[]), ticks.into()).is_ok());
    black_box(gyro.skip(&mut state, ticks).is_ok());
    let tick = gyro.tick(&mut state, raw).map_or(0, |o| o.counts);
    let many = gyro.advance(&mut state, raw, ticks).map_or(0, |o| o.counts);
    if let Err(misuse) = gyro.tick(&mut state, raw) {
        let _ = write!(Nowhere, "{misuse}");
    }
    state = gyro.migrate_state(&state);
    black_box((state.k_q32(), state.increment(), state.target_increment(), state.ticks_to_update()));
    #[cfg(feature = "broken")]
    assert!(raw != 12_345, "a panic path on purpose");
    tick ^ many ^ i32::from((status | Status::HELD | state.status()).bits()) ^ (state.remainder() as i32)
}

/// The loops; their tables come from the host.
#[unsafe(no_mangle)]
pub extern "C" fn sagnac_loops_everything(code: i32, path: &PathLength, light: &Intensity) -> i32 {
    let (mut held, mut lit) = (path.start(), light.start());
    let out = path.tick(black_box(&mut held), code);
    let current = light.tick(black_box(&mut lit), code, code & 1 == 0);
    black_box((held.phase(), held.error(), held.held(), held.modes(), lit.phase()));
    black_box((path.ticks_per_period(), light.ticks_per_update(), out.status.bits(), current.status.bits()));
    let counter = Quadrature { counting: black_box(Counting::X2) };
    let mut state = black_box(QuadratureState::default());
    let count = counter.update(&mut state, code & 2 == 0, code & 4 == 0);
    let mut stripper = black_box(Stripper::new(50, 1000));
    let stripped = stripper.update(count, code).map_or(0, |out| out.counts);
    black_box((stripper.pending(), stripper.has_dither()));
    #[cfg(feature = "broken")]
    assert!(code != 12_345, "a panic path on purpose");
    out.actuator ^ out.modulation ^ current.current ^ stripped as i32
}

/// A board with a key. The arithmetic of the signature is not part of this check: it has panic paths (`sagnac-signature`).
struct Keyed;

impl Trust for Keyed {
    fn public_key(&self) -> Option<[u8; 32]> {
        black_box(Some([7; 32]))
    }

    fn model(&self) -> [u8; 16] {
        black_box([0; 16])
    }

    fn lowest_counter(&self) -> u32 {
        black_box(1)
    }

    fn raise_lowest_counter(&mut self, to: u32) {
        black_box(to);
    }

    fn verify(&self, public_key: &[u8; 32], message: &[u8], signature: &[u8; 64]) -> bool {
        black_box((public_key, message, signature));
        black_box(true)
    }

    fn challenge(&mut self) -> [u8; 16] {
        black_box([1; 16])
    }
}

/// The board: flash banks, tables, the line.
#[unsafe(no_mangle)]
pub extern "C" fn sagnac_board_everything(input: &[u8; TABLE_LEN], gyro: &Gyro, image: &Image) -> i32 {
    let flash = black_box(MemoryFlash::new());
    let Some(mut banks) = Banks::new(flash, black_box(0), black_box(MemoryFlash::BANK)) else { return -1 };
    if let Err(error) = banks.store(gyro, image).and_then(|()| banks.store_on_trial(gyro, image)) {
        let _ = write!(Nowhere, "{error}");
    }
    black_box(banks.start(gyro, black_box(5)));
    if let Err(error) = banks.confirm(gyro) {
        let _ = write!(Nowhere, "{error}");
    }
    if let Err(error) = banks.roll_back(gyro) {
        let _ = write!(Nowhere, "{error}");
    }
    black_box(banks.load(gyro));
    let table = match LoopTable::decode(black_box(input)) {
        Ok(table) => table,
        Err(error) => {
            let _ = write!(Nowhere, "{error}");
            return -2;
        }
    };
    black_box(table.encode());
    if let Err(error) = Trusted::check(black_box(input), black_box(&Keyed)) {
        let _ = write!(Nowhere, "{error}");
    }
    let mut handler = CommandHandler::with_trust(banks, *gyro, table, Keyed);
    if let Some(action) = handler.quiet() {
        black_box(action);
    }
    if let Some(Action::PowerOn(mut ticks, _)) = handler.receive(black_box(7)) {
        black_box(ticks.tick());
    }
    Message::pieces(black_box(input)).for_each(|piece| {
        black_box(piece.frame());
    });
    let mut sent = 0_usize;
    run(&mut handler, input.iter().copied(), |bytes| sent = sent.wrapping_add(bytes.len()));
    #[cfg(feature = "broken")]
    assert!(sent != 12_345, "a panic path on purpose");
    sent as i32
}

/// Hardware of which the compiler knows nothing.
struct Unknown;

impl FringeCounter for Unknown {
    const BITS: u32 = 16;
    fn position(&mut self) -> u32 {
        black_box(1)
    }
}

impl TickClock for Unknown {
    const BITS: u32 = 32;
    fn ticks(&mut self) -> u32 {
        black_box(2)
    }
}

impl Converters for Unknown {
    fn sample(&mut self) -> Sample {
        black_box(Sample::default())
    }
    fn drive(&mut self, codes: &ActuatorCodes) {
        black_box(codes);
    }
}

/// What a bus or a port reports.
#[derive(Clone, Copy, Debug)]
struct Fault;

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("fault")
    }
}

impl core::error::Error for Fault {}

impl embedded_io::Error for Fault {
    fn kind(&self) -> embedded_io::ErrorKind {
        embedded_io::ErrorKind::Other
    }
}

impl embedded_hal::pwm::Error for Fault {
    fn kind(&self) -> embedded_hal::pwm::ErrorKind {
        embedded_hal::pwm::ErrorKind::Other
    }
}

impl embedded_hal::spi::Error for Fault {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}

impl embedded_io::ErrorType for Unknown {
    type Error = Fault;
}

impl embedded_hal::pwm::ErrorType for Unknown {
    type Error = Fault;
}

impl embedded_hal::spi::ErrorType for Unknown {
    type Error = Fault;
}

impl ReadReady for Unknown {
    fn read_ready(&mut self) -> Result<bool, Fault> {
        black_box(Ok(true))
    }
}

impl Read for Unknown {
    fn read(&mut self, room: &mut [u8]) -> Result<usize, Fault> {
        black_box(room);
        black_box(Ok(3))
    }
}

impl embedded_io::Write for Unknown {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Fault> {
        black_box(bytes);
        black_box(Ok(3))
    }
    fn flush(&mut self) -> Result<(), Fault> {
        black_box(Ok(()))
    }
}

impl SetDutyCycle for Unknown {
    fn max_duty_cycle(&self) -> u16 {
        black_box(7)
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Fault> {
        black_box(duty);
        black_box(Ok(()))
    }
}

impl SpiDevice for Unknown {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Fault> {
        black_box(operations);
        black_box(Ok(()))
    }
}

/// A board on hardware: an axis, its line, two outputs.
#[unsafe(no_mangle)]
pub extern "C" fn sagnac_hardware_everything(input: &[u8; TABLE_LEN], gyro: &Gyro) -> i32 {
    let Some(banks) = Banks::new(black_box(MemoryFlash::new()), 0, black_box(MemoryFlash::BANK)) else { return -1 };
    let Ok(table) = LoopTable::decode(black_box(input)) else { return -2 };
    let Ok((mut line, loaded)) = Line::power_on(Unknown, banks, *gyro, Keyed, 0) else { return -3 };
    let setup = BoardSetup {
        loops: table,
        stripper: Some(Stripper::new(50, 1000)),
        watch: black_box(None),
        frame_ticks: black_box(10),
    };
    let board = Board::new(StartCause::PowerOn, loaded.image, loaded.origin, &setup, (false, false));
    let mut axis = Axis::new(board, Unknown, Unknown, Unknown);
    black_box(axis.converters().sample());
    axis.board().make_up(black_box(70_000));
    if let Some(output) = axis.tick() {
        black_box(line.send(output).is_ok());
    }
    black_box(line.poll(|loaded| axis.board().use_loaded(loaded)).is_ok());
    black_box(line.quiet(|loaded| axis.board().use_loaded(loaded)).is_ok());
    line.second();
    if !axis.board().is_intact(&setup) {
        axis.board().mend(&line.load(), &setup);
    }
    let Some(mut width) = PwmOutput::new(Unknown, black_box(-5), black_box(5)) else { return -4 };
    black_box(width.set(black_box(1)).is_ok());
    black_box(SpiDac::new(Unknown, black_box(-5)).set(black_box(1)).is_ok());
    #[cfg(feature = "broken")]
    assert!(gyro.axis != 99, "a panic path on purpose");
    0
}
