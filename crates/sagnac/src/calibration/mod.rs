//! The calibration record: what people read and machines exchange (`unit.cal.json`).
//!
//! Its JSON schema is `docs/reference/calibration.schema.json`, made from these types by `cargo xtask schema`.

mod check;
mod doubt;
mod input;
mod table;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::calibration::doubt::{HeatingLessCooling, Prediction, Soak, SoakRow};
pub use crate::calibration::input::{
    Collinearity, CorrectionNoise, FurtherInput, InputAside, InputNoise, InputSource, PathStep, PathVerdict,
};
pub use crate::calibration::table::{Misalignment, Plateau, PpmEstimate, Repeatability, ScaleFactor};
use crate::error::{Error, Result};
use crate::ingest::{LogSummary, Tally};
use crate::setup::{Setup, ThermometerSetup, WindowSize, check_thermometer};

/// Value of `Calibration::format`.
pub const FORMAT: &str = "sagnac-calibration";
/// Value of `Calibration::version`.
pub const VERSION: u32 = 1;
/// Serial of a calibration whose gyro was not named.
pub const UNASSIGNED: &str = "unassigned";

/// A calibration of one unit, one entry per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Always `sagnac-calibration`.
    pub format: String,
    /// Version of this schema.
    pub version: u32,
    /// Serial number of the gyro, or `unassigned`.
    pub serial: String,
    /// Quantity of the log.
    pub unit: LogUnit,
    /// Timing of the target that the calibration was made for.
    pub target: Target,
    /// The thermometer that the terms use.
    pub thermometer: Thermometer,
    /// Analysis window.
    pub window: WindowSize,
    /// Length to which sums per window are scaled, s.
    pub window_s: f64,
    /// Interval of a row of the log, s.
    pub sample_interval_s: f64,
    /// One entry per axis.
    pub axes: Vec<AxisCalibration>,
    /// How the log was read; `verify` and `compensate` read theirs the same way.
    pub setup: Setup,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// Quantity and scale of a log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "quantity", rename_all = "snake_case", deny_unknown_fields)]
pub enum LogUnit {
    /// Counts.
    Counts {
        /// Nominal scale factor S0.
        arcsec_per_count: f64,
        /// Smallest step of the counts, counts; one output count of the image.
        quantum: f64,
    },
    /// Rates, replayed with a virtual LSB.
    Rates {
        /// One output count of the image, arcsec.
        lsb_arcsec: f64,
    },
}

impl LogUnit {
    /// arcsec per output count of the image.
    pub fn arcsec_per_lsb(&self) -> f64 {
        match self {
            Self::Counts { arcsec_per_count, quantum } => arcsec_per_count * quantum,
            Self::Rates { lsb_arcsec } => *lsb_arcsec,
        }
    }
}

/// Timing of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Tick, ns.
    pub tick_ns: u32,
    /// Ticks per temperature period Δt.
    pub period_ticks: u32,
    /// Ticks over which a new correction is approached.
    pub slew_ticks: u32,
}

/// Slew unless told, ticks.
const DEFAULT_SLEW_TICKS: u32 = 100;
/// The target counts a temperature period up to here.
const MAX_PERIOD_TICKS: u32 = 1 << 24;

impl Target {
    /// As set up, checked against what the target can count.
    pub(crate) fn from_setup(setup: &Setup) -> Result<Self> {
        let (tick_ns, ticks) = (setup.tick_ns(), setup.period_ns()? / setup.tick_ns());
        let out_of_range = || {
            Error::input(format!("{ticks} ticks in a temperature period; the target counts to {MAX_PERIOD_TICKS}"))
                .column("temperature_period_s")
                .help("give a shorter temperature_period_s or a longer tick_s in the setup")
        };
        let period_ticks = u32::try_from(ticks).ok().filter(|t| (1..=MAX_PERIOD_TICKS).contains(t));
        let period_ticks = period_ticks.ok_or_else(out_of_range)?;
        let tick_ns = u32::try_from(tick_ns).map_err(|_| Error::input("too long").column("tick_s"))?;
        let slew_ticks = setup.slew_ticks.unwrap_or(DEFAULT_SLEW_TICKS.min(period_ticks));
        if slew_ticks > period_ticks {
            let what = format!("the slew is longer than the temperature period of {period_ticks} ticks");
            return Err(Error::input(what).column("slew_ticks").value(slew_ticks.to_string()));
        }
        Ok(Self { tick_ns, period_ticks, slew_ticks })
    }

