//! An angle that accumulates and is counted.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// arcsec/√s in one °/√h.
const ARCSEC_RT_S_PER_DEG_RT_H: f64 = 60.0;

/// Accumulates angle with angle random walk; gives whole quanta.
pub(crate) struct Counter {
    rng: ChaCha8Rng,
    arw_arcsec_rt_s: f64,
    quanta: f64,
    given: f64,
}

impl Counter {
    pub(crate) fn new(seed: u64, arw_deg_rt_h: f64) -> Self {
        let arw_arcsec_rt_s = arw_deg_rt_h * ARCSEC_RT_S_PER_DEG_RT_H;
        Self { rng: ChaCha8Rng::seed_from_u64(seed), arw_arcsec_rt_s, quanta: 0.0, given: 0.0 }
    }

    /// Quanta passed during `dt_s` at a mean rate in °/h, one quantum being `arcsec`.
    pub(crate) fn count(&mut self, rate_dph: f64, dt_s: f64, arcsec: f64) -> f64 {
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        let angle = rate_dph * dt_s + self.arw_arcsec_rt_s * libm::sqrt(dt_s) * noise;
        self.quanta += angle / arcsec;
        let passed = libm::floor(self.quanta) - self.given;
        self.given += passed;
        passed
    }
}
