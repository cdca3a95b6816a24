//! Two corrections on a ramp up and down again over their common temperatures, at 1 °C/min: where a lag or a rate effect has changed, they
//! part though their curves at rest agree.
//!
//! ```text
//! D(t)         correction of one record less that of the other, each behind its own lags, in the second of two cycles
//! hysteresis   mean of D while heating less while cooling         ± 2·σ of the rate effects, and of a lag 4·c·σ_τ over a leg
//! residual     rms of D about its mean                            ± σ of the curves and of the rate effects
//! ```
//!
//! Fails where only a rate other than 1 °C/min shows the change.

use crate::calibration::{AxisCalibration, Input};
use crate::verify::Estimate;

/// Rate of the ramps, °C/min.
const RATE_CPM: f64 = 1.0;
/// Step of time, s.
const STEP_S: f64 = 5.0;

/// What the corrections of two records make of the ramps.
pub(crate) struct Apart {
    pub(crate) hysteresis_dph: Estimate,
    pub(crate) residual_dph: Estimate,
}

/// Two records between two temperatures.
pub(crate) fn apart(pair: [&AxisCalibration; 2], [lo_c, hi_c]: [f64; 2]) -> Apart {
    let leg = (((hi_c - lo_c) / RATE_CPM * 60.0 / STEP_S).round() as usize).max(1);
    let [a, b] = pair.map(|axis| cycle(axis, [lo_c, hi_c], leg));
    let apart: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (heating, cooling) = apart.split_at(leg);
    let about = mean(&apart);
    let rms = (apart.iter().map(|d| (d - about).powi(2)).sum::<f64>() / apart.len() as f64).sqrt();
    let middle_c = f64::midpoint(lo_c, hi_c);
    let square = |of: &dyn Fn(&AxisCalibration) -> f64| pair.iter().map(|axis| of(axis).powi(2)).sum::<f64>();
    let rates = square(&|axis| axis.rate_effect(middle_c).map_or(0.0, |[_, sigma]| sigma)) * RATE_CPM * RATE_CPM;
    let lags = square(&|axis| {
        let lag = axis.thermometer().lag_s.and_then(|lag| lag.sigma).unwrap_or(0.0);
        4.0 * axis.rate_effect(middle_c).map_or(0.0, |[effect, _]| effect) * RATE_CPM * lag / (leg as f64 * STEP_S)
    });
    let curves = square(&|axis| axis.predict(lo_c).map_or(0.0, |found| found.curve_dph / 2.0));
    Apart {
        hysteresis_dph: Estimate { value: mean(heating) - mean(cooling), sigma: (4.0 * rates + lags).sqrt() },
        residual_dph: Estimate { value: rms, sigma: (curves + rates).sqrt() },
    }
}

/// The correction of a record at each step of a cycle that follows another, heating first.
fn cycle(axis: &AxisCalibration, [lo_c, hi_c]: [f64; 2], leg: usize) -> Vec<f64> {
    let inputs = &axis.correction.inputs;
    let mut lagged = vec![-RATE_CPM; inputs.len()];
    let mut out = Vec::with_capacity(2 * leg);
    for step in 0..4 * leg {
        let (is_heating, along) = ((step / leg).is_multiple_of(2), (step % leg) as f64 + 0.5);
        let part = along / leg as f64;
        let celsius = if is_heating { lo_c + part * (hi_c - lo_c) } else { hi_c - part * (hi_c - lo_c) };
        let rate_cpm = if is_heating { RATE_CPM } else { -RATE_CPM };
        for (state, input) in lagged.iter_mut().zip(inputs) {
            let keep = input.lag_s.filter(|lag| lag.value > 0.0).map_or(0.0, |lag| (-STEP_S / lag.value).exp());
            *state = keep * *state + (1.0 - keep) * rate_cpm;
        }
        if step >= 2 * leg {
            let rate_of = |input: &Input| {
                let at = inputs.iter().position(|other| other.name == input.name);
                let rate = at.map_or(0.0, |at| lagged[at]);
                input.rate_span_per_min.map_or(rate, |[lo, hi]| rate.clamp(lo, hi))
            };
            out.push(axis.drift_at_rates(celsius, &rate_of));
        }
    }
    out
}
