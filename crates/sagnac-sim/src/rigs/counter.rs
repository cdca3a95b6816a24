//! A counter of angle with angle random walk: n = ⌊∫Ω dt/S⌋, differenced. Counts are exact; none are lost.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::physics::ARCSEC_RT_S_PER_DEG_RT_H;

/// Accumulates angle and white noise; returns whole counts.
pub(crate) struct RigCounter {
    rng: ChaCha8Rng,
    arw_arcsec_rt_s: f64,
    /// Angle so far, counts.
    total: f64,
    /// Whole counts returned so far.
    returned: f64,
}

impl RigCounter {
    pub(crate) fn new(seed: u64, arw_deg_rt_h: f64) -> Self {
        let arw_arcsec_rt_s = arw_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        Self { rng: ChaCha8Rng::seed_from_u64(seed), arw_arcsec_rt_s, total: 0.0, returned: 0.0 }
    }

    /// Counts during `dt_s` at a mean rate in °/h, with `arcsec` per count.
    pub(crate) fn count(&mut self, rate_dph: f64, dt_s: f64, arcsec: f64) -> f64 {
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        let angle = rate_dph * dt_s + self.arw_arcsec_rt_s * libm::sqrt(dt_s) * noise;
        self.total += angle / arcsec;
        let counts = libm::floor(self.total) - self.returned;
        self.returned += counts;
        counts
    }
}
