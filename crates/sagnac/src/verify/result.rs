//! The result of a verification: axis by axis, before next to after, with the verdict of each limit.

use std::collections::BTreeMap;

use sagnac_core::Image;
use serde::{Deserialize, Serialize};

use crate::calibration::{LogFile, PpmEstimate};
use crate::verify::flight::position::PositionError;
use crate::verify::limits::source::LimitsSource;
use crate::verify::limits::verdict::Verdict;
use crate::verify::overrides::{Override, kinds};
use crate::verify::replay::flagged::FlaggedOff;
use crate::verify::values::before_after::DriftValues;
use crate::verify::values::diagnostics::ResidualDiagnostics;
use crate::verify::values::rate_table::ScaleProof;
use crate::verify::values::repeatability::BiasRepeatability;
use crate::verify::values::residual::RetestResidual;
use crate::verify::values::suspects::Suspect;
use crate::window::Windows;
use sagnac_log::ingest::Tally;
use sagnac_units::format::celsius;

/// The floor of a retest's windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RetestNoiseFloor {
    /// σ of the used windows from noise alone, °/h: root mean square of √(N²/τ + 2Q²/τ²) over their lengths τ.
    pub value_dph: f64,
    /// Its standard error, °/h; zero where N was stated, or where the laws do not describe the curve of the rows.
    pub sigma_dph: f64,
    /// The floor in the unit of the values.
    pub value: f64,
    /// Expected max − min of the largest run's n windows of white noise, in the unit of the values.
    pub expected_peak_to_peak: f64,
    /// That n.
    pub n: usize,
    /// Where it comes from.
    pub source: String,
    /// How neighbouring rows correlate: σ² at two rows over that at one, and the interval of a row, s; absent where they do not show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_over_first: Option<[f64; 2]>,
}

/// How much of the temperatures of the fit a retest saw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Coverage {
    /// Span of the fit, by the image, °C.
    pub fit_c: [f64; 2],
    /// Lowest and highest sample of the used windows, °C.
    pub tested_c: [f64; 2],
    /// Part of the fit's span that the windows cover, 0 to 1; gaps of a twentieth of it count as covered.
    pub covered_fraction: f64,
}

/// Part of the fit's span that a gap between windows may have and count as covered.
const BRIDGED: f64 = 0.05;

impl Coverage {
    /// `20.0 … 45.0 °C: 23 % of the fit's -39.0 … 69.0 °C`.
    pub fn words(&self) -> String {
        let Self { tested_c: [lo, hi], fit_c: [from, to], covered_fraction } = *self;
        let [lo, hi, from, to] = [lo, hi, from, to].map(celsius);
        format!("{lo} … {hi} °C: {:.0} % of the fit's {from} … {to} °C", 100.0 * covered_fraction)
    }

    pub(crate) fn of(image: &Image, windows: &Windows, used: &[usize], sensor: usize) -> Option<Self> {
        let spec = image.inputs().first()?;
        let fit_c = [spec.span_lo_q24, spec.span_hi_q24].map(|q24| f64::from(q24) / 2.0_f64.powi(24));
        let (min_c, max_c) = (&windows.rows.min_c[sensor], &windows.rows.max_c[sensor]);
        let mut stretches: Vec<[f64; 2]> =
            used.iter().map(|i| [min_c[*i], max_c[*i]]).filter(|[lo, _]| lo.is_finite()).collect();
        stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let span = fit_c[1] - fit_c[0];
        let (mut common, mut reached) = (0.0, f64::NEG_INFINITY);
        for [from, to] in &stretches {
            // Between windows a little is left out; farther apart nothing was seen.
            let start = if from - reached <= BRIDGED * span { reached } else { *from };
            common += (to.min(fit_c[1]) - start.max(fit_c[0]).min(fit_c[1])).max(0.0);
            reached = reached.max(*to);
        }
        let lo = stretches.first().map_or(f64::INFINITY, |[lo, _]| *lo);
        let hi = reached;
        let covered_fraction = (common / span).clamp(0.0, 1.0);
        (lo <= hi).then_some(Self { fit_c, tested_c: [lo, hi], covered_fraction })
    }
}

/// A slower ramp is rest, °C/min.
const SLOWEST_CPM: f64 = 0.01;

