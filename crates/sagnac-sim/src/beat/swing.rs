//! Mechanical dither: a sine whose amplitude is new at each swing.
//!
//! θ(t) = A_n·sin(ωt), A_n drawn anew where θ = 0, so that the angle never jumps. A_n = A·(1 + σ·normal), held
//! between 1 − 3σ and 1 + 3σ, every swing with the other sign.

use rand_chacha::ChaCha8Rng;

use crate::noise::normal;

/// The block's swing.
#[derive(Clone, Debug)]
pub(crate) struct Swing {
    amplitude_arcsec: f64,
    noise: f64,
    omega: f64,
    /// In 0 … π within this swing.
    phase: f64,
    /// Amplitude of this swing with its sign.
    now_arcsec: f64,
    upward: bool,
    rng: ChaCha8Rng,
}

/// A stretch of one swing under a constant input rate: Φ(t) = k·A·sin(phase + ωt) + k·Ω·t, rad.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    pub(crate) amplitude: f64,
    pub(crate) omega: f64,
    pub(crate) phase: f64,
    pub(crate) rate: f64,
    pub(crate) length_s: f64,
}

/// Φ and its first derivatives at a time.
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
    /// Φ a little later, to fourth order.
    #[inline]
    pub(crate) fn later(&self, h: f64) -> f64 {
        self.value + h * (self.first + h * (0.5 * self.second + h * (self.third / 6.0 + h * (self.fourth / 24.0))))
    }
}

impl Swing {
    /// A swing that begins upward through 0; without frequency or amplitude it stays there.
    pub(crate) fn new(frequency_hz: f64, amplitude_arcsec: f64, noise: f64, rng: ChaCha8Rng) -> Self {
        let mut swing = Self {
            amplitude_arcsec,
            noise,
            omega: std::f64::consts::TAU * frequency_hz,
            phase: 0.0,
            now_arcsec: 0.0,
            upward: false,
            rng,
        };
        swing.turn();
        swing
    }

    pub(crate) fn tune(&mut self, frequency_hz: f64) {
        self.omega = std::f64::consts::TAU * frequency_hz;
    }

    /// Stops: the angle goes to 0 at once and stays.
    pub(crate) fn stop(&mut self) {
        (self.omega, self.now_arcsec, self.phase) = (0.0, 0.0, 0.0);
    }

    /// Begins a swing, upward, from the 0 at which it stopped.
    pub(crate) fn restart(&mut self) {
        self.upward = false;
        self.turn();
    }

    fn turn(&mut self) {
        self.upward = !self.upward;
        let random = if self.noise > 0.0 { normal(&mut self.rng).clamp(-3.0, 3.0) * self.noise } else { 0.0 };
        let sign = if self.upward { 1.0 } else { -1.0 };
        self.now_arcsec = sign * self.amplitude_arcsec * (1.0 + random);
        self.phase = 0.0;
    }

    /// Angle now, arcsec.
    pub(crate) fn angle_arcsec(&self) -> f64 {
        self.now_arcsec * libm::sin(self.phase)
    }

    /// The stretch from now to the end of the swing or of `left_s`, and moves there.
    pub(crate) fn stretch(&mut self, left_s: f64, k: f64, rate_dph: f64) -> Stretch {
        let mut length_s = left_s;
        let (phase, amplitude) = (self.phase, self.now_arcsec);
        if self.omega > 0.0 {
            let to_turn = (std::f64::consts::PI - self.phase) / self.omega;
            if to_turn <= left_s {
                length_s = to_turn;
                self.turn();
            } else {
                self.phase += self.omega * left_s;
            }
        }
        Stretch { amplitude: k * amplitude, omega: self.omega, phase, rate: k * rate_dph, length_s }
    }
}
