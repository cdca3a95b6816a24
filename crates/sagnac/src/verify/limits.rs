//! `limits.toml`: what a retest must show. Every key is optional; unknown keys are refused.
//!
//! Two sets come with the program, by name: `navigation-grade` and `paper`; `base` starts from one of them. A limit whose value
//! cannot be had is not met. Those of a rate table are asked only of a retest on one, those of a gyro at rest only of one at
//! rest: what is not asked is listed as such, and never counts as met.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::verify::flight::Flight;
use crate::verify::{AxisVerification, Estimate};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_units::format::{significant, with_sigma};

/// Limits of a verification.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Set whose limits hold where this file gives none: `navigation-grade` or `paper`.
    pub base: Option<String>,
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
    /// Least improvement of max − min.
    pub improvement_min: Option<f64>,
    /// Least improvement of σ.
    pub improvement_sigma_min: Option<f64>,
    /// Largest part of the windows with the status OUT_OF_SPAN, 0 to 1.
    pub out_of_span_max: Option<f64>,
    /// Least part of the fit's span of temperature that the used windows cover, 0 to 1; gaps of a twentieth of it count as covered.
    pub span_covered_min: Option<f64>,
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
    pub position_error_m_max: Option<f64>,
    /// A flight, whose position error is then stated.
    pub flight: Option<Flight>,
}

/// Which limits a unit was held against.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
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
    fn of(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), sha256: hex(&sha256(text.as_bytes())), base: None }
    }
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
    /// Standard error of the value, where it has one. The value alone is held against the limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Room between value and limit as a part of the limit; negative where it is not met, null without a value.
    pub margin: Option<f64>,
    /// It is met; null where it is not asked of such a retest.
    pub pass: Option<bool>,
    /// Why the retest does not tell the value, or is not asked for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl Verdict {
    /// The value for people, with its standard error.
    pub fn value_text(&self) -> String {
        match (self.value, self.sigma) {
            (Some(value), Some(sigma)) => with_sigma(value, Some(sigma)),
            (Some(value), None) => significant(value, 4),
            (None, _) => if self.pass.is_some() { "unknown" } else { "-" }.to_owned(),
        }
    }

    /// The margin for people: in per cent, or how often the bound is exceeded.
    pub fn margin_text(&self) -> String {
        match self.margin {
            Some(margin) if margin < -9.0 => format!("{} times the bound", significant(1.0 - margin, 2)),
            Some(margin) => format!("{} %", significant(100.0 * margin, 2)),
            None => "-".to_owned(),
        }
    }

    /// `met`, `not met` or `not asked`.
    pub fn word(&self) -> &'static str {
        match self.pass {
            Some(true) => "met",
            Some(false) => "not met",
            None => "not asked",
        }
    }
}

/// How many limits are met, not met, and not asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Judged {
    /// Met.
    pub met: usize,
    /// Not met.
    pub not_met: usize,
    /// Not asked of such a retest.
    pub not_asked: usize,
}

impl Judged {
    /// Counts verdicts.
    pub fn of<'a>(verdicts: impl IntoIterator<Item = &'a Verdict>) -> Self {
        let mut out = Self::default();
        for verdict in verdicts {
            *match verdict.pass {
                Some(true) => &mut out.met,
                Some(false) => &mut out.not_met,
                None => &mut out.not_asked,
            } += 1;
        }
        out
    }

    /// `9 of 10 limits met, 2 not asked of such a retest`.
    pub fn words(self) -> String {
        let Self { met, not_met, not_asked } = self;
        let more = if not_asked > 0 { format!(", {not_asked} not asked of such a retest") } else { String::new() };
        format!("{met} of {} limits met{more}", met + not_met)
    }
}

