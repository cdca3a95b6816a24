//! The hardware of one axis behind traits: what a port writes, and no more.
//!
//! ```text
//! FringeCounter ─ position, modulo 2^BITS ─▶ difference ─▶ counts ─┐
//! TickClock ───── ticks, modulo 2^BITS ────▶ missed ticks ─────────┼─▶ Board ─▶ actuators ─▶ Converters
//! Converters ──── codes, light, pickoff ───────────────────────────┘        └─▶ output frame
//! ```
//!
//! `embedded-hal` 1.0 has no counter, no clock and no analogue converter, so these are traits of this crate. What it has is used: an
//! actuator on a pulse width ([`PwmOutput`]), a converter on SPI ([`SpiDac`]). The serial line is `embedded-io` ([`crate::Line`]), the flash
//! `embedded-storage`.
//!
//! A clock of its own makes a missed tick visible. Without one, a tick that comes late, because flash was erased or an interrupt was masked,
//! costs its correction without a sign, although the counter keeps its counts.
//!
//! Where it fails: a counter that moves by more than half of its range between two ticks (16 bits: 32,767 counts, also in a pause) has an
//! unknown direction, and nothing shows that. A clock that wraps during a pause hides as many ticks. Use 32 bits where pauses are long.

use embedded_hal::pwm::SetDutyCycle;
use embedded_hal::spi::SpiDevice;

use crate::board::{ActuatorCodes, Board, Sample};
use crate::message::OutputFrame;

/// A counter of fringes in hardware: a timer in encoder mode, a capture unit, a counter of an FPGA.
pub trait FringeCounter {
    /// Bits of the position, 1 to 32; it wraps.
    const BITS: u32;

    /// The position at the tick. Hardware that latches it at the tick itself keeps the time that an interrupt waits out of the counts.
    fn position(&mut self) -> u32;

    /// Steps of unknown direction since power-on, modulo 2³²; 0 for a counter that cannot tell.
    fn lost_steps(&mut self) -> u32 {
        0
    }
}

/// A clock that counts ticks, whether or not the tick's interrupt is served.
pub trait TickClock {
    /// Bits of the number, 1 to 32; it wraps.
    const BITS: u32;

    /// Ticks since any moment.
    fn ticks(&mut self) -> u32;
}

/// The converters of the axis: thermometers, photodiode and pickoff in, path-length actuator and discharge current out.
pub trait Converters {
    /// The newest samples. A thermometer without a new value since the last slow update is `None`.
    fn sample(&mut self) -> Sample;

    /// Puts the codes out. Called once a tick.
    fn drive(&mut self, codes: &ActuatorCodes);
}

/// A board on hardware. Call [`Axis::tick`] from the tick's interrupt.
#[derive(Debug)]
pub struct Axis<N, K, V> {
    board: Board,
    counter: N,
    clock: K,
    converters: V,
    position: u32,
    ticks: u32,
}

impl<N: FringeCounter, K: TickClock, V: Converters> Axis<N, K, V> {
    /// Counts and ticks begin here.
    pub fn new(board: Board, mut counter: N, mut clock: K, converters: V) -> Self {
        const {
            assert!(N::BITS >= 1 && N::BITS <= 32 && K::BITS >= 1 && K::BITS <= 32, "1 to 32 bits");
        }
        let (position, ticks) = (counter.position(), clock.ticks());
        Self { board, counter, clock, converters, position, ticks }
    }

    /// The board, for a new image or a comparison with flash between two ticks.
    pub const fn board(&mut self) -> &mut Board {
        &mut self.board
    }

    /// The converters, for what their interrupt needs.
    pub const fn converters(&mut self) -> &mut V {
        &mut self.converters
    }

    /// One tick, and before it those that were missed since the last call. `None` also for a call within the same tick.
    #[inline]
    pub fn tick(&mut self) -> Option<OutputFrame> {
        let now = self.clock.ticks();
        let elapsed = difference::<K>(now, self.ticks);
        let missed = elapsed.checked_sub(1)?;
        self.ticks = now;
        self.board.make_up(missed);
        let position = self.counter.position();
        let shift = 32 - N::BITS;
        let counts = (position.wrapping_sub(self.position) << shift).cast_signed() >> shift;
        self.position = position;
        let sample = self.converters.sample();
        let (codes, output) = self.board.tick_counts(counts, self.counter.lost_steps(), &sample);
        self.converters.drive(&codes);
        output
    }
}

/// Ticks from one reading of the clock to the next, without a sign.
fn difference<K: TickClock>(now: u32, before: u32) -> u32 {
    now.wrapping_sub(before) & (u32::MAX >> (32 - K::BITS))
}

/// An actuator behind a pulse width and a low-pass filter.
#[derive(Debug)]
pub struct PwmOutput<P> {
    pwm: P,
    lowest: i32,
    /// Codes from the lowest to the highest.
    range: u32,
}

impl<P: SetDutyCycle> PwmOutput<P> {
    /// `lowest` is the code of no pulse, `highest` that of a pulse without end. `None` if they are not in this order.
    pub fn new(pwm: P, lowest: i32, highest: i32) -> Option<Self> {
        (lowest < highest).then(|| Self { pwm, lowest, range: highest.abs_diff(lowest) })
    }

    /// Puts the code out, held to the range, to the nearest step of the pulse width.
    ///
    /// # Errors
    /// Those of the channel.
    pub fn set(&mut self, code: i32) -> Result<(), P::Error> {
        let most = self.pwm.max_duty_cycle();
        let above = if code < self.lowest { 0 } else { code.abs_diff(self.lowest).min(self.range) };
        let rounded = u64::from(above) * u64::from(most) + u64::from(self.range / 2);
        let duty = rounded.checked_div(self.range.into()).unwrap_or(0);
        self.pwm.set_duty_cycle(u16::try_from(duty).unwrap_or(most))
    }
}

/// A converter of 16 bits on SPI that has one straight binary word, most significant bit first.
#[derive(Debug)]
pub struct SpiDac<S> {
    spi: S,
    lowest: i32,
}

impl<S: SpiDevice> SpiDac<S> {
    /// `lowest` is the code of word 0.
    pub const fn new(spi: S, lowest: i32) -> Self {
        Self { spi, lowest }
    }

    /// Puts the code out, held to the range of the converter.
    ///
    /// # Errors
    /// Those of the bus.
    pub fn set(&mut self, code: i32) -> Result<(), S::Error> {
        let word = (i64::from(code) - i64::from(self.lowest)).clamp(0, 0xffff) as u16;
        self.spi.write(&word.to_be_bytes())
    }
}
