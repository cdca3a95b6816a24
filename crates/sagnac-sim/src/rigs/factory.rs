//! A factory: gyros of several lots that scatter about their lot's mean.
//!
//! ```text
//! d = 0.01 °/h + a₁u + a₂u² + a₃u³ + c·Ṫ      aᵢ, c = mean + lot + unit,  lot and unit normal
//! ```
//!
//! Normal scatter: real lots have heavier tails.

use crate::random::{Stream, generator, normal};
use crate::rigs::LaggedChamber;

/// Coefficients of u, u², u³, °/h, and of Ṫ, °/h per °C/min: mean of all, σ of lots, σ of units in a lot.
const MEAN: [f64; 4] = [0.15, -0.06, 0.03, 0.05];
const OF_LOTS: [f64; 4] = [0.03, 0.015, 0.006, 0.008];
const OF_UNITS: [f64; 4] = [0.04, 0.02, 0.01, 0.01];
/// Fixed bias of all, °/h.
const FIXED_DPH: f64 = 0.01;

/// A factory of a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Factory {
    /// Another one is another factory.
    pub seed: u64,
}

impl Factory {
    /// Unit `number` of lot `lot`, in the chamber of the domain notes; its slope is so many σ of its lot further away.
    pub fn unit(&self, lot: u64, number: u64, odd_sigmas: f64) -> LaggedChamber {
        let draws = |stream: Stream, number: u64| {
            let mut random = generator(self.seed.wrapping_mul(1_000_003).wrapping_add(number), stream);
            [(); 4].map(|()| normal(&mut random))
        };
        let (of_lot, of_unit) = (draws(Stream::Lot, lot), draws(Stream::Unit, number));
        let mut own: [f64; 4] =
            std::array::from_fn(|at| MEAN[at] + OF_LOTS[at] * of_lot[at] + OF_UNITS[at] * of_unit[at]);
        own[0] += odd_sigmas * OF_UNITS[0];
        let [a, b, c, rate_effect] = own;
        LaggedChamber { drift_dph: vec![FIXED_DPH, a, b, c], rate_effect, ..LaggedChamber::domain_notes() }
    }
}
