//! Closed forms of the ring laser: what the simulator must obey, and what it is built from.
//!
//! Angles in arcsec, rates in arcsec/s (1 arcsec/s = 1 °/h), lengths in m, phases in rad.

use std::f64::consts::{PI, TAU};

use serde::Deserialize;

/// Speed of light in vacuum, m/s (SI, exact).
pub const C_M_PER_S: f64 = 299_792_458.0;
/// Arcsec in a radian.
pub const ARCSEC_PER_RAD: f64 = 3600.0 * 180.0 / PI;
/// arcsec/√s in one °/√h.
pub const ARCSEC_RT_S_PER_DEG_RT_H: f64 = 60.0;

/// Shape of the light's path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// Equilateral triangle.
    Triangle,
    /// Square.
    Square,
    /// Circle: the limit of many mirrors, and the source paper's figure.
    Circle,
}

impl Shape {
    /// Enclosed area of a path of that length: p²/(12√3), p²/16, p²/(4π).
    pub fn area_m2(self, perimeter_m: f64) -> f64 {
        perimeter_m * perimeter_m
            / match self {
                Self::Triangle => 12.0 * 3.0_f64.sqrt(),
                Self::Square => 16.0,
                Self::Circle => 4.0 * PI,
            }
    }
}

/// Scale factor λL/(4A), arcsec of rotation per fringe.
pub fn arcsec_per_fringe(shape: Shape, perimeter_m: f64, wavelength_m: f64) -> f64 {
    wavelength_m * perimeter_m / (4.0 * shape.area_m2(perimeter_m)) * ARCSEC_PER_RAD
}

/// Beat frequency Δν = 4AΩ/(λL), Hz, at a rate in arcsec/s.
pub fn beat_hz(shape: Shape, perimeter_m: f64, wavelength_m: f64, rate_dph: f64) -> f64 {
    rate_dph / arcsec_per_fringe(shape, perimeter_m, wavelength_m)
}

/// Free spectral range c/L, Hz.
pub fn free_spectral_range_hz(perimeter_m: f64) -> f64 {
    C_M_PER_S / perimeter_m
}

/// Gain at a detuning over that at the peak, the detuning in full widths of the line at half height: a Gaussian.
pub fn gain_line(detuning: f64) -> f64 {
    libm::exp(-4.0 * std::f64::consts::LN_2 * detuning * detuning)
}

/// Wavelengths in the path: the mode number.
pub fn mode_number(perimeter_m: f64, wavelength_m: f64) -> f64 {
    libm::round(perimeter_m / wavelength_m)
}

/// Adler's mean rate: Ω·√(1 − (Ω_L/Ω)²) outside of the dead band, 0 inside.
pub fn adler_mean_dph(rate_dph: f64, lock_in_dph: f64) -> f64 {
    let outside = rate_dph * rate_dph - lock_in_dph * lock_in_dph;
    if outside > 0.0 { libm::copysign(libm::sqrt(outside), rate_dph) } else { 0.0 }
}

/// Angle random walk of a dithered gyro, Ω_L/√(K·Ω_D) with K = 2π/S and Ω_D = 2πf·θ, in °/√h.
///
/// Each turn-round of the dither leaves a kick of random sign; the walk is their sum. True while K·θ ≫ 1 and the
/// kicks are small (KΩ_L ≪ √φ″).
pub fn dithered_arw_deg_rt_h(lock_in_dph: f64, arcsec_per_fringe: f64, dither_hz: f64, dither_arcsec: f64) -> f64 {
    let k = TAU / arcsec_per_fringe;
    lock_in_dph / libm::sqrt(k * TAU * dither_hz * dither_arcsec) / ARCSEC_RT_S_PER_DEG_RT_H
}

/// Lock-in threshold from two backscatter amplitudes (fractions of the field per round trip) and their phases:
/// K·Ω_L = (c/L)·|r₁e^(−jε₁) + r₂e^(jε₂)|, at equal intensities. arcsec/s.
pub fn lock_in_dph(perimeter_m: f64, arcsec_per_fringe: f64, r: [f64; 2], epsilon_rad: [f64; 2]) -> f64 {
    let re = r[0] * libm::cos(epsilon_rad[0]) + r[1] * libm::cos(epsilon_rad[1]);
    let im = r[1] * libm::sin(epsilon_rad[1]) - r[0] * libm::sin(epsilon_rad[0]);
    free_spectral_range_hz(perimeter_m) * libm::hypot(re, im) * arcsec_per_fringe / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Domain notes §4 and the source paper (§1 there): printed to the digits held here.
    #[test]
    fn scale_factors_of_the_domain_notes() {
        let s = |shape, l| arcsec_per_fringe(shape, l, 0.63299e-6);
        assert!((s(Shape::Triangle, 0.16) - 4.24).abs() < 0.005);
        assert!((s(Shape::Triangle, 0.28) - 2.42).abs() < 0.005);
        assert!((s(Shape::Square, 0.28) - 1.86).abs() < 0.006);
        let circle = beat_hz(Shape::Circle, TAU * 0.1, 0.6333e-6, 10.0);
        assert!((circle - 15.3107).abs() < 5e-5, "{circle}");
        assert!((free_spectral_range_hz(0.28) / 1e6 - 1071.0).abs() < 0.5);
        assert!((1e6 / mode_number(0.28, 0.63299e-6) - 2.26).abs() < 0.005);
        assert!((1e6 / mode_number(0.16, 0.63299e-6) - 3.96).abs() < 0.005);
    }

    #[test]
    fn walk_of_the_domain_notes() {
        let arw = dithered_arw_deg_rt_h(300.0, 2.42, 400.0, 150.0);
        assert!((arw - 0.00505).abs() < 5e-6, "{arw}");
        assert!((0.003 / arw * 300.0 - 178.0).abs() < 0.5);
    }

    #[test]
    fn inside_the_dead_band_nothing_turns() {
        assert_eq!(adler_mean_dph(-99.0, 100.0), 0.0);
        assert!((adler_mean_dph(-1000.0, 100.0) + 1000.0 * (1.0 - 0.005 - 0.0000125)).abs() < 1e-3);
    }
}
