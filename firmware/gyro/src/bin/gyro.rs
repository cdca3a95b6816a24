//! The program of the gyro's board: a tick of 100 µs by SysTick; the serial line and the flash in the main loop.
#![no_std]
#![no_main]

use core::cell::RefCell;

use cortex_m::asm::wfi;
use cortex_m::interrupt::{Mutex, free};
use cortex_m::peripheral::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
use sagnac_board::{Action, CommandHandler, MemoryFlash, Message, RigSettings, TickHandler};
use sagnac_core::Banks;
use sagnac_firmware::{finish, say, serial, stack, unit_gyro, unit_loops};

/// Processor clocks of a tick: 100 µs at the MPS2's 25 MHz.
const TICK_CLOCKS: u32 = 2500;
/// Size of the transmit buffer, bytes.
const ROOM: usize = 4096;

/// Data shared by the interrupt and the main loop.
struct Shared {
    ticks: TickHandler,
    out: Ring,
    /// Number of interrupts without a row or without room in the buffer.
    idle: u32,
}

/// Transmit buffer.
struct Ring {
    bytes: [u8; ROOM],
    read: usize,
    held: usize,
}

impl Ring {
    fn push(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let at = (self.read + self.held) % ROOM;
            if let Some(slot) = self.bytes.get_mut(at).filter(|_| self.held < ROOM) {
                *slot = *byte;
                self.held += 1;
            }
        }
    }

    fn pop(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.read).filter(|_| self.held > 0)?;
        self.read = (self.read + 1) % ROOM;
        self.held -= 1;
        Some(byte)
    }
}

static SHARED: Mutex<RefCell<Option<Shared>>> = Mutex::new(RefCell::new(None));

/// Runs `act` on the shared data with interrupts off. `None` only before power-on has set them up.
fn shared<T>(act: impl FnOnce(&mut Shared) -> T) -> Option<T> {
    free(|cs| SHARED.borrow(cs).try_borrow_mut().ok().and_then(|mut shared| shared.as_mut().map(act)))
}

#[exception]
fn SysTick() {
    shared(|shared| {
        // A frame must fit. A gyro with a line that is too slow for its frames would have to drop them here.
        if shared.ticks.ticks_left() == 0 || shared.out.held + 128 > ROOM {
            shared.idle = shared.idle.wrapping_add(1);
        } else if let Some(output) = shared.ticks.tick() {
            send(&mut shared.out, Message::Output(output));
        }
    });
}

fn send(out: &mut Ring, message: Message) {
    if let Some(frame) = message.frame() {
        let (bytes, len) = frame.bytes();
        out.push(bytes.get(..len).unwrap_or(&[]));
    }
}

#[entry]
fn main() -> ! {
    stack::paint();
    serial::start();
    let Some(handler) = power_on() else {
        say(format_args!("the image or the loop table of this unit is not usable"));
        finish(false);
    };
    start_ticks();
    loop {
        while let Some(byte) = shared(|shared| shared.out.pop()).flatten() {
            serial::put(byte);
        }
        let busy = shared(|shared| shared.ticks.ticks_left() > 0 || shared.out.held > 0).unwrap_or(false);
        if busy {
            wfi();
        } else if let Some(byte) = serial::get() {
            receive(handler, byte);
        }
    }
}

/// Power-on. The handler is in static memory; the stack used to make it is free again afterwards.
#[inline(never)]
fn power_on() -> Option<&'static mut CommandHandler<MemoryFlash>> {
    let handler = handler()?;
    let (ticks, reply) = handler.power_on(RigSettings::default());
    let mut out = Ring { bytes: [0; ROOM], read: 0, held: 0 };
    send(&mut out, Message::Reply(reply));
    free(|cs| {
        if let Ok(mut slot) = SHARED.borrow(cs).try_borrow_mut() {
            *slot = Some(Shared { ticks, out, idle: 0 });
        }
    });
    Some(handler)
}

#[inline(never)]
fn handler() -> Option<&'static mut CommandHandler<MemoryFlash>> {
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK)?;
    let (gyro, loops) = (unit_gyro()?, unit_loops()?);
    singleton!(: CommandHandler<MemoryFlash> = CommandHandler::new(banks, gyro, loops))
}

/// Takes a byte from the line and runs the action of a message that ends with it.
#[inline(never)]
fn receive(handler: &mut CommandHandler<MemoryFlash>, byte: u8) {
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
            shared(|shared| shared.ticks.start_row(row));
        }
        Action::Reply(reply, loaded) => {
            shared(|shared| {
                if let Some(loaded) = loaded {
                    shared.ticks.use_image(&loaded);
                }
                send(&mut shared.out, Message::Reply(reply));
            });
        }
        Action::PowerOn(ticks, reply) => {
            shared(|shared| {
                shared.ticks = ticks;
                send(&mut shared.out, Message::Reply(reply));
            });
        }
        Action::Stop => {
            let idle = shared(|shared| shared.idle).unwrap_or(0);
            say(format_args!("stack {} bytes, {idle} interrupts without a row", stack::used()));
            finish(true);
        }
    }
}
