//! Fringes and ticks in three timers that need no processor.
//!
//! ```text
//! PA0, PA1: A/B ─▶ TIM2, encoder mode, 32 bits ◀─ latch ── TIM4, 100 µs ──▶ ADC1 (converters.rs)
//!                                                           └──▶ TIM5 counts the ticks, 32 bits
//! ```
//!
//! TIM4 latches the position of TIM2 at the tick itself, so the time that the interrupt waits is in no count. TIM5 goes on while the processor
//! stands still, for example in an erase of flash: [`sagnac_board::Axis`] makes up the ticks that it shows.
//!
//! TIM2 counts up to 42 million steps a second (half of its clock), beyond which it loses them without a sign: the encoder mode of this timer
//! cannot tell a step of unknown direction.

use sagnac_board::{FringeCounter, TickClock};
use stm32f4::stm32f407::{GPIOA, RCC, TIM2, TIM4, TIM5};

use crate::clocks::SLOW_TIMERS_HZ;

/// Length of a tick, ns.
pub const TICK_NS: u32 = 100_000;
/// Clocks of a tick.
const TICK_CLOCKS: u32 = SLOW_TIMERS_HZ / (1_000_000_000 / TICK_NS);
/// The trigger input of TIM2 that is TIM4 (RM0090, table 97). The vendor's description has no name for this value.
const TIM2_FROM_TIM4: u8 = 3;

/// The position, latched at the tick.
pub struct Encoder(TIM2);

/// Ticks since the start.
pub struct Ticks(TIM5);

/// Sets the timers up; [`run`] starts the ticks.
pub fn start(rcc: &RCC, pins: &GPIOA, encoder: TIM2, tick: &TIM4, ticks: TIM5) -> (Encoder, Ticks) {
    rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled());
    rcc.apb1enr().modify(|_, w| w.tim2en().enabled().tim4en().enabled().tim5en().enabled());
    pins.afrl().modify(|_, w| w.afrl0().af1().afrl1().af1());
    pins.moder().modify(|_, w| w.moder0().alternate().moder1().alternate());

    encoder.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
    encoder.ccmr2_input().write(|w| w.cc3s().trc());
    encoder.ccer().write(|w| w.cc3e().set_bit());
    // SAFETY: 3 is a trigger input of this timer.
    encoder.smcr().write(|w| unsafe { w.ts().bits(TIM2_FROM_TIM4) }.sms().encoder_mode_3());
    // SAFETY: any 32 bits are a limit of this counter.
    encoder.arr().write(|w| unsafe { w.bits(u32::MAX) });
    encoder.cr1().write(|w| w.cen().enabled());

    ticks.smcr().write(|w| w.ts().itr2().sms().ext_clock_mode());
    // SAFETY: as above.
    ticks.arr().write(|w| unsafe { w.bits(u32::MAX) });
    ticks.cr1().write(|w| w.cen().enabled());

    // SAFETY: 8399 is within the 16 bits of this counter.
    tick.arr().write(|w| unsafe { w.bits(TICK_CLOCKS - 1) });
    tick.cr2().write(|w| w.mms().update());
    (Encoder(encoder), Ticks(ticks))
}

/// Starts the ticks.
pub fn run(tick: &TIM4) {
    tick.cr1().write(|w| w.cen().enabled());
}

impl FringeCounter for Encoder {
    const BITS: u32 = 32;

    fn position(&mut self) -> u32 {
        self.0.ccr3().read().bits()
    }
}

impl TickClock for Ticks {
    const BITS: u32 = 32;

    fn ticks(&mut self) -> u32 {
        self.0.cnt().read().bits()
    }
}
