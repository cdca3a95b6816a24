//! The semiclassical form: intensity and phase of both modes (Lamb, Aronowitz).
//!
//! ```text
//! İ₁ = (c/L)[α·I₁ − β·I₁² − θ·I₁I₂ + 2r₂√(I₁I₂)cos(ψ + ε₂)]        İ₂ with 1 ↔ 2, r₁, cos(ψ − ε₁)
//! ψ̇  = Φ̇ − (c/L)[r₁√(I₁/I₂) sin(ψ − ε₁) + r₂√(I₂/I₁) sin(ψ + ε₂)]
//! ```
//!
//! Integrated as complex amplitudes in the frame of the known phase Φ, E₁ = a, E₂ = b·e^(jΦ). That needs no square
//! root and no division:
//!
//! ```text
//! ȧ = (c/2L)(α − β|a|² − θ|b|²)·a + (c/L)·r₂e^(jε₂)·e^(jΦ)·b
//! ḃ = (c/2L)(α − β|b|² − θ|a|²)·b + (c/L)·r₁e^(jε₁)·e^(−jΦ)·a          ψ = Φ + arg b − arg a
//! ```
//!
//! Runge-Kutta of 4th order. A step is at most 0.8 rad of Φ, half a lifetime of the intensity and half a radian of
//! backscatter.
//!
//! Both modes have the same gain (σ₁ = σ₂, τ₁₂ = τ₂₁); the null shift of the scenario accounts for their difference. α
//! is that of a cavity held on its peak at the nominal current. No multimode operation, no spatial hole burning.
//!
//! Where it fails: backscatter as strong as the coupling that separates the modes (2r against the excess gain times
//! (1 − θ/β)/(1 + θ/β)) suppresses one mode. The rest does not beat, and the closed form of the lock-in does not apply.

use crate::beat::swing::{Jet, Stretch};
use crate::physics::free_spectral_range_hz;
use crate::scenario::Scenario;

/// A complex number with the few operations needed here.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    const ZERO: Self = Self { re: 0.0, im: 0.0 };

    fn polar(size: f64, angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self { re: size * cos, im: size * sin }
    }

    #[inline]
    fn square(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    #[inline]
    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    #[inline]
    fn plus(self, part: f64, other: Self) -> Self {
        Self { re: self.re + part * other.re, im: self.im + part * other.im }
    }

    fn conjugate(self) -> Self {
        Self { re: self.re, im: -self.im }
    }
}

/// Coefficients, per second and in units of the intensity at rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoMode {
    /// (c/2L)·α, net gain.
    gain: f64,
    /// (c/2L)·β, self saturation.
    own: f64,
    /// (c/2L)·θ, cross saturation.
    cross: f64,
    /// (c/L)·r₁ and (c/L)·r₂.
    backscatter: [f64; 2],
    /// Backscatter into each mode, (c/L)·r·e^(jε).
    into_1: Complex,
    into_2: Complex,
}

/// Both amplitudes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoModeState {
    a: Complex,
    b: Complex,
    /// arg b − arg a, unwrapped: whole turns, and the latest product b·a*.
    turns: i64,
    product: Complex,
}

/// Longest piece of a stretch over which Φ is a polynomial, s.
const PIECE_S: f64 = 1.25e-5;
/// Largest step, rad of Φ.
const STEP_RAD: f64 = 0.8;
/// Steps in 1/gain, the settling time of the amplitudes.
const STEPS_PER_LIFETIME: f64 = 4.0;

impl TwoMode {
    /// The coefficients of a scenario. In units of the intensity at rest α = β + θ.
    pub(crate) fn build(scenario: &Scenario) -> Self {
        let cavity = &scenario.cavity;
        let fsr = free_spectral_range_hz(scenario.geometry.perimeter_m);
        let gain = 0.5 * fsr * cavity.loss_ppm * 1e-6 * (cavity.gain_ratio - 1.0);
        let own = gain / (1.0 + cavity.cross_saturation);
        let backscatter = [cavity.backscatter_1_ppm, cavity.backscatter_2_ppm].map(|ppm| fsr * ppm * 1e-6);
        let epsilon = [cavity.backscatter_phase_1_deg, cavity.backscatter_phase_2_deg].map(f64::to_radians);
        Self {
            gain,
            own,
            cross: own * cavity.cross_saturation,
            backscatter,
            into_2: Complex::polar(backscatter[0], epsilon[0]),
            into_1: Complex::polar(backscatter[1], epsilon[1]),
        }
    }

