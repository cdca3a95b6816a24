//! Every limit in one table: key, bound, unit, the retests that it applies to, and the figure of it.
//!
//! File, judgement, report and reference are made from [`SPECS`].

use crate::calibration::PpmEstimate;
use crate::verify::limits::stated::Limits;
use crate::verify::limits::verdict::{Decided, DecisionRule, Verdict};
use crate::verify::values::rate_table::{MOST_UNVISITED, worst_known};
use crate::verify::values::repeatability::RUN_WITHOUT_BIAS;
use crate::verify::{AxisVerification, BiasRepeatability, Estimate, PlateauProof, ScaleProof};

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
    /// Those with soaks and with ramps.
    SoaksAndRamps,
}

impl Applies {
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
                unless(both, "needs a calibration and a retest on a rate table, and the calibration's record")
            }
            Self::Excluding => unless(axis.excluded_fraction.is_some(), "nothing was asked to be excluded"),
            Self::SoaksAndRamps => {
                unless(axis.residual.ramp_offset_dph.is_some(), "needs 20 windows of soaks and 20 of ramps")
            }
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
    pub(crate) is_fraction: bool,
    pub(crate) of: fn(&Limits) -> Option<f64>,
    figure: fn(&AxisVerification) -> Figure,
    unknown: &'static str,
}

impl LimitSpec {
    /// True where each run must meet it alone. What a retest must cover or gain is of all its runs.
    pub(crate) fn is_of_each_run(&self) -> bool {
        self.bound == Bound::Most && !OF_ALL.contains(&self.key)
    }

    pub(crate) fn judge(&self, limit: f64, axis: &AxisVerification, rule: DecisionRule) -> Verdict {
        if let Some(why) = self.applies.not_asked(axis) {
            return self.not_asked(limit, why);
        }
        match (self.figure)(axis).filter(|(value, _)| value.is_finite()) {
            Some(figure) => self.hold(limit, figure, rule, axis.hours),
            None => self.unknown(limit, self.why(axis)),
        }
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
            pass: None,
            why: Some(why),
        }
    }

    /// The figure is not known, and why: the limit is not met.
    pub(crate) fn unknown(&self, limit: f64, why: String) -> Verdict {
        Verdict { pass: Some(false), ..self.not_asked(limit, why) }
    }

    /// The figure held against the limit, with the hours behind it.
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
            margin: (limit > 0.0).then(|| room / limit),
            pass: Some(matches!(decided, Decided::Met)),
            undecided_hours,
            why: None,
            ..self.not_asked(limit, String::new())
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

pub(crate) const EXCLUDED: &str = "excluded_max";
/// Limits of the form *at most* that are of the whole retest, not of each run.
const OF_ALL: [&str; 2] = ["turn_on_sigma_dph_max", POSITION_ERROR];
/// A correction brings σ to its noise floor, and not below.
const LEAST_OVER_FLOOR: f64 = 0.9;
const PLATEAU_OFFSET: &str = "plateau_offset_dph_max";
pub(crate) const POSITION_ERROR: &str = "position_error_m_max";
const NO_PLATEAU: &str = "no five steady windows within 1 °C of each other";
const NO_SLOPE: &str =
    "temperature (by σ 0.3 °C) and its rate (by 0.01 °C/min) do not vary, or not apart, or in fewer than ten windows";
const NO_SCALE: &str = "fewer than two plateaus have it, or over 0.38 of the temperatures lie without one between them";
const NO_FLOOR: &str =
    "the noise floor is not known, or σ lies below it: what its rows show at short τ is no white noise";
const NO_NOISE: &str = "the rows do not show their noise: a window needs eight of them or more (a longer --window)";

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
    size_ppm(worst_known(scale_of(axis).into_iter().flat_map(|scale| &scale.plateaus).filter_map(of)))
}

fn over_floor(axis: &AxisVerification) -> Option<f64> {
    axis.noise_floor.as_ref().map(|floor| axis.after.sigma_dph / floor.value_dph)
}

/// σ is smaller than its own noise, beyond what it scatters by: the floor is no floor. A sine at short τ lifts it.
fn is_below_floor(axis: &AxisVerification) -> bool {
    let highest = |ratio: f64| ratio * (1.0 + 4.0 * axis.relative_sigma_of_spread());
    over_floor(axis).is_some_and(|ratio| highest(ratio) < LEAST_OVER_FLOOR)
}