    /// Δt, s.
    pub fn period_s(&self) -> f64 {
        f64::from(self.tick_ns) * f64::from(self.period_ticks) * 1e-9
    }

    /// Tick, s.
    pub fn tick_s(&self) -> f64 {
        f64::from(self.tick_ns) * 1e-9
    }
}

/// The thermometer of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thermometer {
    /// Name in the log's header; empty for a plain `temperature_c`.
    pub name: String,
    /// Temperature at code 0, °C. Without the setup's own conversion a code is 2⁻²⁴ °C.
    pub offset_c: f64,
    /// °C per code.
    pub gain_c_per_code: f64,
    /// Temperatures outside are not believed, °C.
    pub plausible_c: [f64; 2],
    /// Time without temperature after which the correction is STALE, s.
    pub hold_s: f64,
}

/// Replay's own temperature code: 2⁻²⁴ °C.
pub(crate) const CODE_C: f64 = 1.0 / (1 << 24) as f64;

impl Thermometer {
    fn check(&self) -> Result<()> {
        check_thermometer(&ThermometerSetup {
            name: self.name.clone(),
            plausible_c: self.plausible_c,
            hold_s: self.hold_s,
            offset_c: Some(self.offset_c),
            gain_c_per_code: Some(self.gain_c_per_code),
        })
    }

    /// As set up; without a conversion a code is 2⁻²⁴ °C.
    pub(crate) fn from_setup(spec: ThermometerSetup) -> Self {
        Self {
            name: spec.name,
            offset_c: spec.offset_c.unwrap_or(0.0),
            gain_c_per_code: spec.gain_c_per_code.unwrap_or(CODE_C),
            plausible_c: spec.plausible_c,
            hold_s: spec.hold_s,
        }
    }
}

/// What a term adds to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TermKind {
    /// bᵢ·[Tᵢ(x) − Tᵢ(x0)], °/h.
    Bias,
    /// cⱼ·Ṫ·Tⱼ(x), °/h per °C/min.
    Rate,
    /// e_k·[T_k(x) − T_k(x0)], ppm.
    Scale,
    /// z·[Z(x) − Z(x0)], Z = ((x − ξ)/(1 − ξ))² above the knot ξ, 0 below, °/h.
    Zone,
    /// s where the input is at or above the threshold (less that at its reference), °/h.
    Step,
}

impl TermKind {
    /// Its word in names of terms.
    pub fn word(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Rate => "rate",
            Self::Scale => "scale",
            Self::Zone => "zone",
            Self::Step => "step",
        }
    }

    /// Unit of a coefficient over a column, which has a unit of its own.
    pub fn unit_over_column(self) -> &'static str {
        if self == Self::Rate { "deg/h per unit/min" } else { self.unit() }
    }

    /// Unit of a coefficient.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Bias | Self::Zone | Self::Step => "deg/h",
            Self::Rate => "deg/h per degC/min",
            Self::Scale => "ppm",
        }
    }
}

/// One coefficient.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// What it adds to.
    pub kind: TermKind,
    /// Thermometer, or the name of a further input.
    pub sensor: String,
    /// Order of its Chebyshev polynomial; 2 for a zone, 0 for a step.
    pub order: u8,
    /// Where a zone or a step begins, in the input's unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<f64>,
    /// Coefficient.
    pub value: f64,
    /// Standard deviation; null where the coefficient was not fitted here.
    pub sigma: Option<f64>,
    /// Unit of both.
    pub unit: String,
    /// |value| exceeds its 95 % interval; null without sigma.
    pub significant: Option<bool>,
    /// By how much the other terms multiply its variance (1: not at all).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inflation: Option<f64>,
    /// 95 % interval by the block bootstrap, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<[f64; 2]>,
}

/// A fitted lag.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lag {
    /// τ, s.
    pub value: f64,
    /// Standard deviation; null where τ is not resolved and the smallest within 2 % was taken.
    pub sigma: Option<f64>,
}

