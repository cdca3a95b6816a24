//! The correction itself.
//!
//! Slow path, once per Δt: input codes → `k = 1 + ε·1e-6` (Q32) and the increment `d·tick/S0` (counts·2⁻³² per tick).
//! Fast path, every tick:
//!
//! ```text
//! acc += raw·k − increment                             whole counts are output, the Q0.32 remainder is carried
//! Σ out·2³² + remainder = Σ raw·k − Σ increment        exactly, without drift
//! ```
//!
//! The increment slews to a new value over `slew_ticks` L in an arithmetic progression of two parts: with `Δ = q·L + r`, 0 ≤ r < L, the
//! first r ticks step by q + 1 and the others by q. It ends exactly at the new value and differs from the straight line by at most L/4
//! LSB (6e-5 °/h for L = 100 and 1 arcsec per count). Its sum has a closed form, so [`Compensator::advance`] equals that many ticks.
//!
//! A slow update of many terms can be made in slices: [`Compensator::begin_update`].
//!
//! A call past a slow update, or with |raw| > 2²⁹, is refused with a [`Misuse`] and changes nothing.

mod upset;

use core::fmt;

use crate::image::{GUARD_BITS, Image, MAX_INPUTS};
use crate::input::{InputState, ValueSource};
use crate::rounding::round_shift;
use crate::slow_update::{Reading, SlowUpdate, Sums, evaluate, read};
use crate::status::Status;

/// Largest |raw| of one call: 2²⁹ counts.
pub const MAX_RAW: i32 = 1 << 29;
/// An accumulator beyond this after a call has lost its meaning: 2⁶¹ (2²⁹ counts that have not been output).
const ACCUMULATOR_BOUND: i64 = 1 << 61;
/// Slow updates that a start after a reset makes of a warm-up at most.
const MOST_UPDATES_MADE_UP: u64 = 1 << 20;
const ONE_Q32: i64 = 1 << 32;

/// The correction of one gyro axis. Immutable; its memory is a [`State`].
#[derive(Clone, Copy, Debug)]
pub struct Compensator {
    image: Image,
}

/// Memory of one compensator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    accumulator: i64,
    k_q32: i64,
    increment: i64,
    target: i64,
    slope: i64,
    gentle_ticks: u32,
    slewing_ticks: u32,
    ticks_to_update: u32,
    inputs: [InputState; MAX_INPUTS],
    slow_status: Status,
    corrected_once: bool,
    overflow: bool,
    warm: bool,
    /// Slow updates so far, and images applied: a slow update in slices belongs to one of them.
    updates: u32,
}

/// One corrected value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Corrected counts, in quanta.
    pub counts: i32,
    /// What the user of the counts must know about them.
    pub status: Status,
}

/// A call that breaks the contract. Nothing has changed and no count was used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misuse {
    /// A slow update is due before the next tick, or before the `n`-th of an advance.
    UpdateDue {
        /// Ticks that may still run before it.
        ticks_left: u32,
    },
    /// A slow update before its time.
    UpdateNotDue {
        /// Ticks that must run before it.
        ticks_left: u32,
    },
    /// |raw| exceeds [`MAX_RAW`].
    RawOutOfRange,
    /// The number of codes is not the number of inputs of the image.
    InputCount,
    /// A slow update in slices that was begun before another one.
    Outdated,
}

impl fmt::Display for Misuse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UpdateDue { ticks_left } => {
                write!(f, "a slow update is due in {ticks_left} ticks")
            }
            Self::UpdateNotDue { ticks_left } => {
                write!(f, "the next slow update is {ticks_left} ticks away")
            }
            Self::RawOutOfRange => write!(f, "more than {MAX_RAW} counts in one call"),
            Self::Outdated => f.write_str("the slow update was begun before another one"),
            Self::InputCount => f.write_str("the number of codes is not the number of inputs of the image"),
        }
    }
}

impl core::error::Error for Misuse {}

