//! The one rounding rule of the target: divide by a power of two, halves upward.

/// `floor(value / 2^shift + 1/2)`.
///
/// Valid for `shift` in 0..=62 and `|value| ≤ 2^63 − 2^62` (each caller states its own bound).
///
/// **SAG-CORE-001** Every product is divided by a power of two with one rounding, halves upward.
#[inline]
pub(crate) const fn round_shift(value: i64, shift: u32) -> i64 {
    if shift == 0 { value } else { (value + (1_i64 << (shift - 1))) >> shift }
}

#[cfg(test)]
mod tests {
    use super::round_shift;

    /// SAG-CORE-001
    #[test]
    fn halves_go_up_on_both_sides_of_zero() {
        assert_eq!(round_shift(3, 1), 2);
        assert_eq!(round_shift(-3, 1), -1);
        assert_eq!(round_shift(-5, 2), -1);
        assert_eq!(round_shift(5, 0), 5);
    }
}
