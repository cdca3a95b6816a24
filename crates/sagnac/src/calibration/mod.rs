//! The calibration record: what people read and machines exchange (`unit.cal.json`).
//!
//! ```text
//! Calibration ── axes ── AxisCalibration ── correction (what the target applies: inputs and terms)
//!                                        └─ fit (how it was found and how sure it is; null for imported coefficients)
//! ```
//!
//! Its JSON schema is `docs/reference/calibration.schema.json`, made from these types. In the file an axis is one flat object
//! (`axis_record`).

mod axis;
mod axis_record;
mod check;
mod file;
mod input;
mod profile;
mod rate_table;
mod search;
mod uncertainty;

use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{LogSummary, share_rows};
use sagnac_log::setup::{Setup, TargetConfig, WindowSize};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::calibration::axis::{AxisCalibration, AxisCorrection, FitDiagnostics, NonlinearParameter};
pub use crate::calibration::input::{Input, InputSource};
pub use crate::calibration::profile::{Entanglement, MovedTogether, TimeEffect, TimeEffectKind, WarmUp};
pub use crate::calibration::rate_table::{Misalignment, Plateau, PpmEstimate, Repeatability, ScaleFactor};
pub use crate::calibration::search::{
    Collinearity, CorrectionNoise, InputNoise, PriorUse, RejectedInput, RejectedModel, SearchStep, SearchVerdict,
};
pub(crate) use crate::calibration::uncertainty::SCALE_AT_REFERENCE;
pub use crate::calibration::uncertainty::{
    CurveSpread, Evaluation, Hysteresis, LackOfFit, Prediction, SlowNoiseTerms, Soak, SoakRow,
};
use crate::model::{ActsOn, Form, Shape};

/// Value of `Calibration::format`.
pub const FORMAT: &str = "sagnac-calibration";
/// Value of `Calibration::version`: a change of meaning or a field less raises it.
pub const VERSION: u32 = 2;
/// Value of `Calibration::minor_version`: a field or a shape more raises it.
pub const MINOR_VERSION: u32 = 4;
/// Serial of a calibration whose gyro was not named.
pub const UNASSIGNED: &str = "unassigned";

/// A calibration of one unit, one entry per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Calibration {
    /// Always `sagnac-calibration`.
    pub format: String,
    /// Version of this schema. A reader refuses another one.
    pub version: u32,
    /// Minor version. A reader ignores the fields that a newer one adds.
    pub minor_version: u32,
    /// Serial number of the gyro, or `unassigned`.
    pub serial: String,
    /// Quantity of the log.
    pub unit: LogUnit,
    /// Timing of the target that the calibration was made for.
    pub target: Target,
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
#[serde(tag = "quantity", rename_all = "snake_case")]
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
#[non_exhaustive]
pub struct Target {
    /// Tick, ns.
    pub tick_ns: u32,
    /// Ticks per temperature period Δt.
    pub period_ticks: u32,
    /// Ticks over which a new correction is approached.
    pub slew_ticks: u32,
}

/// Default slew, ticks.
const DEFAULT_SLEW_TICKS: u32 = 100;
/// The target counts a temperature period up to here.
const MAX_PERIOD_TICKS: u32 = 1 << 24;

impl Target {
    /// As set up, checked against what the target can count.
    pub(crate) fn from_config(config: TargetConfig) -> Result<Self> {
        let TargetConfig { clock, slew_ticks, .. } = config;
        let (tick_ns, ticks) = (clock.tick_ns(), clock.period_ns()? / clock.tick_ns());
        let out_of_range = || {
            Error::input(format!("{ticks} ticks in a temperature period; the target counts to {MAX_PERIOD_TICKS}"))
                .column("temperature_period_s")
                .help("give a shorter temperature_period_s or a longer tick_s in the setup")
        };
        let period_ticks = u32::try_from(ticks).ok().filter(|t| (1..=MAX_PERIOD_TICKS).contains(t));
        let period_ticks = period_ticks.ok_or_else(out_of_range)?;
        let tick_ns = u32::try_from(tick_ns).map_err(|_| Error::input("too long").column("tick_s"))?;
        let slew_ticks = slew_ticks.unwrap_or(DEFAULT_SLEW_TICKS.min(period_ticks));
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

/// Replay's own temperature code: 2⁻²⁴ °C.
pub(crate) const CODE_C: f64 = 1.0 / (1 << 24) as f64;

/// One term of a correction: what it acts on × input × shape × rate, and its estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Term {
    /// What it acts on.
    pub acts_on: ActsOn,
    /// Name of its input in `inputs`.
    pub input: String,
    /// The function of the input.
    pub shape: Shape,
    /// It is multiplied with the lagged rate of the input, per minute.
    pub times_rate: bool,
    /// Coefficient.
    pub value: f64,
    /// Standard deviation; null where the coefficient was not fitted here.
    pub sigma: Option<f64>,
    /// Unit of both.
    pub unit: String,
    /// |value| exceeds its 95 % interval; null without sigma.
    pub significant: Option<bool>,
    /// Variance inflation factor: by how much the other terms multiply its variance (1: not at all).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vif: Option<f64>,
    /// 95 % interval by the bootstrap, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<[f64; 2]>,
}

impl Term {
    /// A term that was not fitted here, over an input of the record that repeats no other.
    pub fn given(form: Form, input: &Input, value: f64) -> Self {
        let in_celsius = !matches!(input.source, InputSource::Column(_));
        let Form { acts_on, shape, times_rate } = form;
        Self {
            acts_on,
            input: input.name.clone(),
            shape,
            times_rate,
            value,
            sigma: None,
            unit: form.unit(in_celsius).to_owned(),
            significant: None,
            vif: None,
            bootstrap: None,
        }
    }