impl Default for State {
    fn default() -> Self {
        Self::new()
    }
}

impl State {
    /// Memory at power-on: nothing corrected yet, a slow update due before the first tick.
    pub const fn new() -> Self {
        Self {
            accumulator: 0,
            k_q32: ONE_Q32,
            increment: 0,
            target: 0,
            slope: 0,
            gentle_ticks: 0,
            slewing_ticks: 0,
            ticks_to_update: 0,
            inputs: [InputState::new(); MAX_INPUTS],
            slow_status: Status::UNCORRECTED,
            corrected_once: false,
            overflow: false,
            warm: false,
            updates: 0,
        }
    }

    /// Memory after a reset that did not cut the power: as at power-on, but a warm-up is over.
    ///
    /// A term over [`ValueSource::WarmUp`] then corrects nothing, and the status is SETTLING for as long as its input says.
    pub const fn warm() -> Self {
        let mut state = Self::new();
        state.warm = true;
        state
    }

    pub(crate) const fn inputs(&self) -> &[InputState; MAX_INPUTS] {
        &self.inputs
    }

    /// Ticks that may run before the next slow update; 0: it is due now.
    pub const fn ticks_to_update(&self) -> u32 {
        self.ticks_to_update
    }

    /// The part of a count that has not been output yet, counts·2⁻³² (including what an output limit held back).
    pub const fn remainder(&self) -> i64 {
        self.accumulator
    }

    /// Scale correction k now, Q32.
    pub const fn k_q32(&self) -> i64 {
        self.k_q32
    }

    /// Increment used in the last tick, counts·2⁻³² per tick.
    pub const fn increment(&self) -> i64 {
        self.increment
    }

    /// Increment at the end of the slew; equal to [`State::increment`] once the slew has ended.
    pub const fn target_increment(&self) -> i64 {
        self.target
    }

    /// The status that a tick would have now, without its own LIMITED.
    #[inline]
    pub fn status(&self) -> Status {
        if self.overflow { self.slow_status | Status::OVERFLOW } else { self.slow_status }
    }

    /// Clears [`Status::OVERFLOW`]: counts are output again, from a remainder of zero. What was held back is lost, so call it only where
    /// the user of the counts starts again as well.
    ///
    /// **SAG-CORE-015** More than 2^29 counts held back set OVERFLOW, which only a call clears; the counts are zero meanwhile.
    pub const fn clear_overflow(&mut self) {
        if self.overflow {
            self.overflow = false;
            self.accumulator = 0;
        }
    }

    /// The state without what counts the updates.
    fn without_counters(&self) -> Self {
        let mut state = *self;
        for input in &mut state.inputs {
            (input.held_updates, input.settled_updates) = (0, 0);
        }
        (state.updates, state.slow_status) = (0, Status::OK);
        state
    }

    /// As many updates that changed nothing else.
    fn count(&mut self, updates: u64) {
        let more = u32::try_from(updates).unwrap_or(u32::MAX);
        for input in &mut self.inputs {
            // A held input counts how long it is held, any other has it at 0.
            if input.held_updates > 0 {
                input.held_updates = input.held_updates.saturating_add(more);
            }
            if input.settled_updates > 0 {
                input.settled_updates = input.settled_updates.saturating_add(more);
            }
        }
        self.updates = self.updates.wrapping_add(updates as u32);
    }

