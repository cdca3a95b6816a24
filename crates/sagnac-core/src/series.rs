//! Chebyshev polynomials in fixed point.
//!
//! `T₀ = 1, T₁ = x, T_{n+1} = 2x·T_n − T_{n−1}` (DLMF 18.9.1 with 18.9.2) on `x ∈ [−1, 1]`. The
//! recursion runs in Q32 with x in Q47, both in `i64` (so ±1 is exact); the result is Q31.
//!
//! x has 16 bits more than the result because T_n' ≤ n² amplifies a rounding of x. Each step rounds once, by at most 2⁻³³, and a
//! rounding at step j grows to at most (n − j + 1) times itself: for n ≤ 8 the sum stays below 36·2⁻³³. The last rounding to Q31 adds
//! 2⁻³².
//!
//! Not valid for |x| > 1, where the series grows like xⁿ. Callers clamp first.

use crate::rounding::round_shift;

/// Highest order of a series. The error bound of `docs/explanation/arithmetic.md` is stated for it.
pub const MAX_ORDER: u8 = 8;

/// Number of basis values, order 0 to [`MAX_ORDER`].
pub(crate) const BASIS_LEN: usize = MAX_ORDER as usize + 1;

/// 1.0 in Q31.
pub(crate) const ONE_Q31: i64 = 1 << 31;
/// 1.0 in Q47.
pub(crate) const ONE_Q47: i64 = 1 << 47;
/// Low bits of x, multiplied separately from its upper Q30.
const LOW_BITS: u32 = 17;

/// `T₀(x) … T₈(x)` in Q31 for `x` in Q47, `|x| ≤ ONE_Q47`.
///
/// **SAG-CORE-007** Orders 0 to 8 are the Chebyshev polynomials of x, computed by their recurrence.
#[inline]
pub(crate) fn chebyshev(x_q47: i64) -> [i64; BASIS_LEN] {
    let (high, low) = (x_q47 >> LOW_BITS, x_q47 & ((1 << LOW_BITS) - 1));
    let mut before = 1_i64 << 32;
    let mut here = round_shift(x_q47, 15);
    let mut basis = [ONE_Q31; BASIS_LEN];
    for value in basis.iter_mut().skip(1) {
        *value = round_shift(here, 1);
        // |high·T| ≤ 2^30·(2^32 + 36), |low·T| < 2^49.1; shifting by 29 instead of 30 is the factor 2.
        let product = high * here + ((low * here) >> LOW_BITS);
        let next = round_shift(product, 29) - before;
        before = here;
        here = next;
    }
    basis
}

/// ((x − knot)/2)² in Q31 above the knot, 0 below it.
///
/// x − knot ≤ 2 in Q47. Its half is rounded to Q31 (2⁻³²) and the square is rounded again (2⁻³²): within 3·2⁻³² of the value.
///
/// **SAG-CORE-008** A zone is the square of half the distance above its knot, a step is one above it, and both are zero below.
#[inline]
pub(crate) fn zone(x_q47: i64, knot_q15: i16) -> i64 {
    let above = (x_q47 - (i64::from(knot_q15) << 32)).max(0);
    let half = round_shift(above, 17);
    round_shift(half * half, 31)
}

/// 1 in Q31 from the knot on, 0 below it.
#[inline]
pub(crate) fn step(x_q47: i64, knot_q15: i16) -> i64 {
    if x_q47 >= i64::from(knot_q15) << 32 { ONE_Q31 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed form; both ends and both sides of the knot.
    /// SAG-CORE-008
    #[test]
    fn zones_and_steps_begin_at_their_knot() {
        for knot in [i16::MIN, -9_999, 0, 12_345, i16::MAX] {
            let at = i64::from(knot) << 32;
            assert_eq!((zone(at, knot), step(at, knot), step(at - 1, knot)), (0, ONE_Q31, 0));
            assert_eq!(zone(-ONE_Q47, knot), 0);
            let half = (ONE_Q47 - at) as f64 / ONE_Q47 as f64 / 2.0;
            assert!((zone(ONE_Q47, knot) as f64 - half * half * ONE_Q31 as f64).abs() <= 1.5, "{knot}");
        }
        assert_eq!(zone(ONE_Q47, i16::MIN), ONE_Q31);
    }

    /// Measured worst case over 40 001 points: 5.5 LSB of Q31. Closed form: cos(n·acos x).
    /// SAG-CORE-007
    #[test]
    fn agrees_with_the_cosine_form() {
        extern crate std;
        let mut worst = 0.0_f64;
        for i in -20_000_i64..=20_000 {
            let x_q47 = i * (ONE_Q47 / 20_000) + i * (ONE_Q47 % 20_000) / 20_000;
            let x = x_q47 as f64 / ONE_Q47 as f64;
            for (n, value) in chebyshev(x_q47).iter().enumerate() {
                let exact = (n as f64 * x.acos()).cos();
                worst = worst.max((*value as f64 - exact * ONE_Q31 as f64).abs());
            }
        }
        std::println!("worst Chebyshev error: {worst} LSB of Q31");
        assert!(worst < 9.5, "{worst} LSB of Q31, bound 36·2^-33 + 2^-32");
    }

    #[test]
    fn is_exact_at_both_ends() {
        for (n, (right, left)) in chebyshev(ONE_Q47).iter().zip(chebyshev(-ONE_Q47)).enumerate() {
            assert_eq!(*right, ONE_Q31);
            assert_eq!(left, if n % 2 == 0 { ONE_Q31 } else { -ONE_Q31 });
        }
    }
}
