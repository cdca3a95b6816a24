//! Random numbers and the slow noise of the bias.
//!
//! Generator: ChaCha8 (`rand_chacha`), seeded with `seed_from_u64`, one of its streams per source, so that a source
//! that is switched off changes no other. Normal values: the ziggurat of `rand_distr` on `libm`. Both give the same
//! bytes on every machine.
//!
//! ```text
//! flicker      Σ_k OU(σ, τ_k), τ_k = 2^k s, σ² = B²·ln 2/π        one-sided density B²/(πf) between the outer poles
//! rate random walk   b += K·√(1 s)·normal                        σ²(τ) = K²τ/3
//! ```
//!
//! Flicker: a sum of Ornstein-Uhlenbeck processes an octave apart has the density σ²/(ln 2·f); setting it to B²/(πf)
//! gives the flat Allan deviation (2 ln 2/π)^½·B = 0.664 B of IEEE Std 952. It is white below half a second and
//! constant beyond 2^19 s (6 days).

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scenario::tables::Noise;

/// Sources of random numbers; the number of a stream never changes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stream {
    Walk = 1,
    Thermometer = 2,
    Flicker = 3,
    RateWalk = 4,
    Dither = 5,
    Light = 6,
    Pickoff = 7,
    Fault = 8,
}

/// The generator of a source.
pub(crate) fn generator(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    rng
}

/// A normal value.
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Octaves of flicker: poles at 1 s to 2^19 s.
const OCTAVES: usize = 20;

/// The slow noise of the bias, a step a second.
#[derive(Clone, Debug)]
pub(crate) struct SlowNoise {
    flicker: [f64; OCTAVES],
    /// Decay of a second and what keeps the variance.
    decays: [(f64, f64); OCTAVES],
    instability: f64,
    walk_step: f64,
    walk: f64,
    ramp_dph_s: f64,
    flicker_rng: ChaCha8Rng,
    walk_rng: ChaCha8Rng,
}

impl SlowNoise {
    pub(crate) fn new(noise: &Noise, seed: u64) -> Self {
        let sigma = noise.bias_instability_dph * libm::sqrt(std::f64::consts::LN_2 / std::f64::consts::PI);
        let decays = std::array::from_fn(|k| {
            let keep = libm::exp(-libm::exp2(-(k as f64)));
            (keep, sigma * libm::sqrt(1.0 - keep * keep))
        });
        let mut flicker_rng = generator(seed, Stream::Flicker);
        let flicker = std::array::from_fn(|_| sigma * normal(&mut flicker_rng));
        Self {
            flicker,
            decays,
            instability: noise.bias_instability_dph,
            walk_step: noise.rate_random_walk_dph_rt_h / 60.0,
            walk: 0.0,
            ramp_dph_s: noise.rate_ramp_dph_h / 3600.0,
            flicker_rng,
            walk_rng: generator(seed, Stream::RateWalk),
        }
    }

    /// Flicker, rate random walk and ramp of the second that ends at a time, °/h.
    pub(crate) fn second(&mut self, end_s: f64) -> [f64; 3] {
        let mut flicker = 0.0;
        if self.instability > 0.0 {
            for (value, (keep, step)) in self.flicker.iter_mut().zip(&self.decays) {
                *value = *value * keep + step * normal(&mut self.flicker_rng);
                flicker += *value;
            }
        }
        if self.walk_step > 0.0 {
            self.walk += self.walk_step * normal(&mut self.walk_rng);
        }
        [flicker, self.walk, self.ramp_dph_s * end_s]
    }
}
