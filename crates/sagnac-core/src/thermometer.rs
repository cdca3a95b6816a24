//! From a thermometer's code to temperature, its scaled form, and its causal rate.
//!
//! Temperatures are `i32` in units of 2⁻²⁴ °C (±128 °C, 6e-8 °C). The rate comes from a one-pole lag
//! run once per temperature period Δt with zero-order hold:
//!
//! ```text
//! T_lag[n] = T_lag[n−1] + α·(T[n] − T_lag[n−1])      α = 1 − e^(−Δt/τ),  T_lag[0] = T[0]
//! Ṫ[n]     = T_lag[n] − T_lag[n−1]  per Δt
//! ```
//!
//! The filter's memory is `T_lag` in 2⁻⁴⁶ °C plus the remainder of the last product, so there is no
//! dead band and the steps sum to the change of temperature. `Ṫ` is taken from the product itself,
//! finer than the state.
//!
//! What is said of a temperature holds for any number that a correction may depend on: the difference of two thermometers
//! ([`Source::Difference`]), a voltage, a current. A unit of such a number is `2^unit_exponent` of its own.
//!
//! Fails where the code is no temperature: that is what the plausible limits are for.

use crate::rounding::round_shift;
use crate::series::{ONE_Q31, ONE_Q47};

/// Bits of a difference of temperatures that are multiplied apart.
const LOW_BITS: u32 = 23;

/// A positive or negative factor `mantissa · 2^−shift`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scale {
    /// Signed mantissa.
    pub mantissa: i32,
    /// Binary places, 0..=62.
    pub shift: u8,
}

impl Scale {
    /// A factor of one, in the only way an image may write it for a difference.
    pub const ONE: Self = Self { mantissa: 1, shift: 0 };
}

/// Where a temperature comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// A code of its own.
    #[default]
    Code,
    /// Thermometer `of` less thermometer `less`, both with codes of their own and before this one.
    Difference {
        /// Index of the first.
        of: u8,
        /// Index of the one taken from it.
        less: u8,
    },
}

/// The lag filter of one thermometer and the span of its rate. All zero: no rate is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LagSpec {
    /// α as `alpha_mantissa · 2^−alpha_shift`; mantissa ≤ 2³¹, shift 31..=62.
    pub alpha_mantissa: u32,
    /// See `alpha_mantissa`.
    pub alpha_shift: u8,
    /// The rate's unit is 2^−(24 + rate_shift) °C per Δt; less than `alpha_shift`.
    pub rate_shift: u8,
    /// Lower border of the rate span in that unit.
    pub rate_lo: i32,
    /// Upper border.
    pub rate_hi: i32,
    /// y = rate · y_mantissa · 2^−y_shift in Q31; y = ±1 at the border farther from zero.
    pub y_mantissa: u32,
    /// See `y_mantissa`; at most 31.
    pub y_shift: u8,
}

/// One thermometer as the image describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thermometer {
    /// Where it comes from.
    pub source: Source,
    /// What is called °C here is 2^unit_exponent of its own unit (volts, for one), within ±100. Informative; 0 for °C.
    pub unit_exponent: i8,
    /// Temperature at code 0, 2⁻²⁴ °C.
    pub offset_q24: i32,
    /// 2⁻²⁴ °C per code.
    pub gain: Scale,
    /// Lowest temperature taken seriously, 2⁻²⁴ °C.
    pub plausible_lo_q24: i32,
    /// Highest temperature taken seriously, 2⁻²⁴ °C.
    pub plausible_hi_q24: i32,
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
    /// Slow updates without a temperature before the status says STALE.
    pub hold_updates: u32,
    /// Slow updates after the first temperature during which the status says SETTLING.
    pub settling_updates: u32,
}

impl Thermometer {
    /// A thermometer that nothing depends on; fills unused places of a description.
    pub const UNUSED: Self = Self {
        source: Source::Code,
        unit_exponent: 0,
        offset_q24: 0,
        gain: Scale::ONE,
        plausible_lo_q24: -1,
        plausible_hi_q24: 1,
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
        hold_updates: 0,
        settling_updates: 0,
    };

    /// Temperature in 2⁻²⁴ °C, or `None` outside the plausible limits.
    ///
    /// `T = offset + round(code · gain)`; |code · mantissa| ≤ 2⁶², so nothing overflows.
    pub fn temperature_q24(&self, code: i32) -> Option<i32> {
        let scaled = round_shift(i64::from(code) * i64::from(self.gain.mantissa), u32::from(self.gain.shift));
        self.plausible(i64::from(self.offset_q24) + scaled)
    }

    /// A temperature within the plausible limits.
    pub(crate) fn plausible(&self, t_q24: i64) -> Option<i32> {
        let t = i32::try_from(t_q24).ok()?;
        (self.plausible_lo_q24..=self.plausible_hi_q24).contains(&t).then_some(t)
    }

    /// `x` in Q47 of the temperature clamped to the span, and whether it had to be clamped.
    pub(crate) fn scaled(&self, t_q24: i32) -> (i64, bool) {
        let clamped = t_q24.max(self.span_lo_q24).min(self.span_hi_q24);
        let middle = (i64::from(self.span_lo_q24) + i64::from(self.span_hi_q24)) >> 1;
        let product = (i64::from(clamped) - middle) * i64::from(self.x_mantissa);
        let x = round_shift(product, u32::from(self.x_shift));
        (x.clamp(-ONE_Q47, ONE_Q47), clamped != t_q24)
    }
}

impl LagSpec {
    /// True when a filter is configured.
    pub const fn is_used(&self) -> bool {
        self.alpha_mantissa != 0
    }
}

/// Memory of one thermometer: filter, last temperature, how long it was held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ThermometerState {
    lag_q46: i64,
    remainder: i64,
    last_q24: Option<i32>,
    pub(crate) held_updates: u32,
    pub(crate) settled_updates: u32,
}

/// What a slow update learned from one thermometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reading {
    pub(crate) x_q47: i64,
    pub(crate) y_q31: i64,
    pub(crate) x_clamped: bool,
    pub(crate) y_clamped: bool,
}

impl ThermometerState {
    pub(crate) const fn new() -> Self {
        Self { lag_q46: 0, remainder: 0, last_q24: None, held_updates: 0, settled_updates: 0 }
    }

    /// One temperature period. `None` when there is no plausible temperature at this update; the
    /// filter then runs on the last one, as it does between samples.
    pub(crate) fn update(&mut self, spec: &Thermometer, fresh: Option<i32>) -> Option<Reading> {
        let t = match (fresh, self.last_q24) {
            (Some(t), None) => {
                self.lag_q46 = i64::from(t) << 22;
                t
            }
            (Some(t), Some(_)) | (None, Some(t)) => t,
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
        self.held_updates = 0;
        let (x_q47, x_clamped) = spec.scaled(t);
        Some(Reading { x_q47, y_q31, x_clamped, y_clamped })
    }

    /// Advances the lag by one Δt; returns the scaled, clamped rate and whether it was clamped.
    ///
    /// |T − T_lag| ≤ 2⁵⁴ in 2⁻⁴⁶ °C; its upper 32 bits times α's mantissa are ≤ 2⁶², the lower 23 add
    /// less than 2³¹. The product stands in 2^−(23 + alpha_shift) °C, its remainder is below 2³⁹.
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
