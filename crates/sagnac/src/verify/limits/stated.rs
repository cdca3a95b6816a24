//! The limits that a file states, key by key. `limits_file.rs` reads and checks it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::verify::flight::position::Flight;
use crate::verify::limits::verdict::DecisionRule;
use sagnac_log::ingest::{hex, sha256};

/// Limits of a verification.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Limits {
    /// Set whose limits hold where this file gives none: `navigation-grade` or `paper`.
    pub base: Option<String>,
    /// How a value with an uncertainty is compared with a limit; `simple` by default.
    pub decision: Option<DecisionRule>,
    /// Where they come from.
    #[serde(skip)]
    #[schemars(skip)]
    pub source: LimitsSource,
    /// Largest σ after, °/h.
    pub sigma_dph_max: Option<f64>,
    /// Largest max − min after, °/h.
    pub peak_to_peak_dph_max: Option<f64>,
    /// Largest σ after in units of the floor.
    pub sigma_over_floor_max: Option<f64>,
    /// Largest σ after beyond the noise floor, √(σ² − floor²), °/h.
    pub sigma_beyond_floor_dph_max: Option<f64>,
    /// Least improvement of max − min.
    pub improvement_min: Option<f64>,
    /// Least improvement of σ.
    pub improvement_sigma_min: Option<f64>,
    /// Largest part of the windows whose temperature leaves the fit's span by more than 0.5 °C, 0 to 1.
    pub out_of_span_max: Option<f64>,
    /// Least part of the fit's span of temperature that the used windows cover, 0 to 1; gaps of a twentieth of it count as covered.
    pub span_covered_min: Option<f64>,
    /// Largest σ within a plateau, °/h.
    pub plateau_sigma_dph_max: Option<f64>,
    /// Largest distance of a plateau's mean from its run's, °/h.
    pub plateau_offset_dph_max: Option<f64>,
    /// Largest root mean square in ramps, °/h.
    pub ramps_rms_dph_max: Option<f64>,
    /// Largest mean of the ramps less mean of the soaks, °/h.
    pub ramp_offset_dph_max: Option<f64>,
    /// Largest slope over temperature, °/h per °C.
    pub drift_dph_per_c_max: Option<f64>,
    /// Largest slope over its rate, °/h per °C/min.
    pub drift_dph_per_cpm_max: Option<f64>,
    /// Largest mean while heating less mean while cooling, °/h.
    pub hysteresis_dph_max: Option<f64>,
    /// Largest root mean square over temperature of the smooth residual, less what noise makes of it, °/h.
    pub temperature_residual_dph_max: Option<f64>,
    /// Largest difference of a run's fixed bias from that of the calibration, °/h.
    pub bias_repeatability_dph_max: Option<f64>,
    /// Largest one-sided 95 % bound of the σ from turn-on to turn-on, °/h.
    pub turn_on_sigma_dph_max: Option<f64>,
    /// Largest fixed bias of a run, °/h.
    pub fixed_bias_dph_max: Option<f64>,
    /// Largest difference of the scale factor from that of the calibration, ppm.
    pub scale_factor_repeatability_ppm_max: Option<f64>,
    /// Largest deviation of the scale factor from its nominal value, ppm.
    pub scale_factor_ppm_max: Option<f64>,
    /// Largest asymmetry of the scale factor at a plateau, ppm.
    pub scale_factor_asymmetry_ppm_max: Option<f64>,
    /// Largest nonlinearity of the scale factor at a plateau, ppm.
    pub scale_factor_nonlinearity_ppm_max: Option<f64>,
    /// Largest difference of the scale factor between visits of one temperature, ppm.
    pub scale_factor_hysteresis_ppm_max: Option<f64>,
    /// Least part of the fit's span of temperature rate that the retest's ramps reach, 0 to 1.
    pub rate_covered_min: Option<f64>,
    /// Largest part of the time of the runs of which no row is usable, 0 to 1.
    pub missing_max: Option<f64>,
    /// Largest part of the rows that was excluded on request, 0 to 1; 0.005 where a file does not state it.
    pub excluded_max: Option<f64>,
    /// Largest σ of the scale factor over the plateaus of a rate table, ppm.
    pub scale_factor_sigma_ppm_max: Option<f64>,
    /// Largest max − min of the scale factor over those plateaus, ppm.
    pub scale_factor_peak_to_peak_ppm_max: Option<f64>,
    /// Largest angle random walk after, °/√h.
    pub arw_deg_rt_h_max: Option<f64>,
    /// Largest angle random walk after over before.
    pub arw_increase_max: Option<f64>,
    /// Largest bias instability after, °/h.
    pub bias_instability_dph_max: Option<f64>,
    /// Largest position error of the flight by the drift after, two of its σ included, m.
    pub position_error_m_max: Option<f64>,
    /// A flight, whose position error is then stated.
    pub flight: Option<Flight>,
}

/// Which limits a unit was held against.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct LimitsSource {
    /// Name of the set, or of the file.
    pub name: String,
    /// SHA-256 of its text.
    pub sha256: String,
    /// The set that it starts from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Box<LimitsSource>>,
}

impl LimitsSource {
    pub(crate) fn of(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), sha256: hex(&sha256(text.as_bytes())), base: None }
    }
}
