//! Every limit in one table: key, bound, unit, the retests that it applies to, its words and its value.
//!
//! The keys of a file ([`Limits`]), judgement, report and the reference page are made from its rows. A new limit is one row.

use serde::{Deserialize, Serialize};

use crate::calibration::PpmEstimate;
use crate::verify::flight::position::Flight;
use crate::verify::limits::source::{LimitsSource, Specification};
use crate::verify::limits::verdict::{Decided, DecisionRule, Verdict};
use crate::verify::values::rate_table::{MOST_UNVISITED, worst_known};
use crate::verify::values::repeatability::RUN_WITHOUT_BIAS;
use crate::verify::values::residual::RandomWalk;
use crate::verify::{AxisVerification, BiasRepeatability, Estimate, PlateauProof, ScaleProof};

/// Which side of a limit is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The value is at most the limit.
    Most,
    /// The value is at least the limit.
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
    /// Those with soaks and with ramps.
    SoaksAndRamps,
    /// Those at rest whose temperature moves.
    Moving,
}

impl Bound {
    /// `at most` or `at least`.
    pub fn words(self) -> &'static str {
        match self {
            Self::Most => "at most",
            Self::Least => "at least",
        }
    }
}

impl Applies {
    /// The retests in the words of the reference page.
    pub fn words(self) -> &'static str {
        match self {
            Self::Always => "every",
            Self::Turned => "on a rate table",
            Self::AtRest => "at rest",
            Self::KnownInput => "whose input rate is known",
            Self::BothTurned => "on a rate table, as the calibration",
            Self::Excluding => "with `--exclude`",
            Self::WithRate => "with rate terms",
            Self::SoaksAndRamps => "with soaks and ramps",
            Self::Moving => "at rest, with ramps",
        }
    }

    /// Scale factor and fixed bias: a table that turns one way does not part an asymmetry from them.
    fn needs_both_ways(self) -> bool {
        matches!(self, Self::Turned | Self::BothTurned | Self::KnownInput)
    }

    /// Why a retest is not asked; `None` where it is.
    fn not_asked(self, axis: &AxisVerification) -> Option<String> {
        let unless = |holds: bool, why: &str| (!holds).then(|| why.to_owned());
        match self {
            Self::Always => None,
            Self::Turned if axis.turned => unless(axis.turned_about, "needs a rate table that turns about this axis"),
            Self::Turned => Some("needs a retest on a rate table".to_owned()),
            Self::AtRest => unless(!axis.turned, "needs a retest at rest"),
            Self::KnownInput => axis.bias_repeatability_unavailable.clone(),
            Self::BothTurned => {
                let both = axis.turned_about && axis.scale_factor_calibrated;
                unless(both, "needs a rate table in calibration and retest")
            }
            Self::Excluding => unless(axis.left_out_fraction().is_some(), "no data excluded"),
            Self::SoaksAndRamps => {
                unless(axis.residual.ramp_offset_dph.is_some(), "needs 20 windows of soaks and 20 of ramps")
            }
            Self::Moving if axis.turned => Some("needs a retest at rest".to_owned()),
            Self::Moving => unless(axis.residual.ramps_rms_dph.is_some(), "the temperature does not move"),
            Self::WithRate => unless(axis.rate_coverage.is_some(), "the correction has no rate terms, or no record"),
        }
    }
}

/// A value with its standard error, where it has one.
type LimitValue = Option<(f64, Option<f64>)>;

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
    /// The value in words.
    pub label: &'static str,
    /// The same, exactly.
    pub exactly: &'static str,
    /// The largest limit that a file may state.
    pub(crate) largest: f64,
    pub(crate) stated: fn(&Limits) -> Option<f64>,
    value: fn(&AxisVerification) -> LimitValue,
    unknown: &'static str,
}

impl LimitSpec {
    /// True for a part of a whole, 0 to 1.
    pub fn is_fraction(&self) -> bool {
        self.largest == WHOLE
    }

