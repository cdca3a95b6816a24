//! `limits.toml`: what a retest must show. Every key is optional; unknown keys are refused.
//!
//! Two sets come with the program, by name: `navigation-grade` and `paper`; `base` starts from one of them. A limit whose value
//! cannot be had is not met. Those of a rate table are asked only of a retest on one, those of a gyro at rest only of one at
//! rest: what is not asked is listed as such, and never counts as met.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::PpmEstimate;
use crate::verify::flight::Flight;
use crate::verify::{AxisVerification, Estimate, PlateauProof, ScaleProof};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{hex, sha256};
use sagnac_units::format::{significant, with_sigma};

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
#[non_exhaustive]
pub struct Verdict {
    /// Key of the limit.
    pub name: String,
    /// The limit.
    pub limit: f64,
    /// The value; null where it cannot be had (no floor): then the limit is not met.
    pub value: Option<f64>,
    /// Standard error of the value, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// The value over every row, where some were excluded on request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value_of_every_row: Option<f64>,
    /// The guard band reaches across the limit: hours of retest, beyond those of this one, after which it would no longer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undecided_hours: Option<f64>,
    /// Room between value and limit as a part of the limit; negative where it is not met, null without a value.
    pub margin: Option<f64>,
    /// Run whose value this is, where it is worse alone than all runs together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// It is met; false where it is not met or not decided; null where it is not asked of such a retest.
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

    /// `met`, `not met`, `not decided` or `not asked`.
    pub fn word(&self) -> &'static str {
        match (self.pass, self.undecided_hours) {
            (Some(true), _) => "met",
            (Some(false), Some(_)) => "not decided",
            (Some(false), None) => "not met",
            (None, _) => "not asked",
        }
    }

    /// Of one limit, for a run alone and for all: only where the run has a value, and only of limits that a run can be asked for.
    pub(crate) fn is_worse_than(&self, all: &Self) -> bool {
        let rank = |verdict: &Self| match (verdict.pass, verdict.undecided_hours) {
            (Some(false), None) => 2,
            (Some(false), Some(_)) => 1,
            _ => 0,
        };
        let alone = SPECS.iter().any(|spec| spec.key == self.name && spec.bound == Bound::Most)
            && !OF_ALL.contains(&self.name.as_str());
        alone && self.value.is_some() && rank(self) > rank(all)
    }

    /// What more a verdict says: how long a retest would decide, or why there is no value.
    pub fn remark(&self) -> Option<String> {
        let of_run = self.run.as_ref().map(|run| format!("{run} alone"));
        let more = match self.undecided_hours {
            Some(hours) if hours >= MOST_HOURS => {
                Some("the value lies at its limit: no longer retest decides".to_owned())
            }
            Some(hours) => Some(format!("{} more hours would decide", hours.ceil())),
            None => self.why.clone(),
        };
        match (of_run, more) {
            (Some(run), Some(more)) => Some(format!("{run}; {more}")),
            (run, more) => run.or(more),
        }
    }
}

/// How many limits are met, not met, and not asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Judged {
    /// Met.
    pub met: usize,
    /// Not met.
    pub not_met: usize,
    /// Within the guard band: a longer retest would decide.
    pub not_decided: usize,
    /// Not asked of such a retest.
    pub not_asked: usize,
}

impl Judged {
    /// Counts verdicts.
    pub fn of<'a>(verdicts: impl IntoIterator<Item = &'a Verdict>) -> Self {
        let mut out = Self::default();
        for verdict in verdicts {
            *match (verdict.pass, verdict.undecided_hours) {
                (Some(true), _) => &mut out.met,
                (Some(false), None) => &mut out.not_met,
                (Some(false), Some(_)) => &mut out.not_decided,
                (None, _) => &mut out.not_asked,
            } += 1;
        }
        out
    }

    /// `9 of 10 limits met, 1 not decided, 2 not asked of such a retest`.
    pub fn words(self) -> String {
        let Self { met, not_met, not_decided, not_asked } = self;
        let part = |n: usize, what: &str| if n > 0 { format!(", {n} {what}") } else { String::new() };
        let undecided = part(not_decided, "not decided");
        let unasked = part(not_asked, "not asked of such a retest");
        format!("{met} of {} limits met{undecided}{unasked}", met + not_met + not_decided)
    }
}

