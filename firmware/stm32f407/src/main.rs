//! The board of one axis on an STM32F407: counts in a timer, samples at the tick, frames by DMA, images in the internal flash.
//!
//! ```text
//! timers ─▶ ADC1 ─▶ interrupt: Axis::tick ─▶ frames ─▶ main loop: Line::send ─▶ serial line
//!                                    ▲ image, once a second compared with flash ◀─ Line::poll ◀─┘
//! ```
//!
//! The main loop feeds the watchdog only if a tick was counted since the last time, so a dead tick and a hung loop both end in a reset.
//!
//! Built in CI for the part; not run on one. docs/how-to/port-a-board.md says what only hardware can show.
#![no_std]
#![no_main]

mod clocks;
mod converters;
mod flash;
mod fringes;
mod identity;
mod serial;

use core::cell::RefCell;
use core::panic::PanicInfo;

use cortex_m::asm::wfi;
use cortex_m::interrupt::{Mutex, free};
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m_rt::{entry, exception};
use heapless::Deque;
use sagnac_board::{Axis, Board, BoardSetup, FRAME_TICKS, Line, OutputFrame, StartCause};
use sagnac_core::{Banks, NoKey};
use stm32f4::stm32f407::{IWDG, Interrupt, Peripherals, RTC, TIM4, interrupt};

use converters::{Desk, Parts};
use flash::Internal;
use fringes::{Encoder, Ticks};
use serial::Serial;

/// Frames that wait for the main loop: 320 ms.
const WAITING: usize = 32;
/// Ticks from one comparison with flash to the next.
const SCRUB_TICKS: u32 = 10_000;
/// Longest time without food, at about 32 kHz / 64: 4 s, above the longest store.
const WATCHDOG_RELOAD: u16 = 2000;

/// What the tick's interrupt and the main loop share.
struct Shared {
    axis: Axis<Encoder, Ticks, Desk>,
    frames: Deque<OutputFrame, WAITING>,
    ticks: u32,
}

static SHARED: Mutex<RefCell<Option<Shared>>> = Mutex::new(RefCell::new(None));

unsafe extern "C" {
    fn sagnac_firmware_has_a_panic_path() -> !;
}

/// While any panic path remains, this program does not link.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never runs; if this call is kept, the link fails, which is the point.
    unsafe { sagnac_firmware_has_a_panic_path() }
}

/// Runs `act` on the shared data with interrupts off. `None` only before they are set up.
fn shared<T>(act: impl FnOnce(&mut Shared) -> T) -> Option<T> {
    free(|cs| SHARED.borrow(cs).try_borrow_mut().ok().and_then(|mut shared| shared.as_mut().map(act)))
}

/// The four samples of a tick are there.
#[interrupt]
fn ADC() {
    shared(|shared| {
        shared.axis.converters().acknowledge();
        if let Some(frame) = shared.axis.tick() {
            // A full queue loses the frame; the gap in the sequence numbers says so.
            let _ = shared.frames.push_back(frame);
        }
        shared.ticks = shared.ticks.wrapping_add(1);
    });
}

/// The crystal stopped: nothing that counts ticks can go on.
#[exception]
unsafe fn NonMaskableInt() {
    SCB::sys_reset();
}

/// A fault of the processor.
#[exception]
unsafe fn HardFault(_: &cortex_m_rt::ExceptionFrame) -> ! {
    SCB::sys_reset();
}

#[entry]
fn main() -> ! {
    if let Some((line, setup, watchdog, clock)) = power_on() {
        run(line, &setup, &watchdog, &clock);
    }
    // No crystal, or no table of the loops: nothing may be driven. The watchdog, if it runs already, tries again.
    loop {
        wfi();
    }
}

type BoardLine = Line<Serial, Internal, NoKey>;

/// Power-on or a reset, by the flags of the processor, which are cleared for the next time; and how many resets by the watchdog there were in a
/// row, in a register that a reset leaves alone. No clock of this board runs through a reset.
fn how_it_began(parts: &Peripherals) -> (StartCause, u32) {
    let began = parts.RCC.csr().read();
    parts.RCC.csr().modify(|_, w| w.rmvf().set_bit());
    // The register can be written from here on (RM0090, 5.1.2).
    parts.RCC.apb1enr().modify(|_, w| w.pwren().enabled());
    parts.PWR.cr().modify(|_, w| w.dbp().set_bit());
    let is_power_on = began.porrstf().bit_is_set();
    let before = if is_power_on { 0 } else { watchdog_resets(&parts.RTC) };
    let resets = before.saturating_add(u32::from(began.wdgrstf().bit_is_set()));
    set_watchdog_resets(&parts.RTC, resets);
    (if is_power_on { StartCause::PowerOn } else { StartCause::Reset { since_power_on_s: None } }, resets)
}