/// What a retest of the calibration's own profile does not show.
pub const REPEATED_PROFILE: &str = "temperature moves with its rate or with time as in the calibration, which cannot separate \
                                    them: this test proves nothing for other profiles";

/// One axis of a verification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AxisVerification {
    /// Axis letter.
    pub axis: char,
    /// As logged.
    pub before: DriftValues,
    /// As corrected.
    pub after: DriftValues,
    /// Noise floor; null where neither the retest nor the calibration knows it.
    pub noise_floor: Option<RetestNoiseFloor>,
    /// max − min before over after; null where after is zero.
    pub improvement: Option<f64>,
    /// σ before over after; null where after is zero.
    pub improvement_sigma: Option<f64>,
    /// Diagnostics of the residual.
    pub residual_diagnostics: ResidualDiagnostics,
    /// Temperatures of the retest next to those of the fit; null without a temperature.
    pub coverage: Option<Coverage>,
    /// Rates of the temperature over the judged windows, °C/min: the 5th and the 95th percentile; null without time. Faster ones are not
    /// tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_rates_cpm: Option<[f64; 2]>,
    /// A rate table turned the gyro.
    #[serde(default)]
    pub turned: bool,
    /// It turned it about this axis.
    #[serde(default)]
    pub turned_about: bool,
    /// About this axis, one way and the other: else an asymmetry, or a bias even in rate, passes for a scale factor.
    #[serde(default)]
    pub turned_both_ways: bool,
    /// The residual, value by value.
    pub residual: RetestResidual,
    /// What a stated flight comes to; null without one, or where the retest does not tell it.
    pub flight: Option<PositionError>,
    /// Why the flight cannot be told, if one was stated.
    pub flight_unavailable: Option<String>,
    /// The scale factor over temperature, where a rate table tells it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_factor: Option<ScaleProof>,
    /// Fixed bias against the calibration; null where the input rate is not known.
    pub bias_repeatability: Option<BiasRepeatability>,
    /// Why it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias_repeatability_unavailable: Option<String>,
    /// Part of the fit's temperature rates that the ramps of the retest reach, 0 to 1; null without rate terms or a record.
    pub rate_coverage: Option<f64>,
    /// Temperature and its rate, or time, moved together in the calibration, and in this retest again: it proves nothing for
    /// other profiles.
    pub repeats_profile: bool,
    /// Scale factor less that of the calibration at T0; null where a rate table did not turn both.
    pub scale_factor_difference: Option<PpmEstimate>,
    /// The calibration has a scale factor of its own, from a rate table.
    pub scale_factor_calibrated: bool,
    /// Each run covers so little of the temperatures that its own mean would hold the drift: the values are about the mean of all
    /// runs.
    pub about_common_mean: bool,
    /// Part of the time of the runs of which no row is usable, 0 to 1: flagged, missing, unreadable.
    pub missing_fraction: f64,
    /// Part of the windows with a temperature beyond the fit's span by more than half a degree, 0 to 1.
    pub out_of_span_fraction: f64,
    /// Hours of the judged windows.
    pub hours: f64,
    /// Part of the rows that was excluded on request, 0 to 1; null where nothing was asked to be excluded.
    pub excluded_fraction: Option<f64>,
    /// Flagged rows that differ from their neighbours; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flagged_off: Option<FlaggedOff>,
    /// Stretches that look like bumps, steps or start-up. They are judged unless they were asked to be excluded.
    pub suspects: Vec<Suspect>,
    /// Windows in which each status occurred.
    pub status_windows: BTreeMap<String, usize>,
    /// Limits, if any were given.
    pub limits: Vec<Verdict>,
    /// All limits that are asked of such a retest are met; null without limits.
    pub pass: Option<bool>,
}

impl AxisVerification {
    /// The fastest temperature rate of the test, without its fastest windows, °C/min.
    pub fn tested_cpm(&self) -> Option<f64> {
        self.ramp_rates_cpm.map(|[cooling, heating]| heating.max(-cooling)).filter(|cpm| *cpm >= SLOWEST_CPM)
    }

    /// The verdict on a limit, by its key.
    pub fn limit(&self, key: &str) -> Option<&Verdict> {
        self.limits.iter().find(|limit| limit.name == key)
    }