/// The constant of one run: fixed bias plus input rate. Never part of the correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Constant {
    /// Index of the run.
    pub run: u32,
    /// Rate at T0 and Ṫ = 0, °/h.
    pub value_dph: f64,
    /// Standard deviation; null where it was not fitted here.
    pub sigma_dph: Option<f64>,
    /// The constant less the known input rate: the fixed bias, °/h; null where the input rate is not
    /// known or the log has several axes.
    pub fixed_bias_dph: Option<f64>,
}

/// The curve at Ṫ = 0 in the paper's form: value = Σ coefficientᵢ·Tⁱ, T in °C.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Monomial {
    /// Run whose constant it holds.
    pub run: u32,
    /// `counts per window` or `deg/h`.
    pub unit: String,
    /// The window, s.
    pub window_s: f64,
    /// Ascending powers of °C.
    pub coefficients: Vec<f64>,
    /// Standard deviations; null where not fitted here.
    pub sigma: Option<Vec<f64>>,
    /// Temperatures between which it holds, °C, where the span is cut into zones: that of T0; `zones` has them all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_to_c: Option<[f64; 2]>,
}

/// Residual of the fit, about the fitted curve. In-sample: quote the cross-validation instead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Residual {
    /// Windows.
    pub n: usize,
    /// σ with the lost degrees of freedom counted, °/h.
    pub sigma_dph: f64,
    /// Largest minus smallest, °/h.
    pub peak_to_peak_dph: f64,
    /// Correlation of neighbouring residuals, by which the intervals were widened.
    pub autocorrelation: f64,
    /// Half a 95 % interval in units of σ: Student's t at as many degrees of freedom as that correlation leaves.
    pub t95: f64,
}

/// What noise alone leaves in a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Floor {
    /// √(N²/τ + 2Q²/τ²) for the nominal window, °/h.
    pub value_dph: f64,
    /// Angle random walk N, °/√h.
    pub n_deg_rt_h: f64,
    /// Quantization Q, arcsec.
    pub q_arcsec: f64,
    /// Where N and Q come from.
    pub source: String,
}

/// Held-out residual.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CrossValidation {
    /// What is held out.
    pub scheme: String,
    /// How many folds.
    pub folds: usize,
    /// Root mean square of held-out residuals, °/h.
    pub sigma_dph: f64,
}

/// One model that was tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// In the words of `--model`.
    pub model: String,
    /// Coefficients without constants, lag included.
    pub coefficients: usize,
    /// Root mean square of held-out residuals, °/h; null where a fold could not be fitted.
    pub held_out_dph: Option<f64>,
    /// Instructions of its slow update on a Cortex-M4F; the tick costs the same for all.
    #[serde(default)]
    pub slow_update_instructions: Option<u32>,
    /// It was taken.
    pub chosen: bool,
}

/// The calibration of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisCalibration {
    /// Axis letter.
    pub axis: char,
    /// In the words of `--model`.
    pub model: String,
    /// Coefficients.
    pub terms: Vec<Term>,
    /// Lag of the rate term; null without one.
    pub lag_s: Option<Lag>,
    /// T0, °C.
    pub reference_c: f64,
    /// Temperatures of the fit, °C. Outside, the correction is the one at the border.
    pub span_c: [f64; 2],
    /// Temperature rates of the fit, °C/min; null without a rate term.
    pub rate_span_cpm: Option<[f64; 2]>,
    /// Constants of the runs.
    pub constants: Vec<Constant>,
    /// The curve in the paper's form.
    pub monomial: Monomial,
    /// The curve zone by zone, coldest first, where the span is cut into zones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<Monomial>,
    /// What further terms depend on, and the thermometers that their differences need.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<FurtherInput>,
    /// How near the terms are to each other; absent without terms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collinearity: Option<Collinearity>,
    /// What the noise of thermometers does to the corrected angle; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction_noise: Option<CorrectionNoise>,
    /// Further inputs that `auto` did not look at, and why.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs_aside: Vec<InputAside>,
    /// The way from the grid's model to this one; empty where the model was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<PathStep>,
    /// Scale factor, from runs on a rate table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_factor: Option<ScaleFactor>,
    /// Misalignment of the input axis, from runs in which another axis was turned.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub misalignment: Vec<Misalignment>,
    /// Residual of the fit; null where nothing was fitted here.
    pub residual: Option<Residual>,
    /// Noise floor; null where neither measured nor given.
    pub floor: Option<Floor>,
    /// Heating against cooling; absent where the test does not hold both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heating_less_cooling: Option<HeatingLessCooling>,
    /// What more soaking would buy; absent where nothing was fitted here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soak: Option<Soak>,
    /// Held-out residual; null where nothing was fitted here.
    pub cross_validation: Option<CrossValidation>,
    /// What was tried.
    pub candidates: Vec<Candidate>,
    /// What was left out, and why.
    pub excluded: Vec<Tally>,
    /// Covariance of constants, terms and lag in the order of `covariance_of`; empty where not fitted.
    pub covariance: Vec<Vec<f64>>,
    /// Names of its rows.
    pub covariance_of: Vec<String>,
}