    /// True where each run must meet it alone. What a retest must cover or gain is of all its runs.
    pub(crate) fn is_of_each_run(&self) -> bool {
        self.bound == Bound::Most && !OF_ALL.contains(&self.key)
    }

    pub(crate) fn judge(&self, limit: f64, axis: &AxisVerification, rule: DecisionRule) -> Verdict {
        if let Some(why) = self.applies.not_asked(axis) {
            return self.not_asked(limit, why);
        }
        if axis.turned_about && !axis.turned_both_ways && self.applies.needs_both_ways() {
            return self.unknown(limit, ONE_WAY.to_owned());
        }
        match (self.value)(axis).filter(|(value, _)| value.is_finite()) {
            Some(value) => self.at_plateau(axis, self.hold(limit, value, rule, axis.hours)),
            None => self.unknown(limit, self.why(axis)),
        }
    }

    /// A verdict that is not met, with the plateau whose value it is.
    fn at_plateau(&self, axis: &AxisVerification, verdict: Verdict) -> Verdict {
        let at_rest = axis.residual.plateaus;
        let turned = || scale_of(axis);
        let at_c = || match self.key {
            PLATEAU_SIGMA => at_rest?.worst_sigma_temperature_c,
            PLATEAU_OFFSET => Some(at_rest?.worst_offset_temperature_c),
            MEMORY => axis.residual.memory.map(|memory| memory.temperature_c),
            SCALE_SIGMA | SCALE_RANGE => turned()?.furthest_c(),
            ASYMMETRY => worst_plateau(axis, |plateau| plateau.asymmetry).map(|(at_c, _)| at_c),
            NONLINEARITY => worst_plateau(axis, |plateau| plateau.nonlinearity).map(|(at_c, _)| at_c),
            HYSTERESIS => turned()?.hysteresis().map(|(at_c, _)| at_c),
            _ => None,
        };
        let plateau_c = if verdict.pass == Some(false) { at_c() } else { None };
        Verdict { plateau_c, ..verdict }
    }

    /// The limit is not asked, and why.
    pub(crate) fn not_asked(&self, limit: f64, why: String) -> Verdict {
        Verdict {
            name: self.key.to_owned(),
            limit,
            value: None,
            sigma: None,
            value_of_every_row: None,
            undecided_hours: None,
            margin: None,
            run: None,
            plateau_c: None,
            pass: None,
            why: Some(why),
        }
    }

    /// The value is not known, and why: the limit is not decided.
    pub(crate) fn unknown(&self, limit: f64, why: String) -> Verdict {
        Verdict { pass: Some(false), ..self.not_asked(limit, why) }
    }

    /// The value judged by the limit, with the hours behind it.
    pub(crate) fn hold(
        &self,
        limit: f64,
        (value, sigma): (f64, Option<f64>),
        rule: DecisionRule,
        hours: f64,
    ) -> Verdict {
        let room = match self.bound {
            Bound::Most => limit - value,
            Bound::Least => value - limit,
        };
        let decided = rule.decide(room, sigma, hours);
        let undecided_hours = if let Decided::After(hours) = decided { Some(hours) } else { None };
        Verdict {
            value: Some(value),
            sigma,
            margin: (limit > 0.0).then(|| room / limit).filter(|margin| margin.is_finite()),
            pass: Some(matches!(decided, Decided::Met)),
            undecided_hours,
            why: None,
            ..self.not_asked(limit, String::new())
        }
    }

    /// Why the value is not known.
    fn why(&self, axis: &AxisVerification) -> String {
        let lone = axis.residual.plateaus.filter(|_| self.key == PLATEAU_OFFSET);
        let flown = axis.flight_unavailable.as_deref().filter(|_| self.key == POSITION_ERROR);
        match lone {
            Some(lone) => {
                let more = lone
                    .missing_h
                    .map_or("longer".to_owned(), |hours| format!("{:.0} min longer", (60.0 * hours).ceil()));
                format!("one plateau alone: there is nothing to compare it with. Soak {more} at a second temperature")
            }
            None => flown.unwrap_or(self.unknown).to_owned(),
        }
    }
}

