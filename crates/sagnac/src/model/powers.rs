//! The fitted curve in the paper's form: powers of °C.
//!
//! `C + Σ bᵢ·[Tᵢ(x) − Tᵢ(x0)]` with `x = a·T + s` is expanded exactly; the map is linear, so its matrix
//! carries the covariance too. Printed for people and old systems: nothing in Sagnac computes with it,
//! because raw powers of °C are ill-conditioned.

use crate::model::basis::{BASIS_LEN, Span, chebyshev_powers};

/// T_order of the scaled input in ascending powers of the input.
pub(crate) fn powers_of_chebyshev(span: Span, order: u8) -> [f64; BASIS_LEN] {
    substitute(&chebyshev_powers()[usize::from(order).min(BASIS_LEN - 1)], span.slope(), span.x(0.0))
}

/// Chebyshev coefficients 0 … order of a polynomial given by ascending powers of °C.
pub(crate) fn series_from_powers(span: Span, powers: &[f64]) -> [f64; BASIS_LEN] {
    // T = (x − shift)/slope, then peel off the highest power with the T_n that leads it.
    let mut in_x = [0.0; BASIS_LEN];
    in_x[..powers.len()].copy_from_slice(powers);
    let mut in_x = substitute(&in_x, 1.0 / span.slope(), -span.x(0.0) / span.slope());
    let table = chebyshev_powers();
    let mut series = [0.0; BASIS_LEN];
    for n in (0..BASIS_LEN).rev() {
        series[n] = in_x[n] / table[n][n];
        for power in 0..=n {
            in_x[power] -= series[n] * table[n][power];
        }
    }
    series
}

/// p(slope·u + shift) by Horner's rule on polynomials.
fn substitute(powers: &[f64; BASIS_LEN], slope: f64, shift: f64) -> [f64; BASIS_LEN] {
    let mut out = [0.0; BASIS_LEN];
    for coefficient in powers.iter().rev() {
        for power in (0..BASIS_LEN).rev() {
            let below = if power > 0 { out[power - 1] } else { 0.0 };
            out[power] = out[power] * shift + below * slope;
        }
        out[0] += coefficient;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_again() {
        let span = Span { lo: -40.0, hi: 70.0 };
        let powers = [0.3, -0.02, 5e-4, 1e-6];
        let series = series_from_powers(span, &powers);
        for (power, expected) in powers.iter().enumerate() {
            let value: f64 = (0..=3).map(|n| powers_of_chebyshev(span, n)[power] * series[usize::from(n)]).sum();
            assert!((value - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{power}: {value}");
        }
    }
}
