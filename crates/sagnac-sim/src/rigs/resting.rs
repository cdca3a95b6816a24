//! A gyro at rest at one temperature: nothing but the five terms of its noise, a row a second.

use crate::noise::{SlowNoise, Stream, generator, normal};
use crate::scenario::tables::Noise;

/// The noise of a gyro at rest.
#[derive(Clone, Debug, Default)]
pub struct Resting {
    /// Angle random walk, bias instability, rate random walk and rate ramp.
    pub noise: Noise,
    /// Quantization, arcsec: white, of this σ, on the angle at the end of each second.
    pub q_arcsec: f64,
}

impl Resting {
    /// Angle of each second, arcsec.
    pub fn angles(&self, seconds: usize, seed: u64) -> Vec<f64> {
        let mut slow = SlowNoise::new(&self.noise, seed);
        let (mut walk, mut pickoff) = (generator(seed, Stream::Walk), generator(seed, Stream::Pickoff));
        let walk_arcsec = 60.0 * self.noise.arw_deg_rt_h;
        let mut last = 0.0;
        let angles = (1..=seconds).map(|second| {
            // 1 °/h is 1 arcsec/s.
            let rate: f64 = slow.second(second as f64).iter().sum();
            let read = self.q_arcsec * normal(&mut pickoff);
            let angle = rate + walk_arcsec * normal(&mut walk) + read - last;
            last = read;
            angle
        });
        angles.collect()
    }
}
