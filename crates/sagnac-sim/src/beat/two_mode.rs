//! The semiclassical form: both modes with intensity and phase (Lamb, Aronowitz).
//!
//! ```text
//! İ₁ = (c/L)[α·I₁ − β·I₁² − θ·I₁I₂ + 2r₂√(I₁I₂)cos(ψ + ε₂)]        İ₂ with 1 ↔ 2, r₁, cos(ψ − ε₁)
//! ψ̇  = Φ̇ − (c/L)[r₁√(I₁/I₂) sin(ψ − ε₁) + r₂√(I₂/I₁) sin(ψ + ε₂)]
//! ```
//!
//! Integrated as complex amplitudes in the frame of the known phase Φ, E₁ = a, E₂ = b·e^(jΦ), which needs no square
//! root and no division:
//!
//! ```text
//! ȧ = (c/2L)(α − β|a|² − θ|b|²)·a + (c/L)·r₂e^(jε₂)·e^(jΦ)·b
//! ḃ = (c/2L)(α − β|b|² − θ|a|²)·b + (c/L)·r₁e^(jε₁)·e^(−jΦ)·a          ψ = Φ + arg b − arg a
//! ```
//!
//! Runge-Kutta of 4th order; per step at most 0.8 rad of Φ, half a lifetime of the intensity and half a radian of
//! backscatter. Both modes have the same gain (σ₁ = σ₂, τ₁₂ = τ₂₁): what makes them differ is the null shift of the
//! scenario. α is that of a cavity held on its peak at the nominal current. Where backscatter is as strong as what
//! keeps the modes apart (2r against the excess gain times (1 − θ/β)/(1 + θ/β)), one mode is put out and what is
//! left does not beat: the closed form of the lock-in is not true there.

use crate::beat::swing::{Jet, Stretch};

/// A complex number, as far as it is needed.
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

/// Constants per second and per intensity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoModeConstants {
    /// (c/2L)·α, the gain over the loss.
    pub(crate) gain: f64,
    /// (c/2L)·β.
    pub(crate) own: f64,
    /// (c/2L)·θ.
    pub(crate) cross: f64,
    /// (c/L)·r₁ and (c/L)·r₂.
    pub(crate) backscatter: [f64; 2],
    /// ε₁ and ε₂.
    pub(crate) epsilon: [f64; 2],
}

/// Both amplitudes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoMode {
    constants: TwoModeConstants,
    into_1: Complex,
    into_2: Complex,
    a: Complex,
    b: Complex,
    /// arg b − arg a, unwrapped: whole turns, and the product b·a* they were last seen with.
    turns: i64,
    product: Complex,
}

const PIECE_S: f64 = 1.25e-5;
const STEP_RAD: f64 = 0.8;
/// Steps in the time in which the intensities settle.
pub(crate) const STEPS_PER_LIFETIME: f64 = 4.0;

impl TwoMode {
    pub(crate) fn new(constants: TwoModeConstants, chi: f64) -> Self {
        let intensity = constants.gain / (constants.own + constants.cross);
        let size = libm::sqrt(intensity.max(0.0));
        let into = |index: usize| Complex::polar(constants.backscatter[index], constants.epsilon[index]);
        Self {
            into_2: into(0),
            into_1: into(1),
            a: Complex { re: size, im: 0.0 },
            b: Complex::polar(size, chi),
            turns: 0,
            product: Complex::polar(size * size, chi),
            constants,
        }
    }

    pub(crate) fn chi(&self) -> f64 {
        libm::atan2(self.product.im, self.product.re) + std::f64::consts::TAU * self.turns as f64
    }

    /// Intensities of both modes.
    pub(crate) fn intensities(&self) -> [f64; 2] {
        [self.a.square(), self.b.square()]
    }

    /// Through a stretch; Φ begins at `base`.
    pub(crate) fn go(&mut self, stretch: &Stretch, base: f64) {
        let pieces = libm::ceil(stretch.length_s / PIECE_S).max(1.0);
        let length = stretch.length_s / pieces;
        let mut from = stretch.at(0.0);
        for piece in 1..=pieces as u32 {
            let to = stretch.at(length * f64::from(piece));
            self.steps(&from, &to, base, length);
            from = to;
        }
    }

    /// Counts passages of the negative real axis; a step turns by less than half of a half turn.
    #[inline]
    fn unwrap(&mut self) {
        let product = self.b.times(self.a.conjugate());
        let was = self.product;
        if product.re < 0.0 && (product.im < 0.0) != (was.im < 0.0) {
            self.turns += if was.im < 0.0 { -1 } else { 1 };
        }
        self.product = product;
    }

    fn steps(&mut self, from: &Jet, to: &Jet, base: f64, length: f64) {
        let c = &self.constants;
        let back = 2.0 * (c.backscatter[0] + c.backscatter[1]);
        let fastest = (from.first.abs().max(to.first.abs()) / STEP_RAD).max(STEPS_PER_LIFETIME * c.gain).max(back);
        let count = libm::ceil(fastest * length).max(1.0);
        let h = length / count;
        let mut phase = Complex::polar(1.0, base + from.value);
        for step in 0..count as u32 {
            let t = h * f64::from(step);
            let middle = Complex::polar(1.0, base + from.later(t + 0.5 * h));
            let end = Complex::polar(1.0, base + from.later(t + h));
            self.step(h, phase, middle, end);
            self.unwrap();
            phase = end;
        }
    }

    #[inline]
    fn step(&mut self, h: f64, start: Complex, middle: Complex, end: Complex) {
        let (a, b) = (self.a, self.b);
        let (a1, b1) = self.slope(a, b, start);
        let (a2, b2) = self.slope(a.plus(0.5 * h, a1), b.plus(0.5 * h, b1), middle);
        let (a3, b3) = self.slope(a.plus(0.5 * h, a2), b.plus(0.5 * h, b2), middle);
        let (a4, b4) = self.slope(a.plus(h, a3), b.plus(h, b3), end);
        let sum = |k: [Complex; 4]| Complex::ZERO.plus(1.0, k[0]).plus(2.0, k[1]).plus(2.0, k[2]).plus(1.0, k[3]);
        self.a = a.plus(h / 6.0, sum([a1, a2, a3, a4]));
        self.b = b.plus(h / 6.0, sum([b1, b2, b3, b4]));
    }

    #[inline]
    fn slope(&self, a: Complex, b: Complex, phase: Complex) -> (Complex, Complex) {
        let c = &self.constants;
        let (one, two) = (a.square(), b.square());
        let (of_a, of_b) = (c.gain - c.own * one - c.cross * two, c.gain - c.own * two - c.cross * one);
        let into_a = self.into_1.times(phase).times(b);
        let into_b = self.into_2.times(phase.conjugate()).times(a);
        (into_a.plus(of_a, a), into_b.plus(of_b, b))
    }
}