impl Limits {
    /// Reads a limits file.
    ///
    /// # Errors
    /// Unreadable, an unknown key, a limit below zero or no number.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
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
        for (spec, value) in limits.given() {
            if !(value.is_finite() && value >= 0.0) || (spec.is_fraction && value > 1.0) {
                return Err(Error::input("a limit is a number from 0 on (those of a fraction: to 1)")
                    .column(spec.key)
                    .value(value.to_string()));
            }
        }
        if let Some(flight) = &limits.flight {
            flight.check()?;
        }
        if limits.position_error_m_max.is_some() && limits.flight.is_none() {
            return Err(Error::input("a limit of the position error needs a [flight]")
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

    /// The limits that the file gives, with their values.
    fn given(&self) -> Vec<(&'static LimitSpec, f64)> {
        SPECS.iter().filter_map(|spec| Some((spec, (spec.of)(self)?))).collect()
    }

    /// Judges an axis by every limit given, and by how much was excluded.
    pub(crate) fn judge(&self, axis: &AxisVerification) -> Vec<Verdict> {
        let implied = self.excluded_max.is_none() && axis.excluded_fraction.is_some();
        let excluded = implied.then(|| SPECS.iter().find(|spec| spec.key == EXCLUDED)).flatten();
        let all = self.given().into_iter().chain(excluded.map(|spec| (spec, DEFAULT_EXCLUDED_MAX)));
        let rule = self.decision.unwrap_or_default();
        all.map(|(spec, limit)| spec.judge(limit, axis, rule)).collect()
    }
}

/// How a value with an uncertainty is compared with its limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DecisionRule {
    /// The value alone.
    #[default]
    Simple,
    /// With a guard band of 1.645 of the value's standard errors, as ISO 14253-1 has it: met where value and band are within
    /// the limit, not met where both are beyond it, else not decided.
    Guarded,
}

/// One-sided 95 %.
const GUARD_SIGMAS: f64 = 1.645;
/// Hours from which on no retest is proposed.
const MOST_HOURS: f64 = 1000.0;
/// Part of the rows that may be excluded where a file does not state it.
const DEFAULT_EXCLUDED_MAX: f64 = 0.005;

/// Where a value lies.
enum Decided {
    Met,
    NotMet,
    /// More hours that would decide.
    After(f64),
}

impl DecisionRule {
    /// From the room to the limit (negative beyond it), its standard error, and the hours behind it. An uncertainty falls with
    /// the root of the hours.
    fn decide(self, room: f64, sigma: Option<f64>, hours: f64) -> Decided {
        let guard = match self {
            Self::Simple => 0.0,
            Self::Guarded => GUARD_SIGMAS * sigma.unwrap_or(0.0),
        };
        if room >= guard {
            Decided::Met
        } else if room < -guard {
            Decided::NotMet
        } else {
            let needed = (guard / room).powi(2) - 1.0;
            Decided::After(if needed.is_finite() { (hours * needed).min(MOST_HOURS) } else { MOST_HOURS })
        }
    }
}

/// Which side of a limit is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The figure is at most the limit.
    Most,
    /// The figure is at least the limit.
    Least,
}

/// Which retests a limit applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applies {
    /// Every one.
    Always,
    /// Those on a rate table.
    Turned,
    /// Those at rest.
    AtRest,
    /// Those whose input rate is known, as that of the calibration was.
    KnownInput,
    /// Those on a rate table whose calibration was on one, too.
    BothTurned,
    /// Those of which something was excluded on request.
    Excluding,
    /// Those whose correction has rate terms.
    WithRate,
}

