//! A gyro at rest at one temperature: the five noise terms of IEEE Std 952, one row per second.
//!
//! ```text
//! angle = ∫(flicker + rate walk + ramp) dt + N·√dt·normal + q[n] − q[n−1]        q: white, σ = Q
//! ```
//!
//! No mean rate, no lock-in, no counting: angles are real numbers.

use crate::noise::SlowNoise;
use crate::physics::ARCSEC_RT_S_PER_DEG_RT_H;
use crate::random::{Stream, generator, normal};
use crate::scenario::NoiseConfig;

/// A gyro at rest with a known noise.
#[derive(Clone, Debug, Default)]
pub struct Resting {
    /// Angle random walk, bias instability, rate random walk and rate ramp.
    pub noise: NoiseConfig,
    /// Quantization Q, arcsec: standard deviation of white noise on the angle at the end of each second.
    pub q_arcsec: f64,
}

impl Resting {
    /// Angle increment of each second, arcsec.
    pub fn angles(&self, seconds: usize, seed: u64) -> Vec<f64> {
        let slow = SlowNoise::build(&self.noise);
        let mut slow_state = slow.start(seed);
        let (mut walk, mut pickoff) = (generator(seed, Stream::Walk), generator(seed, Stream::Pickoff));
        let walk_arcsec = ARCSEC_RT_S_PER_DEG_RT_H * self.noise.arw_deg_rt_h;
        let mut last = 0.0;
        let angles = (1..=seconds).map(|second| {
            // 1 °/h is 1 arcsec/s.
            let rate: f64 = slow.second(&mut slow_state, second as f64).iter().sum();
            let read = self.q_arcsec * normal(&mut pickoff);
            let angle = rate + walk_arcsec * normal(&mut walk) + read - last;
            last = read;
            angle
        });
        angles.collect()
    }
}
