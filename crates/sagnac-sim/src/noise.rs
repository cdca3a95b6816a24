//! Slow noise of the bias: flicker, rate random walk and rate ramp, in steps of one second.
//!
//! ```text
//! flicker            Σ_k OU(σ, τ_k), τ_k = 2^k s, σ² = B²·ln 2/π    one-sided density B²/(πf)
//! rate random walk   b += K·√(1 s)·normal                           σ²(τ) = K²τ/3
//! rate ramp          R·t
//! ```
//!
//! Flicker is a sum of Ornstein-Uhlenbeck processes an octave apart. Its density is σ²/(ln 2·f); equating that to
//! B²/(πf) gives the flat Allan deviation (2 ln 2/π)^½·B = 0.664 B of IEEE Std 952.
//!
//! Valid between the outer poles: the sum is white below half a second and constant beyond 2^19 s (6 days). White
//! angle noise is added per row by the gyro, not here.

use rand_chacha::ChaCha8Rng;

use crate::random::{Stream, generator, normal};
use crate::scenario::NoiseConfig;

/// Octaves of flicker: poles at 1 s to 2^19 s.
const OCTAVES: usize = 20;

/// Coefficients of the slow noise.
#[derive(Clone, Debug)]
pub(crate) struct SlowNoise {
    /// Standard deviation of each flicker process, °/h.
    sigma_dph: f64,
    /// Decay over a second, and the step that keeps the variance.
    decays: [(f64, f64); OCTAVES],
    instability_dph: f64,
    walk_step_dph: f64,
    ramp_dph_per_s: f64,
}

/// The flicker processes and the walk at the present second.
#[derive(Clone, Debug)]
pub(crate) struct SlowNoiseState {
    flicker: [f64; OCTAVES],
    walk: f64,
    flicker_rng: ChaCha8Rng,
    walk_rng: ChaCha8Rng,
}

impl SlowNoise {
    pub(crate) fn build(noise: &NoiseConfig) -> Self {
        let sigma_dph = noise.bias_instability_dph * libm::sqrt(std::f64::consts::LN_2 / std::f64::consts::PI);
        let decays = std::array::from_fn(|k| {
            let keep = libm::exp(-libm::exp2(-(k as f64)));
            (keep, sigma_dph * libm::sqrt(1.0 - keep * keep))
        });
        Self {
            sigma_dph,
            decays,
            instability_dph: noise.bias_instability_dph,
            walk_step_dph: noise.rate_random_walk_dph_rt_h / 60.0,
            ramp_dph_per_s: noise.rate_ramp_dph_h / 3600.0,
        }
    }

    /// Stationary flicker and a walk at zero.
    pub(crate) fn start(&self, seed: u64) -> SlowNoiseState {
        let mut flicker_rng = generator(seed, Stream::Flicker);
        let flicker = std::array::from_fn(|_| self.sigma_dph * normal(&mut flicker_rng));
        SlowNoiseState { flicker, walk: 0.0, flicker_rng, walk_rng: generator(seed, Stream::RateWalk) }
    }

    /// Flicker, rate random walk and ramp of the second that ends at `end_s`, °/h.
    pub(crate) fn second(&self, state: &mut SlowNoiseState, end_s: f64) -> [f64; 3] {
        let mut flicker = 0.0;
        if self.instability_dph > 0.0 {
            for (value, (keep, step)) in state.flicker.iter_mut().zip(&self.decays) {
                *value = *value * keep + step * normal(&mut state.flicker_rng);
                flicker += *value;
            }
        }
        if self.walk_step_dph > 0.0 {
            state.walk += self.walk_step_dph * normal(&mut state.walk_rng);
        }
        [flicker, state.walk, self.ramp_dph_per_s * end_s]
    }
}