impl Applies {
    /// Why a retest is not asked; `None` where it is.
    fn not_asked(self, axis: &AxisVerification) -> Option<String> {
        let unless = |holds: bool, why: &str| (!holds).then(|| why.to_owned());
        match self {
            Self::Always => None,
            Self::Turned => unless(axis.turned, "needs a retest on a rate table"),
            Self::AtRest => unless(!axis.turned, "needs a retest at rest"),
            Self::KnownInput => axis.bias_repeatability_unavailable.clone(),
            Self::BothTurned => {
                let both = axis.scale_factor_difference.is_some();
                unless(both, "needs a calibration and a retest on a rate table, and the calibration's record")
            }
            Self::Excluding => unless(axis.excluded_fraction.is_some(), "nothing was asked to be excluded"),
            Self::WithRate => unless(axis.rate_coverage.is_some(), "the correction has no rate terms, or no record"),
        }
    }
}

/// A figure with its standard error where it has one.
type Figure = Option<(f64, Option<f64>)>;

/// Everything about one limit: file, judgement, report and documentation are made from these.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct LimitSpec {
    /// Key in the file.
    pub key: &'static str,
    /// Which side is met.
    pub bound: Bound,
    /// Unit; empty for a ratio.
    pub unit: &'static str,
    /// Which retests it applies to.
    pub applies: Applies,
    /// The figure in words.
    pub label: &'static str,
    /// It is a fraction of a whole: 0 to 1.
    is_fraction: bool,
    of: fn(&Limits) -> Option<f64>,
    figure: fn(&AxisVerification) -> Figure,
    unknown: &'static str,
}

impl LimitSpec {
    fn judge(&self, limit: f64, axis: &AxisVerification, rule: DecisionRule) -> Verdict {
        let blank = Verdict {
            name: self.key.to_owned(),
            limit,
            value: None,
            sigma: None,
            value_of_every_row: None,
            undecided_hours: None,
            margin: None,
            run: None,
            pass: None,
            why: None,
        };
        if let why @ Some(_) = self.applies.not_asked(axis) {
            return Verdict { why, ..blank };
        }
        let Some((value, sigma)) = (self.figure)(axis).filter(|(value, _)| value.is_finite()) else {
            return Verdict { pass: Some(false), why: Some(self.why(axis)), ..blank };
        };
        let room = match self.bound {
            Bound::Most => limit - value,
            Bound::Least => value - limit,
        };
        let decided = rule.decide(room, sigma, axis.hours);
        let undecided_hours = if let Decided::After(hours) = decided { Some(hours) } else { None };
        Verdict {
            value: Some(value),
            sigma,
            margin: (limit > 0.0).then(|| room / limit),
            pass: Some(matches!(decided, Decided::Met)),
            undecided_hours,
            ..blank
        }
    }

    /// Why the figure is not known.
    fn why(&self, axis: &AxisVerification) -> String {
        let lone = axis.residual.plateaus.is_some() && self.key == PLATEAU_OFFSET;
        let flown = axis.flight_unavailable.as_deref().filter(|_| self.key == POSITION_ERROR);
        if lone {
            "one plateau alone: there is nothing to compare it with".to_owned()
        } else {
            flown.unwrap_or(self.unknown).to_owned()
        }
    }
}

const EXCLUDED: &str = "excluded_max";
/// Limits of the whole retest, not of each run.
const OF_ALL: [&str; 4] = ["turn_on_sigma_dph_max", "missing_max", EXCLUDED, "position_error_m_max"];
const PLATEAU_OFFSET: &str = "plateau_offset_dph_max";
const POSITION_ERROR: &str = "position_error_m_max";
const NO_PLATEAU: &str = "no five steady windows within 1 °C of each other";
const NO_SLOPE: &str =
    "temperature (by σ 0.3 °C) and its rate (by 0.01 °C/min) do not vary, or not apart, or in fewer than ten windows";
const NO_SCALE: &str = "fewer than two plateaus have it";
const NO_NOISE: &str = "the rows do not show their noise";

