//! Closed forms of the ring laser. The simulator is built from them and tested against them.
//!
//! ```text
//! Δν  = 4AΩ/(λL)                 beat frequency; one fringe is λL/(4A) of rotation
//! FSR = c/L                      m = L/λ: mode number
//! Ω̄   = √(Ω² − Ω_L²)             mean beat rate above lock-in (Adler 1946), 0 below
//! N   = Ω_L/√(K·Ω_D)             angle random walk of dithered lock-in, K = 2π per fringe, Ω_D = 2πf·θ
//! ```
//!
//! Units: angles in arcsec, rates in arcsec/s (1 arcsec/s = 1 °/h), lengths in m, phases in rad. A rate is positive
//! in the direction in which the counter counts up.
//!
//! Sources: R. Adler, "A study of locking phenomena in oscillators", Proc. IRE 34 (1946); F. Aronowitz, "The laser
//! gyro", in Laser Applications 1 (1971); IEEE Std 647 for the terms. Where they fail is stated at each function; the
//! area is that of the ideal figure, with mirrors of no size and beams of no width.

use std::f64::consts::{PI, TAU};

use serde::Deserialize;

/// Speed of light in vacuum, m/s (SI, exact).
pub const C_M_PER_S: f64 = 299_792_458.0;
/// Earth's rotation rate relative to the stars, °/h (IERS, WGS 84: 7.292115e-5 rad/s).
pub const EARTH_RATE_DPH: f64 = 15.041_067;
/// Arcsec in a radian.
pub const ARCSEC_PER_RAD: f64 = 3600.0 * 180.0 / PI;
/// arcsec/√s in one °/√h.
pub const ARCSEC_RT_S_PER_DEG_RT_H: f64 = 60.0;

/// Shape of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RingShape {
    /// Equilateral triangle.
    Triangle,
    /// Square.
    Square,
    /// Circle: the limit of many mirrors, and the figure used by the source paper.
    Circle,
}

impl RingShape {
    /// Enclosed area of a ring of perimeter p: p²/(12√3), p²/16, p²/(4π).
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
pub fn arcsec_per_fringe(shape: RingShape, perimeter_m: f64, wavelength_m: f64) -> f64 {
    wavelength_m * perimeter_m / (4.0 * shape.area_m2(perimeter_m)) * ARCSEC_PER_RAD
}

/// Beat frequency Δν = 4AΩ/(λL), Hz, at a rate in arcsec/s. Without lock-in.
pub fn beat_hz(shape: RingShape, perimeter_m: f64, wavelength_m: f64, rate_dph: f64) -> f64 {
    rate_dph / arcsec_per_fringe(shape, perimeter_m, wavelength_m)
}

/// Free spectral range c/L, Hz.
pub fn free_spectral_range_hz(perimeter_m: f64) -> f64 {
    C_M_PER_S / perimeter_m
}

/// Relative gain of a Gaussian line at a detuning, exp(−4 ln2·x²); x in full widths at half maximum.
pub fn gain_line(detuning: f64) -> f64 {
    libm::exp(-4.0 * std::f64::consts::LN_2 * detuning * detuning)
}

/// Mode number: wavelengths in one round trip.
pub fn mode_number(perimeter_m: f64, wavelength_m: f64) -> f64 {
    libm::round(perimeter_m / wavelength_m)
}

/// Adler's mean rate: Ω·√(1 − (Ω_L/Ω)²) outside the dead band, 0 inside. For a constant rate without dither.
pub fn adler_mean_dph(rate_dph: f64, lock_in_dph: f64) -> f64 {
    let outside = rate_dph * rate_dph - lock_in_dph * lock_in_dph;
    if outside > 0.0 { libm::copysign(libm::sqrt(outside), rate_dph) } else { 0.0 }
}

/// Angle random walk of a dithered gyro, Ω_L/√(K·Ω_D) with K = 2π/S and Ω_D = 2πf·θ, in °/√h.
///
/// Each turning point of the dither adds an angle of random sign; the walk is their sum. Valid for K·θ ≫ 1 and small
/// contributions (KΩ_L ≪ √φ″), with enough dither noise to make successive contributions independent.
pub fn dithered_arw_deg_rt_h(lock_in_dph: f64, arcsec_per_fringe: f64, dither_hz: f64, dither_arcsec: f64) -> f64 {
    let k = TAU / arcsec_per_fringe;
    lock_in_dph / libm::sqrt(k * TAU * dither_hz * dither_arcsec) / ARCSEC_RT_S_PER_DEG_RT_H
}

/// Lock-in threshold from two backscatter amplitudes (fractions of the field per round trip) and their phases:
/// K·Ω_L = (c/L)·|r₁e^(−jε₁) + r₂e^(jε₂)|, arcsec/s. For equal intensities of both beams.
pub fn lock_in_dph(perimeter_m: f64, arcsec_per_fringe: f64, r: [f64; 2], epsilon_rad: [f64; 2]) -> f64 {
    let re = r[0] * libm::cos(epsilon_rad[0]) + r[1] * libm::cos(epsilon_rad[1]);
    let im = r[1] * libm::sin(epsilon_rad[1]) - r[0] * libm::sin(epsilon_rad[0]);
    free_spectral_range_hz(perimeter_m) * libm::hypot(re, im) * arcsec_per_fringe / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Domain notes §4 and the source paper (§1 there), to the printed digits.
    #[test]
    fn scale_factors_of_the_domain_notes() {
        let s = |shape, l| arcsec_per_fringe(shape, l, 0.63299e-6);
        assert!((s(RingShape::Triangle, 0.16) - 4.24).abs() < 0.005);
        assert!((s(RingShape::Triangle, 0.28) - 2.42).abs() < 0.005);
        assert!((s(RingShape::Square, 0.28) - 1.86).abs() < 0.006);
        let circle = beat_hz(RingShape::Circle, TAU * 0.1, 0.6333e-6, 10.0);
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
    fn inside_the_dead_band_the_rate_is_zero() {
        assert_eq!(adler_mean_dph(-99.0, 100.0), 0.0);
        assert!((adler_mean_dph(-1000.0, 100.0) + 1000.0 * (1.0 - 0.005 - 0.0000125)).abs() < 1e-3);
    }
}
