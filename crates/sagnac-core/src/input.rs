//! From an input's code to its value, its scaled position in the fit span, and its causal rate.
//!
//! An input is any number that the correction depends on: a temperature, the difference of two inputs
//! ([`ValueSource::Difference`]), a voltage, a current, another input once more for a second lag ([`ValueSource::Repeat`]), or the
//! time since power-on ([`ValueSource::WarmUp`]). Values are `i32` in units of 2⁻²⁴ °C (±128 °C, 6e-8 °C). For an input that is not a
//! temperature, read "°C" as `2^unit_exponent` of its own unit.
//!
//! The rate comes from a one-pole lag filter. It runs once per temperature period Δt with a zero-order hold:
//!
//! ```text
//! T_lag[n] = T_lag[n−1] + α·(T[n] − T_lag[n−1])      α = 1 − e^(−Δt/τ),  T_lag[0] = T[0]
//! Ṫ[n]     = T_lag[n] − T_lag[n−1]  per Δt
//! ```
//!
//! The filter stores `T_lag` in 2⁻⁴⁶ °C and the remainder of the last product. So it has no dead band, and its steps add up to the
//! change of the value. `Ṫ` comes from the product itself, which is finer than the stored state.
//!
//! A warm-up is the same filter with a constant value of 0 °C and `T_lag` = −1 °C at power-on: `Ṫ[n] = α·(1 − α)ⁿ`, which is
//! `α·e^(−t/τ)`. An image that is applied while the gyro runs does not know how long it has been warm; its warm-up is over at once,
//! and the status is SETTLING for as long as the image says.
//!
//! A sensor that fails can send any code. The valid range (`valid_lo_q24` to `valid_hi_q24`) rejects what cannot be a value. A value
//! farther than its reach from the last one is held back until [`STEADY_UPDATES`] of them in a row lie within the largest step of each
//! other. The reach is the largest step, and the growth of the step for each update without a value:
//!
//! ```text
//! reach = largest_step_q8·2¹⁶ + min(updates, 2¹⁶ − 1)·largest_step_q8·2^growth      2⁻²⁴ °C; without growth the first part alone
//! ```
//!
//! Updates count in which nothing was read, up to the first at which a value was held back.
//!
//! While a value is missing the filter runs on the last one. When it returns after a hold of more than an eighth of τ, or with a step
//! that was held back, the filter begins again at it, and so do those of the differences and repeats that read it: the change meanwhile
//! is no rate. The status is SETTLING again until the settling time has passed. After a shorter hold the rate is wrong by less than 1 % of
//! itself (½(hold/τ)²).
//!
//! After a step that no temperature makes, one of both readings is wrong, and nothing shows which. With growth such a step stays open,
//! and the status SETTLING, until the input jumps back by as much: until the steps since add up to no more than two largest ones. The first
//! samples after power-on are often wrong: the status is SETTLING for [`START_VALUES`] from the first value on, and a step behind fewer is not
//! held open.

use crate::checksum::Checksum;
use crate::rounding::round_shift;
use crate::series::{ONE_Q31, ONE_Q47};

/// Updates for which a step must stay before it is a value.
pub const STEADY_UPDATES: u8 = 3;
/// Values from the first one on among which a step is not held open.
const START_VALUES: u8 = 6;
/// Updates for which a reach grows.
const MOST_GROWTH: u32 = 0xffff;
/// A filter begins again after a hold of more than τ by two to this power.
const HOLD_SHIFT: u32 = 3;

/// Where the filter of a warm-up begins: −1 °C in 2⁻⁴⁶ °C.
const WARM_UP_START_Q46: i64 = -(1 << 46);

/// Low bits of a difference of values, multiplied separately so that each product fits 64 bits.
const LOW_BITS: u32 = 23;

/// A positive or negative gain `mantissa · 2^−shift`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Gain {
    /// Signed mantissa.
    pub mantissa: i32,
    /// Binary places, 0..=62.
    pub shift: u8,
}

impl Gain {
    /// A gain of one, in the only form that an image may use for a difference.
    pub const ONE: Self = Self { mantissa: 1, shift: 0 };
}

