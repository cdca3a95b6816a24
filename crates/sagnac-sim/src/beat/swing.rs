//! Mechanical dither: a sine with a new amplitude for each half cycle.
//!
//! ```text
//! θ(t) = ±A_n·sin(ωt)        A_n = A·(1 + σ·normal), limited to A·(1 ± 3σ)
//! ```
//!
//! A_n is drawn at the zeros of θ, so the angle is continuous; its rate is not. Half cycles alternate in sign.
//!
//! The block's reaction on its case and coning are not modelled. A failed dither returns to zero at once.

use rand_chacha::ChaCha8Rng;

use crate::random::normal;

/// Amplitude of the dither and its noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swing {
    pub(crate) amplitude_arcsec: f64,
    /// Relative standard deviation of the amplitude.
    pub(crate) noise: f64,
}

/// The dither at the present instant.
#[derive(Clone, Debug)]
pub(crate) struct SwingState {
    omega: f64,
    /// Within this half cycle, 0 … π.
    phase: f64,
    /// Amplitude of this half cycle with its sign.
    signed_arcsec: f64,
    upward: bool,
    rng: ChaCha8Rng,
}

/// Part of one half cycle under a constant input rate: Φ(t) = k·A·sin(phase + ωt) + k·Ω·t, rad.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    pub(crate) amplitude: f64,
    pub(crate) omega: f64,
    pub(crate) phase: f64,
    pub(crate) rate: f64,
    pub(crate) length_s: f64,
}

/// Φ and its first four derivatives at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet {
    pub(crate) value: f64,
    pub(crate) first: f64,
    pub(crate) second: f64,
    pub(crate) third: f64,
    pub(crate) fourth: f64,
}

impl Stretch {
    #[inline]
    pub(crate) fn at(&self, t: f64) -> Jet {
        let (sin, cos) = libm::sincos(self.phase + self.omega * t);
        let (a, w) = (self.amplitude, self.omega);
        Jet {
            value: a * sin + self.rate * t,
            first: a * w * cos + self.rate,
            second: -a * w * w * sin,
            third: -a * w * w * w * cos,
            fourth: a * w * w * w * w * sin,
        }
    }
}

impl Jet {
    /// Φ after a short time h, to fourth order.
    #[inline]
    pub(crate) fn later(&self, h: f64) -> f64 {
        self.value + h * (self.first + h * (0.5 * self.second + h * (self.third / 6.0 + h * (self.fourth / 24.0))))
    }
}

impl Swing {
    /// Begins upward through 0; without frequency or amplitude the angle stays 0.
    pub(crate) fn start(&self, frequency_hz: f64, rng: ChaCha8Rng) -> SwingState {
        let omega = std::f64::consts::TAU * frequency_hz;
        let mut state = SwingState { omega, phase: 0.0, signed_arcsec: 0.0, upward: false, rng };
        self.turn(&mut state);
        state
    }

    /// Restarts a stopped dither, upward.
    pub(crate) fn restart(&self, state: &mut SwingState) {
        state.upward = false;
        self.turn(state);
    }

    /// The next half cycle.
    fn turn(&self, state: &mut SwingState) {
        state.upward = !state.upward;
        let random = if self.noise > 0.0 { normal(&mut state.rng).clamp(-3.0, 3.0) * self.noise } else { 0.0 };
        let sign = if state.upward { 1.0 } else { -1.0 };
        state.signed_arcsec = sign * self.amplitude_arcsec * (1.0 + random);
        state.phase = 0.0;
    }

    /// The stretch from now to the end of the half cycle, or of `most_s`; the dither moves to its end.
    pub(crate) fn stretch(&self, state: &mut SwingState, most_s: f64, k: f64, rate_dph: f64) -> Stretch {
        let mut length_s = most_s;
        let (phase, amplitude) = (state.phase, state.signed_arcsec);
        if state.omega > 0.0 {
            let to_turn = (std::f64::consts::PI - state.phase) / state.omega;
            if to_turn <= most_s {
                length_s = to_turn;
                self.turn(state);
            } else {
                state.phase += state.omega * most_s;
            }
        }
        Stretch { amplitude: k * amplitude, omega: state.omega, phase, rate: k * rate_dph, length_s }
    }
}

impl SwingState {
    pub(crate) fn tune(&mut self, frequency_hz: f64) {
        self.omega = std::f64::consts::TAU * frequency_hz;
    }

    /// The angle goes to 0 at once and stays there.
    pub(crate) fn stop(&mut self) {
        (self.omega, self.signed_arcsec, self.phase) = (0.0, 0.0, 0.0);
    }

    /// Present angle, arcsec.
    pub(crate) fn angle_arcsec(&self) -> f64 {
        self.signed_arcsec * libm::sin(self.phase)
    }
}