    /// Advances the slew by `n` ticks (n ≤ ticks to the next update); returns the sum of its increments.
    ///
    /// With m slewing ticks of which e are the steeper ones,
    /// Σ = m·i₀ + q·m(m+1)/2 + e(e+1)/2 + (m−e)·e, then (n−m) times the target.
    /// Bounds: every increment ≤ 2⁶¹/period, so each product is ≤ 2⁶¹ and the sum ≤ 2⁶².
    #[inline]
    fn slew(&mut self, n: u32) -> i64 {
        if self.slewing_ticks == 0 {
            // The usual case: the formula below with m = e = 0.
            return i64::from(n) * self.increment;
        }
        if n == 1 {
            // A tick in the slew: the formula with m = 1.
            self.increment += self.slope + i64::from(self.slewing_ticks > self.gentle_ticks);
            self.slewing_ticks -= 1;
            return self.increment;
        }
        let slewing = n.min(self.slewing_ticks);
        let steeper = slewing.min(self.slewing_ticks.saturating_sub(self.gentle_ticks));
        let (m, e) = (i64::from(slewing), i64::from(steeper));
        let sum = m * self.increment + self.slope * (m * (m + 1) / 2) + e * (e + 1) / 2 + (m - e) * e;
        self.increment += m * self.slope + e;
        self.slewing_ticks -= slewing;
        sum + i64::from(n - slewing) * self.increment
    }

    /// Starts the slew to a new increment.
    ///
    /// **SAG-CORE-012** A new increment is approached in a stated number of ticks by an arithmetic progression that ends on it
    /// exactly.
    fn slew_to(&mut self, target: i64, ticks: u32) {
        let delta = target - self.increment;
        self.target = target;
        match (delta.checked_div_euclid(i64::from(ticks)), delta.checked_rem_euclid(i64::from(ticks))) {
            (Some(slope), Some(steeper)) => {
                self.slope = slope;
                // The steeper ticks come first, so a count of the gentle ones separates the two.
                self.gentle_ticks = ticks - u32::try_from(steeper).unwrap_or(0).min(ticks);
                self.slewing_ticks = ticks;
            }
            // No slew wanted (ticks = 0).
            _ => self.increment = target,
        }
    }
}

impl Compensator {
    /// A compensator for this image.
    pub const fn new(image: Image) -> Self {
        Self { image }
    }

    /// The image it runs.
    pub const fn image(&self) -> &Image {
        &self.image
    }

    /// Memory after a reset that did not cut the power, `updates` slow updates after power-on: as at power-on, but a warm-up goes on.
    ///
    /// A lag has settled to the bit after about 36 τ; a call makes no more than 2²⁰ updates of each warm-up.
    pub fn state_after(&self, updates: u64) -> State {
        let mut state = State::new();
        let updates = updates.min(MOST_UPDATES_MADE_UP);
        for (memory, spec) in state.inputs.iter_mut().zip(self.image.inputs()) {
            if spec.source == ValueSource::WarmUp {
                memory.begin_warm_up();
                for _ in 0..updates {
                    let _ = memory.update(spec, Some(0), false);
                }
            }
        }
        state
    }

    /// The memory for this compensator, made from that of another one for the same gyro: changes the image between two ticks.
    ///
    /// The remainder of a count is kept. The active correction stays until the next slow update, which is due at once, and slews away
    /// from it. Inputs start again: SETTLING, and UNCORRECTED until all of them have a valid value. A warm-up is over, as in
    /// [`State::warm`].
    ///
    /// **SAG-CORE-020** A new image takes over remainder and increment; its inputs settle again, and an update is due.
    pub fn migrate_state(&self, old: &State) -> State {
        let bound = self.image.description().increment_bound();
        let increment = old.increment.max(-bound).min(bound);
        State {
            accumulator: old.accumulator,
            overflow: old.overflow,
            k_q32: old.k_q32,
            increment,
            target: increment,
            updates: old.updates.wrapping_add(1),
            ..State::warm()
        }
    }

    /// One tick: `raw` counts in, corrected counts out.
    ///
    /// # Errors
    /// [`Misuse`] when a slow update is due or |raw| > [`MAX_RAW`]; then nothing has changed.
    #[inline]
    pub fn tick(&self, state: &mut State, raw: i32) -> Result<Output, Misuse> {
        self.advance(state, raw, 1)
    }

