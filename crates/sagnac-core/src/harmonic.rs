//! Cosine and sine of whole or fractional turns over the span, in fixed point.
//!
//! With u turns over the span the angle is `2π·u·(x + 1)/2`: zero at x = −1, u turns at x = +1. The position (x + 1)/2 is rounded to
//! Q38 and multiplied by u in Q18, which gives turns in Q56, below 2⁶². Only the fraction of a turn matters. It is folded into a
//! quarter, `z ∈ [0, 1]` in Q31, where
//!
//! ```text
//! sin(πz/2) = z + z·R(z²),   R of degree 5 by Horner: z² in Q31, sums in Q32
//! ```
//!
//! So the sine is odd, and symmetric about its quarters, to the bit; the quarters themselves are exact because R(1) = 0. Sums stay
//! below 0.646·2³² and products below 2⁶³. Coefficients: Remez exchange, `testdata/sine/quarter_wave.py`.
//!
//! Largest error in LSB of Q31: position 1.57 (at 64 turns; proportional to u), z 0.79, z² 0.33, five sums 1.25, the last rounding 0.5,
//! polynomial and its coefficients 0.15; together 4.6.
//!
//! Not valid for |x| > 1, where the product could overflow. Callers clamp first.

use crate::rounding::round_shift;
use crate::series::{ONE_Q31, ONE_Q47};

/// Largest number of turns over the span in 2⁻¹⁸: just below 64 turns.
pub const MAX_TURNS_Q18: u32 = (1 << 24) - 1;

/// A quarter of a turn in Q56.
const QUARTER_Q56: i64 = 1 << 54;
/// Coefficients of R(w) in Q32, constant first; their sum is zero.
const REST_Q32: [i64; 6] = [2_451_551_556, -2_774_394_651, 342_277_046, -20_107_381, 688_100, -14_670];

/// `cos(2π·turns·(x + 1)/2)` in Q31.
///
/// **SAG-CORE-009** A harmonic is the cosine or sine of up to 64 turns over the span.
#[inline]
pub(crate) fn cosine(x_q47: i64, turns_q18: u32) -> i64 {
    sine_of(turns_q56(x_q47, turns_q18) + QUARTER_Q56)
}

/// `sin(2π·turns·(x + 1)/2)` in Q31.
#[inline]
pub(crate) fn sine(x_q47: i64, turns_q18: u32) -> i64 {
    sine_of(turns_q56(x_q47, turns_q18))
}

/// Turns from the lower end of the span; at most 2³⁸·2²⁴.
fn turns_q56(x_q47: i64, turns_q18: u32) -> i64 {
    round_shift(x_q47 + ONE_Q47, 10) * i64::from(turns_q18)
}

/// The sine of an angle in turns, Q56 and not negative.
fn sine_of(turns_q56: i64) -> i64 {
    let quarter = turns_q56 >> QUARTER_Q56.trailing_zeros() & 3;
    let past = turns_q56 & (QUARTER_Q56 - 1);
    let rising = quarter & 1 == 0;
    let z = round_shift(if rising { past } else { QUARTER_Q56 - past }, 23);
    let square = round_shift(z * z, 31);
    let rest = REST_Q32.iter().rev().fold(0, |sum, coefficient| coefficient + round_shift(sum * square, 31));
    let size = (z + round_shift(z * rest, 32)).min(ONE_Q31);
    if quarter & 2 == 0 { size } else { -size }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    /// Turns that are whole, quarters, halves, odd, the least and the most.
    const TURNS_Q18: [u32; 9] = [1, 1 << 16, 1 << 17, 1 << 18, 3 << 18, 1_000_003, 16 << 18, 12_345_677, MAX_TURNS_Q18];

    /// `2π·turns·(x + 1)/2` less whole turns; the product is exact, so the reference carries no error of its own.
    fn angle(x_q47: i64, turns_q18: u32) -> f64 {
        let turns_q66 = i128::from(x_q47 + ONE_Q47) * i128::from(turns_q18) % (1 << 66);
        turns_q66 as f64 / 2.0_f64.powi(66) * std::f64::consts::TAU
    }

    /// Measured worst case over 9 · 50,001 points: 2.6 LSB of Q31.
    /// SAG-CORE-009
    #[test]
    fn agrees_with_the_sine_of_the_host() {
        let mut worst = 0.0_f64;
        for turns_q18 in TURNS_Q18 {
            for i in -25_000_i64..=25_000 {
                let x_q47 = i * (ONE_Q47 / 25_000) + i * (ONE_Q47 % 25_000) / 25_000;
                let angle = angle(x_q47, turns_q18);
                for (value, exact) in [(cosine(x_q47, turns_q18), angle.cos()), (sine(x_q47, turns_q18), angle.sin())] {
                    worst = worst.max((value as f64 - exact * ONE_Q31 as f64).abs());
                    assert!(value.abs() <= ONE_Q31, "{turns_q18} turns at {x_q47}: {value}");
                }
            }
        }
        std::println!("worst harmonic error: {worst} LSB of Q31");
        assert!(worst < 4.6, "{worst} LSB of Q31");
    }

    #[test]
    fn quarters_are_exact() {
        // A whole turn over the span: its quarters are at x = −1, −1/2, 0, 1/2 and 1.
        let quarters = [-ONE_Q47, -ONE_Q47 / 2, 0, ONE_Q47 / 2, ONE_Q47];
        let expected = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 0)];
        for whole in [1, 5, 61] {
            for (x_q47, (cos, sin)) in quarters.into_iter().zip(expected) {
                // An odd number of turns passes the same quarters, forward (1, 5, 61 are 1 modulo 4).
                let found = (cosine(x_q47, whole << 18), sine(x_q47, whole << 18));
                assert_eq!(found, (cos * ONE_Q31, sin * ONE_Q31), "{whole} turns at {x_q47}");
            }
        }
        // At the lower end every harmonic begins its turn, at the upper end the number of turns decides.
        assert_eq!((cosine(-ONE_Q47, MAX_TURNS_Q18), sine(-ONE_Q47, MAX_TURNS_Q18)), (ONE_Q31, 0));
        assert_eq!((cosine(ONE_Q47, 5 << 17), sine(ONE_Q47, 5 << 17)), (-ONE_Q31, 0));
        assert_eq!((cosine(ONE_Q47, 7 << 16), sine(ONE_Q47, 7 << 16)), (0, -ONE_Q31));
    }

    /// Half a turn later the sine is the opposite, and half a turn less it runs backward, to the bit.
    #[test]
    fn is_symmetric_to_the_bit() {
        const HALF: i64 = 2 * QUARTER_Q56;
        for i in 0..100_000_i64 {
            let turns_q56 = i * 1_441_151_880_759 % HALF;
            assert_eq!(sine_of(turns_q56 + HALF), -sine_of(turns_q56), "{turns_q56}");
            assert_eq!(sine_of(HALF - turns_q56), sine_of(turns_q56), "{turns_q56}");
        }
    }
}
