//! What came of a unit: the row of the table, and `units/UNIT.json`.

use serde::{Deserialize, Serialize};

use super::Unit;
use super::common_basis::{CommonBasis, common_curve, on_common_basis};
use crate::calibration::{AxisCalibration, Calibration};
use crate::verify::{AxisVerification, Verdict, Verification};
use sagnac_log::error::{Error, ErrorKind};

/// Version of a unit's result.
pub(super) const VERSION: u32 = 4;

/// What came of a unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct UnitResult {
    /// Version of this form.
    pub version: u32,
    /// Name in the manifest.
    pub unit: String,
    /// Lot; empty where it is not known.
    pub lot: String,
    /// Rig; empty where it is not known.
    pub rig: String,
    /// What it was made of, as a hash; another key means another result. Empty where its logs cannot be read.
    pub key: String,
    /// Calibrated, refused, not renewed or failed.
    pub outcome: UnitOutcome,
    /// Why not, where it was not calibrated, or not renewed.
    pub refusal: Option<Refusal>,
    /// SHA-256 of its record.
    pub record_sha256: Option<String>,
    /// SHA-256 of each log behind its record.
    pub inputs_sha256: Vec<String>,
    /// Serial number in the record.
    pub serial: Option<String>,
    /// Time of the newest sample in the log's own time, or SOURCE_DATE_EPOCH, s.
    pub time_s: Option<f64>,
    /// What its retest came to.
    pub acceptance: Acceptance,
    /// Why a retest was not judged.
    pub retest_refusal: Option<Refusal>,
    /// SHA-256 of its verification.
    pub proof_sha256: Option<String>,
    /// One per axis.
    pub axes: Vec<AxisResult>,
}

/// How a calibration ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnitOutcome {
    /// There is a record.
    Calibrated,
    /// The data cannot support a calibration.
    Refused,
    /// There is a record from before, whose logs cannot be read now.
    NotRenewed,
    /// A log or setup that cannot be read.
    #[default]
    Failed,
}

impl UnitOutcome {
    /// Its word in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Calibrated => "calibrated",
            Self::Refused => "refused",
            Self::NotRenewed => "not renewed",
            Self::Failed => "failed",
        }
    }
}

/// What the retest of a unit came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceptance {
    /// No retest, or no record to retest.
    #[default]
    NoRetest,
    /// Replayed, without limits to be met.
    NoLimits,
    /// Every limit that applies is met.
    Met,
    /// A limit is not met.
    NotMet,
    /// No limit is failed, but the uncertainty of one reaches across its bound.
    NotDecided,
    /// The retest cannot be read or judged.
    NotJudged,
}

impl Acceptance {
    /// Its words in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoRetest => "no retest",
            Self::NoLimits => "no limits",
            Self::Met => "met",
            Self::NotMet => "not met",
            Self::NotDecided => "not decided",
            Self::NotJudged => "not judged",
        }
    }

    /// A retest that was to be judged and did not pass.
    pub fn is_bad(self) -> bool {
        matches!(self, Self::NotMet | Self::NotDecided | Self::NotJudged)
    }

    fn of(verification: &Verification) -> Self {
        if verification.axes.iter().all(|axis| axis.pass.is_none()) {
            return Self::NoLimits;
        }
        let all = || verification.axes.iter().flat_map(|axis| &axis.limits);
        let failed = all().any(|limit| limit.pass == Some(false) && !limit.is_open());
        match (verification.passed(), failed) {
            (true, _) => Self::Met,
            (false, false) if all().any(|limit| limit.pass == Some(false)) => Self::NotDecided,
            (false, _) => Self::NotMet,
        }
    }
}

/// Why a unit was not calibrated, or not judged.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Refusal {
    /// The cause.
    pub reason: String,
    /// The place of the cause.
    pub place: String,
    /// The remedy.
    pub help: String,
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        let Error { what, place, help, .. } = error;
        Self { reason: what, place: place.to_string(), help }
    }
}

/// What a table says of an axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AxisResult {
    /// Its letter.
    pub axis: String,
    /// In the words of `--model`.
    pub model: String,
    /// T0, °C.
    pub reference_c: f64,
    /// Span of the thermometer of the fit, °C.
    pub span_c: [f64; 2],
    /// Lag of its temperature, s.
    pub lag_s: Option<f64>,
    /// Temperature rates of the fit, °C/min: of its lag, then of its slow lag; empty without rate terms.
    pub rate_spans_cpm: Vec<[f64; 2]>,
    /// Whether its record was made with a prior: then its coefficients are in part those of the units before it.
    pub with_prior: bool,
    /// Coefficients on the basis that all units share; null where the model has none there.
    pub common: Option<CommonBasis>,
    /// Temperature, °C, drift at rest less that at T0, and its σ, °/h.
    pub curve: Vec<[f64; 3]>,
    /// Mean of the run offsets, the rate at T0 and rest, °/h.
    pub mean_offset_dph: Option<f64>,
    /// σ of the residual of a nominal window, °/h.
    pub residual_dph: Option<f64>,
    /// Its autocorrelation from window to window.
    pub residual_autocorrelation: Option<f64>,
    /// Nominal length of a window, s.
    pub window_s: f64,
    /// Root mean square of held-out residuals, °/h.
    pub held_out_dph: Option<f64>,
    /// Noise floor of a nominal window, °/h.
    pub noise_floor_dph: Option<f64>,
    /// Angle random walk, °/√h.
    pub n_deg_rt_h: Option<f64>,
    /// Quantization, arcsec.
    pub q_arcsec: Option<f64>,
    /// Bias instability, °/h; null where the residual holds none.
    pub bias_instability_dph: Option<f64>,
    /// Rate random walk, °/h/√h; null where the residual holds none.
    pub rate_random_walk_dph_rt_h: Option<f64>,
    /// Scale factor at T0 from nominal, ppm; null without a rate table.
    pub scale_ppm: Option<f64>,
    /// σ of the retest before the correction, °/h.
    pub retest_before_dph: Option<f64>,
    /// And after it.
    pub retest_after_dph: Option<f64>,
    /// Limits of the retest.
    pub limits: Vec<LimitResult>,
}

