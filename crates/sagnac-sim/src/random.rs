//! Random numbers: one stream per noise source, the same values on every machine.
//!
//! The generator is ChaCha8 (`rand_chacha`, `seed_from_u64`). Each [`Stream`] is a stream of its own, so switching one
//! noise off does not change any other.
//!
//! Normal values come from a ziggurat of 128 layers (J. Doornik 2005, "An improved ziggurat method to generate normal
//! random samples") on the functions of `libm`. The normal generator of `rand_distr` is not reproducible: other crates of
//! the program switch its `exp` and `ln` to those of the platform, which differ between machines.
//!
//! Resolution: 53 bits. The tail ends near 12 sigma, where the smallest uniform value is reached.

use std::sync::LazyLock;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Noise sources. Numbers of streams never change: the bytes of a simulated log depend on them.
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
    Lot = 9,
    Unit = 10,
}

/// The generator of a stream.
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

/// A uniform value in [0, 1), from the upper 53 bits.
pub(crate) fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A uniform value in (0, 1], for a logarithm.
fn uniform_above_0(rng: &mut ChaCha8Rng) -> f64 {
    ((rng.next_u64() >> 11) + 1) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A standard normal value.
#[inline]
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let edges = &*EDGES;
    loop {
        // Seven bits select the layer; 53 others give a position in −1 … 1.
        let bits = rng.next_u64();
        let layer = (bits & 0x7f) as usize;
        let u = (bits >> 11) as f64 * (2.0 / (1_u64 << 53) as f64) - 1.0;
        let x = u * edges[layer];
        if x.abs() < edges[layer + 1] {
            return x;
        }
        if let Some(x) = outside_the_core(rng, layer, x) {
            return x;
        }
    }
}

/// The tail, and the wedge next to each layer: one draw in seventy.
#[cold]
fn outside_the_core(rng: &mut ChaCha8Rng, layer: usize, x: f64) -> Option<f64> {
    if layer == 0 {
        loop {
            let (a, b) = (-libm::log(uniform_above_0(rng)) / TAIL, -libm::log(uniform_above_0(rng)));
            if 2.0 * b > a * a {
                return Some(libm::copysign(TAIL + a, x));
            }
        }
    }
    let density = |x: f64| libm::exp(-0.5 * x * x);
    let (outer, inner) = (density(EDGES[layer]), density(EDGES[layer + 1]));
    (outer + uniform_above_0(rng) * (inner - outer) < density(x)).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments and tails of ten million draws against the normal distribution (libm's erfc), within five standard
    /// errors.
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