pub(crate) const EXCLUDED: &str = "excluded_max";
/// Limits of the form *at most* that are of the whole retest, not of each run.
const OF_ALL: [&str; 3] = ["turn_on_sigma_dph_max", POSITION_ERROR, MEMORY];
/// A correction brings σ to its noise floor, and not below.
const LEAST_OVER_FLOOR: f64 = 0.9;
const PLATEAU_SIGMA: &str = "plateau_sigma_dph_max";
const PLATEAU_OFFSET: &str = "plateau_offset_dph_max";
const SCALE_SIGMA: &str = "scale_factor_sigma_ppm_max";
const SCALE_RANGE: &str = "scale_factor_peak_to_peak_ppm_max";
const ASYMMETRY: &str = "scale_factor_asymmetry_ppm_max";
const NONLINEARITY: &str = "scale_factor_nonlinearity_ppm_max";
const HYSTERESIS: &str = "scale_factor_hysteresis_ppm_max";
pub(crate) const POSITION_ERROR: &str = "position_error_m_max";
const MEMORY: &str = "memory_dph_max";
const NO_MEMORY: &str = "no temperature was soaked from below and from above: soak at 25 °C from both sides";
const NO_PLATEAU: &str = "no five steady windows within 1 °C of each other";
const NO_SLOPE: &str =
    "temperature (by σ 0.3 °C) and its rate (by 0.01 °C/min) do not vary, or not apart, or in fewer than ten windows";
const ONE_WAY: &str = "the table turned one way only: turn it both ways";
const NO_SCALE: &str = "fewer than two plateaus have it, or over 0.38 of the temperatures lie without one between them";
const NO_FLOOR: &str =
    "the noise floor is not known, or σ lies below it: what its rows show at short τ is no white noise";
const NO_NOISE: &str = "the rows do not show their noise: a window needs eight of them or more (a longer --window)";

/// The value alone, without a standard error.
fn plain(value: Option<f64>) -> LimitValue {
    value.map(|value| (value, None))
}

/// A value whose standard error is a part of it.
fn relative(value: Option<f64>, part: f64) -> LimitValue {
    value.map(|value| (value, Some(value * part)))
}

/// The size of a value in ppm.
fn size_ppm(estimate: Option<PpmEstimate>) -> LimitValue {
    estimate.map(|estimate| (estimate.ppm.abs(), Some(estimate.sigma_ppm)))
}

/// The largest of some of the plateaus' estimates, with its temperature.
fn worst_plateau(
    axis: &AxisVerification,
    value: fn(&PlateauProof) -> Option<PpmEstimate>,
) -> Option<(f64, PpmEstimate)> {
    let plateaus = scale_of(axis).into_iter().flat_map(|scale| &scale.plateaus);
    worst_known(plateaus.filter_map(|plateau| Some((plateau.temperature_c, value(plateau)?))))
}

fn largest_ppm(axis: &AxisVerification, value: fn(&PlateauProof) -> Option<PpmEstimate>) -> LimitValue {
    size_ppm(worst_plateau(axis, value).map(|(_, worst)| worst))
}

fn over_floor(axis: &AxisVerification) -> Option<f64> {
    axis.noise_floor.as_ref().map(|floor| axis.after.sigma_dph / floor.value_dph)
}

/// N with its standard error; its upper bound where it is not resolved.
fn walk_after(walk: RandomWalk) -> (f64, Option<f64>) {
    match walk.after_ends_deg_rt_h {
        Some([lower, upper]) if lower > 0.0 => (walk.after_deg_rt_h, Some((upper - lower) / 3.92)),
        Some([_, at_most]) => (at_most, None),
        None => (walk.after_deg_rt_h, None),
    }
}