/// The value alone, without a standard error.
fn plain(value: Option<f64>) -> Figure {
    value.map(|value| (value, None))
}

/// A value whose standard error is a part of it.
fn relative(value: Option<f64>, part: f64) -> Figure {
    value.map(|value| (value, Some(value * part)))
}

/// The size of a value in ppm.
fn size_ppm(estimate: Option<PpmEstimate>) -> Figure {
    estimate.map(|estimate| (estimate.ppm.abs(), Some(estimate.sigma_ppm)))
}

/// The largest of some of the plateaus' estimates.
fn largest_ppm(axis: &AxisVerification, of: fn(&PlateauProof) -> Option<PpmEstimate>) -> Figure {
    let plateaus = axis.scale_factor.iter().flat_map(|scale| &scale.plateaus);
    size_ppm(plateaus.filter_map(of).max_by(|a, b| a.ppm.abs().total_cmp(&b.ppm.abs())))
}

/// The size of an estimate with its standard error.
fn size(estimate: Option<Estimate>) -> Figure {
    estimate.map(|estimate| (estimate.value.abs(), Some(estimate.sigma)))
}

/// One row of the table below.
macro_rules! limit {
    ($key:ident, $bound:ident, $unit:literal, $applies:ident, $label:literal, $fraction:literal, $figure:expr, $unknown:expr) => {
        LimitSpec {
            key: stringify!($key),
            bound: Bound::$bound,
            unit: $unit,
            applies: Applies::$applies,
            label: $label,
            is_fraction: $fraction,
            of: |limits| limits.$key,
            figure: $figure,
            unknown: $unknown,
        }
    };
}

