//! Scale factor and misalignment from runs on a rate table.

use sagnac_log::setup::RateUnit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A value in parts per million with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct PpmEstimate {
    /// Value, ppm.
    pub ppm: f64,
    /// Standard deviation, ppm.
    pub sigma_ppm: f64,
}

/// One temperature of a test on a rate table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Plateau {
    /// Mean temperature, °C.
    pub temperature_c: f64,
    /// Windows.
    pub windows: usize,
    /// Rates of the table along the axis, °/s, rising.
    pub rates_dps: Vec<f64>,
    /// Deviation of the scale factor S from S0.
    pub scale: PpmEstimate,
    /// Rate at rest: bias and, where it is not taken off, the Earth's, °/h.
    pub bias_dph: f64,
    /// Its standard deviation, °/h.
    pub bias_sigma_dph: f64,
    /// Largest distance of a rate from the straight line, ppm of the largest rate; null with fewer than three rates.
    pub nonlinearity: Option<PpmEstimate>,
    /// 2(S⁺ − S⁻)/(S⁺ + S⁻); null where the rates do not determine it.
    pub asymmetry: Option<PpmEstimate>,
}

/// How well the scale factor comes back to itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Repeatability {
    /// σ among visits of one temperature, pooled over temperatures, ppm.
    pub sigma_ppm: f64,
    /// What the windows' own scatter makes of it, ppm.
    pub of_noise_ppm: f64,
    /// Temperatures that were visited more than once.
    pub temperatures: usize,
    /// Degrees of freedom of the σ.
    pub degrees_of_freedom: usize,
}

/// The scale factor, from runs on a rate table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct ScaleFactor {
    /// S at T0, arcsec per count; null for rate logs.
    pub arcsec_per_count: Option<f64>,
    /// Deviation of S from S0 at T0, by the joint fit. The correction takes out the variation about S alone: image, C and Verilog
    /// divide each coefficient by 1 + this, and give rates of scale factor S. Set S as `arcsec_per_count` to have rates of S0.
    pub at_reference: PpmEstimate,
    /// The plateaus, in the order of the test.
    pub plateaus: Vec<Plateau>,
    /// Null where no temperature was visited twice.
    pub repeatability: Option<Repeatability>,
}

impl ScaleFactor {
    /// What an asymmetry beyond its noise does to the bias, in words: S|Ω| is a rate that does not turn with the table.
    pub fn asymmetry_note(&self, units: RateUnit) -> Option<String> {
        let beyond = |p: &&Plateau| p.asymmetry.is_some_and(|a| a.ppm.abs() > BEYOND_NOISE * a.sigma_ppm);
        let drift_dph = |p: &Plateau| {
            let fastest_dps = p.rates_dps.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
            p.asymmetry.map_or(0.0, |a| 0.5 * a.ppm.abs() * 1e-6 * fastest_dps * 3600.0)
        };
        let lame: Vec<&Plateau> = self.plateaus.iter().filter(beyond).collect();
        let most_dph = lame.iter().map(|p| drift_dph(p)).fold(0.0, f64::max);
        // One in 370 is beyond three σ by chance.
        (lame.len() * 10 > self.plateaus.len() && most_dph > 0.0).then(|| {
            format!(
                "the asymmetry is beyond its noise at {} of {} plateaus: up to {} of it stand in the rate at rest and in the bias; a run \
                 at rest tells the bias alone",
                lame.len(),
                self.plateaus.len(),
                units.text(most_dph, 2)
            )
        })
    }
}

/// An asymmetry beyond this many σ is not noise.
const BEYOND_NOISE: f64 = 3.0;

/// Angle between the input axis and the plane that another axis is normal to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Misalignment {
    /// The axis that was turned.
    pub towards: char,
    /// Misalignment of the input axis towards it, arcsec; positive where its rotation adds to the rate of this axis.
    pub arcsec: f64,
    /// Standard deviation, arcsec.
    pub sigma_arcsec: f64,
}