/// A limit and the value checked against it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LimitResult {
    /// Its key.
    pub name: String,
    /// The limit.
    pub bound: f64,
    /// The value; null where it is not known.
    pub value: Option<f64>,
    /// False where it is not met or not decided.
    pub met: Option<bool>,
}

impl UnitResult {
    /// A unit of which nothing is known yet.
    pub(super) fn begun(unit: &Unit, key: String) -> Self {
        let Unit { name, lot, rig, .. } = unit.clone();
        Self { version: VERSION, unit: name, lot, rig, key, ..Self::default() }
    }

    pub(super) fn calibrated(&mut self, calibration: &Calibration, record_sha256: String) {
        self.outcome = UnitOutcome::Calibrated;
        self.record_sha256 = Some(record_sha256);
        self.inputs_sha256 = calibration.provenance.inputs.iter().map(|input| input.sha256.clone()).collect();
        self.serial = Some(calibration.serial.clone());
        self.time_s = Some(calibration.provenance.time_s);
        self.axes = calibration.axes.iter().map(AxisResult::of).collect();
        self.axes.iter_mut().for_each(|axis| axis.window_s = calibration.window_s);
    }

    pub(super) fn refused(&mut self, error: Error) {
        self.outcome = if error.kind == ErrorKind::Refused { UnitOutcome::Refused } else { UnitOutcome::Failed };
        self.refusal = Some(error.into());
    }

    /// With its logs there again, as they were.
    pub(super) fn renewed(self) -> Self {
        if self.outcome != UnitOutcome::NotRenewed {
            return self;
        }
        Self { outcome: UnitOutcome::Calibrated, refusal: None, ..self }
    }

    pub(super) fn proved(&mut self, verification: &Verification, proof_sha256: String) {
        self.acceptance = Acceptance::of(verification);
        self.proof_sha256 = Some(proof_sha256);
        for proved in &verification.axes {
            let letter = proved.axis.to_string();
            self.axes.iter_mut().filter(|axis| axis.axis == letter).for_each(|axis| axis.prove(proved));
        }
    }

    pub(super) fn not_judged(&mut self, error: Error) {
        self.acceptance = Acceptance::NotJudged;
        self.retest_refusal = Some(error.into());
    }
}

impl AxisResult {
    fn of(axis: &AxisCalibration) -> Self {
        let slow_noise = axis.fit.as_ref().and_then(|fit| fit.slow_noise.as_ref());
        let offsets = &axis.run_offsets;
        let sum: f64 = offsets.iter().map(|offset| offset.value_dph).sum();
        Self {
            axis: axis.axis.to_string(),
            model: axis.correction.model.to_string(),
            reference_c: axis.reference_c(),
            span_c: axis.span_c(),
            lag_s: axis.lag_s().map(|lag| lag.value),
            rate_spans_cpm: axis.rate_spans_cpm(),
            with_prior: axis.fit.as_ref().is_some_and(|fit| fit.prior.is_some()),
            common: on_common_basis(axis),
            curve: common_curve(axis),
            mean_offset_dph: (!offsets.is_empty()).then(|| sum / offsets.len() as f64),
            residual_dph: axis.residual().map(|residual| residual.sigma_dph),
            residual_autocorrelation: axis.residual().map(|residual| residual.lag1_autocorrelation),
            held_out_dph: axis.cross_validation().map(|held_out| held_out.sigma_dph),
            noise_floor_dph: axis.noise_floor().map(|floor| floor.value_dph),
            n_deg_rt_h: axis.noise_floor().map(|floor| floor.n_deg_rt_h),
            q_arcsec: axis.noise_floor().map(|floor| floor.q_arcsec),
            bias_instability_dph: slow_noise.and_then(|noise| noise.bias_instability_dph),
            rate_random_walk_dph_rt_h: slow_noise.and_then(|noise| noise.rate_random_walk_dph_rt_h),
            scale_ppm: axis.scale_factor().map(|scale| scale.at_reference.ppm),
            ..Self::default()
        }
    }

    fn prove(&mut self, proved: &AxisVerification) {
        self.retest_before_dph = Some(proved.before.sigma_dph);
        self.retest_after_dph = Some(proved.after.sigma_dph);
        let asked = proved.limits.iter().filter(|limit| limit.pass.is_some());
        let limit_result = |limit: &Verdict| LimitResult {
            name: limit.name.clone(),
            bound: limit.limit,
            value: limit.value,
            met: limit.pass,
        };
        self.limits = asked.map(limit_result).collect();
    }

    /// Names of the limits that are not met or not decided.
    pub fn limits_not_met(&self) -> Vec<&str> {
        self.limits.iter().filter(|limit| limit.met == Some(false)).map(|limit| limit.name.as_str()).collect()
    }
}
