//! Chebyshev polynomials in fixed point.
//!
//! `T₀ = 1, T₁ = x, T_{n+1} = 2x·T_n − T_{n−1}` (DLMF 18.9.1 with 18.9.2) on `x ∈ [−1, 1]`, all in
//! Q31 held in `i64` (so that ±1 is exact). Each step rounds once, by at most 2⁻³² of full scale,
//! and a rounding made at step j grows to at most (n − j + 1) of itself: for n ≤ 8 the sum stays
//! below 36·2⁻³², which `docs/arithmetic.md` carries into the bound on `d`.
//!
//! Fails for |x| > 1: the series grows like xⁿ. Callers clamp first.

use crate::rounding::round_shift;

/// Highest order of a series. The error bound of `docs/arithmetic.md` is stated for it.
pub const MAX_ORDER: u8 = 8;

/// Number of basis values, order 0 to [`MAX_ORDER`].
pub(crate) const BASIS_LEN: usize = MAX_ORDER as usize + 1;

/// 1.0 in Q31.
pub(crate) const ONE_Q31: i64 = 1 << 31;

/// `T₀(x) … T₈(x)` in Q31 for `x` in Q31, `|x| ≤ ONE_Q31`.
#[inline]
pub(crate) fn chebyshev(x_q31: i64) -> [i64; BASIS_LEN] {
    let mut before = ONE_Q31;
    let mut here = x_q31;
    let mut basis = [ONE_Q31; BASIS_LEN];
    for value in basis.iter_mut().skip(1) {
        *value = here;
        // |x·T| ≤ 2^31·(2^31 + 36) < 2^62.1; shifting by 30 instead of 31 is the factor 2.
        let next = round_shift(x_q31 * here, 30) - before;
        before = here;
        here = next;
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Measured worst case over 40 001 points: 9.9 LSB of Q31 at order 8. Closed form: cos(n·acos x).
    #[test]
    fn agrees_with_the_cosine_form() {
        extern crate std;
        let mut worst = 0.0_f64;
        for i in -20_000_i64..=20_000 {
            let x_q31 = i * ONE_Q31 / 20_000;
            let x = x_q31 as f64 / ONE_Q31 as f64;
            for (n, value) in chebyshev(x_q31).iter().enumerate() {
                let exact = (n as f64 * x.acos()).cos();
                worst = worst.max((*value as f64 - exact * ONE_Q31 as f64).abs());
            }
        }
        std::println!("worst Chebyshev error: {worst} LSB of Q31");
        assert!(worst < 18.0, "{worst} LSB of Q31, bound 36·2^-32");
    }

    #[test]
    fn is_exact_at_both_ends() {
        for (n, (right, left)) in chebyshev(ONE_Q31).iter().zip(chebyshev(-ONE_Q31)).enumerate() {
            assert_eq!(*right, ONE_Q31);
            assert_eq!(left, if n % 2 == 0 { ONE_Q31 } else { -ONE_Q31 });
        }
    }
}