    /// Without its input and its estimate.
    pub fn form(&self) -> Form {
        Form { acts_on: self.acts_on, shape: self.shape, times_rate: self.times_rate }
    }
}

/// A fitted lag.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lag {
    /// τ, s.
    pub value: f64,
    /// Standard deviation; null where τ is not resolved: then it is the smallest whose misfit is within Δχ² = 4 of the least.
    pub sigma: Option<f64>,
}

/// The offset of one run: fixed bias plus input rate. Never part of the correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct RunOffset {
    /// Index of the run.
    pub run: u32,
    /// Rate at T0 and Ṫ = 0, °/h.
    pub value_dph: f64,
    /// Standard deviation; null where it was not fitted here.
    pub sigma_dph: Option<f64>,
    /// The offset less the known input rate: the fixed bias, °/h; null where the input rate is not
    /// known or the log has several axes.
    pub fixed_bias_dph: Option<f64>,
}

/// The curve at Ṫ = 0 in the paper's form: value = Σ coefficientᵢ·Tⁱ, T in °C.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Monomial {
    /// Run whose offset it holds.
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
    pub range_c: Option<[f64; 2]>,
}

/// Residual of the fit, about the fitted curve. In-sample: quote the cross-validation instead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Residual {
    /// Windows.
    pub n: usize,
    /// σ with the lost degrees of freedom counted, °/h.
    pub sigma_dph: f64,
    /// Largest minus smallest, °/h.
    pub peak_to_peak_dph: f64,
    /// Correlation of neighbouring residuals, by which the intervals were widened.
    pub lag1_autocorrelation: f64,
    /// Half a 95 % interval in units of σ: Student's t at as many degrees of freedom as that correlation leaves.
    pub t_quantile_975: f64,
}

/// What noise alone makes of the mean of a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct NoiseFloor {
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
#[non_exhaustive]
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
#[non_exhaustive]
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
    /// It was selected.
    pub chosen: bool,
}

/// Where a record comes from. No clock: the same input gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Time of the newest input sample in the log's own time, s, or SOURCE_DATE_EPOCH.
    pub time_s: f64,
    /// Which of the two.
    pub time_source: String,
    /// The logs.
    pub inputs: Vec<LogFile>,
}

/// Name and version of this program.
pub fn program() -> String {
    format!("sagnac {}", env!("CARGO_PKG_VERSION"))
}

/// One log file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LogFile {
    /// File name without its folder.
    pub file: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Rows read.
    pub rows: u64,
    /// In the record of a calibration: 64 hashes of 64 rows each and 64 of 12, by which a copy in other bytes is recognised; the rows
    /// cannot be had from them. Empty for a log that says too little.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub rows_sketch: String,
}

impl LogFile {
    /// Of a log that was read.
    pub(crate) fn of(summary: &LogSummary) -> Self {
        Self {
            file: sagnac_units::format::file_name(&summary.file),
            sha256: summary.sha256.clone(),
            rows: summary.rows,
            rows_sketch: summary.rows_sketch.clone(),
        }
    }

    /// Without the hashes of its rows: for results, which nothing is held against later.
    pub(crate) fn named(self) -> Self {
        Self { rows_sketch: String::new(), ..self }
    }

    /// The same bytes, or for a part the same rows.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.sha256 == other.sha256 || share_rows(&[&self.rows_sketch], &[&other.rows_sketch])
    }
}
