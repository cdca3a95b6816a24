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

use core::fmt;

use crate::harmonic::{cosine, sine};
use crate::image::{GUARD_BITS, Image, Kind, MAX_INPUTS, Multiplier, Shape, Term};
use crate::input::{InputSpec, InputState, ScaledInput, ValueSource};
use crate::rounding::round_shift;
use crate::series::{BASIS_LEN, ONE_Q31, chebyshev, step, zone};
use crate::status::Status;

/// Largest |raw| of one call: 2²⁹ counts.
pub const MAX_RAW: i32 = 1 << 29;
/// An accumulator beyond this after a call has lost its meaning: 2⁶¹ (2²⁹ counts that have not been output).
const ACCUMULATOR_BOUND: i64 = 1 << 61;
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

/// A slow update in the making: [`Compensator::begin_update`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlowUpdate {
    memory: [InputState; MAX_INPUTS],
    codes: [Option<i32>; MAX_INPUTS],
    warm: bool,
    before: u32,
    reading: Reading,
    basis: [[i64; BASIS_LEN]; MAX_INPUTS],
    sums: Sums,
    slices: u8,
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
    /// the user of the counts starts anew as well.
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

    /// The memory for this compensator, made from that of another one for the same gyro: changes the image between two ticks.
    ///
    /// The remainder of a count is kept. The active correction stays until the next slow update, which is due at once, and slews away
    /// from it. Inputs start again: SETTLING, and UNCORRECTED until all of them have a valid value. A warm-up is over, as in
    /// [`State::warm`].
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
        let reading = self.read(state, codes);
        let sums = if reading.held { Sums::default() } else { self.evaluate(&reading.inputs) };
        Ok(self.conclude(state, &reading, sums))
    }

    /// The largest number of slices of a slow update: one for each input and one for each term.
    pub fn slices(&self) -> usize {
        self.image.inputs().len() + self.image.terms().len()
    }

    /// Begins a slow update before it is due, with the codes of now. [`Compensator::advance_update`] makes it slice by slice, a few in each
    /// tick; [`Compensator::apply_update`] puts it in force when it is due. The result has the bits of [`Compensator::update`] with the same
    /// codes.
    ///
    /// A slice is one input with its lag and series, or one term: at most 605 instructions of the reference, held to 700 by `cargo xtask
    /// firmware` ([`crate::Work`] has the whole).
    ///
    /// # Errors
    /// [`Misuse::InputCount`] for a wrong number of codes.
    pub fn begin_update(&self, state: &State, codes: &[Option<i32>]) -> Result<SlowUpdate, Misuse> {
        if codes.len() != self.image.inputs().len() {
            return Err(Misuse::InputCount);
        }
        let mut own = [None; MAX_INPUTS];
        own.iter_mut().zip(codes).for_each(|(slot, code)| *slot = *code);
        Ok(SlowUpdate {
            memory: state.inputs,
            codes: own,
            warm: state.warm,
            before: state.updates,
            reading: Reading::new(),
            basis: [[0; BASIS_LEN]; MAX_INPUTS],
            sums: Sums::default(),
            slices: 0,
        })
    }

    /// Makes one slice of a slow update; true when none is missing any more.
    #[inline]
    pub fn advance_update(&self, update: &mut SlowUpdate) -> bool {
        let (inputs, at) = (self.image.inputs(), usize::from(update.slices));
        if let Some(spec) = inputs.get(at) {
            let code = update.codes.get(at).copied().flatten();
            if let (Some(memory), Some(row)) = (update.memory.get_mut(at), update.basis.get_mut(at)) {
                update.reading.add(at, spec, memory, code, update.warm);
                *row = chebyshev(update.reading.inputs.get(at).map_or(0, |input| input.x_q47));
            }
        } else if let Some(term) = self.image.terms().get(at - inputs.len()).filter(|_| !update.reading.held) {
            update.sums.add(term, &update.reading.inputs, &update.basis);
        } else {
            return true;
        }
        update.slices += 1;
        false
    }

    /// Puts a slow update in force that is due now, in place of [`Compensator::update`]. Makes the slices that are still missing.
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
        while !self.advance_update(update) {}
        state.inputs = update.memory;
        Ok(self.conclude(state, &update.reading, update.sums))
    }

    /// Whole temperature periods without counts, each begun by a slow update with the same codes: a gap in a log. The state afterwards is that
    /// of as many updates and skips; once the lags have settled to the bit, which takes some 36 τ, the rest is a closed form.
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

    #[inline]
    fn run_clock(&self, state: &mut State, ticks: u32) -> Result<i64, Misuse> {
        if ticks > state.ticks_to_update {
            return Err(Misuse::UpdateDue { ticks_left: state.ticks_to_update });
        }
        state.ticks_to_update -= ticks;
        Ok(state.slew(ticks))
    }

    /// acc ≤ 2⁶¹ before, raw·k ≤ 2²⁹·(2³² + 2²⁶), Σ increments ≤ 2⁶¹: the sum stays below 2⁶³.
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

    /// Runs every input.
    fn read(&self, state: &mut State, codes: &[Option<i32>]) -> Reading {
        let mut reading = Reading::new();
        let warm = state.warm;
        for (at, ((memory, spec), code)) in state.inputs.iter_mut().zip(self.image.inputs()).zip(codes).enumerate() {
            reading.add(at, spec, memory, *code, warm);
        }
        reading
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

    /// The sums of all terms.
    fn evaluate(&self, inputs: &[ScaledInput; MAX_INPUTS]) -> Sums {
        let mut basis = [[0_i64; BASIS_LEN]; MAX_INPUTS];
        for (row, input) in basis.iter_mut().zip(inputs).take(self.image.inputs().len()) {
            *row = chebyshev(input.x_q47);
        }
        let mut sums = Sums::default();
        for term in self.image.terms() {
            sums.add(term, inputs, &basis);
        }
        sums
    }
}

