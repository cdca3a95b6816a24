//! The reduced form: one equation for the phase of the beat (Adler 1946).
//!
//! ```text
//! ψ = Φ(t) + χ        χ̇ = −ε·sin(Φ + χ)        ε = K·Ω_L, g = Φ̇
//! |g| large:  χ_b = χ_a + [ε·cos ψ/g + ε·g′·sin ψ/g³ + ε²·sin 2ψ/(4g²)] − (ε²/2)·∫dt/g
//! else:       Runge-Kutta of 4th order in steps of at most 0.4 rad of ψ
//! ```
//!
//! Φ is the phase from dither and input alone. It is known in closed form, so only the slow χ is integrated.
//!
//! Far from the turning points of the dither the right side oscillates fast. Its integral is then given by its ends:
//! integration by parts in ψ. The next term of that expansion is 3ε·g′²/g⁵, kept below 1e-4 rad by |g| > 4.5·√|g′|.
//! The last term kept is the scale-factor error −½(Ω_L/Ω)². Only near the turning points are steps needed.
//!
//! One backscatter constant; the intensities do not respond.

use crate::beat::swing::{Jet, Stretch};

/// Coupling of the two beams, ε = K·Ω_L, rad/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Adler {
    pub(crate) epsilon: f64,
}

/// Longest piece of a stretch that is integrated at once, s.
const PIECE_S: f64 = 1.25e-5;
/// |g| over √|g′| beyond which the integral is given by its ends.
const FAR: f64 = 4.5;
/// |g| over ε beyond which second order in ε suffices.
const STRONG: f64 = 30.0;
/// Largest Runge-Kutta step, rad.
const STEP_RAD: f64 = 0.4;

impl Adler {
    /// Advances χ over a stretch; Φ begins at `base`.
    pub(crate) fn advance(&self, chi: &mut f64, stretch: &Stretch, base: f64) {
        let (a, b) = (stretch.at(0.0), stretch.at(stretch.length_s));
        if self.is_far(&a, &b, stretch) {
            self.by_ends(chi, &a, &b, base, stretch.length_s);
            return;
        }
        let pieces = libm::ceil(stretch.length_s / PIECE_S).max(1.0);
        let length = stretch.length_s / pieces;
        let mut from = a;
        for piece in 1..=pieces as u32 {
            let to = stretch.at(length * f64::from(piece));
            if self.is_far(&from, &to, stretch) {
                self.by_ends(chi, &from, &to, base, length);
            } else {
                self.by_steps(chi, &from, &to, base, length);
            }
            from = to;
        }
    }

    /// Whether the fast phase keeps its direction and stays fast enough between two points.
    fn is_far(&self, a: &Jet, b: &Jet, stretch: &Stretch) -> bool {
        let slowest = a.first.abs().min(b.first.abs());
        let bend = a.second.abs().max(b.second.abs());
        // g is monotonic within a half cycle, so one sign at both ends is one sign between them.
        a.first * b.first > 0.0
            && slowest * slowest > FAR * FAR * bend
            && slowest > STRONG * self.epsilon
            && stretch.omega * stretch.length_s < 1.0
    }

    fn by_ends(&self, chi: &mut f64, a: &Jet, b: &Jet, base: f64, length: f64) {
        let e = self.epsilon;
        let end = |jet: &Jet, psi: f64| {
            let (sin, cos) = libm::sincos(psi);
            let inverse = 1.0 / jet.first;
            let value = e * inverse * (cos + sin * inverse * (jet.second * inverse + 0.5 * e * cos));
            // Its derivative with ψ, for the one correction below.
            (value, -e * inverse * sin)
        };
        let middle = 0.5 * (a.first + b.first);
        // Simpson's rule; in the middle g is near its chord.
        let secular = -0.5 * e * e * length * (1.0 / a.first + 4.0 / middle + 1.0 / b.first) / 6.0;
        let (start, _) = end(a, base + a.value + *chi);
        let (finish, slope) = end(b, base + b.value + *chi);
        let change = finish - start + secular;
        *chi += change * (1.0 + slope);
    }

    fn by_steps(&self, chi: &mut f64, a: &Jet, b: &Jet, base: f64, length: f64) {
        let fastest = a.first.abs().max(b.first.abs()) + self.epsilon;
        let count = libm::ceil(fastest * length / STEP_RAD).max(1.0);
        let h = length / count;
        let e = self.epsilon;
        let slope = |t: f64, chi: f64| -e * libm::sin(base + a.later(t) + chi);
        for step in 0..count as u32 {
            let t = h * f64::from(step);
            let k1 = slope(t, *chi);
            let k2 = slope(t + 0.5 * h, *chi + 0.5 * h * k1);
            let k3 = slope(t + 0.5 * h, *chi + 0.5 * h * k2);
            let k4 = slope(t + h, *chi + h * k3);
            *chi += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
        }
    }
}
