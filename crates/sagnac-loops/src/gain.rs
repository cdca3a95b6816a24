//! A gain as the target holds it: mantissa and shift.

/// The value limited to a range. Unlike `clamp` it does not panic if the limits are in the wrong order.
#[inline]
pub(crate) fn held(value: i64, low: i64, high: i64) -> i64 {
    value.max(low).min(high)
}

/// Codes as 2^-32 codes.
pub(crate) const fn q32(code: i32) -> i64 {
    (code as i64) << 32
}

/// 2^-32 codes to codes, halves upward.
pub(crate) const fn codes(q32: i64) -> i32 {
    ((q32 + (1 << 31)) >> 32) as i32
}

/// Products are limited to ± this, 2^-32 codes: far beyond any converter, and the sum with a code fits an `i64`.
const MOST_Q32: i64 = 1 << 61;

/// A gain of `mantissa · 2^-shift`, in actuator codes per unit of error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoopGain {
    /// Below 2^30 in size.
    pub mantissa: i32,
    /// 0 to 62.
    pub shift: u8,
}

impl LoopGain {
    /// `error` times the gain, in 2^-32 codes: rounded to nearest, halves upward, limited to ±2^61; `|error| ≤ 2^30`.
    #[inline]
    pub(crate) fn times(self, error: i32) -> i64 {
        // |mantissa·error| ≤ 2^60; adding half a unit of the shift stays in range.
        let product = i64::from(self.mantissa) * i64::from(error);
        let shift = u32::from(self.shift.min(62));
        if shift > 32 {
            return (product + (1_i64 << (shift - 33))) >> (shift - 32);
        }
        let left = 32 - shift;
        let most = MOST_Q32 >> left;
        held(product, -most, most) << left
    }

    /// True if both fields are in range.
    pub(crate) const fn is_valid(self) -> bool {
        self.mantissa.unsigned_abs() < 1 << 30 && self.shift <= 62
    }

    /// The nearest gain. `None` for 2^30 and more, and for values so small that the mantissa has less than 8 bits (2^-54).
    #[cfg(feature = "design")]
    pub fn from_f64(value: f64) -> Option<Self> {
        if value == 0.0 {
            return Some(Self { mantissa: 0, shift: 32 });
        }
        if !value.is_finite() {
            return None;
        }
        let (_, exponent) = libm::frexp(value);
        // |value| < 2^exponent, so that mantissa < 2^30.
        let shift = (30 - exponent).min(62);
        let mantissa = libm::round(libm::ldexp(value, shift));
        let fits = shift >= 0 && (256.0..1_073_741_825.0).contains(&libm::fabs(mantissa));
        fits.then(|| Self { mantissa: (mantissa as i32).clamp(-(1 << 30) + 1, (1 << 30) - 1), shift: shift as u8 })
    }

    /// Its value.
    #[cfg(feature = "design")]
    pub fn to_f64(self) -> f64 {
        libm::ldexp(f64::from(self.mantissa), -i32::from(self.shift))
    }
}

#[cfg(test)]
mod tests {
    use super::LoopGain;
    use num_bigint::BigInt;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn products_are_the_nearest_2_pow_minus_32(mantissa in -(1 << 30) + 1..1 << 30, shift in 33_u8..=62, error in -(1 << 30)..=1 << 30) {
            let gain = LoopGain { mantissa, shift };
            let twice = BigInt::from(mantissa) * BigInt::from(error) * (BigInt::from(1) << (1 + 32));
            let got = (BigInt::from(gain.times(error)) * 2) << usize::from(shift);
            let away = got - twice;
            let half = BigInt::from(1) << usize::from(shift);
            prop_assert!(away <= half && away > -half);
        }

        #[test]
        fn large_gains_are_exact_or_held(mantissa in -(1 << 30) + 1..1 << 30, shift in 0_u8..=32, error in -(1 << 30)..=1 << 30) {
            let exact = (BigInt::from(mantissa) * BigInt::from(error)) << usize::from(32 - shift);
            let most = BigInt::from(1_i64 << 61);
            let got = BigInt::from(LoopGain { mantissa, shift }.times(error));
            let held = exact.clone().max(-most.clone()).min(most);
            // The limit is in whole units of the shift.
            prop_assert!((&got - &held).magnitude() >> usize::from(32 - shift) <= BigInt::from(1).magnitude().clone());
            prop_assert!(got == exact || exact.magnitude() > &(BigInt::from(1_i64 << 60)).magnitude().clone());
        }

        #[test]
        fn a_gain_keeps_its_value(value in 1e-12_f64..1e6) {
            let back = LoopGain::from_f64(-value).unwrap().to_f64();
            prop_assert!((back / -value - 1.0).abs() < 1.0 / 512.0);
        }
    }

    #[test]
    fn gains_that_do_not_fit_are_refused() {
        assert_eq!(LoopGain::from_f64(1.1e9), None);
        assert_eq!(LoopGain::from_f64(1e-17), None);
        assert_eq!(LoopGain::from_f64(f64::NAN), None);
        assert!(LoopGain::from_f64(0.0).is_some());
    }
}
