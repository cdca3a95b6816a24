//! `limits.toml`: what a retest must show. Every key is optional; unknown keys are refused.
//!
//! Two sets come with the program, by name: `navigation-grade` and `paper`. A limit whose value cannot be had is not met, but for
//! those of a rate table, which are asked only of a retest on one.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::verify::AxisVerification;
use crate::verify::flight::Flight;

/// Limits of a verification.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest σ after, °/h.
    pub sigma_dph_max: Option<f64>,
    /// Largest max − min after, °/h.
    pub peak_to_peak_dph_max: Option<f64>,
    /// Largest σ after in units of the floor.
    pub sigma_over_floor_max: Option<f64>,
    /// Least improvement of max − min.
    pub improvement_min: Option<f64>,
    /// Least improvement of σ.
    pub improvement_sigma_min: Option<f64>,
    /// Largest part of the windows with the status OUT_OF_SPAN, 0 to 1.
    pub out_of_span_max: Option<f64>,
    /// Largest σ within a plateau, °/h.
    pub plateau_sigma_dph_max: Option<f64>,
    /// Largest distance of a plateau's mean from its run's, °/h.
    pub plateau_offset_dph_max: Option<f64>,
    /// Largest root mean square in ramps, °/h.
    pub ramps_rms_dph_max: Option<f64>,
    /// Largest slope over temperature, °/h per °C.
    pub drift_dph_per_c_max: Option<f64>,
    /// Largest slope over its rate, °/h per °C/min.
    pub drift_dph_per_cpm_max: Option<f64>,
    /// Largest mean while heating less mean while cooling, °/h.
    pub hysteresis_dph_max: Option<f64>,
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
    pub mis_distance_m_max: Option<f64>,
    /// A flight, whose position error is then stated.
    pub flight: Option<Flight>,
}

/// Sets that come with the program.
pub const SETS: [(&str, &str); 2] = [
    ("navigation-grade", include_str!("limits_sets/navigation-grade.toml")),
    ("paper", include_str!("limits_sets/paper.toml")),
];

/// One limit held against its value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verdict {
    /// Key of the limit.
    pub name: String,
    /// The limit.
    pub limit: f64,
    /// The value; null where it cannot be had (no floor): then the limit is not met.
    pub value: Option<f64>,
    /// Room between value and limit as a part of the limit; negative where it is not met, null without a value.
    pub margin: Option<f64>,
    /// It is met.
    pub pass: bool,
    /// Why the retest does not tell the value, where it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl Limits {
    /// Reads a limits file.
    ///
    /// # Errors
    /// Unreadable, an unknown key, a limit below zero or no number.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| Error::io_path(path, "read the limits", &e))?;
        Self::parse(&text).map_err(|e| e.file(name))
    }

    /// Parses the text of a limits file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn parse(text: &str) -> Result<Self> {
        let limits: Self = toml::from_str(text)
            .map_err(|e| Error::toml("limits", text, &e).help("docs/verification.md lists the keys"))?;
        for (name, value) in limits.given() {
            if !(value.is_finite() && value >= 0.0) || (name == "out_of_span_max" && value > 1.0) {
                return Err(Error::input("a limit is a number from 0 on (out_of_span_max: to 1)")
                    .column(name)
                    .value(value.to_string()));
            }
        }
        if let Some(flight) = &limits.flight {
            flight.check()?;
        }
        if limits.mis_distance_m_max.is_some() && limits.flight.is_none() {
            return Err(Error::input("a limit of mis-distance needs a [flight]").column("mis_distance_m_max"));
        }
        if limits.given().is_empty() && limits.flight.is_none() {
            return Err(Error::input("no limit in the limits file").help("docs/verification.md lists the keys"));
        }
        Ok(limits)
    }

    /// A set that comes with the program, by its name, else a file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn named_or_read(name: &str) -> Result<Self> {
        match SETS.iter().find(|(set, _)| *set == name) {
            Some((set, text)) => Self::parse(text).map_err(|e| e.file(*set)),
            None => Self::read(Path::new(name)),
        }
    }

    /// True where it holds a limit, not a flight alone.
    pub(crate) fn asks(&self) -> bool {
        !self.given().is_empty()
    }

    fn given(&self) -> Vec<(&'static str, f64)> {
        let all = [
            ("sigma_dph_max", self.sigma_dph_max),
            ("peak_to_peak_dph_max", self.peak_to_peak_dph_max),
            ("sigma_over_floor_max", self.sigma_over_floor_max),
            ("improvement_min", self.improvement_min),
            ("improvement_sigma_min", self.improvement_sigma_min),
            ("out_of_span_max", self.out_of_span_max),
            ("plateau_sigma_dph_max", self.plateau_sigma_dph_max),
            ("plateau_offset_dph_max", self.plateau_offset_dph_max),
            ("ramps_rms_dph_max", self.ramps_rms_dph_max),
            ("drift_dph_per_c_max", self.drift_dph_per_c_max),
            ("drift_dph_per_cpm_max", self.drift_dph_per_cpm_max),
            ("hysteresis_dph_max", self.hysteresis_dph_max),
            ("scale_factor_sigma_ppm_max", self.scale_factor_sigma_ppm_max),
            ("scale_factor_peak_to_peak_ppm_max", self.scale_factor_peak_to_peak_ppm_max),
            ("arw_deg_rt_h_max", self.arw_deg_rt_h_max),
            ("arw_increase_max", self.arw_increase_max),
            ("bias_instability_dph_max", self.bias_instability_dph_max),
            ("mis_distance_m_max", self.mis_distance_m_max),
        ];
        all.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// Holds an axis against every limit given.
    pub(crate) fn judge(&self, axis: &AxisVerification) -> Vec<Verdict> {
        // A table tells the scale factor, and a gyro at rest its noise.
        let asked = |(name, _): &(&str, f64)| !name.starts_with(if axis.turned { "arw" } else { "scale_factor" });
        let verdict = |(name, limit): (&'static str, f64)| {
            let value = value_of(name, axis);
            let least = name.ends_with("_min");
            let room = |value: f64| if least { value - limit } else { limit - value };
            let pass = value.is_some_and(|value| room(value) >= 0.0);
            let margin = value.filter(|_| limit > 0.0).map(|value| room(value) / limit);
            let why = value.is_none().then(|| unknown(name, axis));
            Verdict { name: name.to_owned(), limit, value, margin, pass, why }
        };
        self.given().into_iter().filter(asked).map(verdict).collect()
    }
}

