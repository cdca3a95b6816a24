//! Diagnostics of the residual of a verification, from the retest alone.
//!
//! ```text
//! over the floor            √(σ² − floor²)                                if it exceeds two sampling errors
//! hysteresis                mean while heating less mean while cooling    a gradient, another lag
//! gap steps                 rms of the steps over breaks of the record    mode steps, where resets are marked invalid
//! lag-1 autocorrelation     of neighbouring windows                       anything slow
//! ```
//!
//! All of corrected windows, each run about its own mean. Sampling errors are those of white residuals of n windows:
//! √(2/n)·floor² for the variance, σ√(1/n₁ + 1/n₂) for steps, 1/√n for the correlation; of the hysteresis by the noise of the windows,
//! slow noise too ([`super::noise`]).

use sagnac_log::setup::RateUnit;
use serde::{Deserialize, Serialize};

use crate::diagnostics::{Leg, WindowPoint, hysteresis_of};
use crate::verify::values::judged_windows::{Estimate, FEWEST, joined, judged, lag1_autocorrelation, mean, spread};
use crate::verify::values::noise::RetestNoise;
use sagnac_units::format::{counted, significant, with_sigma};

/// Windows on each side of a gap whose means are compared.
const BESIDE: usize = 10;

/// Steps over the breaks of a record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GapSteps {
    /// Breaks with enough windows on both sides.
    pub gaps: usize,
    /// Root mean square of the steps, °/h.
    pub rms_dph: f64,
    /// What the windows' own spread makes of it, °/h.
    pub noise_dph: f64,
}

/// Diagnostics of the residual.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ResidualDiagnostics {
    /// √(σ² − floor²), °/h; null where it is within two sampling errors of nothing, or without a floor.
    pub over_floor_dph: Option<f64>,
    /// Mean while heating less mean while cooling, °/h; null without both.
    pub hysteresis_dph: Option<Estimate>,
    /// Null without gaps.
    pub gap_steps: Option<GapSteps>,
    /// Correlation of neighbouring windows; null with too few.
    pub lag1_autocorrelation: Option<Estimate>,
}

impl ResidualDiagnostics {
    /// Rows for people: what, its value, and what noise alone would show.
    pub fn rows(&self, units: RateUnit) -> Vec<Vec<String>> {
        let name = units.name();
        let mut rows = Vec::new();
        let mut row = |name: &str, value: String, noise: String| rows.push(vec![name.to_owned(), value, noise]);
        if let Some(over) = self.over_floor_dph {
            row(&format!("over the floor, {name}"), units.number(over, 2), "0".to_owned());
        }
        if let Some(legs) = self.hysteresis_dph {
            let noise = format!("± {}", units.number(2.0 * legs.sigma, 2));
            let value = units.with_sigma(legs.value, Some(legs.sigma));
            row(&format!("hysteresis (heating minus cooling), {name}"), value, noise);
        }
        if let Some(gaps) = self.gap_steps {
            let name = format!("steps across {}, rms, {name}", counted(gaps.gaps, "gap", "gaps"));
            row(&name, units.number(gaps.rms_dph, 2), units.number(gaps.noise_dph, 2));
        }
        if let Some(slow) = self.lag1_autocorrelation {
            let noise = format!("± {}", significant(2.0 * slow.sigma, 2));
            row("lag-1 autocorrelation", with_sigma(slow.value, Some(slow.sigma)), noise);
        }
        rows
    }
}

/// From the points of an axis. σ of the values, which counts a short window by its length, and the floor in °/h.
pub(crate) fn residual_diagnostics(
    points: &[WindowPoint],
    noise: &RetestNoise,
    sigma_dph: f64,
    floor_dph: Option<f64>,
) -> ResidualDiagnostics {
    let used = judged(points);
    let sigma = spread(&used);
    ResidualDiagnostics {
        over_floor_dph: floor_dph.and_then(|floor| over(sigma_dph, floor, used.len())),
        hysteresis_dph: hysteresis(points, noise, &used),
        gap_steps: gap_steps(&used, sigma),
        lag1_autocorrelation: lag1_autocorrelation(&used, sigma),
    }
}

fn over(sigma: f64, floor: f64, n: usize) -> Option<f64> {
    let excess = sigma * sigma - floor * floor;
    let sampling = (2.0 / n as f64).sqrt() * floor * floor;
    (n >= FEWEST && excess > 2.0 * sampling).then(|| excess.sqrt())
}