fn watchdog_resets(clock: &RTC) -> u32 {
    clock.bkpr(0).read().bkp().bits()
}

fn set_watchdog_resets(clock: &RTC, to: u32) {
    // SAFETY: any number may stand in this register.
    clock.bkpr(0).write(|w| unsafe { w.bkp().bits(to) });
}

/// Everything up to the first tick.
#[inline(never)]
fn power_on() -> Option<(BoardLine, BoardSetup, IWDG, RTC)> {
    let parts = Peripherals::take()?;
    start_watchdog(&parts.IWDG);
    let (cause, resets) = how_it_began(&parts);
    clocks::start(&parts.RCC, &parts.FLASH, &parts.PWR)?;
    let setup = BoardSetup { loops: flash::loops()?, stripper: None, watch: None, frame_ticks: FRAME_TICKS };
    let port = Serial::start(&parts.RCC, &parts.GPIOA, parts.USART2, parts.DMA1);
    let banks = Banks::new(Internal::new(parts.FLASH), 0, flash::BANK)?;
    let (line, loaded) = Line::power_on(port, banks, identity::gyro(), NoKey, resets).ok()?;
    let of = Parts { rcc: &parts.RCC, port_a: &parts.GPIOA, port_c: &parts.GPIOC, common: &parts.ADC_COMMON };
    let desk = Desk::start(&of, parts.ADC1, parts.DAC, parts.TIM1)?;
    let (encoder, ticks) = fringes::start(&parts.RCC, &parts.GPIOA, parts.TIM2, &parts.TIM4, parts.TIM5);
    let mut board = Board::new(cause, loaded.image, loaded.origin, &setup, (false, false));
    board.use_loaded(&loaded);
    let axis = Axis::new(board, encoder, ticks, desk);
    free(|cs| {
        if let Ok(mut slot) = SHARED.borrow(cs).try_borrow_mut() {
            *slot = Some(Shared { axis, frames: Deque::new(), ticks: 0 });
        }
    });
    start_ticks(&parts.TIM4);
    Some((line, setup, parts.IWDG, parts.RTC))
}

fn start_ticks(tick: &TIM4) {
    // SAFETY: the handler shares its data by critical sections alone.
    unsafe { NVIC::unmask(Interrupt::ADC) };
    fringes::run(tick);
}

/// What the watchdog takes as a key (RM0090, 21.4.1).
const WATCHDOG_SETTINGS: u16 = 0x5555;
const WATCHDOG_START: u16 = 0xcccc;
const WATCHDOG_FOOD: u16 = 0xaaaa;

fn watchdog_key(watchdog: &IWDG, key: u16) {
    // SAFETY: one of the three keys above.
    watchdog.kr().write(|w| unsafe { w.key().bits(key) });
}

fn start_watchdog(watchdog: &IWDG) {
    watchdog_key(watchdog, WATCHDOG_START);
    watchdog_key(watchdog, WATCHDOG_SETTINGS);
    watchdog.pr().write(|w| w.pr().divide_by64());
    watchdog.rlr().write(|w| w.rl().set(WATCHDOG_RELOAD));
    watchdog_key(watchdog, WATCHDOG_FOOD);
}

/// The main loop.
fn run(mut line: BoardLine, setup: &BoardSetup, watchdog: &IWDG, clock: &RTC) {
    let (mut seen, mut compared, mut heard) = (0, 0, 0_u32);
    loop {
        let now = shared(|shared| shared.ticks).unwrap_or(seen);
        if now != seen {
            seen = now;
            watchdog_key(watchdog, WATCHDOG_FOOD);
        }
        while let Some(frame) = shared(|shared| shared.frames.pop_front()).flatten() {
            let Ok(()) = line.send(frame);
        }
        let Ok(any) = line.poll(|loaded| {
            shared(|shared| shared.axis.board().use_loaded(loaded));
        });
        if any {
            heard = now;
        } else if now.wrapping_sub(heard) > QUIET_TICKS {
            heard = now;
            let Ok(()) = line.quiet(|loaded| {
                shared(|shared| shared.axis.board().use_loaded(loaded));
            });
        }
        if now.wrapping_sub(compared) >= SCRUB_TICKS {
            compared = now;
            line.second();
            if shared(|shared| shared.axis.board().is_intact(setup)) == Some(false) {
                let loaded = line.load();
                shared(|shared| shared.axis.board().mend(&loaded, setup));
            }
            if now >= MINUTE_TICKS {
                // The image has proved that the board can live with it.
                set_watchdog_resets(clock, 0);
            }
        }
        wfi();
    }
}

/// A board that runs for so long is in no loop of its watchdog.
const MINUTE_TICKS: u32 = 600_000;
/// A line that is quiet for so many ticks has ended its frame: 50 ms, about eight of the longest frames.
const QUIET_TICKS: u32 = 500;