    /// `ticks` ticks at once. The counts and the state afterwards are those of that many single ticks, for any distribution of `raw`
    /// over them, while no output limit is reached.
    ///
    /// # Errors
    /// [`Misuse`] when a slow update is due before the last tick or |raw| > [`MAX_RAW`]; then
    /// nothing has changed.
    ///
    /// **SAG-CORE-017** Counts of a tick beyond 2^29 are refused and change nothing.
    #[inline]
    pub fn advance(&self, state: &mut State, raw: i32, ticks: u32) -> Result<Output, Misuse> {
        // |raw| > MAX_RAW in one comparison.
        if raw.wrapping_add(MAX_RAW).cast_unsigned() > 2 * MAX_RAW.cast_unsigned() {
            return Err(Misuse::RawOutOfRange);
        }
        self.run_clock(state, ticks).map(|increments| self.emit(state, raw, increments))
    }

    /// Skips `ticks` ticks that have no counts (a gap in a log): clock and slew advance, the accumulator does not change.
    ///
    /// # Errors
    /// [`Misuse::UpdateDue`] when a slow update is due before the last tick.
    pub fn skip(&self, state: &mut State, ticks: u32) -> Result<(), Misuse> {
        self.run_clock(state, ticks).map(|_| ())
    }

    /// A slow update: one code per input of the image, `None` where there is no sample. A difference uses the values of its two inputs
    /// at this update, a repeat that of its one, a warm-up none; their own codes are ignored.
    ///
    /// # Errors
    /// [`Misuse`] when it is not due, or the number of codes is wrong; then nothing has changed.
    pub fn update(&self, state: &mut State, codes: &[Option<i32>]) -> Result<Status, Misuse> {
        if state.ticks_to_update != 0 {
            return Err(Misuse::UpdateNotDue { ticks_left: state.ticks_to_update });
        }
        if codes.len() != self.image.inputs().len() {
            return Err(Misuse::InputCount);
        }
        let reading = read(&self.image, &mut state.inputs, codes, state.warm);
        let sums = if reading.held { Sums::default() } else { evaluate(&self.image, &reading.inputs) };
        Ok(self.conclude(state, &reading, sums))
    }

    /// The largest number of slices of a slow update: one for each input and one for each term.
    pub fn slices(&self) -> usize {
        self.image.inputs().len() + self.image.terms().len()
    }

    /// Begins a slow update before it is due, with the codes of now. [`Self::advance_update`] makes it slice by slice, a few in each tick;
    /// [`Self::apply_update`] puts it in force when it is due. The result has the bits of [`Self::update`] with the same codes.
    ///
    /// A slice is one input with its lag and series, or one term: at most 605 instructions of the reference, held to 700 by `cargo xtask
    /// firmware` ([`crate::Work`] has the whole).
    ///
    /// # Errors
    /// [`Misuse::InputCount`] for a wrong number of codes.
    ///
    /// **SAG-CORE-010** While any input has no valid value the whole correction is held, with HELD, and after the hold time
    /// with STALE.
    pub fn begin_update(&self, state: &State, codes: &[Option<i32>]) -> Result<SlowUpdate, Misuse> {
        if codes.len() != self.image.inputs().len() {
            return Err(Misuse::InputCount);
        }
        Ok(SlowUpdate::new(codes, state.inputs, state.warm, state.updates))
    }

    /// Makes one slice of a slow update; true when none is missing any more.
    ///
    /// **SAG-CORE-026** A slow update in slices has the bits of a whole one.
    #[inline]
    pub fn advance_update(&self, update: &mut SlowUpdate) -> bool {
        update.advance(&self.image)
    }

    /// Puts a slow update in force that is due now, instead of [`Self::update`]. Makes the slices that are still missing.
    ///
    /// # Errors
    /// [`Misuse::UpdateNotDue`]; [`Misuse::Outdated`] if the state had another slow update, or is another one, since this was begun. Then
    /// nothing has changed.
    pub fn apply_update(&self, state: &mut State, update: &mut SlowUpdate) -> Result<Status, Misuse> {
        if state.ticks_to_update != 0 {
            return Err(Misuse::UpdateNotDue { ticks_left: state.ticks_to_update });
        }
        if update.before != state.updates {
            return Err(Misuse::Outdated);
        }
        while !update.advance(&self.image) {}
        state.inputs = update.memory;
        Ok(self.conclude(state, &update.reading, update.sums))
    }