/// The figure that a limit bounds; `None` where the retest does not tell it.
fn value_of(name: &str, axis: &AxisVerification) -> Option<f64> {
    let (after, left) = (&axis.after, &axis.residual);
    let dph_per_unit = if after.sigma > 0.0 { after.sigma_dph / after.sigma } else { 0.0 };
    match name {
        "sigma_dph_max" => Some(after.sigma_dph),
        "peak_to_peak_dph_max" => Some(after.peak_to_peak * dph_per_unit),
        "sigma_over_floor_max" => axis.floor.as_ref().map(|floor| after.sigma_dph / floor.value_dph),
        "improvement_min" => axis.improvement,
        "improvement_sigma_min" => axis.improvement_sigma,
        "out_of_span_max" => Some(axis.status_windows.get("OUT_OF_SPAN").copied().unwrap_or(0) as f64 / after.n as f64),
        "plateau_sigma_dph_max" => left.plateaus.map(|p| p.worst_sigma_dph),
        "plateau_offset_dph_max" => left.plateaus.map(|p| p.worst_offset_dph.value.abs()),
        "ramps_rms_dph_max" => left.ramps_rms_dph,
        "drift_dph_per_c_max" => left.per_c.map(|slope| slope.value.abs()),
        "drift_dph_per_cpm_max" => left.per_cpm.map(|slope| slope.value.abs()),
        "hysteresis_dph_max" => axis.left.heating_less_cooling_dph.map(|legs| legs.value.abs()),
        "scale_factor_sigma_ppm_max" => axis.scale_factor.as_ref().map(|scale| scale.after.sigma_ppm),
        "scale_factor_peak_to_peak_ppm_max" => axis.scale_factor.as_ref().map(|scale| scale.after.peak_to_peak_ppm),
        "arw_deg_rt_h_max" => left.random_walk.map(|walk| walk.after_deg_rt_h),
        "arw_increase_max" => left.random_walk.map(|walk| walk.after_deg_rt_h / walk.before_deg_rt_h),
        "bias_instability_dph_max" => left.bias_instability_dph,
        "mis_distance_m_max" => axis.flight.as_ref().map(|flight| flight.bound_after_m),
        _ => None,
    }
}

/// Why a figure cannot be had.
fn unknown(name: &str, axis: &AxisVerification) -> String {
    let why = match name {
        "sigma_over_floor_max" => "the noise floor is not known",
        "improvement_min" | "improvement_sigma_min" => "nothing is left to divide by",
        "plateau_sigma_dph_max" | "plateau_offset_dph_max" => "no five steady windows within 1 °C of each other",
        "ramps_rms_dph_max" => "fewer than ten windows in ramps",
        "drift_dph_per_c_max" | "drift_dph_per_cpm_max" => "temperature or its rate does not vary",
        "hysteresis_dph_max" => "fewer than 20 windows of heating or of cooling",
        "scale_factor_sigma_ppm_max" | "scale_factor_peak_to_peak_ppm_max" => "fewer than two plateaus tell it",
        "arw_deg_rt_h_max" | "arw_increase_max" => "the rows do not tell their noise",
        "bias_instability_dph_max" => "no six windows that follow each other",
        "mis_distance_m_max" => axis.flight_untold.as_deref().unwrap_or("the flight was not flown"),
        _ => "the retest does not tell it",
    };
    why.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sets_are_limits() {
        for (name, _) in SETS {
            let limits = Limits::named_or_read(name).unwrap();
            assert!(limits.given().len() >= 3, "{name}");
        }
        assert!(Limits::parse("mis_distance_m_max = 100.0").is_err());
        assert!(Limits::named_or_read("no such file or set").is_err());
    }
}
