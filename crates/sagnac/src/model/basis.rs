//! Chebyshev polynomials on the scaled span, in `f64`, with what a window needs of them.
//!
//! A window in which temperature moves does not see T_i at its mean temperature but the mean of T_i:
//! `mean(T_i(x)) = T_i(x̄) + ½·T_i''(x̄)·var(x)`, exact to order 3 for symmetric movement.

use sagnac_core::MAX_ORDER;

/// Values of order 0 to 8.
pub const BASIS_LEN: usize = MAX_ORDER as usize + 1;

/// The span of an input, in its own unit, and the scaling to x ∈ [−1, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Lowest value.
    pub lo: f64,
    /// Highest value.
    pub hi: f64,
}

/// Even codes of 2⁻²⁴ °C per °C.
const GRID_PER_C: f64 = (1 << 23) as f64;

impl Span {
    /// The span from `lo` to `hi`, widened by at most 1.2e-7 °C to even codes of the target's
    /// temperature, so that host and target scale by the same borders exactly.
    pub fn on_grid(lo: f64, hi: f64) -> Self {
        Self { lo: (lo * GRID_PER_C).floor() / GRID_PER_C, hi: (hi * GRID_PER_C).ceil() / GRID_PER_C }
    }

    /// x of a value.
    pub fn x(&self, t_c: f64) -> f64 {
        (2.0 * t_c - self.lo - self.hi) / (self.hi - self.lo)
    }

    /// The value at x.
    pub fn at(&self, x: f64) -> f64 {
        f64::midpoint(self.lo, self.hi) + x / self.slope()
    }

    /// dx per unit of the input.
    pub fn slope(&self) -> f64 {
        2.0 / (self.hi - self.lo)
    }
}

/// T₀(x) … T₈(x).
pub fn chebyshev(x: f64) -> [f64; BASIS_LEN] {
    chebyshev_mean(x, 0.0)
}

/// Means of T₀ … T₈ over a window with this mean and second moment of x.
pub(crate) fn chebyshev_mean(x: f64, variance: f64) -> [f64; BASIS_LEN] {
    let (mut value, mut first, mut second) = ([1.0; BASIS_LEN], [0.0; BASIS_LEN], [0.0; BASIS_LEN]);
    (value[1], first[1]) = (x, 1.0);
    for n in 1..BASIS_LEN - 1 {
        value[n + 1] = 2.0 * x * value[n] - value[n - 1];
        first[n + 1] = 2.0 * value[n] + 2.0 * x * first[n] - first[n - 1];
        second[n + 1] = 4.0 * first[n] + 2.0 * x * second[n] - second[n - 1];
    }
    std::array::from_fn(|n| value[n] + 0.5 * second[n] * variance)
}

/// Derivatives of T₀ … T₈ at x: T_{n+1}' = 2·T_n + 2x·T_n' − T_{n−1}'.
pub(crate) fn chebyshev_slope(x: f64) -> [f64; BASIS_LEN] {
    let (value, mut first) = (chebyshev(x), [0.0; BASIS_LEN]);
    first[1] = 1.0;
    for n in 1..BASIS_LEN - 1 {
        first[n + 1] = 2.0 * value[n] + 2.0 * x * first[n] - first[n - 1];
    }
    first
}

/// Coefficients of T_n as a polynomial of x, ascending powers; row n has n + 1 of them.
pub(crate) fn chebyshev_powers() -> [[f64; BASIS_LEN]; BASIS_LEN] {
    let mut rows = [[0.0; BASIS_LEN]; BASIS_LEN];
    rows[0][0] = 1.0;
    rows[1][1] = 1.0;
    for n in 1..BASIS_LEN - 1 {
        for power in 0..BASIS_LEN {
            let shifted = if power > 0 { rows[n][power - 1] } else { 0.0 };
            rows[n + 1][power] = 2.0 * shifted - rows[n - 1][power];
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_count_the_curvature_inside_a_window() {
        // Closed form: over x ± a, uniform, mean(2x² − 1) = 2(x² + a²/3) − 1; a cubic likewise.
        let (x, a) = (0.3, 0.1);
        let variance = a * a / 3.0;
        let mean = chebyshev_mean(x, variance);
        assert!((mean[2] - (2.0 * (x * x + variance) - 1.0)).abs() < 1e-15);
        assert!((mean[3] - (4.0 * (x.powi(3) + 3.0 * x * variance) - 3.0 * x)).abs() < 1e-15);
    }

    #[test]
    fn powers_are_those_of_the_tables() {
        // DLMF 18.5: T₄ = 8x⁴ − 8x² + 1.
        assert_eq!(chebyshev_powers()[4][..5], [1.0, 0.0, -8.0, 0.0, 8.0]);
    }
}