    /// Whole temperature periods without counts, each begun by a slow update with the same codes: a gap in a log. The state afterwards is that
    /// of as many updates and skips; once the lags have settled to the bit, which takes about 36 τ, the rest is a closed form.
    ///
    /// # Errors
    /// [`Misuse`] when no update is due, or the number of codes is wrong; then nothing has changed.
    pub fn rest(&self, state: &mut State, codes: &[Option<i32>], periods: u64) -> Result<(), Misuse> {
        let period_ticks = self.image.description().period_ticks;
        let mut left = periods;
        while left > 0 {
            let before = state.without_counters();
            self.update(state, codes)?;
            self.skip(state, period_ticks)?;
            left -= 1;
            if left > 1 && state.without_counters() == before {
                // The last one is made: its status knows the counters.
                state.count(left - 1);
                left = 1;
            }
        }
        Ok(())
    }

    /// **SAG-CORE-016** A tick when a slow update is due is refused and changes nothing.
    #[inline]
    fn run_clock(&self, state: &mut State, ticks: u32) -> Result<i64, Misuse> {
        if ticks > state.ticks_to_update {
            return Err(Misuse::UpdateDue { ticks_left: state.ticks_to_update });
        }
        state.ticks_to_update -= ticks;
        Ok(state.slew(ticks))
    }

    /// acc ≤ 2⁶¹ before, raw·k ≤ 2²⁹·(2³² + 2²⁶), Σ increments ≤ 2⁶¹: the sum stays below 2⁶³.
    ///
    /// **SAG-CORE-013** The corrected counts are the whole counts of the sum of raw times k minus increment; the rest is
    /// carried, so that no count is lost or made.
    ///
    /// **SAG-CORE-014** The counts of a tick are held to the output limit, with LIMITED; what is held back comes out later.
    #[inline]
    fn emit(&self, state: &mut State, raw: i32, increments: i64) -> Output {
        if state.overflow {
            return Output { counts: 0, status: state.status() };
        }
        let sum = state.accumulator + (i64::from(raw) * state.k_q32 - increments);
        // The image holds the limit within 1 … 2^31 − 1; the whole part of an i64 in Q32 is an i32.
        let limit = self.image.description().output_limit.cast_signed();
        let whole = (sum >> 32) as i32;
        if whole <= limit && whole >= -limit {
            // All whole counts are output; only the fraction stays.
            state.accumulator = sum & (ONE_Q32 - 1);
            return Output { counts: whole, status: state.status() };
        }
        let counts = if whole > limit { limit } else { -limit };
        state.accumulator = sum - (i64::from(counts) << 32);
        state.overflow = state.accumulator.unsigned_abs() > ACCUMULATOR_BOUND.unsigned_abs();
        Output { counts, status: state.status() | Status::LIMITED }
    }

    /// The end of a slow update: correction and status of the ticks from here on.
    fn conclude(&self, state: &mut State, reading: &Reading, sums: Sums) -> Status {
        state.ticks_to_update = self.image.description().period_ticks;
        state.updates = state.updates.wrapping_add(1);
        let mut status = reading.status;
        if reading.held {
            // A held correction keeps the span bits of the values it was computed from.
            for (bit, _) in Status::NAMES.iter().take(2) {
                if state.slow_status.contains(*bit) {
                    status |= *bit;
                }
            }
        } else {
            state.k_q32 = ONE_Q32 + round_shift(sums.scale, GUARD_BITS);
            state.slew_to(round_shift(sums.bias, GUARD_BITS), self.image.description().slew_ticks);
            state.corrected_once = true;
        }
        if !state.corrected_once {
            status |= Status::UNCORRECTED;
        }
        state.slow_status = status;
        state.status()
    }
}