/// Where a record comes from. No clock: the same input gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Time of the newest input sample in the log's own time, s, or SOURCE_DATE_EPOCH.
    pub time_s: f64,
    /// Which of the two.
    pub time_source: String,
    /// The logs.
    pub inputs: Vec<Input>,
}

/// One log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Rows read.
    pub rows: u64,
}

impl Input {
    /// Of a log that was read.
    pub(crate) fn of(summary: &LogSummary) -> Self {
        Self { file: crate::write::file_name(&summary.file), sha256: summary.sha256.clone(), rows: summary.rows }
    }
}

impl Calibration {
    /// Reads and checks a record.
    ///
    /// # Errors
    /// Not JSON, a missing, extra or non-finite field, another format or version (field named).
    pub fn parse(text: &str) -> Result<Self> {
        let head: serde_json::Value = serde_json::from_str(text).map_err(|e| not_json(&e))?;
        if head.get("format").and_then(|f| f.as_str()) != Some(FORMAT) {
            return Err(Error::input("JSON, but no calibration of Sagnac").column("format"));
        }
        if head.get("version").and_then(serde_json::Value::as_u64) != Some(u64::from(VERSION)) {
            let found = head.get("version").map(ToString::to_string).unwrap_or_default();
            return Err(Error::input(format!("this program reads version {VERSION}")).column("version").value(found));
        }
        let calibration: Self = serde_json::from_str(text).map_err(|e| not_json(&e))?;
        calibration.check()?;
        Ok(calibration)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// As [`Calibration::parse`], with the file named.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io_path(path, "read", &e))?;
        Self::parse(&text).map_err(|e| e.file(path.display().to_string()))
    }

    /// As JSON, ending in a newline.
    ///
    /// # Errors
    /// A number that JSON cannot hold.
    pub fn to_json(&self) -> Result<String> {
        self.check()?;
        let mut text =
            serde_json::to_string_pretty(self).map_err(|e| Error::input(format!("cannot write JSON: {e}")))?;
        text.push('\n');
        Ok(text)
    }
}

fn not_json(error: &serde_json::Error) -> Error {
    let text = error.to_string();
    let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
    Error::input(format!("not a readable calibration: {what}")).line(error.line() as u64)
}

impl AxisCalibration {
    /// Unit of a term's coefficient.
    fn unit_of(&self, term: &Term) -> &'static str {
        let of_column = self.input_of(term).is_some_and(|input| matches!(input.source, InputSource::Column(_)));
        if of_column { term.kind.unit_over_column() } else { term.kind.unit() }
    }

    /// A term over the thermometer of the fit.
    pub fn is_main(&self, term: &Term) -> bool {
        self.input_of(term).is_none()
    }

    /// The further input of a term.
    pub(crate) fn input_of(&self, term: &Term) -> Option<&FurtherInput> {
        self.inputs.iter().find(|input| input.name == term.sensor)
    }

    /// The span of the thermometer of the fit as a scaling to −1 … 1.
    pub(crate) fn span(&self) -> crate::fit::Span {
        crate::fit::Span { lo_c: self.span_c[0], hi_c: self.span_c[1] }
    }

    /// The coefficients of one kind by order over the thermometer of the fit; zero where there is no term.
    pub fn series(&self, kind: TermKind) -> [f64; crate::fit::BASIS_LEN] {
        let mut series = [0.0; crate::fit::BASIS_LEN];
        for term in self.terms.iter().filter(|term| term.kind == kind && self.is_main(term)) {
            if let Some(slot) = series.get_mut(usize::from(term.order)) {
                *slot = term.value;
            }
        }
        series
    }
}
