//! Random numbers and the slow noise of the bias.
//!
//! Generator: ChaCha8 (`rand_chacha`), seeded with `seed_from_u64`, one of its streams per source, so that a source
//! that is switched off changes no other. Normal values: a ziggurat of 128 layers (Doornik 2005, "An improved ziggurat
//! method to generate normal random samples") on `libm`. Both give the same bytes on every machine; the normal generator of
//! `rand_distr` does not, because other crates of the program switch its `exp` and `ln` to those of the platform.
//!
//! ```text
//! flicker      Σ_k OU(σ, τ_k), τ_k = 2^k s, σ² = B²·ln 2/π        one-sided density B²/(πf) between the outer poles
//! rate random walk   b += K·√(1 s)·normal                        σ²(τ) = K²τ/3
//! ```
//!
//! Flicker: a sum of Ornstein-Uhlenbeck processes an octave apart has the density σ²/(ln 2·f); setting it to B²/(πf)
//! gives the flat Allan deviation (2 ln 2/π)^½·B = 0.664 B of IEEE Std 952. It is white below half a second and
//! constant beyond 2^19 s (6 days).

use std::sync::LazyLock;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

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

/// Layers of the ziggurat.
const LAYERS: usize = 128;
/// Where the tail begins, and the area of each layer.
const TAIL: f64 = 3.442_619_855_899;
const AREA: f64 = 9.912_563_035_262_17e-3;

/// Right edges of the layers, from the widest, which holds the tail, to 0.
static EDGES: LazyLock<[f64; LAYERS + 1]> = LazyLock::new(|| {
    let density = |x: f64| libm::exp(-0.5 * x * x);
    let mut edges = [0.0; LAYERS + 1];
    edges[0] = AREA / density(TAIL);
    edges[1] = TAIL;
    for layer in 2..LAYERS {
        let inside = edges[layer - 1];
        edges[layer] = libm::sqrt(-2.0 * libm::log(AREA / inside + density(inside)));
    }
    edges
});

/// A uniform value in (0, 1].
fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    ((rng.next_u64() >> 11) + 1) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A normal value.
#[inline]
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let edges = &*EDGES;
    loop {
        // Seven bits for the layer, 53 others for a place in −1 … 1.
        let bits = rng.next_u64();
        let layer = (bits & 0x7f) as usize;
        let u = (bits >> 11) as f64 * (2.0 / (1_u64 << 53) as f64) - 1.0;
        let x = u * edges[layer];
        if x.abs() < edges[layer + 1] {
            return x;
        }
        if let Some(x) = seldom(rng, layer, x) {
            return x;
        }
    }
}

/// The tail, and the slope beside each layer: one draw in seventy.
#[cold]
fn seldom(rng: &mut ChaCha8Rng, layer: usize, x: f64) -> Option<f64> {
    if layer == 0 {
        loop {
            let (a, b) = (-libm::log(uniform(rng)) / TAIL, -libm::log(uniform(rng)));
            if 2.0 * b > a * a {
                return Some(libm::copysign(TAIL + a, x));
            }
        }
    }
    let density = |x: f64| libm::exp(-0.5 * x * x);
    let (outer, inner) = (density(EDGES[layer]), density(EDGES[layer + 1]));
    (outer + uniform(rng) * (inner - outer) < density(x)).then_some(x)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments and tails of ten million draws against the normal distribution's own (libm's erfc), within five of
    /// their standard errors.
    #[test]
    fn normal_values_are_normal() {
        const N: usize = 10_000_000;
        let mut rng = generator(1, Stream::Walk);
        let (mut sums, mut beyond) = ([0.0; 4], [0_u32; 5]);
        let limits = [0.5, 1.0, 2.0, 3.0, 4.0];
        for _ in 0..N {
            let x = normal(&mut rng);
            let square = x * x;
            sums = [sums[0] + x, sums[1] + square, sums[2] + x * square, sums[3] + square * square];
            for (count, limit) in beyond.iter_mut().zip(limits) {
                *count += u32::from(x > limit);
            }
        }
        let n = N as f64;
        for (sum, (moment, variance)) in sums.iter().zip([(0.0, 1.0), (1.0, 2.0), (0.0, 15.0), (3.0, 96.0)]) {
            assert!((sum / n - moment).abs() < 5.0 * libm::sqrt(variance / n), "{} for {moment}", sum / n);
        }
        for (count, limit) in beyond.iter().zip(limits) {
            let wanted = 0.5 * libm::erfc(limit * std::f64::consts::FRAC_1_SQRT_2);
            let away = f64::from(*count) / n - wanted;
            assert!(away.abs() < 5.0 * libm::sqrt(wanted / n), "{limit}: {away} of {wanted}");
        }
    }
}