/// What a slow update has read so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reading {
    pub(crate) inputs: [ScaledInput; MAX_INPUTS],
    /// Values of this update, for the differences and repeats that come later in the table.
    fresh_q24: [Option<i64>; MAX_INPUTS],
    status: Status,
    /// A value is missing: the last correction stays.
    pub(crate) held: bool,
}

impl Reading {
    pub(crate) const fn new() -> Self {
        let nothing = ScaledInput { x_q47: 0, y_q31: 0, x_clamped: false, y_clamped: false };
        Self { inputs: [nothing; MAX_INPUTS], fresh_q24: [None; MAX_INPUTS], status: Status::OK, held: false }
    }

    /// Runs one input.
    #[inline]
    pub(crate) fn add(&mut self, at: usize, spec: &InputSpec, memory: &mut InputState, code: Option<i32>, warm: bool) {
        let fresh = self.value(spec, code);
        if spec.source == ValueSource::WarmUp && !warm {
            memory.begin_warm_up();
        }
        match memory.update(spec, fresh) {
            Some(scaled) => {
                if scaled.x_clamped || scaled.y_clamped {
                    self.status |= Status::OUT_OF_SPAN;
                }
                if scaled.y_clamped {
                    self.status |= Status::RATE_OUT_OF_SPAN;
                }
                if let (Some(slot), Some(place)) = (self.inputs.get_mut(at), self.fresh_q24.get_mut(at)) {
                    *slot = scaled;
                    *place = fresh.map(i64::from);
                }
            }
            None => {
                self.held = true;
                self.status |= Status::HELD;
                if memory.held_updates > spec.stale_after_updates {
                    self.status |= Status::STALE;
                }
            }
        }
        if spec.settling_updates > 0 && memory.settled_updates <= spec.settling_updates {
            self.status |= Status::SETTLING;
        }
    }

    fn value(&self, spec: &InputSpec, code: Option<i32>) -> Option<i32> {
        let of_update = |i: u8| self.fresh_q24.get(usize::from(i)).copied().flatten();
        match spec.source {
            ValueSource::Code => code.and_then(|code| spec.value_q24(code)),
            ValueSource::Difference { of, less } => {
                of_update(of).zip(of_update(less)).and_then(|(a, b)| spec.if_valid(a - b))
            }
            ValueSource::Repeat { of } => of_update(of).and_then(|value| spec.if_valid(value)),
            ValueSource::WarmUp => spec.if_valid(0),
        }
    }
}

/// Sums of the terms, Q40; `Image::new` bounds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sums {
    bias: i64,
    scale: i64,
}

impl Sums {
    /// Adds one term.
    #[inline]
    pub(crate) fn add(
        &mut self,
        term: &Term,
        inputs: &[ScaledInput; MAX_INPUTS],
        basis: &[[i64; BASIS_LEN]; MAX_INPUTS],
    ) {
        let index = usize::from(term.input);
        let input = inputs.get(index).copied().unwrap_or_default();
        let shape = match term.shape {
            Shape::Chebyshev(order) => {
                basis.get(index).and_then(|row| row.get(usize::from(order))).copied().unwrap_or(0)
            }
            Shape::Zone { knot_q15 } => zone(input.x_q47, knot_q15),
            Shape::Step { knot_q15 } => step(input.x_q47, knot_q15),
            Shape::Cosine { turns_q18 } => cosine(input.x_q47, turns_q18),
            Shape::Sine { turns_q18 } => sine(input.x_q47, turns_q18),
        };
        let value = term_value(term, shape, input.y_q31);
        match term.kind {
            Kind::Bias => self.bias += value,
            Kind::Scale => self.scale += value,
        }
    }
}

/// |mantissa|·|basis| ≤ 2³¹·(2³¹ + 36) < 2⁶²·¹.
#[inline]
fn term_value(term: &Term, shape: i64, y: i64) -> i64 {
    let basis = match term.multiplier {
        Multiplier::One => shape,
        Multiplier::Rate => round_shift(shape * y, ONE_Q31.trailing_zeros()),
    };
    round_shift(i64::from(term.mantissa) * basis, u32::from(term.shift))
}