fn hysteresis(points: &[WindowPoint], noise: &RetestNoise, used: &[&WindowPoint]) -> Option<Estimate> {
    let legs = hysteresis_of(points, FEWEST, |p| p.after_dph)?;
    let count = |leg: Leg| used.iter().filter(|p| p.leg() == leg).count() as f64;
    let (heating, cooling) = (count(Leg::Heating), count(Leg::Cooling));
    let part = |point: &&WindowPoint| match point.leg() {
        Leg::Heating => 1.0 / heating,
        Leg::Cooling => -1.0 / cooling,
        Leg::Steady => 0.0,
    };
    let parts: Vec<f64> = used.iter().map(part).collect();
    Some(Estimate { value: legs.difference_dph, sigma: noise.sigma_dph(&parts) })
}

fn gap_steps(used: &[&WindowPoint], sigma: f64) -> Option<GapSteps> {
    let breaks = (BESIDE..used.len().saturating_sub(BESIDE - 1)).filter(|i| {
        let beside = &used[i - BESIDE..i + BESIDE];
        let whole = |part: &[&WindowPoint]| part.windows(2).all(|pair| joined(pair[0], pair[1]));
        used[i - 1].run == used[*i].run
            && !joined(used[i - 1], used[*i])
            && whole(&beside[..BESIDE])
            && whole(&beside[BESIDE..])
    });
    let steps: Vec<f64> = breaks.map(|i| mean(&used[i..i + BESIDE]) - mean(&used[i - BESIDE..i])).collect();
    let mean_square = steps.iter().map(|step| step * step).sum::<f64>() / steps.len() as f64;
    let noise_dph = sigma * (2.0 / BESIDE as f64).sqrt();
    (!steps.is_empty()).then(|| GapSteps { gaps: steps.len(), rms_dph: mean_square.sqrt(), noise_dph })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::tests::noise;

    /// Windows of 100 s: heating for a hundred, cooling for a hundred, a gap each fifty.
    fn points(after: impl Fn(usize) -> f64) -> Vec<WindowPoint> {
        let one = |i: usize| WindowPoint {
            run: 0,
            hours: (i as f64 + (i / 50) as f64 * 0.1) / 36.0,
            length_h: 1.0 / 36.0,
            temperature_c: 20.0,
            rate_cpm: if i < 100 { 1.0 } else { -1.0 },
            before_dph: 0.0,
            inputs_dph: 0.0,
            after_dph: after(i),
            excluded: None,
        };
        (0..200).map(one).collect()
    }

    #[test]
    fn what_was_put_in_is_named() {
        let floor = (1.0_f64 / 12.0).sqrt();
        let of = |points: &[WindowPoint], floor| {
            let noise = RetestNoise::of(&judged(points), false);
            residual_diagnostics(points, &noise, spread(&points.iter().collect::<Vec<_>>()), floor)
        };
        let nothing = of(&points(noise), Some(floor));
        assert_eq!(nothing.over_floor_dph, None);
        let (legs, slow) = (nothing.hysteresis_dph.unwrap(), nothing.lag1_autocorrelation.unwrap());
        assert!(legs.value.abs() < 3.0 * legs.sigma && slow.value.abs() < 3.0 * slow.sigma, "{nothing:?}");
        let gaps = nothing.gap_steps.unwrap();
        assert!(gaps.gaps == 3 && gaps.rms_dph < 2.0 * gaps.noise_dph, "{gaps:?}");
        // Half a degree an hour between the legs, and a step at each gap.
        let apart = of(&points(|i| noise(i) + if i < 100 { 0.25 } else { -0.25 }), Some(floor));
        let legs = apart.hysteresis_dph.unwrap();
        assert!((legs.value - 0.5).abs() < 3.0 * legs.sigma, "{legs:?}");
        assert!((apart.over_floor_dph.unwrap() - 0.25).abs() < 0.06, "{apart:?}");
        assert!(apart.lag1_autocorrelation.unwrap().value > 0.25);
        let stepped = of(&points(|i| 0.1 * noise(i) + if (i / 50) % 2 == 0 { 0.5 } else { -0.5 }), None);
        let gaps = stepped.gap_steps.unwrap();
        assert!((gaps.rms_dph - 1.0).abs() < 0.1, "{gaps:?}");
        assert_eq!(stepped.over_floor_dph, None, "no floor");
    }
}