/// Where the value of an input comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ValueSource {
    /// Its own code.
    #[default]
    Code,
    /// Input `of` minus input `less`. Both have codes of their own and come before this one in the table.
    Difference {
        /// Index of the minuend.
        of: u8,
        /// Index of the subtrahend.
        less: u8,
    },
    /// The value of input `of`, which comes before this one and repeats no other. It serves a second lag: validity and hold time
    /// are those of the input that it repeats.
    Repeat {
        /// Index of the input that is repeated.
        of: u8,
    },
    /// The time since power-on: a constant 0 °C behind a lag that begins at −1 °C. It is never missing.
    WarmUp,
}

/// The lag filter of one input and the span of its rate. All zero: the input has no rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LagSpec {
    /// α as `alpha_mantissa · 2^−alpha_shift`; mantissa ≤ 2³¹, shift 31..=62.
    pub alpha_mantissa: u32,
    /// See `alpha_mantissa`.
    pub alpha_shift: u8,
    /// The rate's unit is 2^−(24 + rate_shift) °C per Δt; less than `alpha_shift`.
    pub rate_shift: u8,
    /// Lower border of the rate span in that unit.
    pub rate_lo: i32,
    /// Upper border of the rate span in that unit.
    pub rate_hi: i32,
    /// y = rate · y_mantissa · 2^−y_shift in Q31; y = ±1 at the border farther from zero.
    pub y_mantissa: u32,
    /// See `y_mantissa`; at most 31.
    pub y_shift: u8,
}

/// One input as the image describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct InputSpec {
    /// Where its value comes from.
    pub source: ValueSource,
    /// For an input that is not a temperature: "°C" means 2^unit_exponent of its own unit, within ±100. For display only; 0 for °C.
    pub unit_exponent: i8,
    /// Value at code 0, 2⁻²⁴ °C.
    pub offset_q24: i32,
    /// 2⁻²⁴ °C per code.
    pub gain: Gain,
    /// Lowest valid value, 2⁻²⁴ °C. A value below it counts as a missing sample.
    pub valid_lo_q24: i32,
    /// Highest valid value, 2⁻²⁴ °C.
    pub valid_hi_q24: i32,
    /// Fit span, lower border, 2⁻²⁴ °C; `span_lo + span_hi` is even.
    pub span_lo_q24: i32,
    /// Fit span, upper border, 2⁻²⁴ °C.
    pub span_hi_q24: i32,
    /// x = (T − middle of span) · x_mantissa · 2^−x_shift in Q47.
    pub x_mantissa: u32,
    /// See `x_mantissa`; at most 15.
    pub x_shift: u8,
    /// Lag filter and rate span.
    pub lag: LagSpec,
    /// Consecutive slow updates without a valid value that are tolerated; with one more the status is STALE.
    pub stale_after_updates: u32,
    /// Slow updates after the first valid value, and after each new beginning of the filter, with the status SETTLING.
    pub settling_updates: u32,
    /// Largest step between two updates that is a value at once, 2⁻⁸ °C; 0 for any step.
    pub largest_step_q8: u16,
    /// Each update without a value adds `largest_step_q8 · 2^step_growth` to it, 2⁻²⁴ °C; at most 16. 0: nothing is added, and no step
    /// is held open.
    pub step_growth: u8,
}

impl InputSpec {
    /// An input that no term uses; fills unused places of a description.
    pub const UNUSED: Self = Self {
        source: ValueSource::Code,
        unit_exponent: 0,
        offset_q24: 0,
        gain: Gain::ONE,
        valid_lo_q24: -1,
        valid_hi_q24: 1,
        span_lo_q24: -(1 << 16),
        span_hi_q24: 1 << 16,
        x_mantissa: 1 << 31,
        x_shift: 0,
        lag: LagSpec {
            alpha_mantissa: 0,
            alpha_shift: 0,
            rate_shift: 0,
            rate_lo: 0,
            rate_hi: 0,
            y_mantissa: 0,
            y_shift: 0,
        },
        stale_after_updates: 0,
        settling_updates: 0,
        largest_step_q8: 0,
        step_growth: 0,
    };