impl Limits {
    /// Reads a limits file.
    ///
    /// # Errors
    /// Unreadable, an unknown key, a limit below zero or no number.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let sets = Error::choices(&SETS.map(|(set, _)| set.to_owned()));
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::io_path(path, "read the limits", &e).help(format!("a TOML file, or a set: {sets}")))?;
        Self::of_text(&name, &text)
    }

    fn of_text(name: &str, text: &str) -> Result<Self> {
        let limits = Self::parse(text).map_err(|e| e.file(name))?;
        let set = SETS.iter().find(|(set, _)| limits.base.as_deref() == Some(*set));
        let base = set.map(|(set, text)| Box::new(LimitsSource::of(set, text)));
        Ok(Self { source: LimitsSource { base, ..LimitsSource::of(name, text) }, ..limits })
    }

    /// Parses the text of a limits file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn parse(text: &str) -> Result<Self> {
        let own: Self = toml::from_str(text)
            .map_err(|e| Error::toml("limits", text, &e).help("docs/reference/limits.md lists the keys"))?;
        let limits = own.on_base()?;
        for (name, value) in limits.given() {
            if !(value.is_finite() && value >= 0.0) || (PARTS.contains(&name) && value > 1.0) {
                return Err(Error::input("a limit is a number from 0 on (out_of_span_max, span_covered_min: to 1)")
                    .column(name)
                    .value(value.to_string()));
            }
        }
        if let Some(flight) = &limits.flight {
            flight.check()?;
        }
        if limits.position_error_m_max.is_some() && limits.flight.is_none() {
            return Err(Error::input("a limit of mis-distance needs a [flight]")
                .column("position_error_m_max")
                .help("[flight] with axis = \"level\" and profile = [{ minutes = 0, temperature_c = 20 }, …]; docs/reference/limits.md"));
        }
        if limits.given().is_empty() && limits.flight.is_none() {
            return Err(Error::input("no limit in the limits file").help("docs/reference/limits.md lists the keys"));
        }
        Ok(limits)
    }

    /// A set that comes with the program, by its name, else a file.
    ///
    /// # Errors
    /// As [`Limits::read`].
    pub fn named_or_read(name: &str) -> Result<Self> {
        match SETS.iter().find(|(set, _)| *set == name) {
            Some((set, text)) => Self::of_text(set, text),
            None => Self::read(Path::new(name)),
        }
    }

    /// With the limits of its base where it gives none.
    fn on_base(self) -> Result<Self> {
        let Some(name) = self.base.clone() else { return Ok(self) };
        let Some((_, text)) = SETS.iter().find(|(set, _)| *set == name) else {
            let sets = Error::choices(&SETS.map(|(set, _)| set.to_owned()));
            return Err(Error::input("no set of this name")
                .column("base")
                .value(name)
                .help(format!("there is: {sets}")));
        };
        let table = |limits: &Self| {
            toml::Table::try_from(limits).map_err(|e| Error::input(format!("the limits cannot be joined: {e}")))
        };
        let mut joined = table(&Self::parse(text)?)?;
        joined.extend(table(&self)?);
        joined.try_into().map_err(|e| Error::input(format!("the limits cannot be joined: {e}")))
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
            ("span_covered_min", self.span_covered_min),
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
            ("position_error_m_max", self.position_error_m_max),
        ];
        all.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// Holds an axis against every limit given.
    pub(crate) fn judge(&self, axis: &AxisVerification) -> Vec<Verdict> {
        let verdict = |(name, limit): (&'static str, f64)| {
            let name_of = name.to_owned();
            if let Some(why) = not_asked(name, axis) {
                let why = Some(why.to_owned());
                return Verdict { name: name_of, limit, value: None, sigma: None, margin: None, pass: None, why };
            }
            let (value, sigma) = value_of(name, axis).unzip();
            let least = name.ends_with("_min");
            let room = |value: f64| if least { value - limit } else { limit - value };
            let pass = value.is_some_and(|value| room(value) >= 0.0);
            let margin = value.filter(|_| limit > 0.0).map(|value| room(value) / limit);
            let why = value.is_none().then(|| unknown(name, axis));
            Verdict { name: name_of, limit, value, sigma: sigma.flatten(), margin, pass: Some(pass), why }
        };
        self.given().into_iter().map(verdict).collect()
    }
}

/// Limits that are parts of a whole.
const PARTS: [&str; 2] = ["out_of_span_max", "span_covered_min"];

/// Why such a retest is not asked: a table tells the scale factor, and a gyro at rest its noise.
fn not_asked(name: &str, axis: &AxisVerification) -> Option<&'static str> {
    match (name.starts_with("scale_factor"), name.starts_with("arw"), axis.turned) {
        (true, _, false) => Some("needs a retest on a rate table"),
        (_, true, true) => Some("needs a retest at rest"),
        _ => None,
    }
}