/// σ is smaller than its own noise, beyond what it scatters by: the floor is no floor. A sine at short τ lifts it.
fn is_below_floor(axis: &AxisVerification) -> bool {
    let highest = |ratio: f64| ratio * (1.0 + 4.0 * axis.relative_sigma_over_floor());
    over_floor(axis).is_some_and(|ratio| highest(ratio) < LEAST_OVER_FLOOR)
}

/// The scale factor, where the table turned at enough of the temperatures.
fn scale_of(axis: &AxisVerification) -> Option<&ScaleProof> {
    axis.scale_factor.as_ref().filter(|scale| scale.unvisited_fraction <= MOST_UNVISITED)
}

/// The size of an estimate with its standard error.
fn size(estimate: Option<Estimate>) -> LimitValue {
    estimate.map(|estimate| (estimate.value.abs(), Some(estimate.sigma)))
}

/// What a file may state at most: any number, or a part of a whole.
const ANY: f64 = f64::INFINITY;
const WHOLE: f64 = 1.0;

/// [`Limits`] and [`SPECS`] from one row per limit: the words of the reference, then key, words of a report, bound, largest number
/// that a file may state, unit, retests, value, and what is said where there is none.
macro_rules! limits {
    ($(
        #[doc = $exactly:literal]
        $key:ident: $label:literal, $bound:ident, $to:ident, $unit:literal, $applies:ident, $value:expr, $unknown:expr;
    )*) => {
        /// Limits of a verification. A row of the reference page says each value exactly.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        #[non_exhaustive]
        pub struct Limits {
            /// Set whose limits hold where this file gives none: `navigation-grade` or `paper`.
            pub base: Option<String>,
            /// How a value with an uncertainty is compared with a limit; `simple` by default.
            pub decision: Option<DecisionRule>,
            /// The customer's specification.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub specification: Option<Specification>,
            /// Where they come from.
            #[serde(skip)]
            pub source: LimitsSource,
            $(#[doc = $exactly] pub $key: Option<f64>,)*
            /// A flight, whose position error is then stated.
            pub flight: Option<Flight>,
        }

        /// Every limit, in the order of reports.
        pub const SPECS: &[LimitSpec] = &[$(LimitSpec {
            key: stringify!($key),
            bound: Bound::$bound,
            unit: $unit,
            applies: Applies::$applies,
            label: $label,
            exactly: $exactly,
            largest: $to,
            stated: |limits| limits.$key,
            value: $value,
            unknown: $unknown,
        }),*];
    };
}

limits! {
    /// σ after
    sigma_dph_max: "σ after correction", Most, ANY, "deg/h", Always,
        |a| relative(Some(a.after.sigma_dph), a.relative_sigma_of_spread()), "";
    /// max − min after
    peak_to_peak_dph_max: "max − min after correction", Most, ANY, "deg/h", Always,
        |a| relative(Some(a.after.peak_to_peak * a.after.dph_per_unit()), a.relative_sigma_of_range()), "";
    /// σ after over the noise floor
    sigma_over_floor_max: "σ over the noise floor", Most, ANY, "", Always,
        |a| {
            let ratio = over_floor(a).filter(|_| !is_below_floor(a));
            relative(ratio, a.relative_sigma_over_floor())
        },
        NO_FLOOR;
    /// σ after beyond the noise floor, √(σ² − floor²)
    sigma_beyond_floor_dph_max: "σ beyond the noise floor", Most, ANY, "deg/h", Always,
        |a| a.sigma_beyond_floor().filter(|_| !is_below_floor(a)), NO_FLOOR;
    /// max − min before over after
    improvement_min: "max − min, before over after", Least, ANY, "", Always,
        |a| relative(a.improvement, a.relative_sigma_of_range()), "the residual is zero: there is nothing to divide by";
    /// σ before over after
    improvement_sigma_min: "σ, before over after", Least, ANY, "", Always,
        |a| relative(a.improvement_sigma, a.relative_sigma_of_spread()), "the residual is zero: there is nothing to divide by";
    /// fraction of the windows beyond the fit's temperatures by over 0.5 °C
    out_of_span_max: "beyond calibrated temperatures, fraction", Most, WHOLE, "", Always,
        |a| plain(Some(a.out_of_span_fraction)), "";
    /// fraction of the fit's temperature span that the windows cover
    span_covered_min: "temperature span covered, fraction", Least, WHOLE, "", Always,
        |a| plain(a.coverage.as_ref().map(|coverage| coverage.covered_fraction)), "the retest has no temperature";
    /// largest σ within a plateau
    plateau_sigma_dph_max: "plateau σ, largest", Most, ANY, "deg/h", Always,
        |a| a.residual.plateaus.map(|p| (p.worst_sigma_dph, Some(p.worst_sigma_dph * p.worst_relative_sigma))), NO_PLATEAU;
    /// largest distance of a plateau's mean from its run's
    // The mean of an only plateau is that of its run, or nearly.
    plateau_offset_dph_max: "plateau bias, largest", Most, ANY, "deg/h", Always,
        |a| size(a.residual.plateaus.filter(|p| p.plateaus > 1).map(|p| p.worst_offset_dph)), NO_PLATEAU;
    /// rms in ramps
    ramps_rms_dph_max: "ramp residual, rms", Most, ANY, "deg/h", Always,
        |a| relative(a.residual.ramps_rms_dph, a.relative_sigma_of_spread()), "fewer than ten windows in ramps";
    /// mean of the ramps less mean of the soaks
    ramp_offset_dph_max: "ramps less soaks", Most, ANY, "deg/h", SoaksAndRamps,
        |a| size(a.residual.ramp_offset_dph), "";
    /// slope over temperature
    drift_dph_per_c_max: "bias temperature slope", Most, ANY, "deg/h per degC", Always,
        |a| size(a.residual.temperature_slope), NO_SLOPE;
    /// slope over the temperature rate
    drift_dph_per_cpm_max: "bias temperature-rate slope", Most, ANY, "deg/h per degC/min", Always,
        |a| size(a.residual.rate_slope), NO_SLOPE;
    /// mean while heating less mean while cooling
    hysteresis_dph_max: "hysteresis, heating less cooling", Most, ANY, "deg/h", Always,
        |a| size(a.residual_diagnostics.hysteresis_dph), "fewer than 20 windows of heating or of cooling";
    /// mean at rest after heating less after cooling at one temperature, each over the last hour of its soak
    memory_dph_max: "memory, after heating less after cooling", Most, ANY, "deg/h", Moving,
        |a| size(a.residual.memory.map(|memory| memory.difference_dph)), NO_MEMORY;
    /// σ of the scale factor over the plateaus
    scale_factor_sigma_ppm_max: "scale factor over temperature, σ", Most, ANY, "ppm", Turned,
        |a| plain(scale_of(a).map(|scale| scale.after.sigma_ppm)), NO_SCALE;
    /// max − min of the scale factor over the plateaus
    scale_factor_peak_to_peak_ppm_max: "scale factor over temperature, max − min", Most, ANY, "ppm", Turned,
        |a| plain(scale_of(a).map(|scale| scale.after.peak_to_peak_ppm)), NO_SCALE;
    /// angle random walk after
    arw_deg_rt_h_max: "angle random walk", Most, ANY, "deg/rt h", AtRest,
        |a| a.residual.random_walk.map(walk_after), NO_NOISE;
    /// angle random walk after over before
    arw_increase_max: "angle random walk, after over before", Most, ANY, "", AtRest,
        |a| plain(a.residual.random_walk.map(|walk| walk.after_deg_rt_h / walk.before_deg_rt_h)), NO_NOISE;
    /// bias instability after
    bias_instability_dph_max: "bias instability", Most, ANY, "deg/h", Always,
        |a| size(a.residual.bias_instability_dph), "no six windows that follow each other";
    /// position error of the flight by the drift after, with two of its σ
    position_error_m_max: "position error of the flight, with 2 σ", Most, ANY, "m", Always,
        |a| plain(a.flight.as_ref().map(|flight| flight.bound_after_m)), "the flight was not flown";
    /// rms over temperature of the smooth residual, less what noise makes of it
    temperature_residual_dph_max: "bias over temperature beyond noise, rms", Most, ANY, "deg/h", Always,
        |a| size(a.residual.over_temperature_dph), "fewer than 40 windows with a temperature, or less than 1 °C between them";
    /// largest fixed bias of a run less that of the calibration
    bias_repeatability_dph_max: "bias repeatability, largest", Most, ANY, "deg/h", KnownInput,
        |a| size(a.bias_of_every_run().ok().and_then(|biases| Some(biases.worst()?.difference_dph))), RUN_WITHOUT_BIAS;
    /// one-sided 95 % bound of the σ from turn-on to turn-on
    turn_on_sigma_dph_max: "turn-on bias, σ (95 % bound)", Most, ANY, "deg/h", KnownInput,
        |a| plain(a.bias_of_every_run().ok().and_then(|biases| Some(biases.turn_ons?.sigma_upper_dph))),
        "fewer than two turn-ons are stated (--turn-ons), or a run is shorter than eight windows or was turned at one rate alone";
    /// largest fixed bias of a run
    fixed_bias_dph_max: "fixed bias after correction, largest", Most, ANY, "deg/h", KnownInput,
        |a| size(a.bias_of_every_run().ok().and_then(BiasRepeatability::largest_bias_dph)), RUN_WITHOUT_BIAS;
    /// scale factor less that of the calibration
    scale_factor_repeatability_ppm_max: "scale factor repeatability", Most, ANY, "ppm", BothTurned,
        |a| size_ppm(scale_of(a).and(a.scale_factor_difference)), NO_SCALE;
    /// deviation of the scale factor from its nominal value
    scale_factor_ppm_max: "scale factor error", Most, ANY, "ppm", Turned,
        |a| {
            let scale = scale_of(a)?;
            let sigma_ppm = scale.of_noise_ppm / (scale.plateaus.len() as f64).sqrt();
            Some((scale.after.mean_ppm.abs(), Some(sigma_ppm)))
        },
        NO_SCALE;
    /// largest asymmetry of the scale factor at a plateau
    scale_factor_asymmetry_ppm_max: "scale factor asymmetry, largest", Most, ANY, "ppm", Turned,
        |a| largest_ppm(a, |plateau| plateau.asymmetry),
        "no plateau has rates in both directions, or too few temperatures have a plateau";
    /// largest nonlinearity of the scale factor at a plateau
    scale_factor_nonlinearity_ppm_max: "scale factor nonlinearity, largest", Most, ANY, "ppm", Turned,
        |a| largest_ppm(a, |plateau| plateau.nonlinearity), "no plateau has three rates, or too few temperatures have a plateau";
    /// largest difference of the scale factor between visits of one temperature
    scale_factor_hysteresis_ppm_max: "scale factor hysteresis, largest", Most, ANY, "ppm", Turned,
        |a| size_ppm(scale_of(a).and_then(ScaleProof::hysteresis).map(|(_, worst)| worst)),
        "no temperature was visited twice, or too few of them have a plateau";
    /// fraction of the fit's temperature rates that the ramps reach
    rate_covered_min: "temperature rates covered, fraction", Least, WHOLE, "", WithRate,
        |a| plain(a.rate_coverage), "the ramps of the fit are not known";
    /// fraction of the time of the runs of which no row is usable
    missing_max: "time without usable rows, fraction", Most, WHOLE, "", Always,
        |a| plain(Some(a.missing_fraction)), "";
    /// fraction of the rows that was excluded on request, or flagged and differs from its neighbours by over 4 σ
    excluded_max: "rows excluded, or flagged and off, fraction", Most, WHOLE, "", Excluding,
        |a| plain(a.left_out_fraction()), "";
}