    /// Part of the time that was excluded on request or flagged, where it differs from its neighbours, 0 to 1; `None` without either.
    pub fn left_out_fraction(&self) -> Option<f64> {
        let flagged = self.flagged_off.map(|off| off.fraction);
        let all = [self.excluded_fraction, flagged];
        all.iter().any(Option::is_some).then(|| all.into_iter().flatten().sum())
    }

    /// Where a limit that is not met fails: its plateau, its run, or both. `None` where it is met, or of the whole test.
    pub fn failing_place(&self, key: &str) -> Option<String> {
        let verdict = self.limit(key).filter(|limit| limit.pass == Some(false))?;
        let plateau = verdict.plateau_c.map(|at_c| format!("at {} °C", celsius(at_c)));
        let run = verdict.run.as_ref().map(|run| format!("in {run}"));
        let places: Vec<String> = plateau.into_iter().chain(run).collect();
        (!places.is_empty()).then(|| places.join(" "))
    }
}

/// The result of `sagnac verify`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Verification {
    /// Program and version.
    pub program: String,
    /// Serial number of the gyro.
    pub serial: String,
    /// What the sensor is, as the setup says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// What it was tested on, as the setup says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<String>,
    /// Unit of the values: `counts per window` or `deg/h`.
    pub unit: String,
    /// Length to which windows are scaled, s.
    pub window_s: f64,
    /// One entry per axis.
    pub axes: Vec<AxisVerification>,
    /// Windows and rows left out on both sides, by reason.
    pub excluded: Vec<Tally>,
    /// SHA-256 of the images' bytes, in the order of their axes.
    pub image_sha256: String,
    /// SHA-256 of the record that the images were made from, by the images.
    pub record_sha256: String,
    /// Its limits, if any were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<LimitsSource>,
    /// The retest logs.
    pub inputs: Vec<LogFile>,
    /// Axes of the calibration that the retest does not have: with any of them the unit is not accepted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub untested_axes: Vec<char>,
    /// Those of them that the calibration was made from: with any of them this is no proof, and no limit can be met.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub training_overlap: Vec<String>,
    /// True for an image alone, which does not name its training logs: nothing shows that these are others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub training_unknown: bool,
    /// What was stated otherwise for the retest than for its calibration, or in the limits than in their base set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub overrides: Vec<Override>,
    /// Why the unit is not accepted, whatever its limits: each in a sentence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objections: Vec<String>,
    /// Files whose clock begins again, where nobody stated that they are separate tests: the time before them is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub new_clocks: Vec<String>,
    /// Hours between files of one clock, where nobody stated that they are separate tests: they count as missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen_h: Option<f64>,
}

impl AxisVerification {
    /// The temperature moved, and no limit asks whether the unit remembers it.
    fn leaves_memory(&self) -> bool {
        let asked = self.limits.iter().any(|limit| limit.name == "memory_dph_max");
        self.pass.is_some() && !self.turned && self.residual.ramps_rms_dph.is_some() && !asked
    }
}

impl Verification {
    /// The retest's logs are known not to be those of the fit.
    pub fn is_of_other_logs(&self) -> bool {
        !self.training_unknown && self.training_overlap.is_empty()
    }

    /// Properties of the unit on which the limits or the retest are silent, and what was overridden, in words: `; the fixed bias and memory
    /// are NOT judged, overridden: input rate, 2 limits`. Empty where there is neither.
    pub fn reservations(&self) -> String {
        let bias = self.axes.iter().flat_map(|axis| &axis.limits);
        let bias = bias.filter(|limit| limit.name == "bias_repeatability_dph_max").any(|limit| limit.pass.is_none());
        let memory = self.axes.iter().any(AxisVerification::leaves_memory);
        let silent = match (bias, memory) {
            (true, true) => "; the fixed bias and memory are NOT judged",
            (true, false) => "; the fixed bias is NOT judged",
            (false, true) => "; memory is NOT judged",
            (false, false) => "",
        };
        if self.overrides.is_empty() {
            return silent.to_owned();
        }
        format!("{silent}, overridden: {}", kinds(&self.overrides))
    }

    /// False when a limit is not met, or where limits were checked with a log of the fit.
    pub fn passed(&self) -> bool {
        let judged = self.axes.iter().any(|axis| axis.pass.is_some());
        let sound = self.training_overlap.is_empty() && self.untested_axes.is_empty() && self.objections.is_empty();
        self.axes.iter().all(|axis| axis.pass != Some(false)) && (!judged || sound)
    }
}
