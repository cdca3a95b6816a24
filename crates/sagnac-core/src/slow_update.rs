//! The slow update: every input read, every term summed, at once or slice by slice.
//!
//! ```text
//! codes ─▶ input ─▶ input ─▶ … ─▶ term ─▶ term ─▶ …  ─▶ Reading, Sums
//!          └────────────── a slice each ──────────┘
//! ```
//!
//! The compensator makes them with [`read`] and [`evaluate`] when the update is due, or with a [`SlowUpdate`] some ticks before. Both ways run
//! [`Reading::add`] and [`Sums::add`] in the same order, so the bits are the same.

use crate::harmonic::{cosine, sine};
use crate::image::{Image, Kind, MAX_INPUTS, Multiplier, Shape, Term};
use crate::input::{InputSpec, InputState, ScaledInput, ValueSource};
use crate::rounding::round_shift;
use crate::series::{BASIS_LEN, ONE_Q31, chebyshev, step, zone};
use crate::status::Status;

/// A slow update in the making: [`crate::Compensator::begin_update`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlowUpdate {
    codes: [Option<i32>; MAX_INPUTS],
    warm: bool,
    /// Slow updates of the state before this one.
    pub(crate) before: u32,
    pub(crate) memory: [InputState; MAX_INPUTS],
    basis: [[i64; BASIS_LEN]; MAX_INPUTS],
    pub(crate) reading: Reading,
    pub(crate) sums: Sums,
    slices: u8,
}

impl SlowUpdate {
    /// No slice made yet; `codes` beyond [`MAX_INPUTS`] are ignored.
    pub(crate) fn new(codes: &[Option<i32>], memory: [InputState; MAX_INPUTS], warm: bool, before: u32) -> Self {
        let mut own = [None; MAX_INPUTS];
        own.iter_mut().zip(codes).for_each(|(slot, code)| *slot = *code);
        Self {
            codes: own,
            warm,
            before,
            memory,
            basis: [[0; BASIS_LEN]; MAX_INPUTS],
            reading: Reading::new(),
            sums: Sums::default(),
            slices: 0,
        }
    }

    /// Makes one slice; true when none is missing any more.
    #[inline]
    pub(crate) fn advance(&mut self, image: &Image) -> bool {
        let (inputs, at) = (image.inputs(), usize::from(self.slices));
        if let Some(spec) = inputs.get(at) {
            let code = self.codes.get(at).copied().flatten();
            if let (Some(memory), Some(row)) = (self.memory.get_mut(at), self.basis.get_mut(at)) {
                self.reading.add(at, spec, memory, code, self.warm);
                *row = chebyshev(self.reading.inputs.get(at).map_or(0, |input| input.x_q47));
            }
        } else if let Some(term) = image.terms().get(at - inputs.len()).filter(|_| !self.reading.held) {
            self.sums.add(term, &self.reading.inputs, &self.basis);
        } else {
            return true;
        }
        self.slices += 1;
        false
    }
}

/// Runs every input.
pub(crate) fn read(image: &Image, memory: &mut [InputState; MAX_INPUTS], codes: &[Option<i32>], warm: bool) -> Reading {
    let mut reading = Reading::new();
    for (at, ((memory, spec), code)) in memory.iter_mut().zip(image.inputs()).zip(codes).enumerate() {
        reading.add(at, spec, memory, *code, warm);
    }
    reading
}

/// The sums of all terms.
///
/// **SAG-CORE-011** Increment and scale are the sums of their terms; a term with a rate is multiplied by its input's rate.
pub(crate) fn evaluate(image: &Image, inputs: &[ScaledInput; MAX_INPUTS]) -> Sums {
    let mut basis = [[0_i64; BASIS_LEN]; MAX_INPUTS];
    for (row, input) in basis.iter_mut().zip(inputs).take(image.inputs().len()) {
        *row = chebyshev(input.x_q47);
    }
    let mut sums = Sums::default();
    for term in image.terms() {
        sums.add(term, inputs, &basis);
    }
    sums
}

/// What a slow update has read so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reading {
    pub(crate) inputs: [ScaledInput; MAX_INPUTS],
    /// Values of this update, for the differences and repeats that come later in the table.
    fresh_q24: [Option<i64>; MAX_INPUTS],
    /// Which of them took a step.
    stepped: [bool; MAX_INPUTS],
    pub(crate) status: Status,
    /// A value is missing: the last correction stays.
    pub(crate) held: bool,
}

impl Reading {
    pub(crate) const fn new() -> Self {
        let nothing = ScaledInput { x_q47: 0, y_q31: 0, x_clamped: false, y_clamped: false };
        Self {
            inputs: [nothing; MAX_INPUTS],
            fresh_q24: [None; MAX_INPUTS],
            stepped: [false; MAX_INPUTS],
            status: Status::OK,
            held: false,
        }
    }

    /// Runs one input.
    #[inline]
    pub(crate) fn add(&mut self, at: usize, spec: &InputSpec, memory: &mut InputState, code: Option<i32>, warm: bool) {
        let fresh = self.value(spec, code);
        if spec.source == ValueSource::WarmUp && !warm {
            memory.begin_warm_up();
        }
        match memory.update(spec, fresh, self.source_stepped(spec)) {
            Some((scaled, stepped)) => {
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
                if let Some(place) = self.stepped.get_mut(at) {
                    *place = stepped;
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
        let settles = spec.settling_updates > 0 && memory.settled_updates <= spec.settling_updates;
        if settles || memory.is_open(spec) {
            self.status |= Status::SETTLING;
        }
    }

    /// An input that this one is derived from took a step.
    fn source_stepped(&self, spec: &InputSpec) -> bool {
        let stepped = |i: u8| self.stepped.get(usize::from(i)).copied().unwrap_or(false);
        match spec.source {
            ValueSource::Difference { of, less } => stepped(of) || stepped(less),
            ValueSource::Repeat { of } => stepped(of),
            ValueSource::Code | ValueSource::WarmUp => false,
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
    pub(crate) bias: i64,
    pub(crate) scale: i64,
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