/// The figure that a limit bounds, with its standard error where it has one; `None` where the retest does not tell it.
fn value_of(name: &str, axis: &AxisVerification) -> Option<(f64, Option<f64>)> {
    let (after, left) = (&axis.after, &axis.residual);
    let size = |estimate: Estimate| (estimate.value.abs(), Some(estimate.sigma));
    match name {
        // The only plateau's mean is that of its run, or nearly.
        "plateau_offset_dph_max" => return left.plateaus.filter(|p| p.plateaus > 1).map(|p| size(p.worst_offset_dph)),
        "drift_dph_per_c_max" => return left.temperature_slope.map(size),
        "drift_dph_per_cpm_max" => return left.rate_slope.map(size),
        "hysteresis_dph_max" => return axis.residual_diagnostics.hysteresis_dph.map(size),
        _ => {}
    }
    let dph_per_unit = if after.sigma > 0.0 { after.sigma_dph / after.sigma } else { 0.0 };
    let value = match name {
        "sigma_dph_max" => Some(after.sigma_dph),
        "peak_to_peak_dph_max" => Some(after.peak_to_peak * dph_per_unit),
        "sigma_over_floor_max" => axis.noise_floor.as_ref().map(|floor| after.sigma_dph / floor.value_dph),
        "improvement_min" => axis.improvement,
        "improvement_sigma_min" => axis.improvement_sigma,
        "out_of_span_max" => Some(axis.status_windows.get("OUT_OF_SPAN").copied().unwrap_or(0) as f64 / after.n as f64),
        "plateau_sigma_dph_max" => left.plateaus.map(|p| p.worst_sigma_dph),
        "span_covered_min" => axis.coverage.as_ref().map(|coverage| coverage.covered_fraction),
        "ramps_rms_dph_max" => left.ramps_rms_dph,
        "scale_factor_sigma_ppm_max" => axis.scale_factor.as_ref().map(|scale| scale.after.sigma_ppm),
        "scale_factor_peak_to_peak_ppm_max" => axis.scale_factor.as_ref().map(|scale| scale.after.peak_to_peak_ppm),
        "arw_deg_rt_h_max" => left.random_walk.map(|walk| walk.after_deg_rt_h),
        "arw_increase_max" => left.random_walk.map(|walk| walk.after_deg_rt_h / walk.before_deg_rt_h),
        "bias_instability_dph_max" => left.bias_instability_dph,
        "position_error_m_max" => axis.flight.as_ref().map(|flight| flight.bound_after_m),
        _ => None,
    };
    value.map(|value| (value, None))
}

/// Why a figure cannot be had.
fn unknown(name: &str, axis: &AxisVerification) -> String {
    let why = match name {
        "sigma_over_floor_max" => "the noise floor is not known",
        "improvement_min" | "improvement_sigma_min" => "nothing is left to divide by",
        "plateau_offset_dph_max" if axis.residual.plateaus.is_some() => {
            "one plateau alone: it is compared with nothing"
        }
        "plateau_sigma_dph_max" | "plateau_offset_dph_max" => "no five steady windows within 1 °C of each other",
        "span_covered_min" => "the retest has no temperature",
        "ramps_rms_dph_max" => "fewer than ten windows in ramps",
        "drift_dph_per_c_max" | "drift_dph_per_cpm_max" => {
            "temperature (by σ 0.3 °C) and its rate (by 0.01 °C/min) do not vary, or not apart, or in fewer than ten windows"
        }
        "hysteresis_dph_max" => "fewer than 20 windows of heating or of cooling",
        "scale_factor_sigma_ppm_max" | "scale_factor_peak_to_peak_ppm_max" => "fewer than two plateaus tell it",
        "arw_deg_rt_h_max" | "arw_increase_max" => "the rows do not tell their noise",
        "bias_instability_dph_max" => "no six windows that follow each other",
        "position_error_m_max" => axis.flight_unavailable.as_deref().unwrap_or("the flight was not flown"),
        _ => "the retest does not tell it",
    };
    why.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The documentation holds the sets word for word.
    #[test]
    fn the_sets_stand_in_the_documentation() {
        let page = include_str!("../../../../docs/reference/limits.md");
        for (name, text) in SETS {
            assert!(page.contains(text), "{name} in docs/reference/limits.md is another");
        }
    }

    #[test]
    fn the_sets_are_limits() {
        for (name, _) in SETS {
            let limits = Limits::named_or_read(name).unwrap();
            assert!(limits.given().len() >= 3, "{name}");
        }
        let joined = Limits::parse("base = \"navigation-grade\"\nhysteresis_dph_max = 0.5").unwrap();
        let set = Limits::named_or_read("navigation-grade").unwrap();
        assert_eq!((joined.hysteresis_dph_max, joined.arw_deg_rt_h_max), (Some(0.5), set.arw_deg_rt_h_max));
        assert_eq!(joined.given().len(), set.given().len());
        assert!(Limits::parse("base = \"nav-grade\"").is_err());
        assert!(Limits::parse("span_covered_min = 90.0").is_err());
        assert!(Limits::parse("position_error_m_max = 100.0").is_err());
        assert!(Limits::named_or_read("no such file or set").is_err());
    }
}
