//! The program of the gyro's board: a tick of 100 µs by SysTick; the serial line and the flash in the main loop.
//!
//! A received byte interrupts and goes to a buffer, so that none is lost while the main loop checks a signature or stores an image, and
//! the tick interrupts both. A full buffer makes the sender wait.
#![no_std]
#![no_main]

use core::cell::RefCell;

use cortex_m::asm::wfi;
use cortex_m::interrupt::{Mutex, free};
use cortex_m::peripheral::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
use sagnac_board::{Action, CommandHandler, MemoryFlash, Message, RigSettings, Row, TickHandler};
use sagnac_core::Banks;
use sagnac_firmware::{UnitTrust, finish, say, serial, stack, unit_gyro, unit_loops, unit_trust};

/// Processor clocks of a tick: 100 µs at the MPS2's 25 MHz.
const TICK_CLOCKS: u32 = 2500;
/// Size of the transmit buffer, bytes.
const ROOM: usize = 4096;
/// Size of the receive buffer, bytes.
const HEARD: usize = 256;

/// What this board's messages go through.
type Handler = CommandHandler<MemoryFlash, UnitTrust>;

/// Data shared by the interrupt and the main loop.
struct Shared {
    ticks: TickHandler,
    out: Ring<ROOM>,
    heard: Ring<HEARD>,
    /// The next row, while one runs.
    next: Option<Row>,
    /// Number of interrupts without a row or without room in the buffer.
    idle: u32,
    /// The axis letter of this gyro.
    axis: u8,
}

/// A buffer of bytes.
struct Ring<const N: usize> {
    bytes: [u8; N],
    read: usize,
    held: usize,
}

impl<const N: usize> Ring<N> {
    const fn new() -> Self {
        Self { bytes: [0; N], read: 0, held: 0 }
    }

    fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let at = (self.read + self.held) % N;
            if let Some(slot) = self.bytes.get_mut(at).filter(|_| self.held < N) {
                *slot = *byte;
                self.held += 1;
            }
        }
    }

    fn pop(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.read).filter(|_| self.held > 0)?;
        self.read = (self.read + 1) % N;
        self.held -= 1;
        Some(byte)
    }
}

static SHARED: Mutex<RefCell<Option<Shared>>> = Mutex::new(RefCell::new(None));

/// Runs `act` on the shared data with interrupts off. `None` only before power-on has set them up.
fn shared<T>(act: impl FnOnce(&mut Shared) -> T) -> Option<T> {
    free(|cs| SHARED.borrow(cs).try_borrow_mut().ok().and_then(|mut shared| shared.as_mut().map(act)))
}

/// The serial port's interrupt, the only one that is on besides the tick.
#[exception]
unsafe fn DefaultHandler(_: i16) {
    if let Some(byte) = serial::get() {
        shared(|shared| {
            shared.heard.push(&[byte]);
            if shared.heard.held == HEARD {
                serial::listen(false);
            }
        });
    }
}

#[exception]
fn SysTick() {
    shared(|shared| {
        if shared.ticks.ticks_left() == 0
            && let Some(row) = shared.next.take()
        {
            shared.ticks.start_row(row);
        }
        // A frame must fit. A gyro with a line that is too slow for its frames would have to drop them here.
        if shared.ticks.ticks_left() == 0 || shared.out.held + 128 > ROOM {
            shared.idle = shared.idle.wrapping_add(1);
        } else if let Some(output) = shared.ticks.tick() {
            send(&mut shared.out, Message::Output(output), shared.axis);
        }
    });
}

fn send(out: &mut Ring<ROOM>, message: Message, axis: u8) {
    if let Some(frame) = message.frame() {
        let (bytes, len) = frame.of_axis(axis).bytes();
        out.push(bytes.get(..len).unwrap_or(&[]));
    }
}

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(handler) = power_on() else {
        say(format_args!("the image or the loop table of this unit is not usable"));
        finish(false);
    };
    // Not before there is a buffer for what it receives.
    serial::start();
    start_ticks();
    loop {
        flush();
        match shared(heard).flatten() {
            Some(byte) => receive(handler, byte),
            None => wfi(),
        }
    }
}

/// Sends what waits to be sent.
fn flush() {
    while let Some(byte) = shared(|shared| shared.out.pop()).flatten() {
        serial::put(byte);
    }
}

/// The next byte to handle. On a rig, not before the row has ended, so that the same bytes give the same frames.
fn heard(shared: &mut Shared) -> Option<u8> {
    let running = shared.ticks.ticks_left() > 0 || shared.out.held > 0;
    let waits = if cfg!(feature = "live") { shared.next.is_some() } else { running };
    let byte = if waits { None } else { shared.heard.pop() };
    if byte.is_some() {
        serial::listen(true);
    }
    byte
}

/// Power-on. The handler is in static memory; the stack used to make it is free again afterwards.
#[inline(never)]
fn power_on() -> Option<&'static mut Handler> {
    let handler = handler()?;
    let (ticks, reply) = handler.power_on(RigSettings::default());
    let mut out = Ring::new();
    send(&mut out, Message::Reply(reply), handler.axis());
    free(|cs| {
        if let Ok(mut slot) = SHARED.borrow(cs).try_borrow_mut() {
            *slot = Some(Shared { ticks, out, heard: Ring::new(), next: None, idle: 0, axis: handler.axis() });
        }
    });
    Some(handler)
}

#[inline(never)]
fn handler() -> Option<&'static mut Handler> {
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK)?;
    let (gyro, loops) = (unit_gyro()?, unit_loops()?);
    singleton!(: Handler = CommandHandler::with_trust(banks, gyro, loops, unit_trust()))
}

/// Takes a byte from the line and runs the action of a message that ends with it.
#[inline(never)]
fn receive(handler: &mut Handler, byte: u8) {
    if let Some(action) = handler.receive(byte) {
        run(action);
    }
}

fn start_ticks() {
    if let Some(mut peripherals) = Peripherals::take() {
        peripherals.SYST.set_clock_source(SystClkSource::Core);
        peripherals.SYST.set_reload(TICK_CLOCKS - 1);
        peripherals.SYST.clear_current();
        peripherals.SYST.enable_interrupt();
        peripherals.SYST.enable_counter();
    }
}

fn run(action: Action) {
    match action {
        Action::Run(row) => {
            shared(|shared| {
                if shared.ticks.ticks_left() > 0 {
                    shared.next = Some(row);
                } else {
                    shared.ticks.start_row(row);
                }
            });
        }
        Action::Send(message, loaded) => {
            shared(|shared| {
                if let Some(loaded) = loaded {
                    shared.ticks.use_loaded(&loaded);
                }
                send(&mut shared.out, message, shared.axis);
            });
        }
        Action::PowerOn(ticks, reply) => {
            shared(|shared| {
                shared.ticks = ticks;
                send(&mut shared.out, Message::Reply(reply), shared.axis);
            });
        }
        Action::Stop => {
            // Live: what still runs ends first.
            while shared(|shared| shared.ticks.ticks_left() > 0 || shared.next.is_some()).unwrap_or(false) {
                flush();
                wfi();
            }
            flush();
            let idle = shared(|shared| shared.idle).unwrap_or(0);
            say(format_args!("stack {} bytes, {idle} interrupts without a row", stack::used()));
            finish(true);
        }
    }
}