    /// How far from an older value a value may lie after some updates without one, 2⁻²⁴ °C.
    pub(crate) fn reach_q24(&self, updates: u32) -> u32 {
        let step = u64::from(self.largest_step_q8);
        let grown = if self.step_growth > 0 { u64::from(updates.min(MOST_GROWTH)) * step } else { 0 };
        let reach = (step << 16) + (grown << u32::from(self.step_growth & 31));
        u32::try_from(reach).unwrap_or(u32::MAX)
    }

    /// The value of a code in 2⁻²⁴ °C, or `None` outside the valid range.
    ///
    /// `T = offset + round(code · gain)`; |code · mantissa| ≤ 2⁶², so nothing overflows.
    ///
    /// **SAG-CORE-002** The value of a code is offset plus code times gain. Beyond the valid range there is no value.
    pub fn value_q24(&self, code: i32) -> Option<i32> {
        let scaled = round_shift(i64::from(code) * i64::from(self.gain.mantissa), u32::from(self.gain.shift));
        self.if_valid(i64::from(self.offset_q24) + scaled)
    }

    /// The value, or `None` outside the valid range.
    pub(crate) fn if_valid(&self, t_q24: i64) -> Option<i32> {
        let t = i32::try_from(t_q24).ok()?;
        (self.valid_lo_q24..=self.valid_hi_q24).contains(&t).then_some(t)
    }

    /// `x` in Q47 of the value clamped to the span, and whether it was clamped.
    ///
    /// **SAG-CORE-006** A value beyond the span is used as the border of the span, and OUT_OF_SPAN reports it.
    pub(crate) fn scaled(&self, t_q24: i32) -> (i64, bool) {
        let clamped = t_q24.max(self.span_lo_q24).min(self.span_hi_q24);
        let middle = (i64::from(self.span_lo_q24) + i64::from(self.span_hi_q24)) >> 1;
        let product = (i64::from(clamped) - middle) * i64::from(self.x_mantissa);
        let x = round_shift(product, u32::from(self.x_shift));
        (x.clamp(-ONE_Q47, ONE_Q47), clamped != t_q24)
    }
}

impl LagSpec {
    /// Longest hold after which the filter goes on, slow updates: an eighth of τ, 1/(8α).
    ///
    /// **SAG-CORE-004** After a hold of more than an eighth of τ, and after a step of its own or of what it is derived from, the lag
    /// restarts at the value, and SETTLING stands until it has settled.
    pub fn longest_hold_updates(&self) -> u32 {
        let eighth = 1_u64.checked_shl(u32::from(self.alpha_shift).saturating_sub(HOLD_SHIFT)).unwrap_or(0);
        let updates = eighth.checked_div(u64::from(self.alpha_mantissa)).unwrap_or(u64::MAX);
        u32::try_from(updates).unwrap_or(u32::MAX)
    }

    /// True when a filter is configured.
    pub const fn is_used(&self) -> bool {
        self.alpha_mantissa != 0
    }
}

/// Memory of one input: its filter, its last valid value, and how long that has been held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct InputState {
    lag_q46: i64,
    remainder: i64,
    last_q24: Option<i32>,
    /// A value too far from the last one, and for how many updates it has stayed.
    step_q24: i32,
    steady_updates: u8,
    pub(crate) held_updates: u32,
    /// Updates of the hold without a sample, before one was held back: its reach.
    unread_updates: u16,
    pub(crate) settled_updates: u32,
    /// Values since the first one, up to [`START_VALUES`] and one.
    values: u8,
    /// The sum of the steps since one is open, modulo 2³²; 0 without.
    open_q24: i32,
}

/// One input at one slow update, scaled for the terms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ScaledInput {
    pub(crate) x_q47: i64,
    pub(crate) y_q31: i64,
    pub(crate) x_clamped: bool,
    pub(crate) y_clamped: bool,
}

impl InputState {
    pub(crate) const fn new() -> Self {
        Self {
            lag_q46: 0,
            remainder: 0,
            last_q24: None,
            step_q24: 0,
            steady_updates: 0,
            held_updates: 0,
            unread_updates: 0,
            settled_updates: 0,
            values: 0,
            open_q24: 0,
        }
    }

