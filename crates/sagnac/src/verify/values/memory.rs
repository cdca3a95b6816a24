//! Memory of temperature that does not depend on its rate: friction, mounting stress, a play operator.
//!
//! ```text
//! value    mean at rest after heating, less the mean after cooling at the same temperature; each over the last hour of its soak
//! pairs    soaks from both sides ([`crate::diagnostics::soaks`]); the largest counts
//! ```
//!
//! On ramps, memory and an effect of the temperature rate look alike; at rest only memory is left. So no retest without such a pair can
//! show it. Standard error by the noise of the windows, slow noise too ([`super::noise`]).
//!
//! Fails where the play is wider than the way from which a soak is reached, and for memory that a soak of an hour forgets.

use serde::{Deserialize, Serialize};

use crate::diagnostics::WindowPoint;
use crate::diagnostics::soaks::{SoakPair, soak_pairs};
use crate::verify::values::judged_windows::Estimate;
use crate::verify::values::noise::RetestNoise;

/// Difference of the bias at rest by the side from which its temperature was reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Memory {
    /// After heating less after cooling, °/h.
    pub difference_dph: Estimate,
    /// Temperature of the soaks, °C.
    pub temperature_c: f64,
}

/// The largest memory of the judged windows; `None` without a soak from both sides.
pub(crate) fn memory(used: &[&WindowPoint], noise: &RetestNoise) -> Option<Memory> {
    let of_pair = |pair: SoakPair| {
        let parts = pair.parts(used.len());
        let value = parts.iter().zip(used).map(|(part, point)| part * point.after_dph).sum();
        let difference_dph = Estimate { value, sigma: noise.sigma_dph(&parts) };
        Memory { difference_dph, temperature_c: pair.temperature_c }
    };
    let pairs = soak_pairs(used).into_iter().map(of_pair);
    pairs.max_by(|a, b| a.difference_dph.value.abs().total_cmp(&b.difference_dph.value.abs()))
}