    /// Integration steps that a time needs at least, for the intensities.
    pub(crate) fn least_steps(&self, time_s: f64) -> f64 {
        STEPS_PER_LIFETIME * self.gain * time_s
    }

    /// Both modes at the intensity without backscatter.
    pub(crate) fn start(&self, chi: f64) -> TwoModeState {
        let intensity = self.gain / (self.own + self.cross);
        let size = libm::sqrt(intensity.max(0.0));
        TwoModeState {
            a: Complex { re: size, im: 0.0 },
            b: Complex::polar(size, chi),
            turns: 0,
            product: Complex::polar(size * size, chi),
        }
    }

    /// Advances over a stretch; Φ begins at `base`.
    pub(crate) fn advance(&self, state: &mut TwoModeState, stretch: &Stretch, base: f64) {
        let pieces = libm::ceil(stretch.length_s / PIECE_S).max(1.0);
        let length = stretch.length_s / pieces;
        let mut from = stretch.at(0.0);
        for piece in 1..=pieces as u32 {
            let to = stretch.at(length * f64::from(piece));
            self.steps(state, &from, &to, base, length);
            from = to;
        }
    }

    fn steps(&self, state: &mut TwoModeState, from: &Jet, to: &Jet, base: f64, length: f64) {
        let back = 2.0 * (self.backscatter[0] + self.backscatter[1]);
        let fastest = (from.first.abs().max(to.first.abs()) / STEP_RAD).max(STEPS_PER_LIFETIME * self.gain).max(back);
        let count = libm::ceil(fastest * length).max(1.0);
        let h = length / count;
        let mut phase = Complex::polar(1.0, base + from.value);
        for step in 0..count as u32 {
            let t = h * f64::from(step);
            let middle = Complex::polar(1.0, base + from.later(t + 0.5 * h));
            let end = Complex::polar(1.0, base + from.later(t + h));
            self.step(state, h, [phase, middle, end]);
            state.unwrap();
            phase = end;
        }
    }

    /// One Runge-Kutta step, with e^(jΦ) at its start, middle and end.
    #[inline]
    fn step(&self, state: &mut TwoModeState, h: f64, [start, middle, end]: [Complex; 3]) {
        let (a, b) = (state.a, state.b);
        let (a1, b1) = self.slope(a, b, start);
        let (a2, b2) = self.slope(a.plus(0.5 * h, a1), b.plus(0.5 * h, b1), middle);
        let (a3, b3) = self.slope(a.plus(0.5 * h, a2), b.plus(0.5 * h, b2), middle);
        let (a4, b4) = self.slope(a.plus(h, a3), b.plus(h, b3), end);
        let sum = |k: [Complex; 4]| Complex::ZERO.plus(1.0, k[0]).plus(2.0, k[1]).plus(2.0, k[2]).plus(1.0, k[3]);
        state.a = a.plus(h / 6.0, sum([a1, a2, a3, a4]));
        state.b = b.plus(h / 6.0, sum([b1, b2, b3, b4]));
    }

    #[inline]
    fn slope(&self, a: Complex, b: Complex, phase: Complex) -> (Complex, Complex) {
        let (one, two) = (a.square(), b.square());
        let of_a = self.gain - self.own * one - self.cross * two;
        let of_b = self.gain - self.own * two - self.cross * one;
        let into_a = self.into_1.times(phase).times(b);
        let into_b = self.into_2.times(phase.conjugate()).times(a);
        (into_a.plus(of_a, a), into_b.plus(of_b, b))
    }
}

impl TwoModeState {
    /// arg b − arg a, rad.
    pub(crate) fn chi(&self) -> f64 {
        libm::atan2(self.product.im, self.product.re) + std::f64::consts::TAU * self.turns as f64
    }

    /// Intensities of both modes.
    pub(crate) fn intensities(&self) -> [f64; 2] {
        [self.a.square(), self.b.square()]
    }

    /// Counts crossings of the negative real axis; a step turns by less than a quarter turn.
    #[inline]
    fn unwrap(&mut self) {
        let product = self.b.times(self.a.conjugate());
        let was = self.product;
        if product.re < 0.0 && (product.im < 0.0) != (was.im < 0.0) {
            self.turns += if was.im < 0.0 { -1 } else { 1 };
        }
        self.product = product;
    }
}