    /// Every field of this input in the checksum of its state.
    pub(crate) const fn add_to(&self, sum: Checksum) -> Checksum {
        let (has_last, last) = match self.last_q24 {
            Some(last) => (1, last.cast_unsigned()),
            None => (0, 0),
        };
        sum.long(self.lag_q46)
            .long(self.remainder)
            .word(has_last | (self.steady_updates as u32) << 1 | (self.values as u32) << 9)
            .word(self.unread_updates as u32)
            .word(last)
            .word(self.step_q24.cast_unsigned())
            .word(self.held_updates)
            .word(self.settled_updates)
            .word(self.open_q24.cast_unsigned())
    }

    /// This input with each one of its bits turned over.
    #[cfg(test)]
    pub(crate) fn flipped(&self) -> impl Iterator<Item = Self> + '_ {
        let long = (0..64).flat_map(|bit| {
            [Self { lag_q46: self.lag_q46 ^ 1 << bit, ..*self }, Self { remainder: self.remainder ^ 1 << bit, ..*self }]
        });
        let word = (0..32).flat_map(|bit| {
            [
                Self { step_q24: self.step_q24 ^ 1 << bit, ..*self },
                Self { held_updates: self.held_updates ^ 1 << bit, ..*self },
                Self { settled_updates: self.settled_updates ^ 1 << bit, ..*self },
                Self { open_q24: self.open_q24 ^ 1 << bit, ..*self },
                Self { last_q24: Some(self.last_q24.unwrap_or(0) ^ 1 << bit), ..*self },
            ]
        });
        let present = self.last_q24.map_or(Some(1), |_| None);
        let byte = (0..8).flat_map(|bit| {
            [
                Self { steady_updates: self.steady_updates ^ 1 << bit, ..*self },
                Self { values: self.values ^ 1 << bit, ..*self },
            ]
        });
        let short = (0..16).map(|bit| Self { unread_updates: self.unread_updates ^ 1 << bit, ..*self });
        long.chain(word).chain(byte).chain(short).chain([Self { last_q24: present, ..*self }])
    }

    /// Power-on: the filter of a warm-up begins, once.
    pub(crate) fn begin_warm_up(&mut self) {
        if self.last_q24.is_none() {
            *self = Self { lag_q46: WARM_UP_START_Q46, last_q24: Some(0), settled_updates: u32::MAX, ..Self::new() };
        }
    }

    /// One temperature period. `None` without a valid value at this update; the filter then runs on the last one, as it does
    /// between samples. `source_stepped`: what this input is derived from took a step. Also whether it is one itself.
    pub(crate) fn update(
        &mut self,
        spec: &InputSpec,
        fresh: Option<i32>,
        source_stepped: bool,
    ) -> Option<(ScaledInput, bool)> {
        let (fresh, own_step) = self.held_back(spec, fresh);
        let stepped = own_step || source_stepped;
        let t = match (fresh, self.last_q24) {
            (Some(t), None) => {
                self.lag_q46 = i64::from(t) << 22;
                t
            }
            (Some(t), Some(_)) => {
                let held = self.held_updates > 0 && self.held_updates > spec.lag.longest_hold_updates();
                if spec.lag.is_used() && (stepped || held) {
                    (self.lag_q46, self.remainder, self.settled_updates) = (i64::from(t) << 22, 0, 0);
                }
                t
            }
            (None, Some(t)) => t,
            (None, None) => {
                self.held_updates = self.held_updates.saturating_add(1);
                return None;
            }
        };
        self.last_q24 = Some(t);
        self.settled_updates = self.settled_updates.saturating_add(1);
        let (y_q31, y_clamped) = self.step(&spec.lag, t);
        if fresh.is_none() {
            self.held_updates = self.held_updates.saturating_add(1);
            return None;
        }
        (self.held_updates, self.unread_updates) = (0, 0);
        self.values = (self.values + 1).min(START_VALUES + 1);
        let (x_q47, x_clamped) = spec.scaled(t);
        Some((ScaledInput { x_q47, y_q31, x_clamped, y_clamped }, stepped))
    }

    /// A value that is too far from the last one counts as missing until it has stayed. Also whether this one has.
    ///
    /// **SAG-CORE-003** A value beyond reach of the last one is used only when three in a row lie within the largest step of each other.
    fn held_back(&mut self, spec: &InputSpec, fresh: Option<i32>) -> (Option<i32>, bool) {
        let (Some(t), Some(last)) = (fresh, self.last_q24) else {
            // A reach does not grow over a sample that was held back: what comes behind it may be as wrong.
            let grows = fresh.is_none() && self.steady_updates == 0;
            self.unread_updates = self.unread_updates.saturating_add(grows.into());
            return (fresh, false);
        };
        let largest = u32::from(spec.largest_step_q8) << 16;
        if largest == 0 || t.abs_diff(last) <= spec.reach_q24(self.unread_updates.into()) {
            self.steady_updates = 0;
            return (fresh, false);
        }
        let stays = self.steady_updates > 0 && t.abs_diff(self.step_q24) <= largest;
        self.steady_updates = if stays { self.steady_updates + 1 } else { 1 };
        self.step_q24 = t;
        if self.steady_updates < STEADY_UPDATES {
            return (None, false);
        }
        self.steady_updates = 0;
        if spec.step_growth > 0 {
            self.leave_open(spec, t, last);
        }
        (fresh, true)
    }

    /// A value was too far from the last one, and has not stayed for long enough: either may be wrong.
    pub(crate) const fn weighs_a_jump(&self) -> bool {
        self.steady_updates > 0
    }

    /// Nothing shows yet that the first value was right, or a step is open.
    pub(crate) const fn is_open(&self, spec: &InputSpec) -> bool {
        spec.step_growth > 0 && (self.values <= START_VALUES || self.open_q24 != 0)
    }

    /// **SAG-CORE-028** After a step SETTLING stands until the input steps back by as much.
    fn leave_open(&mut self, spec: &InputSpec, t: i32, last: i32) {
        if self.open_q24 == 0 && self.values < START_VALUES {
            return;
        }
        // Both ends of a fault lie within a largest step of the true value.
        let sum = self.open_q24.wrapping_add(t.wrapping_sub(last));
        let is_back = self.open_q24 != 0 && u64::from(sum.unsigned_abs()) <= u64::from(spec.largest_step_q8) << 17;
        self.open_q24 = if is_back { 0 } else { sum };
    }

    /// Advances the lag by one Δt; returns the scaled, clamped rate and whether it was clamped.
    ///
    /// |T − T_lag| ≤ 2⁵⁴ in 2⁻⁴⁶ °C. Its upper 32 bits times the mantissa of α are ≤ 2⁶², and the lower 23 bits add less than 2³¹.
    /// The product is in 2^−(23 + alpha_shift) °C; its remainder is below 2³⁹.
    ///
    /// **SAG-CORE-005** The lag carries the remainder of its division, so that its rounding does not add up.
    fn step(&mut self, lag: &LagSpec, t_q24: i32) -> (i64, bool) {
        if !lag.is_used() {
            return (0, false);
        }
        let (shift, mantissa) = (u32::from(lag.alpha_shift), i64::from(lag.alpha_mantissa));
        let difference = (i64::from(t_q24) << 22) - self.lag_q46;
        let low = difference & ((1 << LOW_BITS) - 1);
        let product = (difference >> LOW_BITS) * mantissa + ((low * mantissa) >> LOW_BITS);
        let total = product + self.remainder;
        let whole = total >> (shift - LOW_BITS);
        self.remainder = total - (whole << (shift - LOW_BITS));
        self.lag_q46 += whole;

        let rate = round_shift(product, shift - 1 - u32::from(lag.rate_shift));
        let clamped = rate.max(i64::from(lag.rate_lo)).min(i64::from(lag.rate_hi));
        let y = round_shift(clamped * i64::from(lag.y_mantissa), u32::from(lag.y_shift));
        (y.clamp(-ONE_Q31, ONE_Q31), clamped != rate)
    }
}