/// Every limit, in the order of reports.
pub const SPECS: [LimitSpec; 32] = [
    limit!(
        sigma_dph_max,
        Most,
        "deg/h",
        Always,
        "σ after",
        false,
        |a| relative(Some(a.after.sigma_dph), a.relative_sigma_of_spread()),
        ""
    ),
    limit!(
        peak_to_peak_dph_max,
        Most,
        "deg/h",
        Always,
        "max − min after",
        false,
        |a| relative(Some(a.after.peak_to_peak * a.after.dph_per_unit()), a.relative_sigma_of_range()),
        ""
    ),
    limit!(
        sigma_over_floor_max,
        Most,
        "",
        Always,
        "σ after over the noise floor",
        false,
        |a| {
            let ratio = a.noise_floor.as_ref().map(|floor| a.after.sigma_dph / floor.value_dph);
            relative(ratio, a.relative_sigma_of_spread())
        },
        "the noise floor is not known"
    ),
    limit!(
        sigma_beyond_floor_dph_max,
        Most,
        "deg/h",
        Always,
        "σ after beyond the noise floor, √(σ² − floor²)",
        false,
        |a| a.sigma_beyond_floor(),
        "the noise floor is not known"
    ),
    limit!(
        improvement_min,
        Least,
        "",
        Always,
        "max − min before over after",
        false,
        |a| relative(a.improvement, a.relative_sigma_of_range()),
        "the residual is zero: there is nothing to divide by"
    ),
    limit!(
        improvement_sigma_min,
        Least,
        "",
        Always,
        "σ before over after",
        false,
        |a| relative(a.improvement_sigma, a.relative_sigma_of_spread()),
        "the residual is zero: there is nothing to divide by"
    ),
    limit!(
        out_of_span_max,
        Most,
        "",
        Always,
        "fraction of the windows beyond the fit's temperatures by over 0.5 °C",
        true,
        |a| plain(Some(a.out_of_span_fraction)),
        ""
    ),
    limit!(
        span_covered_min,
        Least,
        "",
        Always,
        "fraction of the fit's temperature span that the windows cover",
        true,
        |a| plain(a.coverage.as_ref().map(|coverage| coverage.covered_fraction)),
        "the retest has no temperature"
    ),
    limit!(
        plateau_sigma_dph_max,
        Most,
        "deg/h",
        Always,
        "largest σ within a plateau",
        false,
        |a| a.residual.plateaus.map(|p| (p.worst_sigma_dph, Some(p.worst_sigma_dph * p.worst_relative_sigma))),
        NO_PLATEAU
    ),
    // The mean of an only plateau is that of its run, or nearly.
    limit!(
        plateau_offset_dph_max,
        Most,
        "deg/h",
        Always,
        "largest distance of a plateau's mean from its run's",
        false,
        |a| size(a.residual.plateaus.filter(|p| p.plateaus > 1).map(|p| p.worst_offset_dph)),
        NO_PLATEAU
    ),
    limit!(
        ramps_rms_dph_max,
        Most,
        "deg/h",
        Always,
        "rms in ramps",
        false,
        |a| relative(a.residual.ramps_rms_dph, a.relative_sigma_of_spread()),
        "fewer than ten windows in ramps"
    ),
    limit!(
        drift_dph_per_c_max,
        Most,
        "deg/h per degC",
        Always,
        "slope over temperature",
        false,
        |a| size(a.residual.temperature_slope),
        NO_SLOPE
    ),
    limit!(
        drift_dph_per_cpm_max,
        Most,
        "deg/h per degC/min",
        Always,
        "slope over the temperature rate",
        false,
        |a| size(a.residual.rate_slope),
        NO_SLOPE
    ),
    limit!(
        hysteresis_dph_max,
        Most,
        "deg/h",
        Always,
        "mean while heating less mean while cooling",
        false,
        |a| size(a.residual_diagnostics.hysteresis_dph),
        "fewer than 20 windows of heating or of cooling"
    ),
    limit!(
        scale_factor_sigma_ppm_max,
        Most,
        "ppm",
        Turned,
        "σ of the scale factor over the plateaus",
        false,
        |a| plain(a.scale_factor.as_ref().map(|scale| scale.after.sigma_ppm)),
        NO_SCALE
    ),
    limit!(
        scale_factor_peak_to_peak_ppm_max,
        Most,
        "ppm",
        Turned,
        "max − min of the scale factor over the plateaus",
        false,
        |a| plain(a.scale_factor.as_ref().map(|scale| scale.after.peak_to_peak_ppm)),
        NO_SCALE
    ),
    limit!(
        arw_deg_rt_h_max,
        Most,
        "deg/rt h",
        AtRest,
        "angle random walk after",
        false,
        |a| plain(a.residual.random_walk.map(|walk| walk.after_deg_rt_h)),
        NO_NOISE
    ),
    limit!(
        arw_increase_max,
        Most,
        "",
        AtRest,
        "angle random walk after over before",
        false,
        |a| plain(a.residual.random_walk.map(|walk| walk.after_deg_rt_h / walk.before_deg_rt_h)),
        NO_NOISE
    ),
    limit!(
        bias_instability_dph_max,
        Most,
        "deg/h",
        Always,
        "bias instability after",
        false,
        |a| size(a.residual.bias_instability_dph),
        "no six windows that follow each other"
    ),
    limit!(
        position_error_m_max,
        Most,
        "m",
        Always,
        "position error of the flight by the drift after, with two of its σ",
        false,
        |a| plain(a.flight.as_ref().map(|flight| flight.bound_after_m)),
        "the flight was not flown"
    ),
    limit!(
        temperature_residual_dph_max,
        Most,
        "deg/h",
        Always,
        "rms over temperature of the smooth residual, less what noise makes of it",
        false,
        |a| size(a.residual.over_temperature_dph),
        "fewer than 40 windows with a temperature, or less than 1 °C between them"
    ),
    limit!(
        bias_repeatability_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "largest fixed bias of a run less that of the calibration",
        false,
        |a| size(a.bias_repeatability.as_ref().and_then(|found| Some(found.worst()?.difference_dph))),
        "no run of the retest has it"
    ),
    limit!(
        turn_on_sigma_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "one-sided 95 % bound of the σ from turn-on to turn-on",
        false,
        |a| plain(a.bias_repeatability.as_ref().and_then(|found| Some(found.turn_ons?.sigma_upper_dph))),
        "fewer than two runs"
    ),
    limit!(
        fixed_bias_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "largest fixed bias of a run",
        false,
        |a| size(a.bias_repeatability.as_ref().and_then(|found| found.largest_bias_dph())),
        "no run of the retest has it"
    ),
    limit!(
        scale_factor_repeatability_ppm_max,
        Most,
        "ppm",
        BothTurned,
        "scale factor less that of the calibration",
        false,
        |a| size_ppm(a.scale_factor_difference),
        NO_SCALE
    ),
    limit!(
        scale_factor_ppm_max,
        Most,
        "ppm",
        Turned,
        "deviation of the scale factor from its nominal value",
        false,
        |a| {
            let scale = a.scale_factor.as_ref()?;
            let sigma_ppm = scale.of_noise_ppm / (scale.plateaus.len() as f64).sqrt();
            Some((scale.after.mean_ppm.abs(), Some(sigma_ppm)))
        },
        NO_SCALE
    ),
    limit!(
        scale_factor_asymmetry_ppm_max,
        Most,
        "ppm",
        Turned,
        "largest asymmetry of the scale factor at a plateau",
        false,
        |a| largest_ppm(a, |plateau| plateau.asymmetry),
        "no plateau has rates in both directions"
    ),
    limit!(
        scale_factor_nonlinearity_ppm_max,
        Most,
        "ppm",
        Turned,
        "largest nonlinearity of the scale factor at a plateau",
        false,
        |a| largest_ppm(a, |plateau| plateau.nonlinearity),
        "no plateau has three rates"
    ),
    limit!(
        scale_factor_hysteresis_ppm_max,
        Most,
        "ppm",
        Turned,
        "largest difference of the scale factor between visits of one temperature",
        false,
        |a| size_ppm(a.scale_factor.as_ref().and_then(ScaleProof::hysteresis)),
        "no temperature was visited twice"
    ),
    limit!(
        rate_covered_min,
        Least,
        "",
        WithRate,
        "fraction of the fit's temperature rates that the ramps reach",
        true,
        |a| plain(a.rate_coverage),
        "the ramps of the fit are not known"
    ),
    limit!(
        missing_max,
        Most,
        "",
        Always,
        "fraction of the time of the runs of which no row is usable",
        true,
        |a| plain(Some(a.missing_fraction)),
        ""
    ),
    limit!(
        excluded_max,
        Most,
        "",
        Excluding,
        "fraction of the rows that was excluded on request",
        true,
        |a| plain(a.excluded_fraction),
        ""
    ),
];

impl std::str::FromStr for Limits {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text)
    }
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

    /// The table of the reference is made from [`SPECS`].
    #[test]
    fn every_limit_is_in_the_reference() {
        let page = include_str!("../../../../docs/reference/limits.md");
        for spec in &SPECS {
            let bound = match spec.bound {
                Bound::Most => "at most",
                Bound::Least => "at least",
            };
            let retests = match spec.applies {
                Applies::Always => "every",
                Applies::Turned => "on a rate table",
                Applies::AtRest => "at rest",
                Applies::KnownInput => "whose input rate is known",
                Applies::BothTurned => "on a rate table, as the calibration",
                Applies::Excluding => "with `--exclude`",
                Applies::WithRate => "with rate terms",
            };
            let unit = if spec.unit.is_empty() { "-" } else { spec.unit };
            let row = format!("| `{}` | {} | {bound} | {unit} | {retests} |", spec.key, spec.label);
            assert!(page.contains(&row), "docs/reference/limits.md has no row\n{row}");
        }
        let table = page.split("## Decision").next().unwrap();
        let rows = table.lines().filter(|line| line.starts_with("| `"));
        assert_eq!(rows.count(), SPECS.len());
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
