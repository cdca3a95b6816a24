//! Clocks: a crystal of 8 MHz, 168 MHz for the processor, 42 and 84 MHz for the buses, 84 MHz for the timers of the slow bus.
//!
//! The tick is the unit of the correction's time, so it comes from the crystal or not at all: without it the board does not start, and the
//! watchdog tries again. The internal oscillator is wrong by up to 1 %, which would be 1 % of every bias.

use stm32f4::stm32f407::{FLASH, PWR, RCC};

/// Clock of the timers 2 to 5, Hz.
pub const SLOW_TIMERS_HZ: u32 = 84_000_000;
/// Clock of the slow bus, for the serial port, Hz.
pub const SLOW_BUS_HZ: u32 = 42_000_000;
/// Readings of a flag until a clock counts as dead: about 100 ms at 16 MHz.
const PATIENCE: u32 = 200_000;

/// Switches to the crystal. `None` if crystal or PLL does not start.
pub fn start(rcc: &RCC, flash: &FLASH, power: &PWR) -> Option<()> {
    rcc.apb1enr().modify(|_, w| w.pwren().enabled());
    // Scale 1, the reset value, is needed for 168 MHz.
    power.cr().modify(|_, w| w.vos().scale1());
    rcc.cr().modify(|_, w| w.hseon().on());
    wait(|| rcc.cr().read().hserdy().is_ready())?;
    // 8 MHz / 8 · 336 / 2.
    // SAFETY: the values are within the ranges of the reference manual (RM0090, 7.3.2).
    rcc.pllcfgr().write(|w| unsafe { w.pllsrc().hse().pllm().bits(8).plln().bits(336).pllp().div2().pllq().bits(7) });
    rcc.cr().modify(|_, w| w.pllon().on());
    wait(|| rcc.cr().read().pllrdy().is_ready())?;
    // Five wait states at 168 MHz and 3.3 V, before the clock rises.
    flash.acr().modify(|_, w| w.latency().ws5().icen().enabled().dcen().enabled());
    wait(|| flash.acr().read().latency().is_ws5())?;
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2().sw().pll());
    wait(|| rcc.cfgr().read().sws().is_pll())?;
    // A crystal that stops later raises the non-maskable interrupt, which starts the board again.
    rcc.cr().modify(|_, w| w.csson().on());
    Some(())
}

fn wait(ready: impl Fn() -> bool) -> Option<()> {
    (0..PATIENCE).any(|_| ready()).then_some(())
}
