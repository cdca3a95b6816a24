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
mod axis_file;
mod axis_record;
mod check;
mod evaluate;
mod file;
mod input;
mod of_fit;
mod profile;
mod provenance;
mod rate_table;
mod record;
mod search;
mod term;
mod uncertainty;

pub use crate::calibration::axis::{AxisCalibration, AxisCorrection, NonlinearParameter};
pub use crate::calibration::axis_record::FitDiagnostics;
pub(crate) use crate::calibration::input::SAMPLED_S;
pub use crate::calibration::input::{Input, InputSource, Lag};
pub use crate::calibration::of_fit::{
    Candidate, CrossValidation, FitResidual, FixedBias, Monomial, NoiseFloor, RunOffset, WholeNoise,
};
pub use crate::calibration::profile::{Entanglement, MovedTogether, TimeEffect, TimeEffectKind, WarmUp};
pub(crate) use crate::calibration::provenance::log_files;
pub use crate::calibration::provenance::{LogFile, NoiseTrace, Provenance, program};
pub use crate::calibration::rate_table::{Misalignment, Plateau, PpmEstimate, Repeatability, ScaleFactor};
pub use crate::calibration::record::{Calibration, FORMAT, LogUnit, MINOR_VERSION, Target, UNASSIGNED, VERSION};
pub use crate::calibration::search::{
    Collinearity, CorrectionNoise, InputNoise, PriorUse, RejectedInput, RejectedModel, SearchStep, SearchVerdict,
};
pub use crate::calibration::term::CorrectionTerm;
pub(crate) use crate::calibration::uncertainty::SCALE_AT_REFERENCE;
pub use crate::calibration::uncertainty::{
    CurveSpread, Evaluation, Hysteresis, LackOfFit, MemoryAtRest, Prediction, SlowNoiseTerms, Soak, SoakRow,
};