/// The scale factor, where the table turned at enough of the temperatures.
fn scale_of(axis: &AxisVerification) -> Option<&ScaleProof> {
    axis.scale_factor.as_ref().filter(|scale| scale.unvisited_fraction <= MOST_UNVISITED)
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
pub const SPECS: [LimitSpec; 33] = [
    limit!(
        sigma_dph_max,
        Most,
        "deg/h",
        Always,
        "σ after correction",
        false,
        |a| relative(Some(a.after.sigma_dph), a.relative_sigma_of_spread()),
        ""
    ),
    limit!(
        peak_to_peak_dph_max,
        Most,
        "deg/h",
        Always,
        "max − min after correction",
        false,
        |a| relative(Some(a.after.peak_to_peak * a.after.dph_per_unit()), a.relative_sigma_of_range()),
        ""
    ),
    limit!(
        sigma_over_floor_max,
        Most,
        "",
        Always,
        "σ after correction over the noise floor",
        false,
        |a| {
            let ratio = over_floor(a).filter(|_| !is_below_floor(a));
            relative(ratio, a.relative_sigma_of_spread())
        },
        NO_FLOOR
    ),
    limit!(
        sigma_beyond_floor_dph_max,
        Most,
        "deg/h",
        Always,
        "σ beyond the noise floor, √(σ² − floor²)",
        false,
        |a| a.sigma_beyond_floor().filter(|_| !is_below_floor(a)),
        NO_FLOOR
    ),
    limit!(
        improvement_min,
        Least,
        "",
        Always,
        "max − min, before over after",
        false,
        |a| relative(a.improvement, a.relative_sigma_of_range()),
        "the residual is zero: there is nothing to divide by"
    ),
    limit!(
        improvement_sigma_min,
        Least,
        "",
        Always,
        "σ, before over after",
        false,
        |a| relative(a.improvement_sigma, a.relative_sigma_of_spread()),
        "the residual is zero: there is nothing to divide by"
    ),
    limit!(
        out_of_span_max,
        Most,
        "",
        Always,
        "windows beyond the calibrated temperatures, fraction",
        true,
        |a| plain(Some(a.out_of_span_fraction)),
        ""
    ),
    limit!(
        span_covered_min,
        Least,
        "",
        Always,
        "calibrated temperature span covered, fraction",
        true,
        |a| plain(a.coverage.as_ref().map(|coverage| coverage.covered_fraction)),
        "the retest has no temperature"
    ),
    limit!(
        plateau_sigma_dph_max,
        Most,
        "deg/h",
        Always,
        "plateau σ, largest",
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
        "plateau bias, largest",
        false,
        |a| size(a.residual.plateaus.filter(|p| p.plateaus > 1).map(|p| p.worst_offset_dph)),
        NO_PLATEAU
    ),
    limit!(
        ramps_rms_dph_max,
        Most,
        "deg/h",
        Always,
        "ramp residual, rms",
        false,
        |a| relative(a.residual.ramps_rms_dph, a.relative_sigma_of_spread()),
        "fewer than ten windows in ramps"
    ),
    limit!(
        ramp_offset_dph_max,
        Most,
        "deg/h",
        SoaksAndRamps,
        "ramps less soaks",
        false,
        |a| size(a.residual.ramp_offset_dph),
        ""
    ),
    limit!(
        drift_dph_per_c_max,
        Most,
        "deg/h per degC",
        Always,
        "bias temperature slope",
        false,
        |a| size(a.residual.temperature_slope),
        NO_SLOPE
    ),
    limit!(
        drift_dph_per_cpm_max,
        Most,
        "deg/h per degC/min",
        Always,
        "bias temperature-rate slope",
        false,
        |a| size(a.residual.rate_slope),
        NO_SLOPE
    ),
    limit!(
        hysteresis_dph_max,
        Most,
        "deg/h",
        Always,
        "hysteresis, heating less cooling",
        false,
        |a| size(a.residual_diagnostics.hysteresis_dph),
        "fewer than 20 windows of heating or of cooling"
    ),
    limit!(
        scale_factor_sigma_ppm_max,
        Most,
        "ppm",
        Turned,
        "scale factor over temperature, σ",
        false,
        |a| plain(scale_of(a).map(|scale| scale.after.sigma_ppm)),
        NO_SCALE
    ),
    limit!(
        scale_factor_peak_to_peak_ppm_max,
        Most,
        "ppm",
        Turned,
        "scale factor over temperature, max − min",
        false,
        |a| plain(scale_of(a).map(|scale| scale.after.peak_to_peak_ppm)),
        NO_SCALE
    ),
    limit!(
        arw_deg_rt_h_max,
        Most,
        "deg/rt h",
        AtRest,
        "angle random walk",
        false,
        |a| plain(a.residual.random_walk.map(|walk| walk.after_deg_rt_h)),
        NO_NOISE
    ),
    limit!(
        arw_increase_max,
        Most,
        "",
        AtRest,
        "angle random walk, after over before",
        false,
        |a| plain(a.residual.random_walk.map(|walk| walk.after_deg_rt_h / walk.before_deg_rt_h)),
        NO_NOISE
    ),
    limit!(
        bias_instability_dph_max,
        Most,
        "deg/h",
        Always,
        "bias instability",
        false,
        |a| size(a.residual.bias_instability_dph),
        "no six windows that follow each other"
    ),
    limit!(
        position_error_m_max,
        Most,
        "m",
        Always,
        "position error of the flight, with 2 σ",
        false,
        |a| plain(a.flight.as_ref().map(|flight| flight.bound_after_m)),
        "the flight was not flown"
    ),
    limit!(
        temperature_residual_dph_max,
        Most,
        "deg/h",
        Always,
        "bias over temperature beyond noise, rms",
        false,
        |a| size(a.residual.over_temperature_dph),
        "fewer than 40 windows with a temperature, or less than 1 °C between them"
    ),
    limit!(
        bias_repeatability_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "bias repeatability, largest",
        false,
        |a| size(a.bias_of_every_run().ok().and_then(|found| Some(found.worst()?.difference_dph))),
        RUN_WITHOUT_BIAS
    ),
    limit!(
        turn_on_sigma_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "turn-on to turn-on bias, σ (95 % bound)",
        false,
        |a| plain(a.bias_of_every_run().ok().and_then(|found| Some(found.turn_ons?.sigma_upper_dph))),
        "fewer than two runs, or one that is shorter than eight windows or was turned at one rate alone"
    ),
    limit!(
        fixed_bias_dph_max,
        Most,
        "deg/h",
        KnownInput,
        "fixed bias, largest",
        false,
        |a| size(a.bias_of_every_run().ok().and_then(BiasRepeatability::largest_bias_dph)),
        RUN_WITHOUT_BIAS
    ),
    limit!(
        scale_factor_repeatability_ppm_max,
        Most,
        "ppm",
        BothTurned,
        "scale factor repeatability",
        false,
        |a| size_ppm(scale_of(a).and(a.scale_factor_difference)),
        NO_SCALE
    ),
    limit!(
        scale_factor_ppm_max,
        Most,
        "ppm",
        Turned,
        "scale factor error",
        false,
        |a| {
            let scale = scale_of(a)?;
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
        "scale factor asymmetry, largest",
        false,
        |a| largest_ppm(a, |plateau| plateau.asymmetry),
        "no plateau has rates in both directions, or too few temperatures have a plateau"
    ),
    limit!(
        scale_factor_nonlinearity_ppm_max,
        Most,
        "ppm",
        Turned,
        "scale factor nonlinearity, largest",
        false,
        |a| largest_ppm(a, |plateau| plateau.nonlinearity),
        "no plateau has three rates, or too few temperatures have a plateau"
    ),
    limit!(
        scale_factor_hysteresis_ppm_max,
        Most,
        "ppm",
        Turned,
        "scale factor hysteresis, largest",
        false,
        |a| size_ppm(scale_of(a).and_then(ScaleProof::hysteresis)),
        "no temperature was visited twice, or too few of them have a plateau"
    ),
    limit!(
        rate_covered_min,
        Least,
        "",
        WithRate,
        "calibrated temperature rates covered, fraction",
        true,
        |a| plain(a.rate_coverage),
        "the ramps of the fit are not known"
    ),
    limit!(
        missing_max,
        Most,
        "",
        Always,
        "time without usable rows, fraction",
        true,
        |a| plain(Some(a.missing_fraction)),
        ""
    ),
    limit!(
        excluded_max,
        Most,
        "",
        Excluding,
        "rows excluded on request, fraction",
        true,
        |a| plain(a.excluded_fraction),
        ""
    ),
];
