//! `limits.toml`: what a retest must show. Every key is optional; unknown keys are refused.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::verify::AxisVerification;

/// Limits of a verification.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
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
}

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
    /// It is met.
    pub pass: bool,
}

impl Limits {
    /// Reads a limits file.
    ///
    /// # Errors
    /// Unreadable, an unknown key, a limit that is no positive number.
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
        if limits.given().is_empty() {
            return Err(Error::input("no limit in the limits file").help("docs/verification.md lists the keys"));
        }
        Ok(limits)
    }

    fn given(&self) -> Vec<(&'static str, f64)> {
        let all = [
            ("sigma_dph_max", self.sigma_dph_max),
            ("peak_to_peak_dph_max", self.peak_to_peak_dph_max),
            ("sigma_over_floor_max", self.sigma_over_floor_max),
            ("improvement_min", self.improvement_min),
            ("improvement_sigma_min", self.improvement_sigma_min),
            ("out_of_span_max", self.out_of_span_max),
        ];
        all.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// Holds an axis against every limit given.
    pub(crate) fn judge(&self, axis: &AxisVerification) -> Vec<Verdict> {
        let after = &axis.after;
        let dph_per_unit = if after.sigma > 0.0 { after.sigma_dph / after.sigma } else { 0.0 };
        let out_of_span = axis.status_windows.get("OUT_OF_SPAN").copied().unwrap_or(0) as f64 / after.n as f64;
        let verdict = |(name, limit): (&str, f64)| {
            let value = match name {
                "sigma_dph_max" => Some(after.sigma_dph),
                "peak_to_peak_dph_max" => Some(after.peak_to_peak * dph_per_unit),
                "sigma_over_floor_max" => axis.floor.as_ref().map(|floor| after.sigma_dph / floor.value_dph),
                "improvement_min" => axis.improvement,
                "improvement_sigma_min" => axis.improvement_sigma,
                _ => Some(out_of_span),
            };
            let pass = value.is_some_and(|v| if name.ends_with("_min") { v >= limit } else { v <= limit });
            Verdict { name: name.to_owned(), limit, value, pass }
        };
        self.given().into_iter().map(verdict).collect()
    }
}
